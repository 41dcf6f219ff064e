"""Turns the frames of a CAN log into a recording, with the checks and conversions of the bridge, for all frames at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_can_bridge.codec import REASONS, BulkFrame, Codec, CounterCheck, FrameSpec
from boom_can_bridge.receiver import CROWD_REFUSED, CROWD_SHARE
from boom_input.channels import BY_NAME, CURRENTS, SENSORS
from boom_recording.can_log import CanFrames
from boom_recording.errors import RecordingError
from boom_recording.recording import Configuration, Recording, Signal
from boom_recording.writing import START_NS

_EXTENDED = 0x80000000
_PORTION = 50_000
_OF_COMMAND = {"retract_current": "retract_current_command", "extend_current": "extend_current_command"}


@dataclass(frozen=True)
class FrameReport:
    """The frames of one kind: number used, number lost according to the counters, bad ones by reason."""

    name: str
    identifier: str
    used: int
    lost: int
    bad: dict[str, int]


@dataclass(frozen=True)
class Imported:
    """A recording made from a log, and what was left out.

    frames     one row for each frame that the mapping knows
    unknown    identifier -> number of frames that the mapping does not know
    left_out   entries of the log that are not data frames, by kind
    """

    recording: Recording
    frames: list[FrameReport]
    unknown: dict[str, int]
    left_out: dict[str, int] = field(default_factory=dict)


def convert(
    name: str,
    frames: CanFrames,
    codec: Codec,
    configuration: Configuration,
    progress: Callable[[float], None] | None = None,
) -> Imported:
    """The recording that `frames` hold.

    A sample has the time of its frame. A command that is not enabled counts as zero, as for the ECU.

    Raises RecordingError if no frame carries a measured value.
    """
    verdicts = np.zeros(len(frames.ids), np.uint8)
    parts: dict[str, list[tuple[NDArray[np.intp], BulkFrame]]] = {kind: [] for kind in codec.frames}
    for begin in range(0, len(frames.ids), _PORTION):
        rows = slice(begin, begin + _PORTION)
        ids = frames.ids[rows]
        bulk = codec.decode_many(ids & ~_EXTENDED, frames.data[rows], frames.lengths[rows], (ids & _EXTENDED) != 0)
        verdicts[rows] = bulk.verdicts
        for kind, part in bulk.frames.items():
            parts[kind].append((part.index + begin, part))
        if progress is not None:
            progress(min(begin + _PORTION, len(frames.ids)) / len(frames.ids))
    stamps = frames.stamps_ns if frames.dated else frames.stamps_ns - frames.stamps_ns.min() + START_NS
    check = CounterCheck(codec)
    counter_verdict = np.uint8(1 + REASONS.index("counter"))
    columns: dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
    used: dict[str, tuple[int, int, int]] = {}
    for spec in codec.frames.values():
        index, values, counters = _joined(spec, parts[spec.name])
        seconds = (stamps[index] - stamps[0]) / 1e9
        good, lost = check.accept_many(spec.name, counters, seconds)
        verdicts[index[~good]] = counter_verdict
        used[spec.name] = (int(good.sum()), lost, int((~good).sum()))
        for signal, column in _signals(spec, values).items():
            columns[signal] = (stamps[index[good]], column[good])
    measured = [c.name for c in (*SENSORS, *CURRENTS) if c.name in columns]
    if not any(len(columns[signal][0]) for signal in measured):
        raise RecordingError(
            f"{name}: none of the {len(frames.ids)} frames carries a measured value that the mapping knows: "
            f"is it the right DBC file? The log has {_listed(_unknown(frames, verdicts)) or 'damaged frames only'}"
        )
    start = min(int(columns[signal][0].min()) for signal in measured if len(columns[signal][0]))
    signals = {}
    for signal, (times, column) in columns.items():
        if len(times):
            channel = BY_NAME[signal]
            seconds = (times - start) / 1e9
            signals[signal] = Signal(signal, channel.unit, channel.topic, times, seconds, column, np.isfinite(column))
    duration = max(float(signals[signal].time.max()) for signal in measured if signal in signals)
    recording = Recording(
        name, Path(name), start, duration, signals, warnings=list(frames.warnings), stored_configuration=configuration
    )
    reports = [_report(spec, codec, frames, verdicts, used[spec.name]) for spec in codec.frames.values()]
    if crowded := _crowded(codec, used, duration):
        raise RecordingError(f"{name}: {crowded}")
    return Imported(recording, reports, _unknown(frames, verdicts), dict(frames.left_out))


def _crowded(codec: Codec, used: dict[str, tuple[int, int, int]], duration: float) -> str:
    """Whether two nodes send one kind of frame, in a sentence; empty: none. As the bridge tells it while it runs."""
    for spec in codec.incoming:
        good, _, refused = used[spec.name]
        seen = good + refused
        if seen > CROWD_SHARE * duration / spec.period_s and refused > CROWD_REFUSED * seen:
            return (
                f"{refused} of {seen} frames {spec.name} contradict their counter, and there are more than are due: two nodes send "
                "it, as where a log holds two buses. Give a log of one of them"
            )
    return ""


def _joined(
    spec: FrameSpec, parts: list[tuple[NDArray[np.intp], BulkFrame]]
) -> tuple[NDArray[np.intp], dict[str, NDArray[np.float64]], NDArray[np.int64] | None]:
    if not parts:
        return np.zeros(0, np.intp), {name: np.zeros(0) for name in spec.fields}, None
    values = {name: np.concatenate([part.values[name] for _, part in parts]) for name in spec.fields}
    counted = [part.counters for _, part in parts if part.counters is not None]
    counters = np.concatenate(counted) if counted else None
    return np.concatenate([index for index, _ in parts]), values, counters


def _signals(spec: FrameSpec, values: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """The columns of `spec` that a recording contains, by the name of the signal."""
    if spec.direction == "from_ecu":
        return {name: column for name, column in values.items() if name in BY_NAME}
    enabled = values["enable"] >= 0.5 if "enable" in values else True
    return {signal: np.where(enabled, values[name], 0.0) for name, signal in _OF_COMMAND.items()}


def _report(
    spec: FrameSpec, codec: Codec, frames: CanFrames, verdicts: NDArray[np.uint8], used: tuple[int, int, int]
) -> FrameReport:
    bad: Counter[str] = Counter()
    shared = [s for s in codec.frames.values() if _wire_id(s) == _wire_id(spec)]
    if shared[0].name == spec.name:  # a bad frame does not tell its page: the first page's row shows it
        numbers = np.bincount(verdicts[frames.ids == _wire_id(spec)], minlength=len(REASONS) + 1)[1:]
        names = ("unknown page" if reason == "unknown_id" else reason for reason in REASONS)
        bad.update({reason: int(number) for reason, number in zip(names, numbers, strict=True) if number})
    return FrameReport(spec.name, _identifier(_wire_id(spec)), used[0], used[1], dict(bad))


def _wire_id(spec: FrameSpec) -> int:
    return spec.arbitration_id | (_EXTENDED if spec.is_extended else 0)


def _unknown(frames: CanFrames, verdicts: NDArray[np.uint8]) -> dict[str, int]:
    missing = frames.ids[verdicts == 1 + REASONS.index("unknown_id")]
    ids, numbers = np.unique(missing, return_counts=True)
    return {_identifier(int(i)): int(number) for i, number in zip(ids, numbers, strict=True)}


def _identifier(number: int) -> str:
    return f"{number & ~_EXTENDED:08X}x" if number & _EXTENDED else f"{number:03X}"


def _listed(unknown: dict[str, int]) -> str:
    most = sorted(unknown, key=lambda name: -unknown[name])
    return ", ".join(most[:6]) + (f" and {len(most) - 6} more" if len(most) > 6 else "")
