"""The simulation node as a process, seen from a partner that knows topics and services only."""

from __future__ import annotations

import itertools
import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

from boom_interfaces.msg import GroundTruth, MachineConfiguration, SolenoidCurrents
from boom_interfaces.srv import SetPayload
from boom_node import qos
from boom_node.stamps import set_ns, to_ns

pytestmark = pytest.mark.process
PATIENCE = 30.0
RELIABLE = qos.EVENTS


class Partner:
    """Commands the crane and keeps what it says."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("partner", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {}
        self.ticks: list[int] = []
        self.commands = self.node.create_publisher(
            SolenoidCurrents, "/boom/current_command", qos.BY_TOPIC["/boom/current_command"]
        )
        for kind, topic in (
            (JointState, "/joint_states"), (FluidPressure, "/boom/hose_pressure"), (FluidPressure, "/boom/rod_pressure"),
            (SolenoidCurrents, "/boom/solenoid_currents"), (MachineConfiguration, "/boom/machine_configuration"),
            (String, "/robot_description"), (GroundTruth, "/boom/ground_truth"),
        ):  # fmt: skip
            self.heard[topic] = []
            profile = qos.BY_TOPIC.get(topic, qos.SENSOR_DATA)
            self.node.create_subscription(kind, topic, self.heard[topic].append, profile)
        self.node.create_subscription(Clock, "/clock", lambda m: self.ticks.append(to_ns(m.clock)), RELIABLE)

    def until(self, done: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, "what was waited for did not happen"
            self.executor.spin_once(timeout_sec=0.02)

    def command(self, retract: float, extend: float, stamp_ns: int = 0) -> None:
        message = SolenoidCurrents(retract=retract, extend=extend)
        set_ns(message.header.stamp, stamp_ns)
        self.commands.publish(message)

    def step(self, retract: float, extend: float) -> JointState:
        """Lockstep: one command, then the tick and the joint state that answer it."""
        ticks = len(self.ticks)
        self.command(retract, extend)
        self.until(lambda: len(self.ticks) > ticks)
        now = self.ticks[-1]
        self.until(lambda: self.heard["/joint_states"] and to_ns(self.heard["/joint_states"][-1].header.stamp) == now)
        return self.heard["/joint_states"][-1]

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

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

    def begin(*parameters: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "boom_sim.simulation_node", "--ros-args"]
        command += [word for parameter in parameters for word in ("-p", parameter)]
        running.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True))
        return running[-1]

    yield begin
    for process in running:
        process.kill()
        process.communicate(timeout=PATIENCE)


def test_a_crane_that_stood_still_stamps_no_sample_ahead_of_the_clock(partner: Partner, start: Any) -> None:
    """The periods that are made up for take their time: their samples had led by it for good, and a controller refused them."""
    process = start("sensors:=ideal")
    heard = partner.heard["/joint_states"]
    partner.until(lambda: len(heard) > 50)
    process.send_signal(signal.SIGSTOP)
    begin = time.monotonic()
    partner.until(lambda: time.monotonic() - begin > 1.2)
    process.send_signal(signal.SIGCONT)
    heard.clear()
    partner.until(lambda: len(heard) > 60)
    leads = []
    for _ in range(30):
        count = len(heard)
        partner.until(lambda count=count: len(heard) > count)
        leads.append(1e-6 * (to_ns(heard[-1].header.stamp) - partner.node.get_clock().now().nanoseconds))
    assert max(leads) < 5.0  # ms


def test_lockstep_advances_one_period_per_command(partner: Partner, start: Any) -> None:
    start("mode:=lockstep", "sensors:=ideal")
    partner.until(lambda: partner.commands.get_subscription_count() and partner.heard["/boom/machine_configuration"])
    for k in range(1, 21):
        partner.step(0.0, 0.5)
        assert partner.ticks[-1] == k * 10_000_000
    assert partner.heard["/joint_states"][-1].position[0] > 0.3


def test_lockstep_is_reproducible_bit_by_bit(partner: Partner, start: Any) -> None:
    def run(seed: int) -> list[tuple[float, ...]]:
        process = start("mode:=lockstep", f"seed:={seed}")
        partner.until(lambda: partner.commands.get_subscription_count())
        result = []
        for k in range(60):
            state = partner.step(0.0, 0.5 if k < 30 else 0.0)
            result.append((state.position[0], state.velocity[0]))
        process.terminate()
        process.wait(timeout=PATIENCE)
        partner.until(lambda: not partner.commands.get_subscription_count())
        partner.ticks.clear()
        return result

    first = run(5)
    assert run(5) == first
    assert run(6) != first


def test_a_late_joiner_learns_machine_and_robot_description(partner: Partner, start: Any) -> None:
    start("robot_description:='<robot name=\"x\"/>'", "load_mass:=300.0", "telescope_length:=2.8")
    partner.until(lambda: partner.heard["/joint_states"])
    partner.until(lambda: partner.heard["/boom/machine_configuration"] and partner.heard["/robot_description"])
    (configuration,) = partner.heard["/boom/machine_configuration"]
    assert (configuration.machine, configuration.telescope_length, configuration.load_mass) == ("tz17", 2.8, 300.0)
    assert partner.heard["/robot_description"][0].data == '<robot name="x"/>'
    assert list(partner.heard["/joint_states"][-1].name) == ["inner_boom_joint", "outer_boom_joint", "telescope_joint"]


def test_real_time_stamps_are_of_the_present_and_pressures_absolute(partner: Partner, start: Any) -> None:
    start("sensors:=ideal")
    partner.until(lambda: len(partner.heard["/boom/rod_pressure"]) > 20)
    age = partner.node.get_clock().now().nanoseconds - to_ns(partner.heard["/joint_states"][-1].header.stamp)
    assert abs(age) < 2e9
    assert partner.heard["/boom/rod_pressure"][-1].fluid_pressure == pytest.approx(1.0e6 + 101_325.0, rel=1e-3)
    stamps = [to_ns(m.header.stamp) for m in partner.heard["/boom/rod_pressure"]]
    # best effort: a sample may be lost on a busy computer, but each is stamped on the grid of the periods
    assert all((b - a) % 10_000_000 == 0 for a, b in itertools.pairwise(stamps[1:]))


def test_without_fresh_commands_the_valve_closes(partner: Partner, start: Any) -> None:
    start()
    partner.until(lambda: partner.commands.get_subscription_count())
    currents = partner.heard["/boom/solenoid_currents"]

    def lift() -> bool:
        partner.command(0.0, 0.5, partner.node.get_clock().now().nanoseconds)
        return bool(currents) and currents[-1].extend > 0.4

    partner.until(lift)
    partner.until(lambda: currents[-1].extend < 0.01)


def test_command_that_is_no_number_closes_the_valve(partner: Partner, start: Any) -> None:
    start("mode:=lockstep", "sensors:=ideal")
    partner.until(lambda: partner.commands.get_subscription_count())
    partner.step(0.0, 0.5)
    partner.step(0.0, math.nan)
    partner.step(0.0, math.nan)
    partner.until(lambda: partner.heard["/boom/solenoid_currents"][-1].extend == 0.0)


def test_a_second_publisher_closes_the_valve_and_the_terminal_says_so_once_and_when_it_has_gone(
    partner: Partner, start: Any
) -> None:
    crane = start()
    partner.until(lambda: partner.heard["/joint_states"])

    def closed() -> bool:
        partner.command(0.0, 0.5)
        heard = partner.heard["/boom/solenoid_currents"]
        return not heard or heard[-1].extend < 0.1

    partner.until(lambda: not closed())
    topic = "/boom/current_command"
    second = partner.node.create_publisher(SolenoidCurrents, topic, qos.BY_TOPIC[topic])
    partner.until(closed)
    diagnosed: list[str] = []
    partner.node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: diagnosed.extend(s.message for s in m.status), 10
    )
    partner.node.destroy_publisher(second)
    partner.until(lambda: closed() and "valve closed: commands act once they were zero" in diagnosed)
    assert closed(), "who is left is in the middle of a motion"
    partner.until(lambda: partner.command(0.0, 0.0) or not closed())
    crane.terminate()
    lines = crane.communicate(timeout=PATIENCE)[1].splitlines()
    told = [line for line in lines if "valve closed: 2 publish /boom/current_command (partner, partner)" in line]
    again = [line for line in lines if "one publisher each again" in line]
    assert (len(told), len(again)) == (1, 1), lines


def test_what_a_second_crane_said_of_itself_is_put_right_when_it_has_gone(partner: Partner, start: Any) -> None:
    crane = start()
    told = partner.heard["/boom/machine_configuration"]
    partner.until(lambda: told)
    other = start("load_mass:=3000.0")
    partner.until(lambda: told[-1].load_mass == 3000.0)
    assert any("2 publish /joint_states" in line for line in crane.stderr)
    other.terminate()
    partner.until(lambda: told[-1].load_mass == 0.0)


def test_log_is_grasped_and_dropped_while_running(partner: Partner, start: Any) -> None:
    start("mode:=lockstep", "sensors:=ideal", "ground_truth:=true")
    partner.until(lambda: partner.commands.get_subscription_count())
    partner.step(0.0, 0.0)
    refused = partner.call(SetPayload, "/boom_simulation/set_payload", SetPayload.Request(mass=math.nan))
    assert not refused.success
    assert "load" in refused.message
    grasped = partner.call(SetPayload, "/boom_simulation/set_payload", SetPayload.Request(mass=300.0))
    assert grasped.success
    assert "0 kg -> 300 kg" in grasped.message
    for _ in range(150):
        partner.step(0.0, 0.0)
    partner.until(lambda: to_ns(partner.heard["/boom/ground_truth"][-1].header.stamp) == partner.ticks[-1])
    truth = partner.heard["/boom/ground_truth"][-1]
    loaded = dict(zip(truth.names, truth.values, strict=True))
    assert loaded["head_pressure"] > 8.6e6
    assert dict(zip(truth.names, truth.units, strict=True))["head_pressure"] == "Pa"
    assert partner.call(SetPayload, "/boom_simulation/set_payload", SetPayload.Request(mass=0.0)).success


def test_pause_holds_the_crane_and_reset_begins_again(partner: Partner, start: Any) -> None:
    start("mode:=lockstep", "sensors:=ideal")
    partner.until(lambda: partner.commands.get_subscription_count())
    for _ in range(30):
        partner.step(0.0, 0.5)
    assert partner.call(SetBool, "/boom_simulation/pause", SetBool.Request(data=True)).message == "paused"
    before = len(partner.ticks)
    partner.command(0.0, 0.5)
    assert partner.call(SetBool, "/boom_simulation/pause", SetBool.Request(data=False)).success
    assert len(partner.ticks) == before
    assert partner.call(Trigger, "/boom_simulation/reset", Trigger.Request()).success
    assert partner.step(0.0, 0.0).position[0] == pytest.approx(0.3, abs=1e-5)
    assert partner.ticks[-1] == 10_000_000


def test_crane_that_left_its_range_stands_until_reset(partner: Partner, start: Any) -> None:
    start("mode:=lockstep", "sensors:=ideal", "initial_angle:=1.55")
    partner.until(lambda: partner.commands.get_subscription_count())
    for _ in range(200):
        ticks = len(partner.ticks)
        partner.command(0.0, 0.55)
        end = time.monotonic() + 1.0
        while len(partner.ticks) == ticks and time.monotonic() < end:
            partner.executor.spin_once(timeout_sec=0.02)
        if len(partner.ticks) == ticks:
            break
    assert 0 < len(partner.ticks) < 200
    assert partner.call(Trigger, "/boom_simulation/reset", Trigger.Request()).success
    assert partner.step(0.0, 0.0).position[0] == pytest.approx(1.55, abs=1e-4)


@pytest.mark.parametrize(
    ("pulses", "profile"), [(1, qos.LATCHED), (5, qos.LATCHED), (1, qos.EVENTS), (1, qos.SENSOR_DATA)]
)
def test_an_emergency_stop_closes_the_valve_however_short_and_commands_begin_again_from_zero(
    start: Callable[..., subprocess.Popen[str]], partner: Partner, pulses: int, profile: QoSProfile
) -> None:
    start("mode:=lockstep", "sensors:=ideal")
    stop = partner.node.create_publisher(Bool, "/boom/emergency_stop", profile)
    partner.until(lambda: partner.commands.get_subscription_count() and stop.get_subscription_count())
    for _ in range(40):
        lifted = partner.step(0.0, 0.6)
    assert lifted.velocity[0] > 0.05
    for _ in range(pulses):
        stop.publish(Bool(data=True))
        stop.publish(Bool(data=False))

    def speed(*currents: float) -> float:
        return float([partner.step(*currents) for _ in range(100)][-1].velocity[0])

    assert abs(speed(0.0, 0.6)) < 0.02  # what went on commanding does not start it
    partner.step(0.0, math.nan)
    assert abs(speed(0.0, 0.6)) < 0.02  # nor does what is refused
    partner.step(0.0, 0.0)
    assert speed(0.0, 0.6) > 0.05
