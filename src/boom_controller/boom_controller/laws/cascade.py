"""The cascade of chapter 6: feedforward and feedback force, force controller, valve map, currents.

Mode ``thesis`` is (6.2)-(6.26) as printed, with the readings of the machine notes. Mode ``baseline`` differs only in the
fields of ``Variant``; docs/control.md explains why.

Anti-windup: while the wanted spool position is beyond its limit, the integral states do not move further out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.control_model import ControlModel, ModelQuantities, OperatingPoint
from boom_controller.blocks.flat import FlatLaw
from boom_controller.blocks.pilot_stage import StaticPilot, require_pilot_stage
from boom_controller.blocks.position_feedback import feedback_torque, integral_for, position_gains
from boom_controller.blocks.valve_inverse import InverseState, ValveInverse
from boom_controller.blocks.valve_map import ValveMap
from boom_controller.errors import ControlError
from boom_controller.settings import LawSettings, tunable
from boom_controller.types import Controller, ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose
from boom_model.regularisation import Expression

LAWS = {
    "thesis": "(6.2)-(6.28) as printed, misprints read as in the machine notes, with anti-windup",
    "baseline": "the smallest change of it that is stable everywhere",
}


@dataclass(frozen=True)
class CascadeSettings(LawSettings):
    """The poles of the cascade."""

    position_pole: float = tunable(
        -3.0, "1/s", -10.0, -0.1, "triple pole of the position loop (6.9), thesis and baseline"
    )
    force_pole: float = tunable(-11.0, "1/s", -40.0, -0.5, "double pole of the force loop (6.15), thesis and baseline")


SETTINGS = CascadeSettings


@dataclass(frozen=True)
class Variant:
    """Differences of a mode from the printed law.

    Attributes:
        friction_at_reference: tau~_f of (6.13a) at the wanted rate instead of the measured one.
        pilot_inverse: currents that compensate for the lag of the pilot stage, instead of (6.25), (6.26).
        spool_inverse: pilot pressures that also compensate for the spool's friction, instead of (6.24).
    """

    friction_at_reference: bool = False
    pilot_inverse: bool = False
    spool_inverse: bool = False


VARIANTS = {
    "thesis": Variant(),
    "baseline": Variant(friction_at_reference=True, pilot_inverse=True, spool_inverse=True),
}


def make(mode: str, machine: Machine, pose: Pose, settings: CascadeSettings) -> Controller:
    """See :mod:`boom_controller.laws`."""
    return Cascade(mode, machine, pose, settings)


class CascadeState(NamedTuple):
    """x_eI [rad s], integral of the force error [N s]; errors of the last cycle (e, e' [rad, rad/s], f [N]); the valve."""

    position: Expression = 0.0
    force: Expression = 0.0
    angle_error: Expression = 0.0
    rate_error: Expression = 0.0
    force_error: Expression = 0.0
    valve: InverseState = InverseState()


class Cascade:
    """Modes ``thesis`` and ``baseline``."""

    def __init__(
        self, mode: str, machine: Machine, pose: Pose, settings: CascadeSettings, variant: Variant | None = None
    ) -> None:
        require_pilot_stage(machine, mode)
        self.mode = mode
        self._variant = variant if variant is not None else VARIANTS[mode]
        self._model = ControlModel(machine, pose)
        p, e = self._model.p, self._model.e
        self._map = ValveMap(machine.structure, p, e)
        self._area_a, self._area_b = float(p.cylinder.A_a), float(p.cylinder.A_b)
        self._stroke = float(p.main_valve_spool.s_max)
        self._settings = settings
        self._gains = position_gains(settings.position_pole, settings.sample_time)
        self._pilot = StaticPilot(p, e)
        self._inverse = ValveInverse(p, e, self._pilot, settings.sample_time, spool=self._variant.spool_inverse)
        self._law = FlatLaw(mode, CascadeState(), self._after, SETTINGS, settings, _named(self._gains))

    def reset(self, measurement: Measurement) -> None:
        """Start at rest at the measured angle: the force beyond gravity becomes the integral state of the position."""
        m = measurement
        q = self._model.at(OperatingPoint(m.angle, 0.0, m.hose_pressure, m.rod_pressure, m.angle, 0.0, 0.0, 0.0, 0.0))
        carried = q.jacobian * q.force - q.gravity
        self._law.start(CascadeState(integral_for(carried, self._gains, 0.0, 0.0, q.inertia)))

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        """(6.2), (6.13), (6.22), (6.23), (6.24)-(6.26), one sample time."""
        return ControlOutput.of(self._law.step(reference, measurement))

    def change(self, settings: CascadeSettings) -> None:
        """Change gains, limits and neutral pressure; integral states are adapted so that forces and spool keep their values.

        Raises:
            ControlError: another sample time.
        """
        if settings.sample_time != self._settings.sample_time:
            raise ControlError("sample_time cannot change while running: stop the controller and start it again")
        x: CascadeState = self._law.states
        torque = feedback_torque(self._gains, x.angle_error, x.rate_error, x.position, 1.0)
        self._gains = position_gains(settings.position_pole, settings.sample_time)
        position = integral_for(torque, self._gains, x.angle_error, x.rate_error, 1.0)
        (kp0, ki0), (kp, ki) = _force_gains(self._settings.force_pole), _force_gains(settings.force_pole)
        force = ((kp0 - kp) * x.force_error + ki0 * x.force) / ki
        self._law.start(x._replace(position=position, force=force))
        self._law.change(settings, _named(self._gains))
        self._settings = settings

    def _after(self, x: CascadeState, r: Reference, m: Measurement, s: Any) -> tuple[CascadeState, list[Expression]]:
        """The law as expressions: states one sample time later, and all of ``ControlOutput`` up to the pilot pressures."""
        q = self._model.expressions(
            OperatingPoint(
                m.angle, m.rate, m.hose_pressure, m.rod_pressure,
                r.angle, r.rate, r.acceleration, r.jerk, 0.0,
            )
        )  # fmt: skip
        e1, e2 = m.angle - r.angle, m.rate - r.rate
        u = feedback_torque([getattr(s, name) for name in _GAINS], e1, e2, x.position, q.inertia)
        friction = q.friction_wanted if self._variant.friction_at_reference else q.friction
        wanted = (q.reference_jacobian * q.feedforward_force - q.reference_gravity + q.gravity - q.reference_friction
                  + friction + u) / q.jacobian  # fmt: skip
        force_error = q.force - wanted
        spool, limited = self._spool(q, force_error, x.force, m.rate, s)
        t = s.sample_time
        # An integral stands where moving it on would push a saturated spool further (spool > 0 retracts).
        force = ca.if_else(force_error * limited > 0, x.force, x.force + t * force_error)
        position = ca.if_else(e1 * limited > 0, x.position, x.position + t * e1)
        valve = x.valve
        if self._variant.pilot_inverse:
            valve, plus, minus = self._inverse.step(x.valve, spool, s)
            retract, extend = valve.retract.current, valve.extend.current
        else:
            plus, minus = self._pilot.split(self._pilot.stiffness * spool, s.neutral_pressure)
            retract, extend = (ca.fmin(self._pilot.current(side), s.largest_current) for side in (plus, minus))
        return CascadeState(position, force, e1, e2, force_error, valve), [
            retract, extend, -e1, q.reference_position - q.position, -force_error, q.feedforward_force,
            wanted - q.feedforward_force, wanted, q.force, spool, plus, minus,
        ]  # fmt: skip

    def _spool(
        self, q: ModelQuantities, force_error: Expression, integral: Expression, rate: Expression, s: Any
    ) -> tuple[Expression, Expression]:
        """Wanted s_s [m] from (6.22), (6.23), and the direction in which it is limited: 1 retract, -1 extend, 0 not."""
        a, b = self._area_a * q.stiffness_head, self._area_b * q.stiffness_rod
        kp, ki = _force_gains(s.force_pole)
        velocity = q.jacobian * rate
        sigma = (q.feedforward_force_rate - kp * force_error - ki * integral
                 + (a * self._area_a + b * self._area_b) * velocity)  # fmt: skip
        largest = s.largest_spool_position * self._stroke
        side = ca.if_else(sigma > 0, -1.0, 1.0)
        size = ca.if_else(
            sigma > 0,
            self._map.extending(sigma, a * q.extend_supply, -b * q.extend_tank),
            self._map.retracting(sigma, a * q.retract_tank, -b * q.retract_supply),
        )
        return side * ca.fmin(size, largest), ca.if_else(size > largest, side, 0.0)


_GAINS = ("position_gain", "rate_gain", "integral_gain")


def _named(gains: tuple[float, float, float]) -> dict[str, float]:
    return dict(zip(_GAINS, gains, strict=True))


def _force_gains(pole: Expression) -> tuple[Expression, Expression]:
    """(k_p [1/s], k_i [1/s^2]) of (6.15) with both poles at ``pole`` [1/s]."""
    return -2.0 * pole, pole * pole
