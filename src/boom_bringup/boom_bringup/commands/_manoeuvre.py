"""The manoeuvre to record next: of a few ways to drive the boom, the one after which least is left open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from boom_bringup.cli import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from boom_identification.foresight import NumberInformation
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

    Array = NDArray[np.float64]

_VALVE = (0.25, 0.55)
"""A. The profiles are for a valve that opens at the first current and is open at the second."""
_REACHES = (0.9, 0.6, 0.4, 0.25, 0.15)
"""Share of full stroke to which the largest current goes: the first with which the boom stays within its range."""
_BEGUN = 1.0
"""s after which a boom that starts or turns has done so: the valve takes 0.1 s, the oil's spring two swings of 2 Hz."""
_SWINGS = 0.25
"""Of its largest speed along the command: the oil's spring overshoots by less once the boom moves, and the gyro's noise is 1 %."""
_LEANS = (
    ", as a crane does whose edge to the tank is too wide for its load-holding valve. If yours does not, A_ta_max is smaller "
    "than the file says"
)
_START = 0.4
"""Where in its range the boom starts."""


@dataclass(frozen=True)
class Manoeuvre:
    """Currents for the next recording.

    Attributes:
        name: what it is.
        period: [s] of the currents.
        currents: (n, 2) retract, extend [A].
        angles: smallest and largest boom angle in the simulation [rad].
        told: information with it and with what was recorded before.
        swings: largest speed against the commanded direction [rad/s]; 0 where it is none to speak of. why: it may, in words.
    """

    name: str
    period: float
    currents: Array
    angles: tuple[float, float]
    told: NumberInformation
    swings: float = 0.0
    why: str = ""

    @property
    def sentence(self) -> str:
        """For the operator."""
        active = self.currents[self.currents > 0.0]
        sizes = " to ".join(dict.fromkeys(f"{size:.2f}" for size in (active.min(), active.max())))
        low, high = np.degrees(self.angles)
        swings = f". In the simulation it SWINGS, up to {self.swings:.2f} rad/s against the lever{self.why}"
        return (
            f"{len(self.currents) * self.period:.0f} s of {self.name}, at {sizes} A; in the simulation the boom stays within "
            f"{low:.0f} .. {high:.0f} deg{swings if self.swings else ''}. Try it with half the currents above the dead zone first"
        )

    def csv(self) -> str:
        """The currents as a file for `./boom simulate`."""
        rows = [
            f"{k * self.period:.2f},{retract:.4f},{extend:.4f}" for k, (retract, extend) in enumerate(self.currents)
        ]
        return "\n".join(["time_s,retract_a,extend_a", *rows]) + "\n"

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {"text": self.sentence, "told": self.told.document()}


def best_manoeuvre(machine: Machine, recordings: Sequence[Recording], now: NumberInformation | None) -> Manoeuvre:
    """The manoeuvre after which least is left open.

    Args:
        machine: as its file has it.
        recordings: that exist; the next one has their sensors.
        now: what they tell.

    Raises:
        UsageError: the crane cannot be simulated.
    """
    from boom_diagnosis.experiment import PERIOD, profiles
    from boom_identification.foresight import information, silenced
    from boom_model.sensors import OUTPUTS
    from boom_recording.measurement import measurements

    seen = [measurements(recording) for recording in recordings]
    missing = [name for name in OUTPUTS if seen and not any(found[name].independent for found in seen)]
    driving = {name for recording in recordings for name in recording.signals}
    tried = []
    for name, profile in profiles().items():
        made = _within_range(machine, profile, driving)
        if made is not None:
            currents, recording = made
            known = information([silenced(recording, missing)], machine)
            angle = recording.signals["angle"].values
            told = known if now is None else now.with_further(known)
            ends = float(angle.min()), float(angle.max())
            tried.append(
                Manoeuvre(name, PERIOD, currents, ends, told, _swings(currents, recording), _LEANS * machine.holds)
            )
    if not tried:
        raise UsageError("the crane of these answers cannot be simulated: compare the table above with the data sheet")
    return min(tried, key=lambda manoeuvre: manoeuvre.told.open)


def _swings(currents: Array, recording: Recording) -> float:
    """Largest speed [rad/s] against the commanded direction once that has been commanded for ``_BEGUN``; 0 below ``_SWINGS``."""
    from boom_diagnosis.experiment import PERIOD

    direction = np.sign(currents[:, 1] - currents[:, 0])
    begun = round(_BEGUN / PERIOD)
    same = np.array([k >= begun and len(set(direction[k - begun : k + 1])) == 1 for k in range(len(direction))])
    rate = recording.signals["rate"]
    along = np.interp(np.arange(len(direction)) * PERIOD, rate.time, rate.values) * direction
    if not (same & (direction != 0.0)).any():
        return 0.0
    against = -float(along[same & (direction != 0.0)].min())
    return against if against > _SWINGS * float(along.max()) else 0.0


def _within_range(machine: Machine, profile: Array, driving: set[str]) -> tuple[Array, Recording] | None:
    """Currents of a profile for this machine, and the simulated recording; None where no size stays within the range."""
    from boom_model.derived import valve_currents
    from boom_model.errors import SimulationError

    opening, full = valve_currents(machine)
    share = (profile - _VALVE[0]) / (_VALVE[1] - _VALVE[0])
    for reach in _REACHES:
        largest = opening + reach * (full - opening)
        currents: Array = np.where(profile > 0.0, opening + share * (largest - opening), 0.0)
        try:
            return currents, _simulated(machine, currents, driving)
        except SimulationError:
            continue
    return None


def _simulated(machine: Machine, currents: Array, driving: set[str]) -> Recording:
    """A recording of the manoeuvre.

    Raises:
        SimulationError: the boom leaves its range.
    """
    from boom_diagnosis.experiment import PERIOD
    from boom_model.structure import DRIVING
    from boom_recording import writing
    from boom_recording.recording import Configuration
    from boom_sim.offline import simulate
    from boom_sim.simulated_crane import CraneStart

    pose, (low, high) = machine.tabulated[0], machine.angle_limits
    configuration = Configuration(machine.name, pose.outer_boom_angle, pose.telescope_length, 0.0)
    time: Array = np.arange(len(currents), dtype=np.float64) * PERIOD
    start = CraneStart(low + _START * (high - low))
    made = simulate(machine, configuration, start, time, currents, noise=machine.sensor_noise())
    constants = {name: machine.parameters.get(".".join(key)) for name, key in DRIVING.items() if name in driving}
    columns = {name: np.full(len(time), number.value[0]) for name, number in constants.items() if number is not None}
    if columns:
        made.signals |= writing.from_columns(made.name, time, columns, configuration).signals
    return made
