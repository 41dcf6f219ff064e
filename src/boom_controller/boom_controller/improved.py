"""Mode ``improved``: the boom as a mass on an oil spring that the valve's flow drives; no force loop.

Every sample time (docs/control.md derives it):

1. observers: load at the tip (``load_observer``), compliance of both chambers, flow that the valve's model misses
   (``flow_observer``);
2. speed wanted of the oil, v = J(q*) q*' ahead by ``preview`` - k_p e - k_v e' - k_d f~ - d^, with gains by pole placement for the
   estimated stiffness and mass and f~ predicted over the valve's remaining lag (``state_feedback``);
3. flow map: Sigma = K v + d/dt f_ff, solved for the spool position by (6.23) (``valve_map``);
4. dead zone: below ``dead_zone_speed`` the spool moves through it in proportion, ahead of a reference that starts or turns;
5. currents through the inverse of spool and pilot stage (``valve_follower``).
"""

from __future__ import annotations

from boom_controller.control_model import ControlModel, Point, Quantities
from boom_controller.controller import Measurement, Output, Reference
from boom_controller.errors import ControlError
from boom_controller.flow_observer import ChamberCompliance, MissedFlow
from boom_controller.load_observer import LoadObserver
from boom_controller.pilot_stage import StaticPilot, require_pilot_stage
from boom_controller.settings import Settings
from boom_controller.stall_watch import StallWatch
from boom_controller.state_feedback import gains, predicted_force
from boom_controller.valve_follower import ValveFollower
from boom_controller.valve_map import ValveMap
from boom_model.machine import Machine, Pose

CAVITATION = 3.0e5
"""Pa. Below it the rod side may draw oil through its anti-cavitation valve, and tells nothing about its compliance."""


class Improved:
    """See the module."""

    mode = "improved"

    def __init__(self, machine: Machine, pose: Pose, settings: Settings) -> None:
        require_pilot_stage(machine, self.mode)
        self._model = ControlModel(machine, pose)
        p, e = self._model.p, self._model.e
        self._area_a, self._area_b = float(p.cylinder.A_a), float(p.cylinder.A_b)
        self._stroke = float(p.main_valve_spool.s_max)
        self._map = ValveMap(p, e)
        self._pilot = StaticPilot(p, e, settings.neutral_pressure)
        dead_zone = max(self._map.dead_extend, self._map.dead_retract)
        self._valve = ValveFollower(p, e, self._pilot, dead_zone, settings)
        self._load = LoadObserver(settings)
        self._head, self._rod = ChamberCompliance(), ChamberCompliance()
        self._missed, self._stall = MissedFlow(), StallWatch()
        self._settings = settings

    def reset(self, measurement: Measurement) -> None:
        """Rest: valve centred, nominal oil, no load beyond the configuration's."""
        self._valve.reset()
        self._load.reset()
        self._head.reset(measurement.hose_pressure)
        self._rod.reset(measurement.rod_pressure)
        force = self._at(Reference(measurement.angle), measurement).force
        self._missed.reset(force)
        self._stall.reset(measurement.hose_pressure * self._area_a)

    def step(self, reference: Reference, measurement: Measurement) -> Output:
        """One sample time."""
        s = self._settings
        q = self._at(reference, measurement)
        self._load.step(q, measurement.rate)
        velocity = q.jacobian * measurement.rate
        head_flow, rod_flow = self._flows(q)
        self._head.step(measurement.hose_pressure, q.stiffness_line * (head_flow - self._area_a * velocity), s)
        self._rod.step(
            measurement.rod_pressure, q.stiffness_rod * (rod_flow + self._area_b * velocity), s,
            trusted=measurement.rod_pressure > CAVITATION,
        )  # fmt: skip
        a = self._area_a * q.stiffness_line / self._head.ratio
        b = self._area_b * q.stiffness_rod / self._rod.ratio
        stiffness = a * self._area_a + b * self._area_b
        modelled = (a * head_flow - b * rod_flow) / stiffness
        self._missed.step(velocity, modelled, q.force, stiffness, s)
        pressure = measurement.hose_pressure
        self._stall.step(
            velocity, head_flow / self._area_a, pressure * self._area_a, a * self._area_a, self._load.load, pressure, s
        )

        ahead = _ahead(reference, s.preview)
        future = self._model.coming(ahead, self._load.load)
        k = gains(stiffness, q.inertia / q.jacobian**2, s)
        e1 = q.position - q.reference_position
        e2 = velocity - q.reference_jacobian * reference.rate
        driving = modelled - future.force_rate / stiffness - velocity
        force = predicted_force(q.force - q.feedforward_force, driving, stiffness, k.frequency, s.remaining_lag)
        wanted = (future.jacobian * ahead.rate - k.position * e1 - k.velocity * e2 - k.force * force
                  - self._missed.speed)  # fmt: skip
        sigma = stiffness * wanted + future.force_rate
        spool = self._spool(q, sigma, a, b)
        coming = future.jacobian * _ahead(reference, s.dead_zone_preview).rate
        spool = self._through_dead_zone(spool, sigma / stiffness + coming)
        retract, extend, plus, minus = self._valve.step(spool)
        return Output(
            retract, extend,
            angle_error=reference.angle - measurement.angle, piston_position_error=-e1, force_error=q.feedforward_force - q.force,
            feedforward_force=q.feedforward_force, feedback_force=0.0, force_set_point=q.feedforward_force, force=q.force,
            spool_position=spool, pilot_pressure_retract=plus, pilot_pressure_extend=minus, estimated_load=self._load.load,
            reason=self._stall.reason,
        )  # fmt: skip

    def change(self, settings: Settings) -> None:
        """Everything but the sample time; the observers' states stay.

        Raises:
            ControlError: another sample time.
        """
        if settings.sample_time != self._settings.sample_time:
            raise ControlError("sample_time cannot change while running: stop the controller and start it again")
        self._pilot.neutral = settings.neutral_pressure
        self._valve.change(settings)
        self._load.change(settings)
        self._settings = settings

    def _at(self, r: Reference, m: Measurement) -> Quantities:
        return self._model.at(
            Point(
                m.angle, m.rate, m.hose_pressure, m.rod_pressure,
                r.angle, r.rate, r.acceleration, r.jerk, self._load.load,
            )
        )  # fmt: skip

    def _flows(self, q: Quantities) -> tuple[float, float]:
        """(q_h, q_b) [m^3/s] into the ports, at the spool position that is followed."""
        position = self._valve.position
        supply, tank = self._map.areas(position)
        if position < 0:
            return q.extend_supply * supply, q.extend_tank * tank
        return q.retract_tank * tank, q.retract_supply * supply

    def _spool(self, q: Quantities, sigma: float, a: float, b: float) -> float:
        """s_s* [m] of (6.23) for Sigma [N/s]; a, b [N/m^3] are force per volume of both chambers."""
        largest = self._settings.largest_spool_position * self._stroke
        if sigma > 0:
            return -min(self._map.extending(sigma, a * q.extend_supply, -b * q.extend_tank), largest)
        return min(self._map.retracting(sigma, a * q.retract_tank, -b * q.retract_supply), largest)

    def _through_dead_zone(self, spool: float, speed: float) -> float:
        """s_s* [m] with its jump across the dead zone made a ramp over ``speed`` [m/s], positive lifts."""
        share = min(abs(speed) / self._settings.dead_zone_speed, 1.0)
        if (speed > 0) == (spool < 0):
            return spool * share
        return -self._map.dead_extend * share if speed > 0 else self._map.dead_retract * share


def _ahead(r: Reference, t: float) -> Reference:
    """The reference t [s] later, as its derivatives tell."""
    return Reference(
        r.angle + t * (r.rate + t / 2 * (r.acceleration + t / 3 * r.jerk)),
        r.rate + t * (r.acceleration + t / 2 * r.jerk),
        r.acceleration + t * r.jerk,
        r.jerk,
    )
