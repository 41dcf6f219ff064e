"""Common types of all control laws: reference and measurement in, two currents and inner quantities out."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import Any, NamedTuple, Protocol


class Reference(NamedTuple):
    """Wanted motion of the boom: q_2* [rad] and its first three derivatives [rad/s, rad/s^2, rad/s^3]."""

    angle: float
    rate: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0

    def ahead(self, t: Any) -> Reference:
        """The reference t [s] later, from its derivatives; also of expressions."""
        return Reference(
            self.angle + t * (self.rate + t / 2 * (self.acceleration + t / 3 * self.jerk)),
            self.rate + t * (self.acceleration + t / 2 * self.jerk),
            self.acceleration + t * self.jerk,
            self.jerk,
        )


MOVES = 0.02
"""rad/s. Ten times the noise of a gyro, and more than its bias: the boom really moves."""


class Measurement(NamedTuple):
    """Sensor values: time [s], q_2 [rad], its rate [rad/s], p_h and p_b [Pa gauge]; age [s] when the currents go out."""

    time: float
    angle: float
    rate: float
    hose_pressure: float
    rod_pressure: float
    age: float = 0.0


GO = ("", "load_not_held")
"""No reason to stop."""


class ControlOutput(NamedTuple):
    """Currents [A] and the quantities behind them, SI; NaN if a mode has no such quantity.

    Attributes:
        retract, extend: i_+^c and i_-^c [A].
        angle_error, piston_position_error, force_error: reference - measurement [rad, m, N].
        feedforward_force, feedback_force, force_set_point, force: f_p^f, f_p^c, f_p^* and f_p [N], positive lifts.
        spool_position: s_s^* [m], positive lowers.
        pilot_pressure_retract, pilot_pressure_extend: p_+^*, p_-^* [Pa].
        estimated_load: at the tip, beyond the configured load [kg].
        fastest_lift, fastest_lower: rates that valve, pump and currents allow now [rad/s], both positive.
        reason: why the motion has to be stopped, in words for the operator; empty without a reason.
        cause: its id in ``supervision.reasons``.
        note: what the operator has to know although the motion goes on; usually empty.
    """

    retract: float
    extend: float
    angle_error: float = nan
    piston_position_error: float = nan
    force_error: float = nan
    feedforward_force: float = nan
    feedback_force: float = nan
    force_set_point: float = nan
    force: float = nan
    spool_position: float = nan
    pilot_pressure_retract: float = nan
    pilot_pressure_extend: float = nan
    estimated_load: float = nan
    fastest_lift: float = nan
    fastest_lower: float = nan
    reason: str = ""
    cause: str = "load_not_held"
    note: str = ""

    @classmethod
    def of(cls, quantities: Sequence[float], stop: tuple[str, str] = GO, note: str = "") -> ControlOutput:
        """The quantities up to the last one that the law has, the reason to stop and its id, the note."""
        missing = len(cls._fields) - 3 - len(quantities)
        return cls._make((*quantities, *(nan,) * missing, *stop, note))


class Controller(Protocol):
    """One control law, called once a sample time."""

    mode: str

    def reset(self, measurement: Measurement) -> None:
        """Start here, bumpless: a boom at rest is held, and one that moves has been moved like this for long."""

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        """Advance by one sample time of the settings; ``measurement`` is the newest, and the currents act until the next step."""

    def change(self, settings: Any) -> None:
        """Use other settings, including the law's own, from the next step on, without a jump beyond the steady change.

        Raises:
            ControlError: the change needs a new controller (another sample time).
        """
