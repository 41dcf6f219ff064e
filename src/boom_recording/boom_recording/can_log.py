"""Reads CAN logs (BLF, ASC, candump .log, CSV, TRC) and makes recordings of them, by the codec that the bridge uses.

A log is read as far as it can be: an unreadable line is counted and left out, a file that ends in the middle of a frame
gives what lies before, a time that cannot be costs its frame. Times are whole microseconds, which is what all of these
formats can hold. python-can's readers (4.6.1) are not used: of 2000 logs damaged by `benchmarks/fuzz_can_logs.py` 930 end in
a traceback and lose what follows, 1 hangs (here 0 and 0); frames/s here over theirs: BLF 1.5, ASC 2.1, .log 2.0, CSV 1.1, TRC 0.85.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from io import SEEK_END
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_input.files import InputError, opened
from boom_recording.can_log_blf import read_blf
from boom_recording.can_log_text import read_text
from boom_recording.errors import RecordingError

SUFFIXES = (".blf", ".asc", ".log", ".csv", ".trc")
_LONGEST_DATA = 8
_REPORT_EVERY = 20_000
_EPOCH = 1_000_000_000
"""s. Times below are not dates: they count from the beginning of the log."""
_END = 2**31
"""s. A ROS stamp ends there, in 2038."""
_OUT_OF_ORDER_S = 1.0
_BACK_S = 0.1
"""s. Less is a buffer's doing."""
_ALONE_S = 60.0
_LONGEST_LOG_S = 7 * 86_400.0

Progress = Callable[[float], None]
"""Called with the fraction of the file that has been read, 0 .. 1."""


@dataclass(frozen=True)
class CanFrames:
    """The data frames of a log, in its order.

    Attributes:
        stamps_ns: (n,) times [ns since 1970, or since the beginning where the log knows no date].
        ids: (n,) identifiers, bit 31 set for extended ones.
        data: (n, 8) bytes, zero behind the length. lengths: (n,).
        dated: whether the times are dates.
        left_out: lines and objects that are no data frames or are unreadable or of no possible time, by kind.
        warnings: what of the file could not be read, one sentence each.
    """

    stamps_ns: NDArray[np.int64]
    ids: NDArray[np.int64]
    data: NDArray[np.uint8]
    lengths: NDArray[np.int64]
    dated: bool
    left_out: dict[str, int] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def read(path: str | Path, progress: Progress | None = None) -> CanFrames:
    """The data frames of a CAN log.

    Raises:
        RecordingError: no such file, an unknown kind, or not one frame in it.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise RecordingError(f"{path}: the kind of a CAN log is told by its name: give one of {', '.join(SUFFIXES)}")
    if path.is_dir():
        raise RecordingError(f"{path} is a folder: give the log file in it")
    left_out: Counter[str] = Counter()
    warnings: list[str] = []
    try:
        times, ids, contents = _frames(path, left_out, warnings, progress)
    except InputError as error:
        raise RecordingError(str(error)) from None
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    if not times:
        held = ", ".join(f"{number} {kind}" for kind, number in left_out.items() if number)
        reason = f"it holds {held}; is it a log of another kind?" if held or warnings else "it is empty"
        raise RecordingError(f"{path}: not one CAN frame in it: {warnings[0] if warnings else reason}")
    seconds = np.array(times)
    good = possible(seconds)
    if not good.any():
        raise RecordingError(f"{path}: none of its frames has a time that can be one [s since 1970, or since it began]")
    bad = len(good) - int(good.sum())
    if bad:
        left_out["frames whose time cannot be"] = bad
        warnings.append(f"{bad} {'frame is' if bad == 1 else 'frames are'} left out: of a time that cannot be")
    warnings += _steps_back(path, seconds[good])
    lengths = np.fromiter(map(len, contents), np.int64, len(contents))
    joined = b"".join([data.ljust(_LONGEST_DATA, b"\0") for data in contents])
    table = np.frombuffer(joined, np.uint8).reshape(-1, _LONGEST_DATA)
    if progress is not None:
        progress(1.0)
    seconds = seconds[good]
    stamps = np.rint(seconds * 1e6).astype(np.int64) * 1000
    dated = bool(np.median(seconds) >= _EPOCH)
    given = {kind: number for kind, number in left_out.items() if number}
    return CanFrames(stamps, np.array(ids, np.int64)[good], table[good], lengths[good], dated, given, warnings)


def _steps_back(path: Path, times: NDArray[np.float64]) -> list[str]:
    """What is wrong with the order of the times [s], in sentences. Raises RecordingError where they do not advance at all."""
    if len(times) > 1 and np.ptp(times) == 0.0:
        raise RecordingError(f"{path}: all {len(times)} frames have the same time: log the times of the frames, too")
    back = -np.diff(times)
    often = int((back > _BACK_S).sum())
    if not often:
        return []
    return [
        f"times go back {'once' if often == 1 else f'{often} times'}, by up to {back.max():.3g} s, first after frame "
        f"{int(np.argmax(back > _BACK_S)) + 1}: frames lie where their times say. Were two logs joined, or was a clock set?"
    ]


def _frames(
    path: Path, left_out: Counter[str], warnings: list[str], progress: Progress | None
) -> tuple[list[float], list[int], list[bytes]]:
    """Times [s], identifiers and data. In three lists: a tuple of each frame would cost a third of the speed."""
    times: list[float] = []
    ids: list[int] = []
    contents: list[bytes] = []
    suffix = path.suffix.lower()
    with opened(path) as stream:
        size = max(stream.seek(0, SEEK_END), 1)
        stream.seek(0)
        binary = suffix == ".blf"
        frames = read_blf(stream, left_out, warnings) if binary else read_text(stream, suffix, left_out, warnings)
        for time, identifier, data in frames:
            times.append(time)
            ids.append(identifier)
            contents.append(data)
            if progress is not None and len(times) % _REPORT_EVERY == 0:
                progress(min(stream.tell() / size, 1.0))
    return times, ids, contents


def possible(times: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of the times [s], in the order of the log, can be: the others are none, or far from those of their neighbours.

    One wrong digit may move a frame by centuries. It shows by the order: the frame is not between the one before and the
    one behind it, and far from the middle of the five around it. A clock that was set moves all frames that follow and is
    left as it is.
    """
    good = np.isfinite(times) & (times >= 0) & (times < _END)
    if good.any():
        good[good] = np.abs(times[good] - np.median(times[good])) <= _LONGEST_LOG_S
    index = np.flatnonzero(good)
    if len(index) < 5:
        return good
    t = times[index]
    middle = np.median(np.lib.stride_tricks.sliding_window_view(t, 5), axis=1)
    middle = np.concatenate(([middle[0]] * 2, middle, [middle[-1]] * 2))
    steps = np.diff(t)
    disordered = np.concatenate(([False], steps < 0)) | np.concatenate((steps < 0, [False]))
    limit = np.where(disordered, _OUT_OF_ORDER_S, np.inf)
    limit[[0, 1, -2, -1]] = _ALONE_S  # a jump there cannot be told from a pause by the order
    limit += 10 * np.median(np.abs(steps))
    good[index] = np.abs(t - middle) <= limit
    return good
