"""The cascade of chapter 6: feedforward and feedback force, force controller, valve map, currents.

Mode ``thesis`` is (6.2)-(6.26) as printed, with the readings of the machine notes. Mode ``baseline`` differs in what
``Variant`` says and nothing else; docs/control.md tells why.

Anti-windup: while the wanted spool position is beyond its limit, the integral states do not move further out.
"""

from __future__ import annotations

from dataclasses import dataclass

from boom_controller.control_model import ControlModel, Point, Quantities
from boom_controller.controller import Measurement, Output, Reference
from boom_controller.errors import ControlError
from boom_controller.pilot_stage import StaticPilot, require_pilot_stage
from boom_controller.position_feedback import PositionFeedback
from boom_controller.settings import Settings
from boom_controller.valve_inverse import ValveInverse
from boom_controller.valve_map import ValveMap
from boom_model.machine import Machine, Pose


@dataclass(frozen=True)
class Variant:
    """Where a mode departs from the printed law.

    Attributes:
        friction_at_reference: tau~_f of (6.13a) at the wanted rate instead of the measured one.
        pilot_inverse: currents that make up for the lag of the pilot stage, instead of (6.25), (6.26).
        spool_inverse: pilot pressures that make up for the spool's friction too, instead of (6.24).
    """

    friction_at_reference: bool = False
    pilot_inverse: bool = False
    spool_inverse: bool = False


VARIANTS = {
    "thesis": Variant(),
    "baseline": Variant(friction_at_reference=True, pilot_inverse=True, spool_inverse=True),
}


class Cascade:
    """Modes ``thesis`` and ``baseline``."""

    def __init__(
        self, mode: str, machine: Machine, pose: Pose, settings: Settings, variant: Variant | None = None
    ) -> None:
        require_pilot_stage(machine, mode)
        self.mode = mode
        self._variant = variant if variant is not None else VARIANTS[mode]
        self._model = ControlModel(machine, pose)
        p, e = self._model.p, self._model.e
        self._map = ValveMap(p, e)
        self._area_a, self._area_b = float(p.cylinder.A_a), float(p.cylinder.A_b)
        self._stroke = float(p.main_valve_spool.s_max)
        self._settings = settings
        self._position = PositionFeedback(settings.position_pole, settings.sample_time)
        self._pilot = StaticPilot(p, e, settings.neutral_pressure)
        self._inverse = ValveInverse(p, e, self._pilot, settings, spool=self._variant.spool_inverse)
        self._force_integral = 0.0
        self._last: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def reset(self, measurement: Measurement) -> None:
        """Rest at the measured angle: what the pressures carry beyond gravity becomes the position's integral."""
        q = self._at(Reference(measurement.angle), measurement, rest=True)
        self._position.hold(q.jacobian * q.force - q.gravity, q.inertia)
        self._force_integral = 0.0
        self._last = (0.0, 0.0, 0.0)
        self._inverse.reset()

    def step(self, reference: Reference, measurement: Measurement) -> Output:
        """(6.2), (6.13), (6.22), (6.23), (6.24)-(6.26), one sample time."""
        q = self._at(reference, measurement)
        e1, e2 = measurement.angle - reference.angle, measurement.rate - reference.rate
        u = self._position.torque(e1, e2, q.inertia)
        friction = q.friction_wanted if self._variant.friction_at_reference else q.friction
        wanted = (q.reference_jacobian * q.feedforward_force - q.reference_gravity + q.gravity - q.reference_friction
                  + friction + u) / q.jacobian  # fmt: skip
        force_error = q.force - wanted
        spool, limited = self._spool(q, force_error, measurement.rate)
        # An integral stands where moving it on would push a saturated spool further (spool > 0 retracts).
        step = self._settings.sample_time
        if not (limited and force_error * limited > 0):
            self._force_integral += step * force_error
        if not (limited and e1 * limited > 0):
            self._position.integrate(e1)
        self._last = (e1, e2, force_error)
        if self._variant.pilot_inverse:
            retract, extend, plus, minus = self._inverse.step(spool)
        else:
            plus, minus = self._pilot.split(self._pilot.stiffness * spool)
            largest = self._settings.largest_current
            retract, extend = min(self._pilot.current(plus), largest), min(self._pilot.current(minus), largest)
        return Output(
            retract, extend,
            angle_error=-e1, piston_position_error=q.reference_position - q.position, force_error=-force_error,
            feedforward_force=q.feedforward_force, feedback_force=wanted - q.feedforward_force, force_set_point=wanted,
            force=q.force, spool_position=spool, pilot_pressure_retract=plus, pilot_pressure_extend=minus,
        )  # fmt: skip

    def change(self, settings: Settings) -> None:
        """Gains, limits and neutral pressure; integral states go on such that forces and spool keep their values.

        Raises:
            ControlError: another sample time.
        """
        if settings.sample_time != self._settings.sample_time:
            raise ControlError("sample_time cannot change while running: stop the controller and start it again")
        e1, e2, force_error = self._last
        self._position.change(settings.position_pole, e1, e2)
        (kp0, ki0), (kp, ki) = _force_gains(self._settings.force_pole), _force_gains(settings.force_pole)
        self._force_integral = ((kp0 - kp) * force_error + ki0 * self._force_integral) / ki
        self._pilot.neutral = settings.neutral_pressure
        self._inverse.change(settings)
        self._settings = settings

    def _at(self, r: Reference, m: Measurement, rest: bool = False) -> Quantities:
        return self._model.at(
            Point(
                m.angle, 0.0 if rest else m.rate, m.hose_pressure, m.rod_pressure,
                r.angle, r.rate, r.acceleration, r.jerk, 0.0,
            )
        )  # fmt: skip

    def _spool(self, q: Quantities, force_error: float, rate: float) -> tuple[float, int]:
        """Wanted s_s [m] from (6.22), (6.23), and the direction in which it is limited: 1 retract, -1 extend, 0 not."""
        a, b = self._area_a * q.stiffness_head, self._area_b * q.stiffness_rod
        kp, ki = _force_gains(self._settings.force_pole)
        velocity = q.jacobian * rate
        sigma = (q.feedforward_force_rate - kp * force_error - ki * self._force_integral
                 + (a * self._area_a + b * self._area_b) * velocity)  # fmt: skip
        largest = self._settings.largest_spool_position * self._stroke
        if sigma > 0:
            size = self._map.extending(sigma, a * q.extend_supply, -b * q.extend_tank)
            return (-largest, -1) if size > largest else (-size, 0)
        size = self._map.retracting(sigma, a * q.retract_tank, -b * q.retract_supply)
        return (largest, 1) if size > largest else (size, 0)


def _force_gains(pole: float) -> tuple[float, float]:
    """(k_p [1/s], k_i [1/s^2]) of (6.15) with both poles at ``pole`` [1/s]."""
    return -2.0 * pole, pole * pole
