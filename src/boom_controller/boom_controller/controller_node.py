"""The controller as a lifecycle node. Topics, parameters, services, reasons to stop: README.md.

Real time: a cycle runs as soon as angle, hose pressure and rod pressure have each delivered a new sample, which adds no waiting
and no jitter; a steady timer runs it if one of them is late. Lockstep: one cycle for each tick of /clock, once all samples of that
tick are there. Configured, it listens. Active, it commands, with zero current until a reference is accepted.
"""

# ruff: noqa: I001
from __future__ import annotations

from boom_node import early  # noqa: F401  (first: signals and environment)

import time
from functools import partial
from typing import Any

from boom_input.channels import MEASURED_TOPICS
from boom_interfaces.msg import MachineConfiguration, SolenoidCurrents
from boom_model.errors import ModelError
from boom_node import parameters, qos, shell
from boom_node.commands import LONGEST_SILENCE_S
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.emergency_stop import EmergencyStop
from boom_node.errors import StartError
from boom_node.joint_state import angle_and_rate, named_twice
from boom_node.node import LifecycleNode
from boom_node.publishers import COMMANDS, SETTLE_S, SolePublishers
from boom_node.realtime import Garbage, WakeUpLatency, use_core, use_priority
from boom_node.stamps import far, seconds_to_ns, to_ns
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import FluidPressure, JointState
from std_srvs.srv import Trigger

from boom_controller.node import messages
from boom_controller.node.configuring import Configuring
from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.cycle import Cycle
from boom_controller.errors import ControlError
from boom_controller.node.lockstep import TickGate
from boom_controller.node.outputs import Log, Outputs
from boom_controller.node.sample_times import SampleTimes
from boom_controller.node.node_parameters import PARAMETERS, settings_of, supervision_of
from boom_controller.loop.other_joints import OtherJoints
from boom_controller.loop.rehearsal import Rehearsal
from boom_controller.node.trajectory_requests import TrajectoryRequests

_LOOK_EVERY = 0.25  # sample times between two looks for samples that are late
_LEVEL = {"ok": Level.OK, "warning": Level.WARN, "error": Level.ERROR, "stopped": Level.ERROR}


class ControllerNode(LifecycleNode):
    """Thin layer around :class:`boom_controller.loop.control_loop.ControlLoop`."""

    def __init__(self) -> None:
        super().__init__("boom_controller")
        self._values = vars(parameters.declare(self, PARAMETERS))
        gate = TickGate(self._values["lockstep_reference"], seconds_to_ns(self._values["lockstep_delay"]))
        self._lockstep = gate if self._values["time"] == "lockstep" else None
        self._others = OtherJoints(self.get_logger().warning)
        self._loop: ControlLoop | None = None
        self._rehearsal: Rehearsal | None = None
        self._active = self._realtime = False
        clock = self.get_clock()
        self._times = SampleTimes(self._lockstep, self._values, lambda: clock.now().nanoseconds, self.guard.refuse)
        self._configuring = Configuring(
            self._values["machine"], self._lockstep is None, self.get_logger(), self.guard.refuse
        )
        self._last: Cycle | None = None
        self._cycles = self._late = 0
        self._garbage, self._wake_up_latency = Garbage(), WakeUpLatency()
        self._failure = ""
        self._sole = SolePublishers(self, (*COMMANDS, *MEASURED_TOPICS), self._values["shared_topics"], SETTLE_S)
        self._streams = SolePublishers(self, ("/boom/reference",), self._values["shared_topics"])
        self._make_topics()
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._use_parameters)
        self._diagnostics = DiagnosticsPublisher(self, self._health)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        if self._lockstep:
            self.create_timer(0.05, self._begin_lockstep, clock=steady)
        else:
            self.create_timer(_LOOK_EVERY * self._values["sample_time"], self._look, clock=steady)
        if self._values["autostart"]:
            self.trigger_configure()
            if not self._failure:
                self.trigger_activate()
            if self._failure:
                raise StartError(f"boom_controller: {self._failure}")

    def _make_topics(self) -> None:
        def subscribe(kind: Any, topic: str, callback: Any, *, sensor: bool = False) -> None:
            profile = qos.EVERY_SAMPLE if sensor and self._lockstep else qos.requested(topic)
            self.create_subscription(kind, topic, callback, profile)

        self._outputs = Outputs(self.create_publisher, self._times.now_ns, bool(self._lockstep))
        self._log = Log(self.get_logger())
        subscribe(JointState, "/joint_states", self._on_joint, sensor=True)
        subscribe(FluidPressure, "/boom/hose_pressure", partial(self._on_pressure, "hose"), sensor=True)
        subscribe(FluidPressure, "/boom/rod_pressure", partial(self._on_pressure, "rod"), sensor=True)
        subscribe(SolenoidCurrents, "/boom/solenoid_currents", self._on_currents, sensor=True)
        subscribe(JointState, "/boom/reference", self._on_reference, sensor=True)
        subscribe(MachineConfiguration, "/boom/machine_configuration", self._on_configuration)
        self._emergency = EmergencyStop(self, self._on_emergency)
        if self._lockstep:
            self.create_subscription(ClockMessage, "/clock", self._on_clock, qos.EVERY_SAMPLE)
        self.create_service(Trigger, "~/resume", self._on_resume)
        self.create_service(Trigger, "~/emergency_stop", self._on_emergency_service)
        self._trajectories = TrajectoryRequests(
            self, self._values, self._times, lambda: self._loop if self._active else None
        )

    # ------------------------------------------------------------------------------------------------------- lifecycle

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Create the loop, which waits for the machine configuration."""
        self._failure = ""
        try:
            told = (self._values["mode"], settings_of(self._values), supervision_of(self._values))
            self._loop = ControlLoop(*told, watch_cycles=self._lockstep is None)
            if self.get_clock().ros_time_is_active:
                self._loop.sensors.trust_no_clock()
            self._rehearsal = None if self._lockstep else Rehearsal(*told)
        except (ControlError, ModelError) as error:
            self._failure, self._loop = str(error), None
            return TransitionCallbackReturn.FAILURE
        self._configuring.again()
        self._configure()
        self._loop.emergency_stop(self._emergency.standing, self._times.now())
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start to command, with zero current at first."""
        self._garbage.hold()
        self._active, self._realtime = True, False
        return super().on_activate(state)

    def _use_realtime(self) -> None:
        """Apply real-time settings at the first cycle, when all threads exist, including those of the executor."""
        self._realtime = True
        problems = []
        if self._values["realtime_priority"]:
            problems += [use_priority(self._values["realtime_priority"]), self._wake_up_latency.hold()]
        if self._values["realtime_core"] >= 0:
            problems.append(use_core(self._values["realtime_core"]))
        for problem in filter(None, problems):
            self.get_logger().warning(problem)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the currents to zero and stop commanding."""
        self._end_motion()
        return super().on_deactivate(state)

    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the loop."""
        self._loop = None
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the currents to zero for good."""
        self._end_motion()
        return TransitionCallbackReturn.SUCCESS

    def close(self) -> None:
        """Bring the currents to zero before the node is destroyed."""
        self._end_motion()
        self._trajectories.destroy()

    def _end_motion(self) -> None:
        if not self._active or self._loop is None:
            return
        self._active = False
        self._garbage.release()
        self._wake_up_latency.release()
        retract, extend = self._loop.drop(self._times.now())
        steps = round(self._loop.supervision.settings.current_ramp / 0.01)
        sent = time.monotonic()
        for k in range(1, steps if (retract or extend) and not self._lockstep else 1):
            if time.monotonic() - sent > LONGEST_SILENCE_S:  # frozen meanwhile: the valve is closed, and stays so
                break
            self._outputs.command(retract * (1 - k / steps), extend * (1 - k / steps))
            sent = time.monotonic()
            time.sleep(0.01)
        self._outputs.command(0.0, 0.0)
        self._trajectories.finish(self._loop)

    def stop_safely(self, reason: str) -> None:
        """A callback raised: the currents come to zero by the loop's ramp, or at once where the loop cannot be relied on."""
        if self._loop is not None and not self._loop.fault(reason, self._times.now()) and self._active:
            self._outputs.command(0.0, 0.0)

    # ------------------------------------------------------------------------------------------------------ parameters

    def _check_parameters(self, changed: list[Any]) -> Any:
        if any(p.name == "use_sim_time" and p.value != self.get_parameter(p.name).value for p in changed):
            reason = "use_sim_time cannot change while the controller runs (samples would seem old): set it at start"
            return SetParametersResult(successful=False, reason=reason)
        values = self._values | {p.name: p.value for p in changed}
        try:
            settings_of(values)
            supervision_of(values).check(self._loop and self._loop.configuration)
        except (ControlError, KeyError, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _use_parameters(self, changed: list[Any]) -> None:
        given = {p.name: p.value for p in changed if p.name in self._values}
        if not given:
            return
        self._values.update(given)
        if self._loop is None:
            return
        try:
            settings, supervision = settings_of(self._values), supervision_of(self._values)
            for loop in filter(None, (self._loop, self._rehearsal)):
                loop.change(mode=self._values["mode"], settings=settings, supervision=supervision)
        except (ControlError, ModelError) as error:
            self.get_logger().error(f"{', '.join(given)} not used: {error}")
            return
        self.get_logger().info("changed: " + ", ".join(f"{name} = {value}" for name, value in given.items()))

    # --------------------------------------------------------------------------------------------------------- samples

    def _on_joint(self, message: JointState) -> None:
        if self._loop is None or named_twice(self.guard, "/joint_states", message, self._values["joint_name"]):
            return
        self._others.take(message.name, message.position)
        moved = angle_and_rate(self.guard, "/joint_states", message, self._values["joint_name"])
        times = self._times.of("/joint_states", message) if moved else None
        if moved and times is not None:
            self._loop.joint(*moved, *times)
            self._arrived("joint", to_ns(message.header.stamp))

    def _on_pressure(self, name: str, message: FluidPressure) -> None:
        if self._loop is None:
            return
        times = self._times.of(f"/boom/{name}_pressure", message)
        if times is not None:
            take = self._loop.hose_pressure if name == "hose" else self._loop.rod_pressure
            take(messages.gauge(message), *times)
            self._arrived(name, to_ns(message.header.stamp))

    def _on_currents(self, message: SolenoidCurrents) -> None:
        if self._loop is None:
            return
        times = self._times.of("/boom/solenoid_currents", message)
        if times is not None:
            self._loop.currents(message.retract, message.extend, *times)

    def _arrived(self, name: str, stamp_ns: int) -> None:
        if self._lockstep:
            self._lockstep.arrived(name, stamp_ns)
            self._answer_tick()
        elif self._active and self._loop is not None:
            if self._loop.due(time.monotonic()):
                self._cycle()
            else:
                self._rehearse(self._loop)

    def _look(self) -> None:
        if not self._active or self._loop is None:
            return
        if self._loop.overdue(time.monotonic()):
            self._late += self._loop.configuration is not None
            self._cycle()
        else:
            self._rehearse(self._loop)

    def _rehearse(self, loop: ControlLoop) -> None:
        """Run warm-up cycles, which keep code and data in the caches: while a set of samples arrives, and in between."""
        if self._rehearsal and loop.configuration:
            self._rehearsal.run(loop.sensors, time.monotonic())

    def _begin_lockstep(self) -> None:
        """Send the first command, without which the simulation does not start, once all partners are there."""
        if not self._active or not self._lockstep.may_begin():
            return
        if (
            self._outputs.commands.get_subscription_count() >= self._values["wait_for"]
            and self._configuring.told is not None
        ):
            self._lockstep.begun = True
            self._outputs.command(0.0, 0.0)

    def _on_clock(self, message: ClockMessage) -> None:
        tick_ns, before = to_ns(message.clock), self._lockstep.tick_ns
        wrong = far(tick_ns, before) if before >= 0 else ""
        if wrong:
            self.guard.refuse("/clock", "far from the tick before", wrong)
            return
        self._lockstep.tick_ns = tick_ns
        self._answer_tick()

    def _answer_tick(self) -> None:
        if self._active and self._lockstep.due():
            self._cycle()

    # ----------------------------------------------------------------------------------------------------------- cycle

    def _cycle(self) -> None:
        loop = self._loop
        assert loop is not None  # the callers have looked
        if not self._realtime:
            self._use_realtime()
        if self._configuring.due:
            self._configure()
        loop.conflict(self._sole.look())
        cycle = loop.cycle(self._times.now())
        self._outputs.command(cycle.retract, cycle.extend)
        self._last = cycle
        self._cycles += 1
        stamp_ns = self._times.stamp_ns(cycle.time)
        self._outputs.cycle(cycle, stamp_ns)
        self._trajectories.answer(cycle, loop, stamp_ns)
        if self._log.tell(cycle):
            self._diagnostics.update()
        self._garbage.cycle_is_over()

    # -------------------------------------------------------------------------------------------------------- requests

    def _on_configuration(self, message: MachineConfiguration) -> None:
        if self._configuring.hear(message) and self._loop is not None:
            self._loop.configuration_changes(self._times.now())
            self._configure()

    def _configure(self) -> None:
        """Apply the latest configuration; if the boom moves, once it stands still."""
        loop = self._loop
        if loop is None or loop.supervision.moving:
            return
        if self._configuring.advance([each for each in (loop, self._rehearsal) if each is not None]) and self._active:
            self._garbage.hold()

    def _on_reference(self, message: JointState) -> None:
        joint = self._values["joint_name"]
        known = self._loop is not None and self._active and joint in message.name
        if self._loop is None or not known or named_twice(self.guard, "/boom/reference", message, joint):
            return
        k, stamp_ns = list(message.name).index(joint), to_ns(message.header.stamp)
        stamped = stamp_ns and not self._lockstep  # without a stamp: of now
        wrong = far(stamp_ns, self._times.now_ns()) if stamped else ""
        if wrong:
            self.guard.refuse("/boom/reference", "stamp far from now", f"{wrong}: synchronise the clocks")
            return
        if self._streams.conflict != self._streams.look() != "":
            self.get_logger().warning(f"{self._streams.conflict}. The boom goes between them")
        if k < len(message.position):
            self._loop.stream(message.position[k], self._times.now())
        if k < len(message.position) and self._lockstep:
            self._arrived("reference", stamp_ns)

    def _on_emergency(self, wanted: bool) -> None:
        if self._loop is not None:
            self._loop.emergency_stop(wanted, self._times.now())

    def _on_emergency_service(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._loop is not None:
            self._loop.stop_now(self._times.now())
        response.success, response.message = True, "stopping; call ~/resume to go on"
        return response

    def _on_resume(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._loop is None or not self._active:
            response.success, response.message = False, "the controller is not active: activate it first"
        else:
            response.success, response.message = self._loop.resume(self._times.now())
        self.get_logger().info(response.message)
        return response

    def _health(self) -> Health:
        if self._loop is None or not self._active:
            return Health(Level.ERROR if self._failure else Level.OK, self._failure or "not active", {})
        last = self._last
        values = {"control law": self._loop.law.mode, "cycles": self._cycles, "cycles without all samples": self._late}
        if last is None:
            return Health(Level.WARN, "no cycle yet", values)
        if self._sole.conflict:
            return Health(Level.ERROR, f"two_publishers: {self._sole.conflict}", values)
        values |= {
            "state": last.state.value,
            "computation of the last cycle [us]": f"{1e6 * last.duration:.0f}",
            "estimated load [kg]": f"{last.load:.0f}",
        }
        others = self._others.moved(self._loop.configuration), self._configuring.foreign, self._streams.look()
        beside = list(filter(None, others))
        said = "; ".join(filter(None, (last.reason, *beside)))
        return Health(max(_LEVEL[last.status], Level(bool(beside))), said or last.state.value, values)


def main() -> int:
    """Runs the node until SIGINT or SIGTERM; returns the exit status."""
    return shell.run(ControllerNode)


if __name__ == "__main__":
    raise SystemExit(main())
