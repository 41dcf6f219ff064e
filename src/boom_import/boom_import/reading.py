"""Reads a foreign file of whatever kind: its first bytes say which. What a library throws ends here as one line."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from itertools import pairwise
from pathlib import Path

import numpy as np

from boom_import.errors import ImportingError
from boom_import.source import Column, Source, unique, without_error_values
from boom_import.timing import TimeChoice
from boom_import.turns import without_turns
from boom_input.files import InputError, opened, read_text
from boom_input.shown import quoted
from boom_recording.bag_folder import METADATA
from boom_recording.errors import RecordingError

Progress = Callable[[float], None]

_HDF5 = b"\x89HDF\r\n\x1a\n"
_KINDS = {
    b"\x89MCAP0\r\n": "MCAP file", b"\x28\xb5\x2f\xfd": "MCAP file", b"SQLite format 3\0": "rosbag2 .db3 file",
    b"#ROSBAG V2.0": "ROS 1 bag", b"MDF     ": "MDF file", b"UnFinMF ": "MDF file", b"MATLAB 7.3": "MAT file v7.3",
    _HDF5: "MAT file v7.3", b"MATLAB 5.0": "MAT file",
}  # fmt: skip
_REFUSED = {
    b"PK\x03\x04": "it is a spreadsheet or an archive: save the table as CSV (or unpack it) and give that",
    b"\xd0\xcf\x11\xe0": "it is an old Excel file: save the table as CSV and give that",
    b"\x1f\x8b": "it is compressed: unpack it (gunzip) and give what comes out",
    b"LOGG": "it is a CAN log: ./boom import-can turns it into a bag",
    b"#ROSBAG V1": "it is a ROS bag of the old format 1: convert it with ROS 1's rosbag fix",
}
_ROLLED_NS = 10_000_000_000
"""A log that rolls over goes on within seconds."""
_MAT_4 = "MAT file v4"
_NOTHING = "copy it again from its source, or export it again"


def read(paths: list[Path], choice: TimeChoice | None = None, progress: Progress = lambda _: None) -> Source:
    """All columns of the files of one recording.

    Args:
        paths: files, or a rosbag2 folder.
        choice: how the time of a table is to be read.
        progress: called with the part that is done, 0 to 1.

    Raises:
        ImportingError: a file is missing, damaged, of no known kind, or its time is not to be found; the message begins with
            its path.
    """
    sources = []
    for i, path in enumerate(paths):
        begin = i / len(paths)
        sources.append(_one(path, choice or TimeChoice(), lambda part, b=begin: progress(b + part / len(paths))))  # type: ignore[misc]
    source = sources[0] if len(sources) == 1 else _together(paths, sources)
    without_error_values(source)
    without_turns(source)
    return source


def _together(paths: list[Path], sources: list[Source]) -> Source:
    """Files side by side, or one after the other where they have the same columns."""
    order = _in_succession(sources)
    if order:
        return _one_after_the_other([paths[k] for k in order], [sources[k] for k in order])
    if len({source.dated for source in sources}) > 1:
        raise ImportingError(
            f"{paths[0]}: of the files only some have dates in their times: give files of one clock, or one file"
        )
    taken: set[str] = set()
    columns = [
        Column(
            unique(f"{path.stem}/{c.key}", taken),
            f"{path.stem} {c.name}",
            c.unit,
            c.stamps_ns,
            c.values,
            c.by_type,
            c.joint,
            c.signal,
        )
        for path, source in zip(paths, sources, strict=True)
        for c in source.columns
    ]
    kinds = ", ".join(dict.fromkeys(source.kind for source in sources))
    notes = [f"{path.name}: {note}" for path, source in zip(paths, sources, strict=True) for note in source.notes]
    return Source(paths[0], kinds, columns, sources[0].dated, sources[0].time, notes)


def _in_succession(sources: list[Source]) -> list[int]:
    """The order of the parts of a log that rolls over; [] where they are none.

    They have the same columns and configuration, and each begins where another one ends.
    """
    first = sources[0]
    alike = all(
        [(c.name, c.unit) for c in s.columns] == [(c.name, c.unit) for c in first.columns]
        and (s.dated, s.configuration) == (first.dated, first.configuration)
        for s in sources
    )
    spans = [
        (min(int(c.stamps_ns[0]) for c in s.columns), max(int(c.stamps_ns[-1]) for c in s.columns)) for s in sources
    ]
    order = sorted(range(len(sources)), key=spans.__getitem__)
    pauses = [spans[b][0] - spans[a][1] for a, b in pairwise(order)]
    return order if alike and all(0 < pause < _ROLLED_NS for pause in pauses) else []


def _one_after_the_other(paths: list[Path], parts: list[Source]) -> Source:
    """Parts with the same columns as one source."""
    columns = [
        replace(
            own[0], stamps_ns=np.concatenate([c.stamps_ns for c in own]), values=np.concatenate([c.values for c in own])
        )
        for own in zip(*(source.columns for source in parts), strict=True)
    ]
    notes = [f"{path.name}: {note}" for path, part in zip(paths, parts, strict=True) for note in part.notes]
    joined = (
        f"{len(parts)} files with the same columns are one after the other: {', '.join(path.name for path in paths)}"
    )
    return replace(parts[0], columns=columns, notes=[joined, *notes])


def _one(path: Path, choice: TimeChoice, progress: Progress) -> Source:
    kind = kind_of(path)
    with _one_line(path, kind):
        return _by_kind(path, kind, choice, progress)


def _by_kind(path: Path, kind: str, choice: TimeChoice, progress: Progress) -> Source:
    if kind.startswith("MAT"):
        from boom_import.readers import matlab

        return matlab.read(path, choice, hdf5=kind.endswith("v7.3"))
    if kind.startswith("MDF"):
        from boom_import.readers import mdf

        return mdf.read(path, progress)
    if kind == "CSV file":
        from boom_import.readers import csv_text

        return csv_text.read(path, choice, progress)
    from boom_import.readers import ros

    readers = {"MCAP file": ros.read_mcap, "rosbag2 .db3 file": ros.read_db3, "ROS 1 bag": ros.read_ros1}
    return readers[kind](path, progress)


def kind_of(path: Path) -> str:
    """What kind of file it is, by its first bytes.

    Raises:
        ImportingError: missing, empty, or of a kind that is refused.
    """
    if path.is_dir():
        return _kind_of_folder(path)
    try:
        with opened(path) as file:
            head = file.read(520)
    except InputError as error:
        raise ImportingError(str(error)) from None
    if not head:
        raise ImportingError(f"{path}: the file is empty (0 bytes): {_NOTHING}")
    for magic, why in _REFUSED.items():
        if head.startswith(magic):
            raise ImportingError(f"{path}: {why}")
    found = next(
        (kind for magic, kind in _KINDS.items() if head.startswith(magic) or head[512:].startswith(magic)), None
    )
    if found is None and path.suffix == ".mat":
        return _MAT_4  # has no magic: what no other kind begins like
    return found or "CSV file"


def _kind_of_folder(path: Path) -> str:
    names = [entry.name for entry in path.iterdir()]
    if any(name.endswith(".db3") for name in names) or _compressed_one_by_one(path / METADATA):
        return "rosbag2 .db3 file"
    if METADATA in names or any(name.endswith((".mcap", ".mcap.zstd")) for name in names):
        return "MCAP file"
    raise ImportingError(f"{path}: this folder holds no bag: give a file, or a rosbag2 folder")


def _compressed_one_by_one(metadata: Path) -> bool:
    """Whether each message of a bag is compressed by itself, which the bulk reader of MCAP does not take."""
    return (
        metadata.is_file()
        and re.search(r"compression_mode:\s*['\"]?message", read_text(metadata), re.IGNORECASE) is not None
    )


@contextmanager
def _one_line(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a library throws at a damaged file into one line, and keep its chatter off the terminal."""
    try:
        with warnings.catch_warnings(), redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            warnings.simplefilter("ignore")
            yield
    except (ImportingError, InputError, RecordingError) as error:
        text = str(error)
        raise ImportingError(text if text.startswith(str(path)) else f"{path}: {text}") from None
    except MemoryError:
        raise ImportingError(
            f"{path}: it does not fit into the memory: import it in parts, or if it should not be so large, {_NOTHING}"
        ) from None
    except Exception as error:
        lines = str(error).strip().splitlines()
        why = quoted(lines[0], 120) if lines else type(error).__name__
        is_one = (
            "it is called .mat, but is no MAT file"
            if kind == _MAT_4
            else f"it begins like a {kind}, but cannot be read"
        )
        raise ImportingError(f"{path}: {is_one} ({why}): {_NOTHING}") from None
