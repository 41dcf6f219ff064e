"""Watches live topics: ``/diagnostics`` shows when the machine leaves the tolerance of its model, and in which subsystem.

Topics, parameters and conditions: README.md of the package. The core is :mod:`boom_monitor.watch`.
"""

# ruff: noqa: I001
from boom_node import early  # noqa: F401  (first: signals and environment)

import time
from functools import partial

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from sensor_msgs.msg import FluidPressure, JointState

from boom_monitor import watch, words
from boom_monitor.status import Alarm, WatchSettings
from boom_monitor.configuration import Configuration, ToldConfiguration, in_words
from boom_input.channels import BY_NAME, MEASURED_TOPICS, PREDICTED
from boom_interfaces.msg import MachineConfiguration, SolenoidCurrents
from boom_model.errors import ModelError
from boom_model.machine_file import load_machine, shipped_machine
from boom_node import qos, shell
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.errors import StartError
from boom_node.foreign import foreign
from boom_node.node import Node
from boom_node.input_watch import InputWatch
from boom_node.parameters import ParameterSpec, declare
from boom_node.publishers import PARAMETER as SHARED_TOPICS
from boom_node.publishers import SolePublishers
from boom_node.stamps import far, ns_to_seconds, to_ns
from boom_recording import channels

_DEFAULT = WatchSettings()
PARAMETERS = (
    ParameterSpec(
        "machine", "", "machine file, shipped name or path; empty: the machine that the configuration names", read_only=True
    ),
    ParameterSpec("joint_name", channels.DEFAULT_JOINT, "name of the boom's joint in /joint_states", read_only=True),
    ParameterSpec(
        "threshold", _DEFAULT.threshold, "score (1 = noise) above which an alarm is raised", "", 1.0, 1000.0, read_only=True
    ),
    ParameterSpec(
        "own_configuration", False, "take pose and load from these parameters, not from /boom/machine_configuration", read_only=True
    ),
    ParameterSpec("outer_boom_angle", 0.28, "own configuration: angle of the outer boom", "rad", -6.3, 6.3, read_only=True),
    ParameterSpec("telescope_length", 2.2, "own configuration: length of the telescope", "m", 0.0, 20.0, read_only=True),
    ParameterSpec("load_mass", 0.0, "own configuration: load at the tip", "kg", 0.0, 50_000.0, read_only=True),
    ParameterSpec("memory", _DEFAULT.memory, "time constant of the score", "s", 0.2, 60.0, read_only=True),
    ParameterSpec("hold", _DEFAULT.hold, "time below the threshold after which an alarm ends", "s", 0.0, 3600.0, read_only=True),
    ParameterSpec("delay", _DEFAULT.delay, "how long the watch waits for late samples", "s", 0.0, 2.0, read_only=True),
    SHARED_TOPICS,
)  # fmt: skip
_ADVANCE_PERIOD_S = 0.05
_CLOCK_SET = 100
"""Samples in a row, a quarter of a second of all topics, that are far from the previous ones, or all before them."""


class WatchNode(Node):
    """Thin layer around :class:`boom_monitor.watch.Watch`."""

    def __init__(self) -> None:
        super().__init__("boom_diagnosis_watch")
        self._values = values = declare(self, PARAMETERS)
        self._settings = WatchSettings(values.threshold, values.memory, values.hold, values.delay)
        self._machine = None
        if values.machine:
            try:
                self._machine = load_machine(values.machine)
            except ModelError as error:
                raise StartError(str(error)) from error
        self._watch: watch.Watch | None = None
        self._configuration: Configuration | None = None
        self._told_configuration = ToldConfiguration()
        self._sole = SolePublishers(self, MEASURED_TOPICS, values.shared_topics)
        self._failure = self._conflict = self._foreign = ""
        self._stamps: dict[str, int] = {}
        self._origin_ns: int | None = None
        self._newest_ns = 0
        self._strange = self._overtaken = 0
        self._refused = 0
        self._told: Alarm | None = None
        self._heard: dict[str, InputWatch] = {}
        self._silent = ""
        self._input = InputWatch(
            "no /boom/machine_configuration for {age} s: start the crane, or give --machine --q3 --q4 --load",
            time.monotonic(),
            once=True,
        )
        sensor = qos.EVERY_SENSOR_SAMPLE
        self.create_subscription(JointState, channels.JOINT_STATES, self._on_joints, sensor)
        for channel in PREDICTED:
            if channel.is_pressure:
                on_pressure = partial(self._on_pressure, channel.name)
                self.create_subscription(FluidPressure, channel.topic, on_pressure, sensor)
        self.create_subscription(SolenoidCurrents, channels.SOLENOID_CURRENTS, self._on_currents, sensor)
        self._diagnostics = DiagnosticsPublisher(self, self._health, values.machine)
        if values.own_configuration:
            if self._machine is None:
                raise StartError("own_configuration needs the parameter 'machine'")
            self._configuration = (values.machine, values.outer_boom_angle, values.telescope_length, values.load_mass)
            self._begin()
        else:
            self.create_subscription(
                MachineConfiguration, channels.MACHINE_CONFIGURATION, self._on_configuration,
                qos.BY_TOPIC[channels.MACHINE_CONFIGURATION],
            )  # fmt: skip
        self.create_timer(_ADVANCE_PERIOD_S, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # ----------------------------------------------------------------------------------------------------------- inputs

    def _on_configuration(self, message: MachineConfiguration) -> None:
        self._input.seen(time.monotonic())
        load = message.load_mass if message.load_mass == message.load_mass else 0.0
        asked = (message.machine, message.outer_boom_angle, message.telescope_length, load)
        if self._told_configuration.hear(asked, time.monotonic()):
            self._begin()
        self._look_for_conflict()

    def _begin(self) -> None:
        """Start a new watch of the last configuration."""
        self._watch, self._failure = None, ""
        self._origin_ns = self._told = None
        self._stamps.clear()
        self._strange = self._overtaken = 0
        asked = self._configuration or self._told_configuration.told
        if asked is None or self._conflict:
            return
        advice = ""  # a machine that is not shipped says what to give
        try:
            machine = self._machine or shipped_machine(asked[0])
            advice = "; correct its publisher, or give pose and load: --q3 --q4 --load"
            self._watch = watch.Watch(machine, machine.pose(*asked[1:]), self._settings)
            self._heard = {name: InputWatch("", time.monotonic()) for name in watch.CHANNELS}
            self.get_logger().info(f"watching {in_words((machine.name, *asked[1:]))}")
            self._foreign = foreign(asked[0], machine.name, "the model is")
            if self._foreign:
                self.get_logger().warning(f"{self._foreign}: is it the right file?")
        except ModelError as error:
            self._failure = f"the machine cannot be watched: {error}{advice}"
            self.get_logger().error(self._failure)
        self._diagnostics.update()

    def _on_joints(self, message: JointState) -> None:
        if self._values.joint_name not in message.name:
            return
        k = list(message.name).index(self._values.joint_name)
        if k < len(message.position):
            rate = {"rate": message.velocity[k]} if k < len(message.velocity) else {}  # none: no gyro
            self._add(message.header.stamp, angle=message.position[k], **rate)

    def _on_pressure(self, name: str, message: FluidPressure) -> None:
        self._add(message.header.stamp, **{name: message.fluid_pressure})

    def _on_currents(self, message: SolenoidCurrents) -> None:
        self._add(message.header.stamp, retract_current=message.retract, extend_current=message.extend)

    def _add(self, stamp, **values: float) -> None:
        if self._watch is None:
            return
        nanoseconds = to_ns(stamp)
        topic = BY_NAME[next(iter(values))].topic
        behind = ns_to_seconds(self._stamps.get(topic, nanoseconds) - nanoseconds)
        self._stamps[topic] = nanoseconds
        if behind > 0:
            self.guard.refuse(topic, "stamps jump back", f"{1e3 * behind:.0f} ms behind the one before")
        if self._origin_ns is None:
            self._origin_ns = self._newest_ns = nanoseconds
        if not self._believed(nanoseconds):
            return
        at = ns_to_seconds(nanoseconds - self._origin_ns)
        for name, wire in values.items():
            channel = BY_NAME[name]
            value = wire - channel.wire_offset
            if not channel.low <= value <= channel.high:
                self._refused += 1
            elif self._watch.add(name, at, value):
                self._heard[name].seen(time.monotonic())
                self._overtaken = 0
            else:
                self._overtaken += 1
        if self._overtaken >= _CLOCK_SET:
            self._begin()

    def _believed(self, nanoseconds: int) -> bool:
        """Whether a stamp fits the others, whatever their clock; if none fits any more, the clock was set."""
        wrong = far(nanoseconds, self._newest_ns)
        if not wrong:
            self._newest_ns, self._strange = nanoseconds, 0
            return True
        self.guard.refuse("samples", "stamp far from the one before", wrong)
        self._strange += 1
        if self._strange >= _CLOCK_SET:
            self._begin()
        return False

    # ---------------------------------------------------------------------------------------------------------- outputs

    def _look_for_conflict(self) -> None:
        """Say that nobody knows which samples or configuration to believe; until that has ended, nothing is judged."""
        conflict = self._told_configuration.look(time.monotonic()) or self._sole.look()
        if conflict == self._conflict:
            return
        self._conflict = conflict
        if conflict:
            self._watch = None
            self.get_logger().warning(f"nothing is judged: {conflict}")
            self._diagnostics.update()
        else:
            self._begin()

    def _on_timer(self) -> None:
        self._look_for_conflict()
        if self._watch is None:
            warning = self._input.warning(time.monotonic())
            if warning and not self._conflict:
                self.get_logger().warning(warning)
            return
        alarm = self._watch.advance().alarm
        self._look_for_silence()
        if (alarm is None) != (self._told is None):
            if alarm is not None:
                self.get_logger().warning(words.alarm(alarm))
            else:
                self.get_logger().info("the machine is within the tolerance of its model again")
        self._told = alarm
        self._diagnostics.update()

    def _look_for_silence(self) -> None:
        """Say once that samples stay away or repeat themselves, and that they are back: without them nothing is watched."""
        if self._watch is None:
            return
        now, status = time.monotonic(), self._watch.status
        missing = [name for name, heard in self._heard.items() if name not in status.absent and heard.missing(now)]
        silent = words.silence(missing) or words.stuck(status.stuck)
        if silent != self._silent:
            if silent:
                self.get_logger().warning(silent)
            else:
                self.get_logger().info("samples of all channels arrive again, and change")
        self._silent = silent

    def _health(self) -> Health:
        if self._conflict or self._failure:
            return Health(Level.ERROR, f"nothing is judged: {self._conflict}" if self._conflict else self._failure)
        if self._watch is None:
            return Health(Level.WARN, "waits for /boom/machine_configuration")
        status = self._watch.status
        values = {**words.values(status), "samples out of range": self._refused}
        fine = status.alarm is None and status.watching and not (self._silent or self._foreign)
        level = Level.OK if fine and status.blind <= words.OFTEN else Level.WARN
        said = words.message(status, self._silent)
        return Health(level, f"{said}; {self._foreign}" if self._foreign else said, values)


def main() -> int:
    """Runs the node until SIGINT or SIGTERM; returns the exit status."""
    return shell.run(WatchNode)


if __name__ == "__main__":
    raise SystemExit(main())
