"""The bridge as a lifecycle node: the machine's topics from CAN frames, command frames from /boom/current_command. See README.md.

Configured, it opens the bus, listens, and sends zero current. Active, it publishes, and passes commands once ~/enable was called.
In lockstep with a simulated ECU, time is that of the simulation, published on /clock.
"""

# ruff: noqa: I001
from __future__ import annotations

from boom_node import early  # noqa: F401  (first: signals and environment)

import time
from typing import Any

from boom_input.channels import MEASURED_TOPICS, SENSORS
from boom_interfaces.msg import MachineConfiguration, SolenoidCurrents
from boom_node import parameters, qos, shell
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.emergency_stop import EmergencyStop
from boom_node.errors import StartError
from boom_node.face import Face
from boom_node.node import LifecycleNode
from boom_node.publishers import COMMANDS, SolePublishers
from boom_node.stamps import far, ns_to_seconds, seconds_to_ns, set_ns, to_ns
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from boom_can_bridge import settings
from boom_can_bridge.bridge import Bridge, BridgeSettings
from boom_can_bridge.connection import BusSettings, BusUnavailableError
from boom_can_bridge.errors import CanConfigurationError
from boom_can_bridge.prepared_message import PreparedMessage
from boom_can_bridge.receiver import Reading

_PRESSURES = tuple(sensor for sensor in SENSORS if sensor.is_pressure)
LOOK_S = 0.05


class BridgeNode(LifecycleNode):
    """Thin layer around :class:`boom_can_bridge.bridge.Bridge`."""

    def __init__(self) -> None:
        super().__init__("boom_can_bridge")
        self._values = values = parameters.declare(self, settings.PARAMETERS)
        self._bridge: Bridge | None = None
        self._failure = ""
        self._said = ""
        self._told: MachineConfiguration | None = None
        self._told_enabled = False
        self._answered = ""
        self._settings = BridgeSettings(
            BusSettings(values.interface, values.channel, values.bitrate),
            values.dbc, values.mapping, values.log, values.good_frames, values.watchdog, values.largest_current,
            values.rise_rate, values.command_timeout, values.revoke_after, values.lockstep, values.filter_foreign,
        )  # fmt: skip
        self._sole = SolePublishers(self, (*COMMANDS, *MEASURED_TOPICS), values.shared_topics)
        self._make_messages()

        def publisher(kind: Any, topic: str) -> Any:
            return self.create_publisher(kind, topic, qos.EVERY_SAMPLE if values.lockstep else qos.BY_TOPIC[topic])

        self._joints = publisher(JointState, "/joint_states")
        self._pressures = {sensor.name: publisher(FluidPressure, sensor.topic) for sensor in _PRESSURES}
        self._currents = publisher(SolenoidCurrents, "/boom/solenoid_currents")
        self._clock_publisher = publisher(ClockMessage, "/clock") if values.lockstep else None
        self._configuration = self.create_publisher(
            MachineConfiguration, "/boom/machine_configuration", qos.BY_TOPIC["/boom/machine_configuration"]
        )
        self._enabled = self.create_publisher(Bool, "~/motion_enabled", qos.LATCHED)
        self.create_subscription(
            SolenoidCurrents, "/boom/current_command", self._on_command, qos.BY_TOPIC["/boom/current_command"]
        )
        self._stop = EmergencyStop(self, self._on_stop)
        self._enabled.publish(Bool(data=False))
        self.create_service(SetBool, "~/enable", self._on_enable)
        self._diagnostics = DiagnosticsPublisher(self, self._health, values.machine)
        self.create_timer(LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        if values.autostart:
            self.trigger_configure()
            if not self._failure:
                self.trigger_activate()
            if self._failure:
                raise StartError(f"boom_can_bridge: {self._failure}")

    def _make_messages(self) -> None:
        values = self._values
        self._face = Face(self, values, (values.outer_boom_angle, values.telescope_length))
        joints = self._face.joints
        state = JointState(name=joints.names, position=joints.positions(0.0), velocity=joints.velocities(0.0, 0.0))
        places = [f"{field}.{k}" for field in ("position", "velocity") for k in joints.moving]
        self._joint_message = PreparedMessage(state, tuple(places), serialize_message)
        self._pressure_messages = {}
        for sensor in _PRESSURES:
            pressure = FluidPressure(variance=values.pressure_variance)
            pressure.header.frame_id = sensor.frame
            self._pressure_messages[sensor.name] = PreparedMessage(pressure, ("fluid_pressure",), serialize_message)
        self._current_message = PreparedMessage(SolenoidCurrents(), ("retract", "extend"), serialize_message)

    # ------------------------------------------------------------------------------------------------------- lifecycle

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Read the DBC file, open the bus, listen."""
        try:
            bridge = Bridge(self._settings, self._publish, self._on_connection, on_cycle=self._publish_clock)
        except CanConfigurationError as error:
            return self._fail(str(error))
        try:
            bridge.open(wait=self._values.wait_for_bus)
        except (CanConfigurationError, BusUnavailableError) as error:
            if bridge.log is not None:
                bridge.log.close()
            return self._fail(str(error))
        bridge.emergency_stop(self._stop.standing)
        self._failure = ""
        self._bridge = bridge
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish; pass commands once motion is enabled."""
        if self._bridge is None:
            return TransitionCallbackReturn.FAILURE
        values = self._values
        message = MachineConfiguration(
            machine=values.machine, outer_boom_angle=values.outer_boom_angle, telescope_length=values.telescope_length,
            load_mass=values.load_mass if values.load_mass >= 0 else float("nan"), note=values.note,
        )  # fmt: skip
        if not values.lockstep:
            message.header.stamp = self.get_clock().now().to_msg()
        self._told = message
        self._configuration.publish(message)
        self._bridge.activate(True)
        self.get_logger().info(f"active on {self._settings.bus}, DBC {values.dbc}; motion needs ~/enable")
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Send zero current and stop publishing."""
        if self._bridge is not None:
            self._bridge.activate(False)
        return super().on_deactivate(state)

    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Close the bus."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Close the bus for good."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def _fail(self, reason: str) -> TransitionCallbackReturn:
        self._failure = reason
        if not self._values.autostart:
            self.get_logger().error(reason)
        return TransitionCallbackReturn.FAILURE

    def close(self) -> None:
        """Send zero current once more, then close the bus."""
        bridge, self._bridge = self._bridge, None
        if bridge is not None:
            bridge.close()

    def stop_safely(self, reason: str) -> None:
        """Send zero current until motion is enabled again, after a callback has raised."""
        if self._bridge is not None:
            self._bridge.stop(reason)

    # ------------------------------------------------------------------------------------------------- bus to topics

    def _publish(self, reading: Reading) -> None:
        """Publish a reading; runs in the receive thread."""
        bridge = self._bridge
        if bridge is None:
            return
        clock, steady = bridge.checker.clock, time.monotonic()
        if bridge.lockstep is not None:
            stamp_ns = seconds_to_ns(reading.steady)
        elif clock.ros_clock_due(steady):
            stamp_ns = clock.to_ros_ns(reading.steady, steady, self.get_clock().now().nanoseconds)
        else:
            stamp_ns = clock.last_ros_ns(reading.steady)
        values = reading.values
        if "angle" in values:
            self._joints.publish(
                self._joint_message.fill(stamp_ns, *self._face.joints.moved(values["angle"], values["rate"]))
            )
        for sensor in _PRESSURES:
            if sensor.name in values:
                absolute = values[sensor.name] + sensor.wire_offset
                self._pressures[sensor.name].publish(self._pressure_messages[sensor.name].fill(stamp_ns, absolute))
        if "retract_current" in values:
            currents = self._current_message.fill(stamp_ns, values["retract_current"], values["extend_current"])
            self._currents.publish(currents)

    def _publish_clock(self, now: float) -> None:
        """Publish /clock in lockstep; runs in the receive thread."""
        message = ClockMessage()
        set_ns(message.clock, seconds_to_ns(now))
        self._clock_publisher.publish(message)

    def _on_connection(self, up: bool, text: str) -> None:
        if up:
            self.get_logger().info(text)
        else:
            self.get_logger().warning(f"{text}; zero current, trying again")

    # ---------------------------------------------------------------------------------------------- topics to the bus

    def _on_command(self, message: SolenoidCurrents) -> None:
        bridge = self._bridge
        if bridge is None:
            return
        stamp_ns = to_ns(message.header.stamp)
        if bridge.lockstep is not None:
            now = bridge.simulated_time
            age = 0.0 if now is None else now - ns_to_seconds(stamp_ns)
        else:
            now_ns = self.get_clock().now().nanoseconds
            wrong = far(stamp_ns, now_ns) if stamp_ns else ""
            if wrong:
                self.guard.refuse("/boom/current_command", "stamp far from now", f"{wrong}: synchronise the clocks")
            age = ns_to_seconds(now_ns - stamp_ns) if stamp_ns else 0.0
        bridge.command(message.retract, message.extend, age)

    def _on_stop(self, wanted: bool) -> None:
        if self._bridge is not None:
            self._bridge.emergency_stop(wanted)

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._bridge is None:
            response.success, response.message = not request.data, "the bridge is not configured: zero current"
        else:
            self._look_around(self._bridge)
            response.success, response.message = self._bridge.enable(bool(request.data))
        if response.message != self._answered:  # who asks again and again is told, not the log
            self._answered = response.message
            self.get_logger().info(response.message)
        return response

    # ------------------------------------------------------------------------------------------------------------ health

    def _look(self) -> None:
        """Report at once when motion is disabled or enabled."""
        if self._bridge is None:
            return
        self._look_around(self._bridge)
        if self._bridge.gate.enabled != self._told_enabled:
            self._told_enabled = self._bridge.gate.enabled
            self._enabled.publish(Bool(data=self._told_enabled))
        output = self._bridge.output
        said = "motion enabled" if output.enable else f"zero current: {output.reason}"
        if said != self._said:
            self._said = said
            self.get_logger().info(said)
            self._diagnostics.update()

    def _look_around(self, bridge: Bridge) -> None:
        """Stop all motion if there are two commanders or two cranes."""
        conflict = self._sole.look()
        if conflict and conflict != bridge.conflict:
            bridge.stop(conflict)
        if bridge.conflict and not conflict and self._told:
            self._configuration.publish(self._told)  # everybody may have heard the other crane's last
        bridge.conflict = conflict

    def _health(self) -> Health:
        if self._bridge is None:
            level = Level.ERROR if self._failure else Level.OK
            return Health(level, self._failure or "not configured", {})
        report = self._bridge.report()
        return Health(Level(report.level), report.message, report.values)


def main() -> int:
    """Runs the node until SIGINT or SIGTERM; returns the exit status."""
    return shell.run(BridgeNode)


if __name__ == "__main__":
    raise SystemExit(main())
