"""./boom sim, alone and with --control: who gives a motion is heard, or told that nobody hears; Ctrl-C ends all processes."""

from __future__ import annotations

import os
import re
import select
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from boom_bringup import cli, supervisor
from boom_bringup.commands import sim
from boom_controller.node.node_parameters import PARAMETERS
from boom_node import qos
from boom_sim.settings import NODE_PARAMETERS

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 90.0


@pytest.mark.parametrize(
    ("words", "pose"),
    [
        ([], (0.28, 2.2)),
        (["--machine", "loader_crane"], (4.5, 0.0)),
        (["--machine", "loader_crane", "--q3", "0.3", "--q4", "2"], (0.3, 2.0)),
    ],
)
def test_a_crane_starts_in_a_pose_that_its_file_has(
    monkeypatch: pytest.MonkeyPatch, words: list[str], pose: tuple[float, float]
) -> None:
    started: list[Any] = []

    class Nothing:
        def __init__(self, programs: Any, **_: Any) -> None:
            started.extend(programs)

        def run(self) -> Any:
            return SimpleNamespace(interrupted=signal.SIGINT, failed=[], statuses={})

    monkeypatch.setattr(supervisor, "Supervisor", Nothing)
    assert cli.main(["sim", *words]) == 0
    said = " ".join(started[0].command)
    assert f"outer_boom_angle:={pose[0]}" in said and f"telescope_length:={pose[1]}" in said


def test_robustness_says_what_it_needs_for_a_crane_without_the_poses_of_its_trajectories(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert cli.main(["robustness", "--machine", "loader_crane", "--bags", str(ROOT / "bags"), "--no-report"]) == 2
    said = capsys.readouterr().err
    assert "machine loader_crane cannot take the pose of healthy/" in said and "--bags" in said


class Sim:
    """./boom sim and what it says."""

    def __init__(self, *words: str) -> None:
        self.process = subprocess.Popen(
            [str(ROOT / "boom"), "sim", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.lines: list[str] = []
        self.news = threading.Condition()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self.news:
                self.lines.append(line)
                self.news.notify_all()

    def count(self, words: str) -> int:
        """How often it has said this."""
        return sum(words in line for line in self.lines)

    def says(self, words: str, often: int = 1) -> None:
        """Waits until it has."""
        with self.news:
            found = self.news.wait_for(lambda: self.count(words) >= often, PATIENCE)
        assert found, "".join(self.lines)

    def end(self) -> int:
        """Ctrl-C, and its exit status."""
        self.process.send_signal(signal.SIGINT)
        status = self.process.wait(PATIENCE)
        self.reader.join(PATIENCE)
        return status


@contextmanager
def running(*words: str) -> Iterator[Sim]:
    made = Sim(*words)
    try:
        yield made
    finally:
        if made.process.poll() is None:
            made.end()


def children(pid: int) -> list[int]:
    """Process ids of the children of a process."""
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()]


@pytest.mark.process
def test_a_motion_that_nobody_follows_is_told_once_with_what_to_type() -> None:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("planner", context=context)
    try:
        with running() as alone:
            alone.says("boom at 0.300 rad")
            node.create_publisher(JointTrajectory, "/boom/joint_trajectory", qos.EVENTS)
            alone.says("/boom/joint_trajectory is given and no controller is there")
            node.create_publisher(JointState, "/boom/reference", qos.LATEST)
            time.sleep(0.6)  # two looks at the graph: what does not come cannot be awaited
            assert alone.end() == 0
        (told,) = [line for line in alone.lines if "no controller" in line]
        assert "./boom sim --control" in told
    finally:
        node.destroy_node()
        context.try_shutdown()


def documented() -> list[str]:
    """The lines of docs/integration.md that move the boom."""
    text = (ROOT / "docs" / "integration.md").read_text(encoding="utf-8")
    return [
        line.split("  #")[0] for line in re.findall(r"^\./boom python -m boom_node\.move_node .*$", text, re.MULTILINE)
    ]


@pytest.mark.process
def test_with_control_the_documented_lines_move_the_boom_by_topic_and_by_action_and_ctrl_c_ends_all() -> None:
    lines = documented()
    assert len(lines) == 2
    with running("--control") as both:
        for line in lines:
            words = shlex.split(line)
            result = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
            assert (result.returncode, result.stderr) == (0, ""), "".join(both.lines)
            assert f"the boom is at {float(words[4]):g} rad" in result.stdout
        started = children(both.process.pid)
        assert len(started) == 3
        assert both.end() == 0
        assert not any(Path(f"/proc/{pid}").exists() for pid in started)
        assert not any("no controller" in line for line in both.lines)


@pytest.mark.process
def test_the_first_goals_after_start_and_resume_succeed_by_topic_and_by_action() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "first_goal.py"), "--starts", "1"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=4 * PATIENCE, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.process
def test_move_says_that_nobody_is_there() -> None:
    command = [
        sys.executable,
        "-c",
        "from boom_node import move_node as m; m.PATIENCE_S = 0.2; raise SystemExit(m.main())",
    ]
    result = subprocess.run([*command, "0.4"], capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert result.returncode == 2
    assert "./boom sim --control" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def programs(monkeypatch: pytest.MonkeyPatch, *words: str) -> dict[str, dict[str, str]]:
    """Parameters of the processes that the command would start, by name."""
    made: dict[str, dict[str, str]] = {}

    class Noted:
        def __init__(self, given: list[Any], **_: Any) -> None:
            for program in given:
                pairs = [word.split(":=", 1) for word in program.command if ":=" in word]
                made[program.name] = {name: value.strip('"') for name, value in pairs}

        def run(self) -> supervisor.Outcome:
            return supervisor.Outcome({}, interrupted=signal.SIGINT)

    monkeypatch.setattr(supervisor, "Supervisor", Noted)
    assert sim.run(cli.parse(sim, "boom sim", list(words))) == 0
    return made


def test_the_controller_gets_machine_law_time_and_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = "src/boom_model/boom_model/machines/tz17.yaml"
    started = programs(
        monkeypatch, "--control", "baseline", "--machine", machine, "--realtime-priority", "7", "--lockstep"
    )
    told = {"machine": machine, "mode": "baseline", "time": "lockstep", "realtime_priority": "7"}
    assert started["control"] == told
    assert (started["crane"]["machine"], started["crane"]["controller_follows"]) == (machine, "true")
    assert set(started["control"]) <= {spec.name for spec in PARAMETERS}
    assert set(started["crane"]) <= {spec.name for spec in NODE_PARAMETERS}


def test_without_control_there_is_none_and_effects_are_of_the_crane_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "control" not in programs(monkeypatch)
    started = programs(monkeypatch, "--control", "--effect", "pilot_lag.tau=0.02")
    assert "pilot_lag" in started["crane"]["effects"]
    assert "pilot_lag" not in str(started["control"])


def test_priority_is_used_by_itself_only_where_it_is_allowed_and_time_is_real(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any) -> None:
        raise PermissionError

    assert programs(monkeypatch, "--lockstep")["crane"]["realtime_priority"] == "0"
    monkeypatch.setattr(os, "sched_setscheduler", refused)
    assert programs(monkeypatch)["crane"]["realtime_priority"] == "0"
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None)
    assert int(programs(monkeypatch)["crane"]["realtime_priority"]) > 0


@pytest.mark.process
def test_what_died_is_named_when_all_others_are_stopped() -> None:
    with running() as alone:
        alone.says("boom at 0.300 rad")
        tip = next(
            pid for pid in children(alone.process.pid) if "tip_pose" in Path(f"/proc/{pid}/cmdline").read_text("utf-8")
        )
        os.kill(tip, signal.SIGKILL)
        assert alone.process.wait(PATIENCE) == 1
        alone.says("boom: tip_pose was killed (SIGKILL), and all others were stopped")


@pytest.mark.process
def test_over_can_late_frames_before_the_first_motion_leave_it_enabled_and_later_ones_do_not() -> None:
    with running("--control", "--can") as both:
        both.says("motion enabled")
        both.says("boom_controller]: idle\n")
        laws, enabled = (stamp(both.lines, end) for end in ("not ready: preparing the control laws", "motion enabled"))
        assert laws < enabled  # the controller's own line comes after the state that the waiting node acts on
        both.says("boom_enable]: motion enabled")
        ecu, enable = (child(both.process.pid, name) for name in ("ecu_node", "enable_node"))
        again = both.count("boom_enable]: motion enabled") + 1
        freeze(ecu)
        both.says("enabling again, nothing has moved yet")
        both.says("boom_enable]: motion enabled", again)
        lost = both.count("motion was disabled: no good")
        gone = os.pidfd_open(enable)
        words = [sys.executable, "-m", "boom_node.move_node", "0.32", "--seconds", "10"]
        with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as moving:
            both.says("boom_controller]: track")
            assert select.select([gone], [], [], PATIENCE)[0], "".join(both.lines)  # it has done its work
            os.close(gone)
            tried = both.count("enabling again")
            freeze(ecu)  # a busy computer may have been as late by itself meanwhile: to the same end
            both.says("motion was disabled: no good", lost + 1)
            assert "stopping" in moving.communicate(timeout=PATIENCE)[1] and moving.returncode == 2
        both.says("boom_controller]: stopped")
        assert both.count("enabling again") == tried
        assert both.end() == 0


def stamp(lines: list[str], said: str) -> float:
    """When a node first said something [s]; lines of two nodes may come in another order."""
    return next(float(line.split("] [")[2]) for line in lines if said in line)


def child(pid: int, module: str) -> int:
    """The child of a process that runs a module."""
    return next(one for one in children(pid) if module in Path(f"/proc/{one}/cmdline").read_text("utf-8"))


def freeze(pid: int) -> None:
    """A process stands still for as long as frames may not."""
    os.kill(pid, signal.SIGSTOP)
    time.sleep(0.3)
    os.kill(pid, signal.SIGCONT)


def test_over_can_motion_is_enabled_once_the_controller_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    assert programs(monkeypatch, "--can", "--control")["enable"]["after_controller"] == "true"
    assert "after_controller" not in programs(monkeypatch, "--can")["enable"]
