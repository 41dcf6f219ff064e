"""The chain as separate processes, each killed once in the middle: the others stay sane and say what is missing."""

from __future__ import annotations

import os
import queue
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

from boom_bringup import environment
from boom_bringup.node_command import node_command
from boom_interfaces.msg import SolenoidCurrents
from boom_node import qos
from boom_recording.loading import load

pytestmark = pytest.mark.process

BAG = Path(__file__).parents[1] / "bags" / "healthy" / "extended"
URDF = Path(__file__).parents[1] / "src" / "boom_description" / "boom_description" / "urdf" / "epsilon_tz17.urdf"
PATIENCE = 40.0
MODULES = {
    "simulation": "boom_sim.simulation_node",
    "replay": "boom_recording.replay_node",
    "recorder": "boom_recording.recorder_node",
    "tip_pose": "boom_description.tip_pose_node",
}


class Node:
    """A node as a process; its lines can be waited for."""

    def __init__(self, name: str, parameters: dict[str, object]) -> None:
        self.name = name
        self.lines: list[str] = []
        self._queue: queue.Queue[str | None] = queue.Queue()
        self.process = subprocess.Popen(
            node_command(MODULES[name], parameters),  # type: ignore[arg-type]
            env=environment.for_processes(os.environ) | {"PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
        )  # fmt: skip
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._queue.put(line.rstrip())
        self._queue.put(None)

    def says(self, pattern: str) -> str:
        """The first new line that matches; fails when the process ends or the time is up before."""
        end = time.monotonic() + PATIENCE
        while (left := end - time.monotonic()) > 0:
            try:
                line = self._queue.get(timeout=left)
            except queue.Empty:
                break
            if line is None:
                pytest.fail(f"{self.name} ended with {self.process.wait()} and never said {pattern!r}: {self.lines}")
            self.lines.append(line)
            if re.search(pattern, line):
                return line
        pytest.fail(f"{self.name} did not say {pattern!r} within {PATIENCE:g} s: {self.lines}")

    def ends(self) -> int:
        return self.process.wait(timeout=PATIENCE)

    def stop(self) -> int:
        """Ends it as a user does; returns its status."""
        self.process.send_signal(signal.SIGINT)
        return self.ends()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(timeout=PATIENCE)

    @property
    def runs(self) -> bool:
        return self.process.poll() is None

    def text(self) -> str:
        while not self._queue.empty():
            line = self._queue.get()
            if line is not None:
                self.lines.append(line)
        return "\n".join(self.lines)


Start = Callable[..., Node]


@pytest.fixture
def start() -> Iterator[Start]:
    nodes: list[Node] = []

    def begin(name: str, **parameters: object) -> Node:
        nodes.append(Node(name, parameters))
        return nodes[-1]

    yield begin
    for node in nodes:
        if node.runs:
            node.kill()


@pytest.fixture
def chain(start: Start, tmp_path: Path) -> dict[str, Node]:
    """Recorder, crane, tip pose and replay in real time, all at work: five seconds have been replayed."""
    nodes = {
        "recorder": start("recorder", output=str(tmp_path / "bag")),
        "simulation": start("simulation", robot_description=str(URDF)),
        "tip_pose": start("tip_pose"),
        "replay": start("replay", bag=str(BAG), wait_for_recorder=True, wait_for=2, loop=True, rate=5.0),
    }
    nodes["replay"].says(r"replayed 5 of 60 s")
    return nodes


def all_end_well(nodes: dict[str, Node], but: str) -> None:
    for name, node in reversed(nodes.items()):  # the replay before the crane that follows it
        if name != but:
            assert node.runs, f"{name} ended too: {node.text()}"
            assert node.stop() == 0, node.text()
            assert "Traceback" not in node.text()


def the_crane_reports_no_current(samples: int = 20) -> None:
    """Waits until so many samples in a row have said so: what a recorder has not taken yet is older."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("listener", context=context)
    closed = [0]

    def hear(message: SolenoidCurrents) -> None:
        closed[0] = closed[0] + 1 if max(message.retract, message.extend) < 0.01 else 0

    node.create_subscription(SolenoidCurrents, "/boom/solenoid_currents", hear, qos.SENSOR_DATA)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    end = time.monotonic() + PATIENCE
    while closed[0] < samples:
        assert time.monotonic() < end, "the crane's currents did not end"
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_without_the_replay_the_crane_closes_its_valve_and_says_so(chain: dict[str, Node], tmp_path: Path) -> None:
    chain["replay"].kill()
    chain["simulation"].says(r"no current command for 100 ms: the valve is closed")
    the_crane_reports_no_current()
    all_end_well(chain, "replay")
    recording = load(tmp_path / "bag")
    assert recording.warnings == []
    assert recording.signals["retract_current"].values[-1] < 0.01
    assert recording.signals["extend_current"].values[-1] < 0.01


def test_a_replay_that_stood_still_does_not_go_on_in_the_middle_of_a_motion(
    chain: dict[str, Node], tmp_path: Path
) -> None:
    replay = chain.pop("replay")
    replay.process.send_signal(signal.SIGSTOP)
    the_crane_reports_no_current()  # what it said may be older: on a busy machine a command came late before
    replay.process.send_signal(signal.SIGCONT)
    assert replay.ends() == 2
    assert re.search(r"the replay itself stood still for \d+ ms", replay.text())
    the_crane_reports_no_current()
    all_end_well(chain, "replay")
    assert load(tmp_path / "bag").signals["extend_current"].values[-1] < 0.01


def test_without_the_crane_the_replay_ends_the_others_go_on_and_name_what_is_missing(
    chain: dict[str, Node], tmp_path: Path
) -> None:
    """A crane that is started in its place would be moved by the middle of a recording."""
    chain.pop("simulation").kill()
    chain["tip_pose"].says(r"/joint_states")
    replay = chain.pop("replay")
    assert replay.ends() == 2
    assert re.search(r"what followed /boom/current_command has gone after \d+ messages", replay.text())
    chain["recorder"].says(r"/joint_states")
    all_end_well(chain, "simulation")
    assert load(tmp_path / "bag").duration > 0.5


def test_without_the_perception_example_and_then_the_recorder_motion_goes_on_and_the_bag_is_readable(
    chain: dict[str, Node], tmp_path: Path
) -> None:
    chain["tip_pose"].kill()
    chain["replay"].says(r"replayed 15 of 60 s")
    assert all(node.runs for name, node in chain.items() if name != "tip_pose")
    chain.pop("recorder").kill()
    chain["replay"].says(r"replayed 25 of 60 s")
    all_end_well(chain, "tip_pose")
    recording = load(tmp_path / "bag")
    assert recording.duration > 2.0
    assert any("cut at" in warning for warning in recording.warnings)


def test_in_lockstep_a_killed_crane_ends_the_replay_with_status_2_and_its_name(start: Start) -> None:
    simulation = start("simulation", mode="lockstep")
    replay = start("replay", bag=str(BAG), lockstep=True, loop=False, tick_timeout=1.0)
    replay.says(r"replayed 5 of 60 s")
    simulation.kill()
    assert replay.ends() == 2
    assert "/clock" in replay.text()
    assert "Traceback" not in replay.text()


def test_in_lockstep_a_killed_replay_leaves_the_crane_waiting(start: Start) -> None:
    simulation = start("simulation", mode="lockstep")
    replay = start("replay", bag=str(BAG), lockstep=True)
    replay.says(r"replayed 5 of 60 s")
    replay.kill()
    assert simulation.runs
    second = start("replay", bag=str(BAG), lockstep=True)
    second.says(r"replayed 5 of 60 s")
    assert simulation.stop() == 0
    assert "Traceback" not in simulation.text()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_crane_ends_cleanly_on_a_signal(start: Start, number: signal.Signals) -> None:
    simulation = start("simulation")
    simulation.says(r"tz17, q3 = 0.28 rad")
    simulation.process.send_signal(number)
    assert simulation.ends() == 0
    assert "Traceback" not in simulation.text()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"machine": "tz71"}, r"tz71: no such machine; shipped are .*tz17"),
        ({"inital_angle": 0.1}, r"did you mean 'initial_angle'"),
        ({"mode": "lockstop"}, r"lockstep"),
    ],
)
def test_an_impossible_parameter_is_one_line_and_status_2(
    start: Start, parameters: dict[str, object], message: str
) -> None:
    simulation = start("simulation", **parameters)
    assert simulation.ends() == 2
    lines = [line for line in simulation.text().splitlines() if line.strip()]
    assert len(lines) == 1
    assert re.search(message, lines[0])


@pytest.mark.parametrize(
    ("transport", "module", "name"), [("topics", "simulation_node", "simulation"), ("can", "ecu_node", "ecu")]
)
def test_the_demo_stops_all_and_says_which_process_died(tmp_path: Path, transport: str, module: str, name: str) -> None:
    """One process of ./boom demo is killed from outside in the middle of the run."""
    command = [sys.executable, "-m", "boom_bringup.cli", "demo", str(BAG), "--output", str(tmp_path / "demo")]
    command += ["--transport", transport]
    demo = subprocess.Popen(
        command, env=environment.for_processes(os.environ), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    end = time.monotonic() + PATIENCE
    victim = None
    while victim is None and time.monotonic() < end and demo.poll() is None:
        bag = list((tmp_path / "demo").glob(".simulated-*/simulated/simulated_0.mcap"))
        if bag and bag[0].stat().st_size > 100_000:
            victim = child_of(demo.pid, f"boom_sim.{module}")
        else:
            threading.Event().wait(0.02)
    assert victim is not None
    os.kill(victim, signal.SIGKILL)
    _, err = demo.communicate(timeout=PATIENCE)
    assert demo.returncode == 2
    assert name in err.strip().splitlines()[-1]
    assert child_of(demo.pid, "boom_") is None


def child_of(parent: int, what: str) -> int | None:
    """Process id of a child of ``parent`` whose command line holds ``what``."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                words = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except OSError:
                continue
            if int(fields[1]) == parent and what in words:
                return int(entry.name)
    return None
