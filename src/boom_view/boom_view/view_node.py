"""Shows the running machine in a browser: subscribes to its topics and serves the page. It commands nothing.

Topics and parameters: README.md of the package. The cores are :mod:`boom_view.feed` and :mod:`boom_view.server`.
"""

# ruff: noqa: I001
from boom_node import early  # noqa: F401  (first: signals and environment)

import os
import time
import webbrowser
from functools import partial

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from sensor_msgs.msg import FluidPressure, JointState

from boom_input.channels import BY_NAME, SENSORS
from boom_input.shown import quoted
from boom_interfaces.msg import MachineConfiguration, SolenoidCurrents
from boom_model.errors import ModelError
from boom_model.machine_file import load_machine, shipped_machine
from boom_node import qos, shell
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.errors import StartError
from boom_node.node import Node
from boom_node.parameters import ParameterSpec, declare
from boom_node.stamps import ns_to_seconds, to_ns
from boom_recording import channels
from boom_report.view.page import live_page
from boom_view.feed import Feed
from boom_view.server import PortError, ViewServer

NICE = 10
"""The controller's process comes first."""
_FLUSH_PERIOD_S = 1 / 30
PARAMETERS = (
    ParameterSpec(
        "machine", "", "machine file, shipped name or path; empty: the machine that the configuration names", read_only=True
    ),
    ParameterSpec("joint_name", channels.DEFAULT_JOINT, "name of the boom's joint in /joint_states", read_only=True),
    ParameterSpec("port", -1, "port of the page on 127.0.0.1; -1: the usual one, or a free one", "", -1, 65535, read_only=True),
    ParameterSpec("open_browser", False, "open the page in the default browser", read_only=True),
    ParameterSpec(
        "own_configuration", False, "take pose and load from these parameters, not from /boom/machine_configuration", read_only=True
    ),
    ParameterSpec("outer_boom_angle", 0.28, "own configuration: angle of the outer boom", "rad", -6.3, 6.3, read_only=True),
    ParameterSpec("telescope_length", 2.2, "own configuration: length of the telescope", "m", 0.0, 20.0, read_only=True),
    ParameterSpec("load_mass", 0.0, "own configuration: load at the tip", "kg", 0.0, 50_000.0, read_only=True),
)  # fmt: skip


class ViewNode(Node):
    """Thin layer around :class:`boom_view.feed.Feed`."""

    def __init__(self) -> None:
        super().__init__("boom_view")
        os.nice(NICE)
        self._values = values = declare(self, PARAMETERS)
        self._machine = None
        if values.machine:
            try:
                self._machine = load_machine(values.machine)
            except ModelError as error:
                raise StartError(str(error)) from error
        self._feed = Feed()
        self._configuration: tuple[str, float, float, float] | None = None
        self._origin_ns: int | None = None
        sensor = qos.EVERY_SENSOR_SAMPLE
        self.create_subscription(JointState, channels.JOINT_STATES, self._on_joints, sensor)
        for channel in SENSORS:
            if channel.is_pressure:
                self.create_subscription(FluidPressure, channel.topic, partial(self._on_pressure, channel.name), sensor)
        self.create_subscription(SolenoidCurrents, channels.SOLENOID_CURRENTS, self._on_currents, sensor)
        if values.own_configuration:
            self._configure((values.machine, values.outer_boom_angle, values.telescope_length, values.load_mass))
        else:
            self.create_subscription(
                MachineConfiguration, channels.MACHINE_CONFIGURATION, self._on_configuration,
                qos.BY_TOPIC[channels.MACHINE_CONFIGURATION],
            )  # fmt: skip
        try:
            server = ViewServer(live_page(), self._feed, values.port if values.port >= 0 else None)
        except PortError as error:
            raise StartError(str(error)) from error
        server.start()
        self._diagnostics = DiagnosticsPublisher(self, self._health, values.machine)
        self.create_timer(_FLUSH_PERIOD_S, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))
        print(f"page: {server.url}  (Ctrl-C ends it)", flush=True)
        if values.open_browser:
            webbrowser.open(server.url)

    def _on_configuration(self, message: MachineConfiguration) -> None:
        load = message.load_mass if message.load_mass == message.load_mass else 0.0
        self._configure((message.machine, message.outer_boom_angle, message.telescope_length, load))

    def _configure(self, asked: tuple[str, float, float, float]) -> None:
        if asked == self._configuration:
            return
        self._configuration = asked
        try:
            machine = self._machine or shipped_machine(asked[0])
            self._feed.configure(machine, machine.pose(*asked[1:]))
        except ModelError as error:
            said = f"The machine of /boom/machine_configuration cannot be shown: {error}."
            self._feed.unknown(said)
            self.get_logger().error(said)

    def _on_joints(self, message: JointState) -> None:
        joint, names = self._values.joint_name, list(message.name)
        k = names.index(joint) if joint in names else len(names)
        if k == len(names):
            there = quoted(", ".join(names), 200) or "none"
            self._feed.refused(
                f"/joint_states has no joint {quoted(joint)} (there are: {there}): give its name with --joint"
            )
        elif k < len(message.position):
            rate = message.velocity[k] if k < len(message.velocity) else float("nan")
            self._add(message.header.stamp, angle=message.position[k], rate=rate)
        else:
            self._feed.refused(f"/joint_states has no position of {quoted(joint)}")

    def _on_pressure(self, name: str, message: FluidPressure) -> None:
        self._add(message.header.stamp, **{name: message.fluid_pressure})

    def _on_currents(self, message: SolenoidCurrents) -> None:
        self._add(message.header.stamp, retract_current=message.retract, extend_current=message.extend)

    def _add(self, stamp, **wire: float) -> None:
        nanoseconds = to_ns(stamp)
        if self._origin_ns is None:
            self._origin_ns = nanoseconds
        values = {name: value - BY_NAME[name].wire_offset for name, value in wire.items()}
        plausible = {name: v for name, v in values.items() if BY_NAME[name].low <= v <= BY_NAME[name].high}
        if "angle" in values and "angle" not in plausible:
            self._feed.refused(f"the angle in /joint_states is {values['angle']:.4g} rad, which no boom has")
        if plausible:
            self._feed.add(ns_to_seconds(nanoseconds - self._origin_ns), **plausible)

    def _on_timer(self) -> None:
        self._feed.flush(time.monotonic())

    def _health(self) -> Health:
        return Health(Level.OK if self._feed.scene else Level.WARN, self._feed.state)


def main() -> int:
    """Runs the node until SIGINT or SIGTERM; returns the exit status."""
    return shell.run(ViewNode)


if __name__ == "__main__":
    raise SystemExit(main())
