"""The recorded inputs of the model: currents, held from stamp to stamp, and what else drives it where it was recorded.

That is the supply and tank pressure, and the motion of the other joints (``boom_model.joint_motion``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_model import joint_motion as other_joints
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.structure import CURRENTS, DRIVING
from boom_recording.joint_motion import joint_motion
from boom_recording.recording import Recording, Signal

Array = NDArray[np.float64]

GAP = 0.05
"""s. Between currents further apart than this they are unknown (contract), at 20 Hz and less than one and a half periods."""
MEASURED = 0.9
"""Share of valid samples from which a pressure drives the model."""


EVEN = 0.1
"""Of the sample time, by which the median between stamps may differ from it."""


@dataclass(frozen=True)
class HeldCurrents:
    """Inputs: time (m,) [s] from which each acts, values (m, NU) as ``Structure.inputs``: retract, extend [A], what else drives.

    still: (m,) whether the other joints stand still. late: by how much [s] samples come less often than commands; sampled: (m,)
    where one was taken. In between currents lie on lines. strays: how far from its stamp one was taken [s], standard deviation.
    """

    time: Array
    values: Array
    still: NDArray[np.bool_] | None = None
    late: float = 0.0
    sampled: NDArray[np.bool_] | None = None
    strays: float = 0.0

    def drawn(self, rng: np.random.Generator) -> Array:
        """(m, NU) inputs that would have given the same samples: a command that changed did so at once, anywhere in between.

        Where samples stray each shows the command of a whole number of samples before it, Poisson's, less its mean.
        """
        if self.strays:
            often = (self.strays / float(np.median(np.diff(self.time)))) ** 2
            row = np.arange(len(self.time)) - rng.poisson(often, len(self.time)) + round(often)
            shown = self.values[np.clip(row, 0, len(self.time) - 1)]
            return np.hstack((shown[:, : len(CURRENTS)], self.values[:, len(CURRENTS) :]))
        if self.sampled is None:
            return self.values.copy()
        k = np.cumsum(self.sampled) - 1
        at, number = np.flatnonzero(self.sampled), len(CURRENTS)
        share = (np.arange(len(k)) - at[k]) / np.diff(np.append(at, len(k)))[k]
        changed = ~self.sampled & (share >= rng.uniform(size=len(at))[k])
        values = self.values.copy()
        values[:, :number] = self.values[at][:, :number][np.minimum(k + changed, len(at) - 1)]
        return values

    @property
    def sampled_at(self) -> Array:
        """Times [s] of the samples."""
        return self.time if self.sampled is None else self.time[self.sampled]

    @property
    def gap(self) -> float:
        """From how far apart [s] nothing is known between two samples."""
        return gap_of(self.time)

    def at(self, time: float) -> tuple[float, ...]:
        """The inputs that act at a time [s]; before the first sample the first."""
        k = max(0, int(np.searchsorted(self.time, time, side="right")) - 1)
        return tuple(self.values[k].tolist())

    def first_above(self, current: float, start: float) -> float:
        """When one of them first exceeds ``current`` [A] at or after ``start`` [s]; infinity if never."""
        later = self.time >= start
        above = np.flatnonzero(later & (self.values[:, : len(CURRENTS)].max(axis=1) > current))
        return float(self.time[above[0]]) if len(above) else float("inf")

    def joints_move_from(self, start: float) -> float:
        """When another joint first moves at or after ``start`` [s]; infinity if never."""
        if self.still is None:
            return float("inf")
        moving = np.flatnonzero((self.time >= start) & ~self.still)
        return float(self.time[moving[0]]) if len(moving) else float("inf")

    def stretches(self, end: float) -> list[tuple[float, float]]:
        """(start, end) [s] of the stretches without a gap, none without samples; the last ends at ``end`` at the latest."""
        if len(self.time) == 0:
            return []
        cuts = np.flatnonzero(np.diff(self.time) > self.gap)
        starts = np.concatenate(([0], cuts + 1))
        ends = np.concatenate((self.time[cuts], [min(end, self.time[-1] + self.gap)]))
        return [(float(self.time[k]), float(e)) for k, e in zip(starts, ends, strict=True) if e > self.time[k]]


def gap_of(time: Array) -> float:
    """The time [s] from which two samples of a topic, measured at ``time`` (n,) [s], are a gap apart."""
    return max(GAP, 1.5 * float(np.median(np.diff(time)))) if len(time) > 1 else GAP


def driving(recording: Recording) -> list[tuple[str, Signal]]:
    """The pressures of a recording that drive the model: those that are known nearly throughout."""
    known = [(name, recording.signals[name]) for name in DRIVING if name in recording.signals]
    return [(name, signal) for name, signal in known if len(signal.time) and signal.valid.mean() > MEASURED]


def driven(machine: Machine, recording: Recording) -> Machine:
    """The machine, driven by what a recording holds of its inputs: pressures nearly throughout, other joints where they move.

    Raises:
        MachineError: joints move, and the file does not tell the bodies.
    """
    machine = machine.driven_by([name for name, _ in driving(recording)])
    if joint_motion(recording) is None:
        return machine
    if not other_joints.known(machine.document):
        raise MachineError(
            f"{recording.name}: other joints than the boom's move, and {machine.name} does not tell the bodies: "
            "add rigid_body.planar to the machine file, or cut the recording to where they stand still"
        )
    return machine.with_moving_joints()


def _lateness(time: Array, machine: Machine) -> float:
    """By how much [s] samples of the currents at ``time`` (n,) [s] come less often than commands."""
    if len(time) < 2:
        return 0.0
    late = float(np.median(np.diff(time))) - machine.sample_time
    return late if late > EVEN * machine.sample_time else 0.0


def held_inputs(recording: Recording, machine: Machine) -> HeldCurrents:
    """The inputs (``Structure.inputs``) of a recording where both currents are valid.

    Where samples come less often than commands, currents lie on lines between them: what is expected of a command that changed at
    an unknown time. Pressures between their samples by lines; the joints' motion as it is in the middle of the time for which it
    is held.
    """
    held = held_currents(recording)
    late = _lateness(held.time, machine)
    if late:
        held = _lines(held, machine.sample_time, late)
    pressures = [recording.signals[name] for name in machine.structure.driven]
    columns = [np.interp(held.time, s.time[s.valid], s.values[s.valid]) for s in pressures]
    still = None
    motion = joint_motion(recording) if machine.structure.moving_joints else None
    if motion is not None and len(held.time):
        pose = recording.configuration.outer_boom_angle, recording.configuration.telescope_length
        ends = np.append(held.time[1:], held.time[-1])
        columns.append(other_joints.inputs(machine.document, pose, *motion.at(0.5 * (held.time + ends))))
        still = other_joints.still(columns[-1])
    return replace(held, values=np.ascontiguousarray(np.column_stack((held.values, *columns))), still=still)


def _lines(held: HeldCurrents, period: float, late: float) -> HeldCurrents:
    """Currents in steps of about ``period`` [s] on lines between samples that come less often; none across a gap."""
    steps = np.diff(held.time)
    parts = np.where(steps > held.gap, 1, np.maximum(np.rint(steps / period), 1)).astype(int)
    k = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(k)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[k]
    time, sampled = np.append(held.time[k] + share * steps[k], held.time[-1]), np.append(share == 0.0, True)
    values = np.column_stack([np.interp(time, held.time, column) for column in held.values.T])
    return HeldCurrents(time, values, late=late, sampled=sampled)


def held_currents(recording: Recording) -> HeldCurrents:
    """The currents of a recording at times when both are valid."""
    retract, extend = recording.signals["retract_current"], recording.signals["extend_current"]
    valid = retract.valid & extend.valid
    return HeldCurrents(retract.time[valid], np.column_stack((retract.values[valid], extend.values[valid])))
