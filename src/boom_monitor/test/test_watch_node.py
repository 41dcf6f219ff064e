"""The watch as a process beside a simulated crane that has an effect switched on, seen on /diagnostics."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState

from boom_input.channels import BY_NAME
from boom_interfaces.msg import MachineConfiguration, SolenoidCurrents
from boom_node import qos
from boom_node.stamps import to_ns

pytestmark = pytest.mark.process
PATIENCE = 60.0
WARN, ERROR = b"\x01", b"\x02"


class Partner:
    """Drives the crane in lockstep and listens to what the watch says."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)  # in the domain of this worker alone, see conftest.py
        self.node = rclpy.create_node("partner", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.said: list[Any] = []
        self.sent = 0
        self.ticks: list[int] = []
        topic = "/boom/current_command"
        self.commands = self.node.create_publisher(SolenoidCurrents, topic, qos.BY_TOPIC[topic])
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._hear, qos.BY_TOPIC["/diagnostics"])
        self.node.create_subscription(Clock, "/clock", lambda m: self.ticks.append(to_ns(m.clock)), qos.EVENTS)

    def _hear(self, message: Any) -> None:
        self.said += [status for status in message.status if status.name == "boom_diagnosis_watch"]

    def until(self, done: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, "what was waited for did not happen"
            self.executor.spin_once(timeout_sec=0.02)

    def step(self, retract: float, extend: float) -> float:
        """One period of the crane; gives its time [s]."""
        ticks = len(self.ticks)
        self.commands.publish(SolenoidCurrents(retract=retract, extend=extend))
        self.until(lambda: len(self.ticks) > ticks)
        return self.ticks[-1] * 1e-9

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def partner() -> Iterator[Partner]:
    made = Partner()
    yield made
    made.close()


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    running: list[subprocess.Popen[str]] = []

    def begin(module: str, *parameters: str) -> subprocess.Popen[str]:
        words = [word for parameter in parameters for word in ("-p", parameter)]
        command = [sys.executable, "-m", module, "--ros-args", *words]
        # what this process imports, and not another tree that may be installed
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path))
        pipe = subprocess.PIPE
        running.append(subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=pipe, text=True))
        return running[-1]

    yield begin
    for process in running:
        process.kill()
        process.communicate(timeout=PATIENCE)


def drive(partner: Partner, until: float, done: Callable[[], Any]) -> float:
    """Lifts and lowers in turn, until ``done`` or simulated time ``until`` [s]; gives the simulated time."""
    at = 0.0
    while at < until and not done():
        lifting = at % 4.0 < 1.5
        at = partner.step(0.0 if lifting else 0.35 * (2.0 < at % 4.0 < 3.5), 0.35 * lifting)
    return at


def test_a_leaking_piston_is_told_with_its_subsystem_within_ten_seconds_of_data(partner: Partner, start: Any) -> None:
    watch = start("boom_monitor.watch_node", "delay:=0.05")
    start(
        "boom_sim.simulation_node", "mode:=lockstep", "effects:='{piston_leakage: {c: 4.0e-12}}'", "initial_angle:=0.4"
    )
    partner.until(lambda: partner.commands.get_subscription_count())
    partner.until(lambda: any("waits for samples" in s.message for s in partner.said))

    # one sample of 2038 among the others: the watch is not led astray
    joints = partner.node.create_publisher(JointState, "/joint_states", qos.EVENTS)
    hostile = JointState(name=["inner_boom_joint"], position=[0.4], velocity=[0.0])
    hostile.header.stamp.sec = 2**31 - 1
    partner.until(joints.get_subscription_count)
    drive(partner, 0.5, lambda: False)
    joints.publish(hostile)
    partner.node.destroy_publisher(joints)

    def alarms() -> list[Any]:
        return [s for s in partner.said if s.message.startswith("the machine has left the tolerance")]

    drive(partner, 10.0, alarms)
    partner.until(alarms)  # without any more data: in lockstep the crane is ahead of who watches it
    first = alarms()[0]
    assert first.level == WARN
    values = {v.key: v.value for v in first.values}
    assert values["subsystem"] == "cylinder" and float(values["score [1 = noise]"]) > 1.35
    watch.terminate()
    assert watch.wait(timeout=PATIENCE) == 0


def test_a_machine_that_falls_silent_is_told_and_not_called_within_its_tolerance(partner: Partner, start: Any) -> None:
    start("boom_monitor.watch_node", "delay:=0.05")
    crane = start("boom_sim.simulation_node", "mode:=lockstep", "initial_angle:=0.4")
    partner.until(lambda: partner.commands.get_subscription_count())
    partner.until(lambda: any("waits for samples" in s.message for s in partner.said))
    watched = "within the tolerance of the model"
    drive(partner, 20.0, lambda: partner.said and partner.said[-1].message == watched)
    assert partner.said[-1].message == watched, sorted({s.message for s in partner.said})
    crane.kill()
    partner.until(lambda: partner.said[-1].message.startswith("no samples of angle, rate, hose_pressure"))
    assert partner.said[-1].level == WARN


def test_a_boom_without_gyro_is_watched_by_its_angle_and_pressures(partner: Partner, start: Any) -> None:
    start("boom_monitor.watch_node", "machine:=tz17", "own_configuration:=true", "outer_boom_angle:=0.19")
    topics = {"/joint_states": JointState, "/boom/hose_pressure": FluidPressure, "/boom/rod_pressure": FluidPressure,
              "/boom/solenoid_currents": SolenoidCurrents}  # fmt: skip
    publishers = {topic: partner.node.create_publisher(kind, topic, 10) for topic, kind in topics.items()}
    partner.until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    hose, rod = (c.wire_offset for c in (BY_NAME["hose_pressure"], BY_NAME["rod_pressure"]))

    def watched() -> bool:
        """A boom at rest whose velocity nobody measures, 50 samples at a time."""
        for _ in range(50):
            stamp = Time(nanoseconds=partner.sent * 10_000_000).to_msg()
            partner.sent += 1
            messages = (
                JointState(name=["inner_boom_joint"], position=[0.3]), FluidPressure(fluid_pressure=hose + 9.0e6),
                FluidPressure(fluid_pressure=rod + 1.0e6), SolenoidCurrents(),
            )  # fmt: skip
            for publisher, message in zip(publishers.values(), messages, strict=True):
                message.header.stamp = stamp
                publisher.publish(message)
        return any(s.message == "within the tolerance of the model (without rate)" for s in partner.said)

    partner.until(watched)


def test_while_two_publish_a_sensor_the_watch_says_so_and_judges_nothing(partner: Partner, start: Any) -> None:
    start("boom_monitor.watch_node", "delay:=0.05")
    start("boom_sim.simulation_node", "mode:=lockstep", "initial_angle:=0.4", "shared_topics:=/boom/rod_pressure")
    partner.until(lambda: partner.commands.get_subscription_count())
    partner.until(lambda: any("waits for samples" in s.message for s in partner.said))
    second = partner.node.create_publisher(FluidPressure, "/boom/rod_pressure", qos.SENSOR_DATA)
    conflict = "nothing is judged: 2 publish /boom/rod_pressure (boom_simulation, partner): end all but one"
    partner.until(lambda: partner.said[-1].message.startswith(conflict))
    assert partner.said[-1].level == ERROR
    told = len(partner.said)
    drive(partner, 5.0, lambda: False)
    assert all(s.message.startswith(conflict) for s in partner.said[told:])
    partner.node.destroy_publisher(second)
    partner.until(lambda: "waits for samples" in partner.said[-1].message)
    watched = "within the tolerance of the model"
    drive(partner, 20.0, lambda: partner.said[-1].message == watched)
    assert partner.said[-1].message == watched, sorted({s.message for s in partner.said})


def test_configurations_that_alternate_contradict_each_other_in_one_line_and_the_last_one_that_stays_counts(
    partner: Partner, start: Any
) -> None:
    watch = start("boom_monitor.watch_node")
    topic = "/boom/machine_configuration"
    configurations = partner.node.create_publisher(MachineConfiguration, topic, qos.BY_TOPIC[topic])
    partner.until(configurations.get_subscription_count)

    def tell(load: float) -> None:
        configurations.publish(
            MachineConfiguration(machine="tz17", outer_boom_angle=0.28, telescope_length=2.2, load_mass=load)
        )

    tell(0.0)
    partner.until(lambda: partner.said and "waits for samples" in partner.said[-1].message)
    for _ in range(50):
        tell(100.0)
        tell(0.0)
        partner.executor.spin_once(timeout_sec=0.02)
    tell(50.0)
    partner.until(lambda: "contradict each other" in partner.said[-1].message)
    partner.until(lambda: "waits for samples" in partner.said[-1].message)
    watch.terminate()
    lines = watch.communicate(timeout=PATIENCE)[1].splitlines()
    assert len([line for line in lines if "contradict each other" in line]) == 1
    watching = [line for line in lines if "watching tz17" in line]
    assert len(watching) <= 3 and watching[-1].endswith("load 50 kg"), lines


def test_a_stamp_that_jumps_back_is_told(partner: Partner, start: Any) -> None:
    watch = start(
        "boom_monitor.watch_node", "machine:=tz17", "own_configuration:=true", "shared_topics:=/boom/rod_pressure"
    )
    pressures = partner.node.create_publisher(FluidPressure, "/boom/rod_pressure", qos.SENSOR_DATA)
    partner.until(lambda: pressures.get_subscription_count() and partner.said)  # each has found the other
    for seconds in (101, 100):
        pressure = FluidPressure(fluid_pressure=1.0e6)
        pressure.header.stamp.sec = seconds
        pressures.publish(pressure)

    def counted() -> bool:
        return any(v.key == "messages refused, /boom/rod_pressure, stamps jump back" for v in partner.said[-1].values)

    partner.until(lambda: partner.said and counted())
    watch.terminate()
    error = watch.communicate(timeout=PATIENCE)[1]
    assert "/boom/rod_pressure refused: stamps jump back: 1000 ms behind the one before" in error


def test_a_machine_without_a_file_is_an_error_that_says_what_to_do(start: Any) -> None:
    watch = start("boom_monitor.watch_node", "machine:=nosuch")
    _, error = watch.communicate(timeout=PATIENCE)
    assert (watch.returncode, error.count("\n")) == (2, 1), error
    assert "nosuch" in error
