"""A recording: signals with units, stamps and defects. No files, no ROS."""

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_input.shown import printable
from boom_recording.channels import FaultKind
from boom_recording.errors import RecordingError

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Stamps = NDArray[np.int64]

BLOCK = 60.0
"""s. Length of the parts that a long recording is worked off in: searches are proved with recordings of a minute."""
SHORTEST_BLOCK = 5.0
"""s. A recording that is shorter has no block."""
_LONGEST_GRID = 100_000_000  # a week at 100 Hz is 60 million
_HALF_PERIOD_MARGIN = 1.1  # samples jitter by a few percent of the period; one that is due is not to be missed for that


@dataclass(frozen=True)
class Signal:
    """One measured quantity over time, in the order in which it was recorded.

    name, unit   of `boom_input.channels` (angle rad, rate rad/s, pressures Pa gauge, currents A)
    topic        where it came from
    stamps_ns    (n,) measurement time of each sample [ns], as the sender wrote it
    time         (n,) the same in seconds since `Recording.start_ns`
    values       (n,) samples [unit]
    valid        (n,) False = masked: not to be used or interpolated over. The stamps of the valid samples
                 increase strictly
    """

    name: str
    unit: str
    topic: str
    stamps_ns: Stamps
    time: Floats
    values: Floats
    valid: Flags


@dataclass(frozen=True)
class Event:
    """A defect of a topic in a recording.

    kind      gap, loss, stale, stuck, clock_jump, out_of_range or nan
    start_s, end_s   [s] since the start of the recording
    count     how many samples are missing or masked
    detail    one sentence for an engineer
    """

    kind: FaultKind
    topic: str
    start_s: float
    end_s: float
    count: int
    detail: str


@dataclass(frozen=True)
class Configuration:
    """Machine, pose of the fixed joints and load that the recording was made with.

    machine            name of the machine file
    outer_boom_angle   q3 [rad]
    telescope_length   q4 [m]
    load_mass          [kg] configured load at the boom tip, NaN = not known
    """

    machine: str
    outer_boom_angle: float
    telescope_length: float
    load_mass: float
    note: str = ""


@dataclass(frozen=True)
class GivenConfiguration:
    """What a user says of pose and load, in the place of what the recording says; None = nothing. Units as in `Configuration`."""

    outer_boom_angle: float | None = None
    telescope_length: float | None = None
    load_mass: float | None = None

    def complete(self) -> bool:
        """Whether it can stand for a configuration that is missing: the pose is given."""
        return self.outer_boom_angle is not None and self.telescope_length is not None

    def over(self, stored: Configuration | None) -> Configuration | None:
        """The stored configuration with what is given; a new one, of no machine, where none is stored and the pose is given."""
        told = {name: value for name, value in vars(self).items() if value is not None}
        if stored is None:
            return Configuration(**{"machine": "", "load_mass": math.nan, **told}) if self.complete() else None
        return replace(stored, **told)


@dataclass(frozen=True)
class Table:
    """Signals at common times: time (n,) [s], columns name -> (n,) with NaN without a valid sample."""

    time: Floats
    columns: dict[str, Floats]


@dataclass
class Recording:
    """The content of a bag.

    name, path     of the bag
    start_ns       stamp of the first sample of a sensor topic [ns]; time zero
    duration       [s] from there to the last sample of a sensor topic
    signals        by name; see `boom_recording.channels`
    events         defects of the samples, by time
    warnings       parts of the file that could not be read, one sentence each
    notes          information that needs no action
    """

    name: str
    path: Path
    start_ns: int
    duration: float
    signals: dict[str, Signal]
    events: list[Event] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    stored_configuration: Configuration | None = None

    @property
    def configuration(self) -> Configuration:
        """The machine's configuration. Raises RecordingError if there is none and none was required."""
        if self.stored_configuration is None:
            raise RecordingError(f"{self.name}: /boom/machine_configuration is missing: the machine is unknown")
        return self.stored_configuration

    def on_grid(self, period: float = 0.01) -> Table:
        """Samples on a common grid of `period` [s] from time zero to the end.

        Each grid time gets the nearest valid sample, or NaN if none lies within half a period (plus a tenth for jitter).
        Nothing is interpolated. Raises ValueError for a period that is not positive, RecordingError if the stamps span
        more than a grid can hold.
        """
        if not period > 0:
            raise ValueError(f"the period of the grid is {period} s: it has to be positive")
        count = int(np.floor(self.duration / period + 1e-9)) + 1
        if count > _LONGEST_GRID:
            raise RecordingError(f"{self.name}: its stamps span {self.duration:.0f} s, longer than any recording")
        time = np.asarray(np.arange(count) * period, np.float64)
        return Table(time, {name: _nearest(signal, time, period) for name, signal in self.signals.items()})


def told_apart(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings, those that share a name with as many folders in front of it as tell them apart: ``c7/a`` and ``c13/a``.

    A recording that is given twice is numbered.
    """
    names = [recording.name for recording in recordings]
    for name in {n for n in names if names.count(n) > 1}:
        group = [k for k, own in enumerate(names) if own == name]
        places = [Path(os.path.abspath(recordings[k].path)).parent.parts for k in group]
        longer, depth = [name] * len(group), 0
        while len(set(longer)) < len(set(places)) and depth < max(map(len, places)):
            depth += 1
            longer = [printable("/".join((*place[-depth:], name))) for place in places]
        for i, k in enumerate(group):
            number = longer[: i + 1].count(longer[i])
            names[k] = longer[i] if number == 1 else f"{longer[i]} ({number})"
    return [r if r.name == name else replace(r, name=name) for r, name in zip(recordings, names, strict=True)]


def part(recording: Recording, start: float, end: float) -> Recording:
    """The stretch from `start` up to `end` [s] of a recording, as a recording of its own; its time zero is `start`."""
    moved = round(start * 1e9)
    signals = {}
    for name, signal in recording.signals.items():
        inside = (signal.time >= start) & (signal.time < end)
        stamps = signal.stamps_ns[inside]
        time = (stamps - recording.start_ns - moved) / 1e9
        signals[name] = replace(
            signal, stamps_ns=stamps, time=time, values=signal.values[inside], valid=signal.valid[inside]
        )
    events = [
        replace(event, start_s=max(0.0, event.start_s - start), end_s=min(end, event.end_s) - start)
        for event in recording.events
        if event.start_s < end and event.end_s >= start
    ]
    return replace(
        recording, start_ns=recording.start_ns + moved, duration=min(end, recording.duration) - start, signals=signals,
        events=events,
    )  # fmt: skip


def blocks(recording: Recording) -> Iterator[Recording]:
    """A recording in parts of about ``BLOCK``, named by where they begin; none of a very short one."""
    if recording.duration < SHORTEST_BLOCK:
        return
    count = max(1, round(recording.duration / BLOCK))
    size = recording.duration / count
    for k in range(count):
        block = part(recording, k * size, (k + 1) * size)
        yield replace(block, name=f"{recording.name} from {k * size:.0f} s") if count > 1 else block


def _nearest(signal: Signal, time: Floats, period: float) -> Floats:
    result = np.full(len(time), np.nan)
    own, values = signal.time[signal.valid], signal.values[signal.valid]
    if len(own) == 0:
        return result
    right = np.searchsorted(own, time)
    left = np.maximum(right - 1, 0)
    right = np.minimum(right, len(own) - 1)
    nearest = np.where(time - own[left] <= own[right] - time, left, right)
    found = np.abs(own[nearest] - time) <= _HALF_PERIOD_MARGIN * period / 2
    result[found] = values[nearest[found]]
    return result
