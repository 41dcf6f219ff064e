"""Recorder and replay as processes: kill -9 costs under a second, a replay ends with zero currents."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_samples import recording

pytest.importorskip("rclpy")

from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_processes import Partner, environment, start
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from boom_interfaces.msg import SolenoidCurrents
from boom_node import qos, stamps
from boom_recording.loading import load
from boom_recording.writing import write

pytestmark = pytest.mark.process


@pytest.fixture
def partner() -> Iterator[Partner]:
    made = Partner("partner")
    yield made
    made.close()


@pytest.fixture
def started() -> Iterator[list["subprocess.Popen[str]"]]:
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "bag"
    write(path, recording(1.0))
    return path


def ready_of(partner: Partner) -> list[bool]:
    seen: list[bool] = []
    partner.node.create_subscription(
        Bool, "/boom_recorder/ready", lambda message: seen.append(message.data), qos.LATCHED
    )
    return seen


def test_what_is_published_is_recorded_and_sigint_completes_the_bag(
    partner: Partner, started: list[Any], tmp_path: Path
) -> None:
    publisher = partner.node.create_publisher(FluidPressure, "/boom/hose_pressure", qos.SENSOR_DATA)
    recorder = start(
        "boom_recording.recorder_node", tmp_path, output="bag", topics=["/boom/hose_pressure", "/late"],
        required_topics=["/boom/hose_pressure"],
    )  # fmt: skip
    started.append(recorder)
    ready = ready_of(partner)
    partner.until(lambda: ready[-1:] == [True])
    message = FluidPressure()
    for k in range(50):
        stamps.set_ns(message.header.stamp, 10**18 + k * 10_000_000)
        message.fluid_pressure = 101_325.0 + k
        publisher.publish(message)
        partner.executor.spin_once(timeout_sec=0.005)
    late = partner.node.create_publisher(Bool, "/late", qos.LATCHED)
    late.publish(Bool(data=True))
    partner.until(lambda: late.get_subscription_count() > 0)
    late.wait_for_all_acked()
    recorder.send_signal(signal.SIGINT)
    out, err = recorder.communicate(timeout=20)
    assert recorder.returncode == 0 and "Traceback" not in err
    assert "/boom/hose_pressure: 50 messages" in out and "/late: 1 messages" in out
    found = load(tmp_path / "bag", require=("/boom/hose_pressure",))
    assert found.signals["hose_pressure"].values.tolist() == list(range(50))
    assert found.warnings == [] and found.notes == []


OTHERS = """
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("stranger")
publisher = node.create_publisher(String, "/boom/hose_pressure", 10)
print("offered", flush=True)
rclpy.spin(node)
"""


def test_a_topic_of_another_type_is_told_at_once_and_the_right_one_is_recorded_beside_it(
    partner: Partner, started: list[Any], tmp_path: Path
) -> None:
    stranger = subprocess.Popen([sys.executable, "-c", OTHERS], env=environment(), stdout=subprocess.PIPE, text=True)
    started.append(stranger)
    assert stranger.stdout is not None and stranger.stdout.readline() == "offered\n"
    topic = "/boom/hose_pressure"
    recorder = start("boom_recording.recorder_node", tmp_path, output="bag", topics=[topic], required_topics=[topic])
    started.append(recorder)
    assert recorder.stderr is not None
    told = next(line for line in recorder.stderr if "not recorded" in line)
    assert f"{topic} is offered as std_msgs/msg/String" in told and "has to be sensor_msgs/msg/FluidPressure" in told
    publisher = partner.node.create_publisher(FluidPressure, topic, 10)  # reliable: what is acknowledged has arrived
    ready = ready_of(partner)
    partner.until(lambda: ready[-1:] == [True])
    message = FluidPressure(fluid_pressure=2e5)
    stamps.set_ns(message.header.stamp, 10**18)
    publisher.publish(message)
    assert publisher.wait_for_all_acked()
    recorder.send_signal(signal.SIGINT)
    out, err = recorder.communicate(timeout=20)
    assert recorder.returncode == 0 and "Traceback" not in err
    assert f"{topic}: 1 messages" in out


def recording_joints(partner: Partner, started: list[Any], folder: Path) -> tuple[Any, "subprocess.Popen[str]"]:
    """A publisher of /joint_states, and a recorder of them to ``bag`` that is ready."""
    publisher = partner.node.create_publisher(JointState, "/joint_states", qos.SENSOR_DATA)
    topics = ["/joint_states"]
    recorder = start("boom_recording.recorder_node", folder, output="bag", topics=topics, required_topics=topics)
    started.append(recorder)
    ready = ready_of(partner)
    partner.until(lambda: ready[-1:] == [True])
    return publisher, recorder


@pytest.mark.parametrize("period", [0.005, 0.1])
def test_a_killed_recorder_loses_less_than_a_second(
    partner: Partner, started: list[Any], tmp_path: Path, period: float
) -> None:
    publisher, recorder = recording_joints(partner, started, tmp_path)
    sent = []
    message = JointState(name=["inner_boom_joint"], position=[0.0], velocity=[0.0])

    def send() -> None:
        sent.append(partner.node.get_clock().now().nanoseconds)
        stamps.set_ns(message.header.stamp, sent[-1])
        publisher.publish(message)

    partner.node.create_timer(period, send)
    partner.until(lambda: sent and sent[-1] - sent[0] > 1.6e9)
    recorder.kill()
    recorder.wait()
    found = load(tmp_path / "bag", require=["/joint_states"])
    kept = found.signals["angle"].stamps_ns
    assert sent[-1] - int(kept[-1]) < 1e9
    assert np.array_equal(kept, sent[: len(kept)])
    assert any(warning.startswith("cut at") for warning in found.warnings)


@pytest.mark.parametrize("moved", [False, True], ids=["deleted", "moved"])
def test_a_bag_that_is_taken_away_while_it_is_recorded_ends_the_recorder_and_is_told(
    partner: Partner, started: list[Any], tmp_path: Path, moved: bool
) -> None:
    publisher, recorder = recording_joints(partner, started, tmp_path)
    message = JointState(name=["inner_boom_joint"], position=[0.0], velocity=[0.0])
    stamps.set_ns(message.header.stamp, partner.node.get_clock().now().nanoseconds)
    partner.node.create_timer(0.01, lambda: publisher.publish(message))
    if moved:
        (tmp_path / "bag").rename(tmp_path / "other")
    else:
        shutil.rmtree(tmp_path / "bag")
    partner.until(lambda: recorder.poll() is not None)
    out, err = recorder.communicate(timeout=20)
    assert recorder.returncode == 2
    assert "messages" not in out
    assert err.strip().splitlines()[-1].startswith("boom: bag: it was deleted or moved while it was recorded")


def test_a_recorder_that_is_stopped_while_it_starts_leaves_no_bag_behind(tmp_path: Path) -> None:
    program = (
        "import os, signal\n"
        "from boom_node import shell\n"
        "from boom_recording import recorder_node\n"
        "begin = recorder_node.RecorderNode._begin\n"
        "def stopped(self, *given):\n"
        "    assert list(self._bag.path.iterdir())\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    begin(self, *given)\n"
        "recorder_node.RecorderNode._begin = stopped\n"
        "raise SystemExit(recorder_node.main())\n"
    )
    command = [sys.executable, "-c", program, "--ros-args", "-p", "output:=bag"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "boom: stopped before anything was recorded\n")
    assert not (tmp_path / "bag").exists()


@pytest.mark.parametrize(
    ("module", "parameters", "told"),
    [
        ("boom_recording.recorder_node", {}, "needs the parameter 'output'"),
        ("boom_recording.recorder_node", {"output": "."}, "exists already"),
        ("boom_recording.recorder_node", {"outputs": "x"}, "did you mean 'output'"),
        ("boom_recording.replay_node", {}, "needs the parameter 'bag'"),
        ("boom_recording.replay_node", {"bag": "absent"}, "no such file or folder"),
    ],
)
def test_a_wrong_start_is_one_line_and_exit_status_2(
    started: list[Any], tmp_path: Path, module: str, parameters: dict[str, object], told: str
) -> None:
    process = start(module, tmp_path, **parameters)
    started.append(process)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 2
    assert told in err and len(err.strip().splitlines()) == 1


def test_a_replay_without_a_listener_says_who_is_missing(started: list[Any], bag: Path, tmp_path: Path) -> None:
    process = start("boom_recording.replay_node", tmp_path, bag=bag, wait_timeout=0.3)
    started.append(process)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 2
    assert "a subscriber of /boom/current_command" in err.strip().splitlines()[-1]


def commands_of(partner: Partner) -> list[tuple[int, float, float]]:
    got: list[tuple[int, float, float]] = []
    profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
    partner.node.create_subscription(
        SolenoidCurrents, "/boom/current_command",
        lambda message: got.append((stamps.to_ns(message.header.stamp), message.retract, message.extend)), profile,
    )  # fmt: skip
    return got


def test_recorded_currents_are_replayed_in_order_with_the_clock_and_end_with_zero(
    partner: Partner, started: list[Any], bag: Path, tmp_path: Path
) -> None:
    got = commands_of(partner)
    clock: list[int] = []
    partner.node.create_subscription(Clock, "/clock", lambda message: clock.append(stamps.to_ns(message.clock)), 1000)
    process = start("boom_recording.replay_node", tmp_path, bag=bag, rate=2.0, clock=True, start_time=5.0)
    started.append(process)
    partner.until(lambda: len(got) == 101)
    process.communicate(timeout=20)
    assert process.returncode == 0
    made = recording(1.0)
    expected = made.signals["extend_current"]
    assert [stamp for stamp, _, _ in got[:-1]] == (expected.stamps_ns - made.start_ns + 5 * 10**9).tolist()
    assert [extend for _, _, extend in got[:-1]] == expected.values.tolist()
    assert got[-1][1:] == (0.0, 0.0)
    assert clock == sorted(clock) and len(clock) > 50


def test_an_interrupted_replay_ends_with_zero_currents(
    partner: Partner, started: list[Any], bag: Path, tmp_path: Path
) -> None:
    got = commands_of(partner)
    process = start("boom_recording.replay_node", tmp_path, bag=bag, loop=True, start=0.4)
    started.append(process)
    partner.until(lambda: got and got[-1][2] > 0.3)
    process.send_signal(signal.SIGINT)
    partner.until(lambda: got[-1][1:] == (0.0, 0.0))
    process.communicate(timeout=20)
    assert process.returncode == 0  # one that repeats has no other end


def test_a_replay_that_is_interrupted_says_how_far_it_came(
    partner: Partner, started: list[Any], bag: Path, tmp_path: Path
) -> None:
    got = commands_of(partner)
    process = start("boom_recording.replay_node", tmp_path, bag=bag, start=0.4, rate=0.2)
    started.append(process)
    partner.until(lambda: got and got[-1][2] > 0.3)
    process.send_signal(signal.SIGTERM)
    partner.until(lambda: got[-1][1:] == (0.0, 0.0))
    process.communicate(timeout=20)
    assert process.returncode == 143


def test_a_paused_replay_waits_goes_on_when_asked_and_commands_zero_when_paused_again(
    partner: Partner, started: list[Any], bag: Path, tmp_path: Path
) -> None:
    got = commands_of(partner)
    started.append(start("boom_recording.replay_node", tmp_path, bag=bag, loop=True, start=0.4, paused=True))
    client = partner.node.create_client(SetBool, "/boom_replay/pause")

    def pause(data: bool) -> str:
        partner.until(client.service_is_ready)
        future = client.call_async(SetBool.Request(data=data))
        partner.until(future.done)
        result = future.result()
        assert result is not None and result.success
        return str(result.message)

    partner.until(lambda: partner.node.count_publishers("/boom/current_command"))
    assert pause(True) == "paused"
    assert got == []
    assert pause(False) == "going on"
    partner.until(lambda: got and got[-1][2] > 0.3)
    pause(True)
    partner.until(lambda: got[-1][1:] == (0.0, 0.0))
    sent = len(got)
    assert pause(True) == "paused"
    assert len(got) - sent <= 1, "nothing but another zero is sent while it is paused"


class Simulation:
    """The partner's side of the lockstep protocol: a tick per command. Stands still after `until` ticks."""

    def __init__(self, partner: Partner, until: int) -> None:
        self.got: list[tuple[int, float, float]] = []
        self.tick = 0
        self.until = until
        self.clock = partner.node.create_publisher(
            Clock, "/clock", QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
        )
        partner.node.create_subscription(SolenoidCurrents, "/boom/current_command", self.step, qos.COMMAND)

    def step(self, message: SolenoidCurrents) -> None:
        self.got.append((stamps.to_ns(message.header.stamp), message.retract, message.extend))
        if self.tick < self.until:
            self.tick += 1
            self.clock.publish(Clock(clock=stamps.set_ns(Clock().clock, self.tick * 10_000_000)))


def test_in_lockstep_every_tick_is_answered_with_the_current_of_its_period(
    partner: Partner, started: list[Any], bag: Path, tmp_path: Path
) -> None:
    simulation = Simulation(partner, until=10**6)
    process = start("boom_recording.replay_node", tmp_path, bag=bag, lockstep=True)
    started.append(process)
    partner.until(lambda: len(simulation.got) == 101)
    process.communicate(timeout=20)
    assert process.returncode == 0
    made = recording(1.0)
    current = made.signals["extend_current"]
    assert [stamp for stamp, _, _ in simulation.got[:-1]] == (current.stamps_ns - made.start_ns).tolist()
    assert [extend for _, _, extend in simulation.got[:-1]] == current.values.tolist()
    assert simulation.got[-1] == (10**9, 0.0, 0.0)


def test_in_lockstep_a_simulation_that_stands_still_is_named_and_zero_is_sent(
    partner: Partner, started: list[Any], bag: Path, tmp_path: Path
) -> None:
    simulation = Simulation(partner, until=5)
    process = start("boom_recording.replay_node", tmp_path, bag=bag, lockstep=True, tick_timeout=0.5)
    started.append(process)
    partner.until(lambda: len(simulation.got) == 7)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 2
    assert "no tick on /clock" in err.strip().splitlines()[-1]
    assert simulation.got[-1][1:] == (0.0, 0.0)
