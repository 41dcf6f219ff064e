"""The simulated crane as a process: follows commands and publishes the machine's topics. Topics, parameters, services: README.md.

Real time: the crane advances every 10 ms of a steady clock; a command older than 100 ms closes the valve.
While /boom/emergency_stop is true, or several nodes publish commands or a sensor, the valve is closed, and stays so until commands
were zero or silent: the end of it starts nothing.
Lockstep: the simulation owns time. At t_n it publishes the samples of t_n, then /clock = t_n, and waits; one command advances it by
one period. A command whose stamp lies inside the coming period acts from that time, any other at once.
"""

# ruff: noqa: I001
from __future__ import annotations

from boom_node import early  # noqa: F401  (first: signals and environment)

import time
from typing import Any

from boom_input.channels import MEASURED_TOPICS, PREDICTED
from boom_interfaces.msg import GroundTruth, MachineConfiguration, SolenoidCurrents
from boom_interfaces.srv import SetPayload
from boom_model.errors import ModelError, SimulationError
from boom_node import parameters, qos, shell
from boom_node.commands import CLOSED_A
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.emergency_stop import EmergencyStop
from boom_node.errors import StartError
from boom_node.face import Face
from boom_node.node import Node
from boom_node.publishers import COMMANDS, SolePublishers
from boom_node.realtime import Garbage, use_priority
from boom_node.stamps import far, ns_to_seconds, seconds_to_ns, set_ns, to_ns
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import FluidPressure, JointState
from std_srvs.srv import SetBool, Trigger

from boom_sim import messages, settings
from boom_sim.pacing import SimulationPacer, WatchedCommand
from boom_sim.simulated_crane import PERIOD, CommandError, CraneSample
from boom_sim.unheard_motion import LOOK_EVERY_S, UnheardMotion


class SimulationNode(Node):
    """Thin layer around :class:`boom_sim.simulated_crane.SimulatedCrane`."""

    def __init__(self) -> None:
        super().__init__("boom_simulation")
        self._values = parameters.declare(self, settings.NODE_PARAMETERS)
        try:
            self._crane = settings.make_crane(self._values)
        except ModelError as error:
            raise StartError(str(error)) from error
        self._lockstep = self._values.mode == "lockstep"
        self._paused = self._held = False
        self._failure = self._refused = self._told_conflict = ""
        self._watch = WatchedCommand()
        self._sole = SolePublishers(self, (*COMMANDS, *MEASURED_TOPICS), self._values.shared_topics)
        pose = self._crane.pose
        self._face = Face(self, self._values, (pose.outer_boom_angle, pose.telescope_length))
        self._variance = (
            self._crane.machine.sensor_noise().pressure_sigma ** 2 if self._values.sensors == "thesis" else 0.0
        )

        def publisher(kind: Any, topic: str) -> Any:
            profile = qos.EVERY_SAMPLE if self._lockstep else qos.BY_TOPIC.get(topic, qos.SENSOR_DATA)
            return self.create_publisher(kind, topic, profile)

        self._joints = publisher(JointState, "/joint_states")
        self._pressures = [(s, publisher(FluidPressure, s.topic)) for s in PREDICTED if s.is_pressure]
        self._currents = publisher(SolenoidCurrents, "/boom/solenoid_currents")
        self._truth = publisher(GroundTruth, "/boom/ground_truth") if self._values.ground_truth else None
        self._clock_publisher = publisher(ClockMessage, "/clock") if self._lockstep else None
        self._latched = self.create_publisher(
            MachineConfiguration, "/boom/machine_configuration", qos.BY_TOPIC["/boom/machine_configuration"]
        )
        self.create_subscription(
            SolenoidCurrents, "/boom/current_command", self._on_command, qos.BY_TOPIC["/boom/current_command"]
        )
        self._stop = EmergencyStop(self, self._on_stop)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(SetPayload, "~/set_payload", self._on_set_payload)
        self._diagnostics = DiagnosticsPublisher(self, self._health, self._crane.machine.name)
        self._unheard = UnheardMotion(self)
        if not self._values.controller_follows:
            self.create_timer(LOOK_EVERY_S, self._look_for_listeners, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._origin_ns = 0 if self._lockstep else self.get_clock().now().nanoseconds
        self._pacer = SimulationPacer(PERIOD)
        note = f"simulated, seed {self._values.seed}"
        if self._crane.machine.effects:
            note += ", effects: " + ", ".join(sorted(self._crane.machine.effects))
        self._configuration = messages.configuration(
            self._crane.machine.name, pose.outer_boom_angle, pose.telescope_length, pose.load, note, self._origin_ns
        )
        self._latched.publish(self._configuration)
        if not self._lockstep:
            self._garbage = Garbage()
            self._garbage.hold()
            self._timer = self.create_timer(PERIOD, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(
            f"{self._crane.machine.name}, q3 = {pose.outer_boom_angle:g} rad, q4 = {pose.telescope_length:g} m, load "
            f"{pose.load:g} kg, boom at {self._values.initial_angle:.3f} rad, {self._values.mode.replace('_', ' ')}"
        )

    # ------------------------------------------------------------------------------------------------------- commands

    def _on_command(self, message: SolenoidCurrents) -> None:
        stamp_ns = to_ns(message.header.stamp)
        if not self._lockstep:
            wrong = far(stamp_ns, self.get_clock().now().nanoseconds) if stamp_ns else ""
            if wrong:
                self.guard.refuse("/boom/current_command", "stamp far from now", f"{wrong}: synchronise the clocks")
                return
            late = self._watch.receive(
                time.monotonic(), ns_to_seconds(self.get_clock().now().nanoseconds - stamp_ns), stamp_ns != 0
            )
            if late:
                self._refuse(late)
                return
        closed = all(
            0.0 <= current <= CLOSED_A for current in (message.retract, message.extend)
        )  # what is refused is not
        if closed and not self._stop.standing:
            self._held = False
        if self._conflict() or self._held:
            message.retract = message.extend = 0.0
        try:
            self._crane.command(
                message.retract, message.extend, ns_to_seconds(stamp_ns - self._origin_ns) if stamp_ns else None
            )
            self._refused = ""
        except CommandError as error:
            self._refuse(str(error))
            self._crane.command(0.0, 0.0)  # what cannot be understood closes the valve
        if self._lockstep and not self._paused:
            if self._crane.time == 0.0:
                self._publish(self._crane.sample, tick=False)  # only now is anybody sure to listen
            self._advance()

    def _on_stop(self, wanted: bool) -> None:
        if wanted == self._held:
            return
        if wanted:
            self._held = True
            self._crane.command(0.0, 0.0)
        elif self._watch.closed and not self._lockstep:
            self._held = False  # nothing waits to go on
        again = "it is false again" if not self._held else "it is false again: commands act once they were zero"
        self.get_logger().warning(f"/boom/emergency_stop: {'valve closed' if wanted else again}")
        self._diagnostics.update()

    def stop_safely(self, _reason: str) -> None:
        """Close the valve after a callback has raised."""
        self._crane.command(0.0, 0.0)

    def _on_tick(self) -> None:
        if self._conflict() and not self._watch.closed:
            self._crane.command(0.0, 0.0)
        if self._watch.has_expired(time.monotonic()):
            self._crane.command(0.0, 0.0)
            self._held = self._stop.standing
            self.get_logger().warning("no current command for 100 ms: the valve is closed until the next one")
            self._diagnostics.update()
        # when this tick was due, however late it comes: stamps stay on one grid, and a late first tick makes no later one early
        late = PERIOD - ns_to_seconds(self._timer.time_until_next_call())
        due = time.monotonic() - late
        if self._paused or self._failure:
            self._pacer.hold(due)
            self._anchor(due)
            return
        if not self._pacer.started:  # the first tick is time zero: building the node took a while
            if self._values.realtime_priority:  # all threads are there, the executor's included
                problem = use_priority(self._values.realtime_priority)
                if problem:
                    self.get_logger().warning(problem)
            self._anchor(due)
            self._publish(self._crane.sample)
        skipped = self._pacer.skipped
        for _ in range(self._pacer.due(due)):
            self._advance()
        if self._pacer.skipped != skipped:
            self._anchor(due)
        self._garbage.cycle_is_over()

    def _conflict(self) -> str:
        """What more than one node publishes, in a line, which the log has too; empty: nothing. Meanwhile the valve is closed."""
        conflict = self._sole.look()
        self._held = self._held or bool(conflict)  # who is left may be in the middle of a motion
        if conflict != self._told_conflict:
            self._told_conflict = conflict
            again = "commands and sensors have one publisher each again: commands act once they were zero"
            self.get_logger().warning(f"valve closed: {conflict}" if conflict else again)
            self._diagnostics.update()
            if not conflict:
                self._latched.publish(self._configuration)  # everybody may have heard the other crane's last
        return conflict

    def _anchor(self, due: float) -> None:
        """Set simulated time, from which stamps are made, to ``due`` [s] of the steady clock: steps since then took their time."""
        since = time.monotonic() - due
        self._origin_ns = self.get_clock().now().nanoseconds - seconds_to_ns(self._crane.time + since)

    def _look_for_listeners(self) -> None:
        told = self._unheard.look()
        if told:
            self.get_logger().warning(told)

    def _refuse(self, reason: str) -> None:
        if reason != self._refused:
            self._refused = reason
            self.get_logger().warning(f"current command refused: {reason}")
            self._diagnostics.update()

    # -------------------------------------------------------------------------------------------------------- stepping

    def _advance(self) -> None:
        if self._failure:
            return
        try:
            sample = self._crane.advance()
        except SimulationError as error:
            self._failure = str(error)
            self.get_logger().error(f"the simulation stands: {error}; call ~/reset to restart")
            self._diagnostics.update()
            return
        self._publish(sample)

    def _publish(self, sample: CraneSample, *, tick: bool = True) -> None:
        stamp = self._origin_ns + seconds_to_ns(sample.time)
        if sample.current_time == sample.current_time:
            self._currents.publish(messages.currents(sample, self._origin_ns + seconds_to_ns(sample.current_time)))
        self._joints.publish(messages.joint_state(sample, self._face.joints, stamp))
        for sensor, publisher in self._pressures:
            publisher.publish(messages.pressure(getattr(sample, sensor.name), sensor.frame, self._variance, stamp))
        if self._truth is not None:
            names, values, units = self._crane.truth
            self._truth.publish(messages.ground_truth(names, values.tolist(), units, stamp))
        if self._clock_publisher is not None and tick:
            clock = ClockMessage()
            set_ns(clock.clock, stamp)
            self._clock_publisher.publish(clock)

    # -------------------------------------------------------------------------------------------------------- services

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._crane.reset()
        self._failure = self._refused = ""
        self._watch = WatchedCommand()
        if not self._lockstep:
            self._pacer = SimulationPacer(PERIOD)
        else:
            self._publish(self._crane.sample, tick=False)
        self._diagnostics.update()
        response.success, response.message = True, f"back at {self._crane.sample.angle:.3f} rad, time 0"
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._paused = bool(request.data)
        response.success, response.message = True, "paused" if self._paused else "running"
        self._diagnostics.update()
        return response

    def _on_set_payload(self, request: SetPayload.Request, response: SetPayload.Response) -> SetPayload.Response:
        before = self._crane.load
        try:
            self._crane.set_load(request.mass)
        except ModelError as error:
            response.success, response.message = False, str(error)
            return response
        response.success, response.message = (
            True,
            f"load {before:g} kg -> {self._crane.load:g} kg at {self._crane.time:.2f} s",
        )
        self.get_logger().info(response.message)
        return response

    def _health(self) -> Health:
        values = {
            "time [s]": f"{self._crane.time:.2f}",
            "load [kg]": f"{self._crane.load:g}",
            "commands received": self._watch.received,
            "commands refused as late": self._watch.late,
            "periods skipped": self._pacer.skipped,
        }
        if self._failure:
            return Health(Level.ERROR, f"stands: {self._failure}", values)
        if self._sole.look():
            return Health(Level.ERROR, f"valve closed: {self._sole.conflict}", values)
        if self._held:
            why = "/boom/emergency_stop" if self._stop.standing else "commands act once they were zero"
            return Health(Level.WARN, f"valve closed: {why}", values)
        if self._paused:
            return Health(Level.WARN, "paused", values)
        if self._refused:
            return Health(Level.WARN, f"command refused: {self._refused}", values)
        if self._lockstep:
            return Health(Level.OK, "lockstep: waits for the next command", values)
        if self._watch.closed:
            return Health(Level.OK, "running, no command: valve closed", values)
        return Health(Level.OK, "running", values)


def main() -> int:
    """Runs the node until SIGINT or SIGTERM; returns the exit status."""
    return shell.run(SimulationNode)


if __name__ == "__main__":
    raise SystemExit(main())
