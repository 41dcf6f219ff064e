"""Mode ``improved``: the boom as a mass on an oil spring driven by the valve's flow; no force loop.

Every sample time (docs/control.md derives it):

1. observers: load at the tip (``load_observer``), compliance of both chambers, flow that the valve's model misses
   (``flow_observer``); they use the valve's position at the time of the sample;
2. wanted speed of the oil, v = J(q*) q*' ahead by ``preview`` - k_p e - k_v e' - k_d f~ - d^, with gains by pole placement for the
   estimated stiffness and mass and f~ predicted over the valve's remaining lag (``state_feedback``); further ahead by the dead
   time, which is the sample's age and ``command_delay``;
3. flow map: Sigma = K v + d/dt f_ff, solved for the spool position by (6.23) (``valve_map``) at pressures that are smoothed over
   ``inverse_smoothing``, and less what the boom's swing, f_p beyond the wanted one against itself smoothed, adds to them. At the
   measured ones the spool follows each swing of the pressure one valve lag late, which takes from the boom the damping that flow
   against pressure gives it, and it swings on its oil spring; most of all where it hardly presses on the cylinder;
4. dead zone: below ``dead_zone_speed`` the spool moves through it in proportion, ahead of a reference that starts or turns;
5. currents through the inverse of spool and pilot stage (``valve_follower``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.control_model import ControlModel, OperatingPoint
from boom_controller.blocks.dead_time import Held, Motion, Past, predicted
from boom_controller.blocks.direct_follower import follower_of
from boom_controller.blocks.flat import FlatLaw
from boom_controller.blocks.hysteresis import Play
from boom_controller.blocks.state_feedback import gains, predicted_force
from boom_controller.blocks.valve_follower import ValveState
from boom_controller.blocks.valve_map import ValveMap
from boom_controller.errors import ControlError
from boom_controller.observers import oscillation_watch
from boom_controller.observers.dead_time_observer import DeadTimeState, observe_dead_time
from boom_controller.observers.flow_observer import ChamberState, MissedState, observe_chamber, observe_missed_flow
from boom_controller.observers.friction_observer import FrictionState, observe_friction
from boom_controller.observers.load_observer import LoadObserver, LoadState
from boom_controller.observers.mode_observer import Modes
from boom_controller.observers.oscillation_watch import OscillationState, watch_oscillation
from boom_controller.observers.reach import ReachState, watch_reach
from boom_controller.observers.rest import RestState, watch_rest
from boom_controller.observers.spool_observer import SpoolSeen, SpoolState, deflection_sigma, observe_spool
from boom_controller.observers.stall_watch import StallState, reason, stalled, watch_supply
from boom_controller.settings import LawSettings, tunable
from boom_controller.types import GO, MOVES, Controller, ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose
from boom_model.regularisation import Expression

LAWS = {
    "improved": "the boom as a mass on an oil spring driven by the valve's flow; observers for load, oil and missing flow",
}
CAVITATION = 3.0e5
"""Pa. Below this the rod side may draw oil through its anti-cavitation valve and gives no information on its compliance."""
QUICKER = 0.5
"""Of ``inverse_smoothing``, in which the force beyond the wanted one counts as no swing. With 0.25 a folded boom swings near the
vertical; with 1 a dead time of 60 ms that is told costs a quarter more (0.46 instead of 0.36 mm in the worst pose)."""
LOAD = ControlOutput._fields.index("estimated_load")


@dataclass(frozen=True)
class ImprovedSettings(LawSettings):
    """Feedback, valve and observers."""

    rest_response: float = tunable(0.05, "s", 0.005, 1.0, "time constant of the spool inside the dead zone, improved")
    feedback_pole: float = tunable(-7.0, "1/s", -15.0, -0.5, "real pole of the position feedback, improved")
    feedback_gain: float = tunable(1.0, "-", 0.1, 5.0, "factor of all feedback gains, improved")
    feedback_damping: float = tunable(0.7, "-", 0.1, 1.5, "damping wanted of the boom on its oil spring, improved")
    largest_damping: float = tunable(30.0, "1/s", 1.0, 60.0, "limit of the force feedback K k_d, improved")
    slowest_frequency: float = tunable(
        6.0, "rad/s", 0.5, 20.0, "frequency to which a softer oil spring is stiffened, improved"
    )
    predicted_phase: float = tunable(
        1.3, "rad", 0.1, 100.0, "turn of the oil spring within the dead time at which the damping is halved, improved"
    )
    preview: float = tunable(0.035, "s", 0.0, 0.2, "lead of the reference over the valve's remaining lag, improved")
    remaining_lag: float = tunable(0.015, "s", 0.0, 0.1, "lag over which the force is predicted, improved")
    command_delay: float = tunable(
        0.0,
        "s",
        0.0,
        0.1,
        "dead time from a command to the solenoids beyond the machine file's, compensated like the samples' age, improved",
    )
    inverse_smoothing: float = tunable(
        0.02, "s", 0.0, 0.5, "time constant of the pressures at which the valve is inverted, improved"
    )
    dead_zone_speed: float = tunable(
        1.0e-3, "m/s", 1e-4, 0.02, "piston speed below which the spool stays inside its dead zone, improved"
    )
    dead_zone_preview: float = tunable(
        0.06, "s", 0.0, 0.3, "how long ahead of the reference the spool crosses its dead zone, improved"
    )
    load_pole: float = tunable(-20.0, "1/s", -60.0, -1.0, "double pole of the load observer, improved")
    load_pole_fast: float = tunable(-60.0, "1/s", -90.0, -1.0, "the same while the rate is a surprise, improved")
    rate_surprise: float = tunable(
        6.0e-3, "rad/s", 1e-4, 0.1, "rate error from which the load observer is faster (4 sigma of the gyro)"
    )
    largest_load: float = tunable(3000.0, "kg", 0.0, 1e5, "largest load that is estimated, improved")
    flow_pole: float = tunable(
        -3.0, "1/s", -10.0, 0.0, "pole with which flow that the valve's model misses is learnt, improved"
    )
    compliance_gain: float = tunable(8.0, "1/s", 0.0, 30.0, "how quickly the oil's compliance is learnt, improved")
    compliance_pressure: float = tunable(
        1.0e6, "Pa", 1e4, 1e7, "pressure change below which it is not learnt, improved"
    )
    oscillation_speed: float = tunable(0.01, "m/s", 1e-3, 0.1, "half-wave from which an oscillation counts, improved")
    stall_time: float = tunable(
        0.5, "s", 0.1, 5.0, "how long the supply may deliver too little before the load counts as too heavy"
    )


SETTINGS = ImprovedSettings


def make(_mode: str, machine: Machine, pose: Pose, settings: ImprovedSettings) -> Controller:
    """See :mod:`boom_controller.laws`."""
    return Improved(machine, pose, settings)


class Pressures(NamedTuple):
    """p_h, p_b [Pa]."""

    hose: Expression = 0.0
    rod: Expression = 0.0
    off: Expression = 0.0
    """f_p beyond the wanted one, smoothed [N]."""

    def towards(self, m: Measurement, off: Expression, head: Expression, rod: Expression, s: Any) -> Pressures:
        """One sample time later, of first-order lags.

        off: f_p beyond the wanted one [N], whose swing is taken out. head, rod: rise of p_a and fall of p_b with f_p where the boom
        swings on its oil [1/m^2].
        """
        quick, share = (s.sample_time / (by * s.inverse_smoothing + s.sample_time) for by in (QUICKER, 1.0))
        slow = self.off + quick * (off - self.off)
        p_h, p_b = m.hose_pressure - head * (off - slow), m.rod_pressure + rod * (off - slow)
        return Pressures(self.hose + share * (p_h - self.hose), self.rod + share * (p_b - self.rod), slow)


class ImprovedState(NamedTuple):
    """States of the law. Initially: valve centred, nominal oil, no load beyond the configured one."""

    valve: ValveState = ValveState()
    load: LoadState = LoadState()
    head: ChamberState = ChamberState()
    rod: ChamberState = ChamberState()
    missed: MissedState = MissedState()
    stall: StallState = StallState()
    past: Past = Past((), ())
    held: Held = Held(())
    swings: OscillationState = OscillationState()
    rest: RestState = RestState()
    friction: FrictionState = FrictionState()
    reach: ReachState = ReachState()
    delay: DeadTimeState = DeadTimeState()
    spool: SpoolState = SpoolState()
    smooth: Pressures = Pressures()


class Improved:
    """See the module."""

    mode = "improved"

    def __init__(self, machine: Machine, pose: Pose, settings: ImprovedSettings) -> None:
        self._model = ControlModel(machine, pose)
        p, e = self._model.p, self._model.e
        self._area_a, self._area_b = float(p.cylinder.A_a), float(p.cylinder.A_b)
        self._stroke = float(p.main_valve_spool.s_max)
        self._map = ValveMap(machine.structure, p, e)
        dead_zone = self._dead_zone = max(self._map.dead_extend, self._map.dead_retract)
        neutral = float(e.through("metering_position", machine.structure.metering.neutral(p), p=p))
        play = Play(machine.effects, self._stroke, neutral)
        self._valve = follower_of(machine, self.mode, p, e, dead_zone, settings.sample_time, play)
        self._settings = settings
        self._load = LoadObserver(Modes(machine, pose, p), p)
        self._spread = deflection_sigma(machine, pose)
        self._start = ImprovedState(
            load=self._load.start,
            past=Past.steady(0.0, 0.0, settings.sample_time),
            held=Held.of(self._model.pressure_delay, settings.sample_time),
            delay=DeadTimeState.untold(settings.sample_time),
            spool=SpoolState.uncertain(self._spread),
        )
        self._law = FlatLaw(self.mode, self._start, self._after, SETTINGS, settings, self._load.gains(settings))
        self._giving = self._giving_function()
        self._stop = GO

    def reset(self, measurement: Measurement) -> None:
        """Start with nominal oil, no load beyond the configured one, the valve centred, or where it moves the boom like this."""
        shown = self._model.sample(measurement)
        valve, past = self._moving(shown) if abs(shown.rate) > MOVES else (self._start.valve, self._start.past)
        load, there = self._load.resting(shown)
        hose, rod = shown.hose_pressure, shown.rod_pressure
        force = self._model.resting_force(there)
        self._law.start(
            self._start._replace(
                valve=valve,
                past=past,
                load=load,
                held=self._start.held.filled(there.angle, shown),
                head=ChamberState(pressure=hose),
                rod=ChamberState(pressure=rod),
                missed=MissedState(force=force),
                delay=self._start.delay._replace(force=force),
                stall=StallState(force=hose * self._area_a),
                smooth=Pressures(hose, rod),
            )
        )
        self._stop = GO

    def _moving(self, m: Measurement) -> tuple[ValveState, Past]:
        """The valve that has given the boom its present rate for long."""
        s = self._settings
        numbers = m.angle, m.rate, m.hose_pressure, m.rod_pressure, s.largest_spool_position, s.dead_zone_speed
        edges, speed, closing = (float(value) for value in self._giving(*numbers))
        return self._valve.settled(edges, closing, s), Past.steady(edges, speed, s.sample_time)

    def _giving_function(self) -> Any:
        """Edges s_s [m] that give the boom its rate, v [m/s], F_q [N] there."""
        given: list[Any] = [ca.SX.sym(f"given_{k}") for k in range(6)]
        angle, rate, hose, rod, largest, slow = given
        q = self._model.expressions(OperatingPoint(angle, rate, hose, rod, angle, rate, 0.0, 0.0, 0.0))
        flows = self._map.flows(hose, rod, (q.rod_cushion, q.hose_cushion))
        a, b = self._area_a * q.stiffness_line, self._area_b * q.stiffness_rod
        speed, stiffness = q.jacobian * rate, a * self._area_a + b * self._area_b
        edges = self._map.through_dead_zone(flows.spool(stiffness * speed, a, b, largest * self._stroke), speed, slow)
        return ca.Function("giving", given, [edges, speed, flows.at(edges)[2]])

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        """One sample time."""
        *quantities, is_stalled, is_calmed, is_unsettled = self._law.step(reference, measurement)
        if not self._stop[0] and (is_stalled or is_unsettled):
            stalls = reason(quantities[LOAD], measurement.hose_pressure), "load_not_held"
            self._stop = stalls if is_stalled else (oscillation_watch.REASON, "oscillation")
        return ControlOutput.of(quantities, self._stop, oscillation_watch.NOTE if is_calmed else "")

    def change(self, settings: ImprovedSettings) -> None:
        """Change everything except the sample time; the observers keep their states.

        Raises:
            ControlError: another sample time.
        """
        if settings.sample_time != self._settings.sample_time:
            raise ControlError("sample_time cannot change while running: stop the controller and start it again")
        self._law.change(settings, self._load.gains(settings))
        self._settings = settings

    def _after(self, x: ImprovedState, r: Reference, m: Measurement, s: Any) -> tuple[ImprovedState, list[Expression]]:
        """The law as expressions: states one sample time later; ``ControlOutput`` up to the load, and whether the supply stalls."""
        r = self._load.wanted(x.load, r)
        now, m, held = x.held.with_next(r, self._model.sample(m), self._model.pressure_delay, s.sample_time)
        m = self._load.seen(x.load, m)
        told = s.command_delay + self._model.command_delay
        late = m.age + told + x.delay.delay  # until the command acts
        dead = late + self._model.pressure_delay  # since the sample
        q = self._model.expressions(
            OperatingPoint(m.angle, m.rate, m.hose_pressure, m.rod_pressure, *now, x.load.load, x.friction.factor)
        )
        position = x.past.position(dead, s.sample_time)
        velocity = q.jacobian * m.rate
        through, known = True, 1.0
        if self._model.machine.holds:
            through = ca.logic_and(position < -self._dead_zone, velocity > s.dead_zone_speed)
            q, known = self._model.carried(q, m, now.acceleration, through)
        safe = x.swings.calmed > 0
        load = self._load.step(x.load, q, m, safe, s, known)
        rub = observe_friction(x.friction, q, load.load, s.sample_time)
        flows = self._map.flows(m.hose_pressure, m.rod_pressure, (q.rod_cushion, q.hose_cushion))
        head_flow, rod_flow, _ = flows.at(position)
        supplied = head_flow / self._area_a, rod_flow / self._area_b
        head_flow, rod_flow = head_flow - q.leakage, rod_flow + q.leakage
        full = m.rod_pressure > CAVITATION
        head = observe_chamber(
            x.head, m.hose_pressure, q.stiffness_line * (head_flow - self._area_a * velocity), s,
            trusted=through,
        )  # fmt: skip
        rod = observe_chamber(
            x.rod, m.rod_pressure, q.stiffness_rod * (rod_flow + self._area_b * velocity), s,
            trusted=full,
        )  # fmt: skip
        a = self._area_a * q.stiffness_line / head.ratio
        b = self._area_b * q.stiffness_rod / rod.ratio
        stiffness = a * self._area_a + b * self._area_b
        # where a valve holds the load, the hose does not show what carries the boom; late pressures show a swing that is over
        shown = through if self._model.pressure_delay == 0.0 else False
        off = ca.if_else(shown, q.force - q.feedforward_force, 0.0)
        smooth = x.smooth.towards(m, off, a / stiffness, b / stiffness, s)
        inverse = self._map.flows(smooth.hose, smooth.rod, (q.rod_cushion, q.hose_cushion))
        modelled = (a * head_flow - b * rod_flow) / stiffness
        missed = observe_missed_flow(x.missed, velocity, modelled, q.force, stiffness, safe, s)
        compressing = (q.force - x.missed.force) / (stiffness * s.sample_time)
        leaking = (a + b) * q.leakage / stiffness
        came = velocity + compressing + leaking
        needed = ca.fabs(flows.spool(stiffness * came, a, b, self._stroke))
        seen = SpoolSeen(position, needed, modelled + leaking, came, compressing, full)
        travel = observe_spool(x.spool, seen, self._dead_zone, self._spread, s)
        delay = observe_dead_time(
            x.delay, velocity, x.past.speeds[0], dead - x.delay.delay, q.force, stiffness, -told, full, s,
            found=self._model.command_delay > 0.0,
        )  # fmt: skip
        stall = watch_supply(
            x.stall, velocity, head_flow / self._area_a, m.hose_pressure * self._area_a, a * self._area_a, s
        )

        mass = q.inertia / q.jacobian**2
        k = gains(stiffness, mass, dead, safe, s)
        between, then = r.ahead(late - 0.5 * dead), r.ahead(late)
        half, target = (
            self._model.coming(between, load.load, rub.factor),
            self._model.coming(then, load.load, rub.factor),
        )
        still = half.force - mass * half.jacobian * between.acceleration
        motion = predicted(
            Motion(q.position, velocity, q.force),
            x.past,
            missed.speed,
            still,
            stiffness,
            k.frequency,
            dead,
            s.sample_time,
        )
        e1, e2 = motion.position - target.position, motion.velocity - target.jacobian * then.rate
        swings = watch_oscillation(
            x.swings,
            velocity - q.reference_jacobian * now.rate + (q.force - q.feedforward_force) * k.frequency / stiffness,
            dead,
            s,
        )
        coming = r.ahead(s.preview + late)
        future = self._model.coming(coming, load.load, rub.factor)
        driving = x.past.speeds[0] - future.force_rate / stiffness - motion.velocity
        force = predicted_force(motion.force - target.force, driving, stiffness, k.frequency, s.remaining_lag)
        wanted = (future.jacobian * coming.rate - k.position * e1 - k.velocity * e2 - k.force * force
                  - missed.speed + leaking)  # fmt: skip
        sigma = stiffness * wanted + future.force_rate
        soon = r.ahead(s.dead_zone_preview + late)
        starting = self._model.coming(soon, load.load).jacobian * soon.rate
        rest = watch_rest(x.rest, sigma / stiffness, starting, s.dead_zone_speed, s.sample_time)
        spool = self._map.through_dead_zone(
            inverse.spool(sigma, a, b, s.largest_spool_position * self._stroke),
            sigma / stiffness + starting,
            s.dead_zone_speed,
        )
        spool = ca.if_else(rest.resting, 0.0, spool * travel.of(spool))
        valve, plus, minus = self._valve.step(x.valve, spool, lambda position: flows.at(position)[2], s)
        edges = self._valve.edges(valve)
        edges = edges / travel.of(edges)
        head_flow, rod_flow, _ = flows.at(edges)
        widest = ca.fmin(s.largest_spool_position * self._stroke, self._valve.reach(s.largest_current))
        reach, lift, lower = watch_reach(
            x.reach, velocity, supplied,
            (flows.at(-widest / travel.lift.share)[0] / self._area_a, flows.at(widest / travel.lower.share)[1] / self._area_b), s,
        )  # fmt: skip
        past = x.past.with_next(edges, (a * head_flow - b * rod_flow) / stiffness - leaking)
        return ImprovedState(valve, load, head, rod, missed, stall, past, held, swings, rest, rub, reach, delay, travel, smooth), [
            valve.retract.current, valve.extend.current, now.angle - m.angle,
            q.reference_position - q.position, q.feedforward_force - q.force,
            q.feedforward_force, 0.0, q.feedforward_force, q.force, spool, plus, minus, load.load,
            lift / q.jacobian, lower / q.jacobian, stalled(stall, s), swings.calmed > 0, swings.unsettled,
        ]  # fmt: skip
