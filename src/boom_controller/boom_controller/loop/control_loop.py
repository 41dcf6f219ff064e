"""The whole controller without ROS: from samples and requests to currents, state and reason, in one cycle per period.

Two clocks. ``now`` [s] is the supervising clock: steady, or the simulation's in lockstep. References and the control law run on
the stamps of the angle, so that reference and angle of the same instant are compared, however late the sample came.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from time import perf_counter

from boom_controller.controller import Settings
from boom_controller.errors import ControlError
from boom_controller.loop.cycle import Cycle
from boom_controller.loop.interlock import Interlock
from boom_controller.loop.law_in_use import LawInUse, PreparedLaws
from boom_controller.loop.request import Request
from boom_controller.loop.unused import unused_in_words
from boom_controller.references.joint_trajectory import Bounds, Code, TrajectoryError, TrajectoryPoint
from boom_controller.references.references import References
from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_controller.supervision.reasons import StopCause
from boom_controller.supervision.sensor_set import SensorSet
from boom_controller.supervision.state_machine import MotionState, Supervision
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.supervision.tracking_goal import Ending, Goals, Tolerances, TrackingGoal
from boom_controller.supervision.watch import MotionWatch
from boom_controller.types import ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose
from boom_node.commands import LONGEST_SILENCE_S

_NO_OUTPUT = ControlOutput(0.0, 0.0)
MOST_APART = 0.75
"""Sample times between the stamps of one set. Three sensors with separate timing are at most two thirds apart."""


class ControlLoop:
    """References, control law and supervision of one boom.

    Args:
        mode: mode of the control law, see ``controller.MODES``.
        settings: of the control law.
        supervision: limits and times.
        watch_cycles: False if time is simulated, so that cycles cannot be late.

    Attributes:
        supervision: the state machine.
        sensors: their newest samples.
        references: the reference.
        law, interlock: the control law; what stands against moving.
    """

    def __init__(
        self, mode: str, settings: Settings, supervision: SupervisionSettings, *, watch_cycles: bool = True
    ) -> None:
        self.law = LawInUse(mode, settings)
        self._period: float = settings.sample_time
        self.supervision = Supervision(supervision)
        self.sensors = SensorSet()
        self._watch_cycles = watch_cycles
        self._watch: MotionWatch | None = None
        self.references = References(
            TrajectoryGenerator(settings.generator_pole, self._period), self._period,
            supervision.stop_deceleration, supervision.largest_rate, supervision.blend,
        )  # fmt: skip
        self.interlock = Interlock(self.law, self.sensors, self.supervision)
        self._note = self._refused_stream = ""
        self._last_cycle: float | None = None
        self._last_reference = -math.inf
        self._time = 0.0
        self._last_output = (0.0, 0.0)
        self._goals = Goals()

    # ---------------------------------------------------------------------------------------------------- configuration

    def configure(self, machine: Machine, pose: Pose) -> None:
        """:meth:`use` with laws made for a machine and its pose. Raises what both raise."""
        self.use(self.law.prepared(machine, pose))

    def use(self, laws: PreparedLaws) -> None:
        """Control with these laws. Raises ControlError: the boom moves, or mode or limits do not fit the machine."""
        if self.supervision.moving:
            raise ControlError("the boom moves: stop it before the configuration changes")
        machine, pose = laws.configuration
        watch = MotionWatch.of(self.supervision.settings, machine, pose)
        self.law.use(laws)
        self._watch, self._note = watch, unused_in_words(machine)
        self.sensors.set_stroke(*machine.angle_limits)
        self._use_supervision(self.supervision.settings)

    def configuration_changes(self, now: float) -> None:
        """React to a changed machine, pose or load: stop a moving boom, after which ``use`` can be called."""
        if self.supervision.moving:
            text = "machine, pose or load changed in the configuration during the motion"
            self._stop(StopCause("configuration_changed", text), now)

    @property
    def configuration(self) -> tuple[Machine, Pose] | None:
        """Machine and pose in use."""
        return self.law.configuration

    def change(
        self,
        *,
        mode: str | None = None,
        settings: Settings | None = None,
        supervision: SupervisionSettings | None = None,
    ) -> None:
        """Change settings from the next cycle on, without a jump of the currents.

        Raises:
            ControlError: no such mode, or the change needs a restart.
        """
        controlled = self.supervision.closed_loop
        blend = self.supervision.settings.blend if controlled else 0.0
        if settings is not None:
            self.law.change_settings(settings, blend)
            self.references.change(self.law.settings.generator_pole)
        if supervision is not None:
            self._use_supervision(supervision)
        if mode is not None:
            self.law.change_mode(mode, self.sensors.newest() if controlled else None, self.supervision.settings.blend)

    def _use_supervision(self, new: SupervisionSettings) -> None:
        if self._watch is not None and self.configuration is not None:
            low, high = new.angles(self.configuration[0].angle_limits)
            self._watch.settings, self._watch.angles = new, (low, high)
            self._angles = (low + new.angle_margin, high - new.angle_margin)
        self.supervision.settings = new
        r = self.references
        r.deceleration, r.fastest, r.blend = new.stop_deceleration, new.largest_rate, new.blend

    def joint(self, angle: float, rate: float, stamp: float, measured: float) -> None:
        """Accept angle [rad] and rate [rad/s] with stamp [s] and time of measurement on the supervising clock [s]."""
        s, resting = self.supervision, self.references.resting
        held = resting and s.state is MotionState.HOLD
        self.sensors.take_joint(angle, rate, stamp, measured, s.settings, at_rest=not s.moving, held=held)

    def hose_pressure(self, pressure: float, stamp: float, measured: float) -> None:
        """p_h [Pa gauge], like ``joint``."""
        self.sensors.take_hose(pressure, stamp, measured, at_rest=not self.supervision.moving)

    def rod_pressure(self, pressure: float, stamp: float, measured: float) -> None:
        """p_b [Pa gauge], like ``joint``."""
        self.sensors.take_rod(pressure, stamp, measured, at_rest=not self.supervision.moving)

    def currents(self, retract: float, extend: float, stamp: float, measured: float) -> None:
        """Measured currents [A], like ``joint``; optional."""
        self.sensors.currents.take((retract, extend), stamp, measured)

    def due(self, now: float) -> bool:
        """True if a cycle has to run now because the sensors are complete; never twice within a quarter period."""
        waited = self._last_cycle is None or now - self._last_cycle >= 0.25 * self._period
        return waited and self.sensors.complete(MOST_APART * self._period)

    def overdue(self, now: float) -> bool:
        """True if a cycle has to run although samples are missing: one of a set is late, or all are."""
        if self._last_cycle is None:
            return True
        return now - self._last_cycle >= (1.3 if self.sensors.begun else 1.7) * self._period

    # ----------------------------------------------------------------------------------------------------------- requests

    def emergency_stop(self, wanted: bool, now: float) -> None:
        """The topic's state: true stops, false allows to resume."""
        self.interlock.emergency = wanted
        if wanted:
            self._stop(StopCause("emergency_stop", "emergency stop"), now)

    def stop_now(self, now: float) -> None:
        """Stop once: the emergency stop by service."""
        self._stop(StopCause("emergency_stop", "emergency stop by service"), now)

    def conflict(self, text: str) -> None:
        """What stands against moving from outside the loop, in a sentence; empty: nothing. More than one drives the boom."""
        self.interlock.conflict = text

    def fault(self, text: str, now: float) -> bool:
        """Handle a failure of this program: ramp to zero, at once the second time. True during the ramp."""
        again = self.supervision.finding is not None and self.supervision.finding.reason == "internal_error"
        self._stop(StopCause("internal_error", text), now)
        if again or not self._watch_cycles:
            self.supervision.drop()
            self._last_output = (0.0, 0.0)
        return self.supervision.moving

    def resume(self, now: float) -> tuple[bool, str]:
        """The explicit command to go on after a stop. Success, and a line for the operator."""
        return self.supervision.resume(self.interlock.standing(now), self.interlock.missing(now))

    def stream(self, wanted: float, now: float) -> None:
        """Accept a wanted angle [rad] of /boom/reference."""
        if not math.isfinite(wanted):
            self._refuse_stream(f"the reference is {wanted}: it is not used")
            return
        self._last_reference = now
        came, state = now if self._watch_cycles else None, self.supervision.state
        if state is MotionState.TRACK:
            if self.references.kind == "stream":
                clamped = self._bounds(self.references.present.angle).nearest(wanted)
                self.references.stream(clamped, came)
                beyond = f"the reference of {wanted:.4g} rad is beyond {clamped:.3f} rad"
                self._note = "" if clamped == wanted else beyond
            return  # a trajectory on its way goes first
        if state not in (MotionState.IDLE, MotionState.HOLD):
            return
        if missing := self.interlock.missing(now):
            self._refuse_stream(missing)
            return
        present = self.references.present.angle if state is MotionState.HOLD else self.sensors.joint.values[0]
        tolerance = self.supervision.settings.start_tolerance
        if abs(wanted - present) > tolerance:
            self._refuse_stream(
                f"the reference of {wanted:.4g} rad is not followed, the boom is at {present:.3f} rad: "
                f"bring it within {tolerance:g} rad to begin"
            )
            return
        self._begin()
        self._refused_stream = self._note = ""
        self.references.stream(self._bounds(present).nearest(wanted), came)
        self.supervision.track()

    def start(
        self,
        points: Sequence[TrajectoryPoint],
        now: float,
        *,
        begin: float | None = None,
        tolerances: Tolerances | None = None,
    ) -> int:
        """Start a planned motion at the next cycle, or at the stamp `begin` [s]. Returns its number, for ``Cycle.endings``.

        Raises:
            TrajectoryError: it is refused; the message says why.
        """
        state = self.supervision.state
        if state in (MotionState.STOPPING, MotionState.STOPPED):
            why = self.supervision.finding.text if self.supervision.finding else ""
            raise TrajectoryError(f"the boom is {state.value}: {why}; call ~/resume first")
        if missing := self.interlock.missing(now):
            raise TrajectoryError(missing)
        sensor, idle = self.sensors.joint, state is MotionState.IDLE
        angle = sensor.values[0]
        request = Request(points, begin, present=Reference(angle) if idle else self.references.onward)
        bounds = self._bounds(angle, request.present.angle)
        # a boom in motion goes on from its reference, which is that of the last cycle: a newer sample may wait for the next one
        trajectory, from_now = request.planned(angle, sensor.stamp, sensor.stamp if idle else self._time, bounds)
        self._goals.end(Code.INVALID_GOAL, "replaced by a new trajectory")
        self._begin()
        self.references.start(trajectory, from_now)
        self.supervision.track()
        self._note = ""
        asked = tolerances or Tolerances.asked(0.0, 0.0, 0.0, self.supervision.settings)
        return self._goals.start(TrackingGoal(asked, trajectory.duration, trajectory.goal))

    def _bounds(self, *where: float) -> Bounds:
        limits = self.supervision.settings
        return Bounds(*self._angles, limits.largest_rate, limits.start_tolerance).from_where(*where)

    def cancel(self, number: int | None = None) -> bool:
        """End a trajectory (of this number, or any): the boom comes to rest and is held."""
        if number is not None and not self._goals.runs(number):
            return False
        self._goals.end(Code.SUCCESSFUL, "cancelled: the boom holds its position")
        if self.supervision.state is MotionState.TRACK:
            self._to_hold("")
        return True

    def drop(self, now: float) -> tuple[float, float]:
        """End control (deactivation). Returns the currents [A] that the caller has to bring to zero."""
        self._goals.end(Code.INVALID_GOAL, "the controller was deactivated")
        self.supervision.drop()
        closed = self._last_cycle is None or self._closed_meanwhile(now - self._last_cycle)
        last, self._last_output = (0.0, 0.0) if closed else self._last_output, (0.0, 0.0)
        self._last_cycle = None
        self.sensors.forget()
        return last

    # -------------------------------------------------------------------------------------------------------------- cycle

    def cycle(self, now: float) -> Cycle:
        """Run one period."""
        begin = perf_counter()
        sensors, supervision = self.sensors, self.supervision
        gap = 0.0 if self._last_cycle is None else now - self._last_cycle
        self._last_cycle = now
        self._time = sensors.joint.stamp if sensors.joint.fresh else self._time + gap
        measurement = sensors.use(now)
        if supervision.moving:
            finding = self._watch.cycle(gap, self._period, now) if self._watch and self._watch_cycles else None
            # what stood still itself finds old samples; that a cycle was late is the cause then
            if finding is None or gap <= supervision.settings.longest_cycle:
                finding = self.interlock.standing(now) or finding
            if finding is not None:
                self._stop(finding, now)
            if supervision.state is MotionState.STOPPING and self._closed_meanwhile(gap):
                supervision.drop()
        if supervision.state is MotionState.TRACK and self.references.kind == "stream":
            self._listen(now)
        reference, output = self._act(measurement, now)
        left = supervision.advance(now, self.references.resting)
        retract, extend = self._last_output[0] * left, self._last_output[1] * left
        if supervision.state is MotionState.STOPPED:
            self._last_output = (0.0, 0.0)
        elif supervision.state is MotionState.TRACK:
            self._look_at_goal(reference, measurement)
        status, reason = self._status(now)
        load = output.estimated_load + self.configuration[1].load if self.configuration else math.nan
        return Cycle(
            self._time, supervision.state, retract, extend, reference, measurement, output, status, reason, load,
            self._goals.pop_endings(), perf_counter() - begin,
        )  # fmt: skip

    def _act(self, measurement: Measurement, now: float) -> tuple[Reference, ControlOutput]:
        watch = self._watch
        if not self.supervision.closed_loop or watch is None:
            if self.supervision.state is MotionState.STOPPING:
                return self.references.present, _NO_OUTPUT
            return Reference(measurement.angle), _NO_OUTPUT
        if self.law.glide():
            self.references.change(self.law.settings.generator_pole)
        reference = self.references.advance(self._time, now - measurement.age)
        output = self.law.step(reference, measurement)
        self.references.governor.allow(output)
        finding = watch.motion(measurement, reference, output, now)
        if finding is None:
            seen = self.sensors.measured_currents(now, self.supervision.settings.sensor_timeout)
            finding = watch.currents(self._last_output, seen, now)
        if math.isfinite(output.retract) and math.isfinite(output.extend):
            self._last_output = (output.retract, output.extend)
        if finding is not None:
            self._stop(finding, now)
        return reference, output

    def _begin(self) -> None:
        """Change from idle to closed loop."""
        if self.supervision.state is not MotionState.IDLE:
            return
        assert self.law.controller is not None and self._watch is not None  # readiness was checked
        measurement = self.sensors.newest()
        self.law.controller.reset(measurement._replace(rate=0.0))  # the valve is closed, whatever moves the boom
        self._time = measurement.time
        self.references.reset(measurement.angle, self._time)
        self._watch.reset()
        self._last_output = (0.0, 0.0)

    def _listen(self, now: float) -> None:
        silence = now - self._last_reference
        if silence > self.supervision.settings.reference_timeout:
            self._to_hold(f"no reference for {1e3 * silence:.0f} ms: the boom holds its position")

    def _to_hold(self, note: str) -> None:
        self.references.rest()
        self.supervision.hold()
        self._note = note

    def _look_at_goal(self, reference: Reference, measurement: Measurement) -> None:
        ending = self._goals.look((r := self.references).elapsed, reference.angle, measurement.angle, r.changing)
        if ending is not None:  # its text is empty on success
            self._to_hold(ending.text and f"trajectory aborted: {ending.text}; the boom holds its position")

    # ------------------------------------------------------------------------------------------------------- supervision

    def _stop(self, finding: StopCause, now: float) -> None:
        finding = self.sensors.doubted(finding)
        if self.supervision.stop(finding, now):
            self._note = ""
            self._goals.end(Code.INVALID_GOAL, f"stopped: {finding.text}")
            if self.supervision.closed_loop:
                self.references.rest()

    def _closed_meanwhile(self, gap: float) -> bool:
        """True if the receivers have closed the valve since the last command: a ramp would open it again."""
        return self._watch_cycles and gap > LONGEST_SILENCE_S

    def _refuse_stream(self, text: str) -> None:
        self._refused_stream = self._note = text

    def _status(self, now: float) -> tuple[str, str]:
        if (finding := self.supervision.finding) is not None:
            return "stopped", f"{finding.reason}: {finding.text}"
        if self.supervision.state is MotionState.IDLE:
            if missing := self.interlock.missing(now):
                return "warning", missing
            if self._refused_stream and now - self._last_reference > 1.0:
                self._refused_stream = self._note = ""
        slowed = self.supervision.closed_loop and (self.law.note or self.references.slowed)
        note = self._note or (self.supervision.closed_loop and self.sensors.doubt) or slowed
        return ("warning", note) if note else ("ok", "")

    def pop_endings(self) -> list[tuple[int, Ending]]:
        """Trajectories that ended since the last call, by their number; called by ``cycle``."""
        return self._goals.pop_endings()

    def goal_progress(self, number: int) -> tuple[float, float, float, float] | None:
        """Of the running trajectory of that number: wanted and measured angle [rad], time since its start [s], pace [-]."""
        r = self.references
        progress = r.present.angle, self.sensors.joint.values[0], r.elapsed, r.governor.share
        return progress if self._goals.runs(number) else None
