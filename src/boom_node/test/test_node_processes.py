"""A node as a process: a clean end on a signal at any moment, one line and exit status 2 for a wrong parameter."""

import os
import select
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytestmark = pytest.mark.process

_NODE = textwrap.dedent(
    """
    from boom_node import early
    import ctypes, os, sys, threading

    def mark(text):
        print(text, flush=True)
        if os.environ["BLOCK_AT"] == text:
            for _ in range(600):  # short waits: what signals in the instant before one begins is handled when it ends
                threading.Event().wait(0.1)

    mark("imported early")
    from boom_node import shell
    from boom_node.errors import StartError
    from boom_node.parameters import ParameterSpec, declare
    import rclpy
    from boom_node.node import Node
    mark("imported rclpy")

    class Tiny(Node):
        def __init__(self):
            mark("initialised")
            super().__init__("tiny")
            mark("created")
            self.values = declare(self, [
                ParameterSpec("rate", 100.0, "publishing rate", "Hz", 1.0, 1000.0),
                ParameterSpec("mode", "fast", "what to do", choices=("fast", "slow")),
                ParameterSpec("names", ["a"], "names"),
            ])
            print(vars(self.values), flush=True)
            self.timer = self.create_timer(0.01, self.tick)
            self.failed = 0
            if os.environ["BLOCK_AT"] == "fail for ever":
                self.create_timer(0.01, self.fail)
                rclpy.node.Node.create_timer(self, 0.01, self.fail)  # past the guard, into the executor

        def fail(self):
            self.failed += 1
            if self.failed == 40:
                print("still here", flush=True)
            raise ValueError("a mistake")

        def stop_safely(self, reason):
            if self.failed == 1:
                print("stopped safely", flush=True)

        def tick(self):
            self.timer.cancel()
            print("spinning", flush=True)
            if os.environ["BLOCK_AT"] == "finish":
                shell.finish(2, "the partner\\n is missing")
            if os.environ["BLOCK_AT"] == "raise":
                raise StartError("the file is gone")

        def close(self):
            print("closed", flush=True)

        def destroy_node(self):
            if os.environ["BLOCK_AT"] == "letting go":
                ctypes.PyDLL(None).sleep(60)  # and no other thread of Python runs meanwhile
            super().destroy_node()

    if os.environ["BLOCK_AT"] == "letting go":
        shell.LETTING_GO_S = 1.0
    sys.exit(shell.run(Tiny))
    """
)


class Tiny:
    """The node above as a process."""

    def __init__(self, folder: Path, block_at: str, *arguments: str, executor: str = "events") -> None:
        (folder / "tiny_node.py").write_text(_NODE)
        environment = dict(os.environ, BLOCK_AT=block_at, BOOM_EXECUTOR=executor, PYTHONUNBUFFERED="1")
        environment["PYTHONPATH"] = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        command = [sys.executable, "-m", "tiny_node", *(["--ros-args", *arguments] if arguments else [])]
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.printed: list[str] = []

    def wait_for(self, text: str) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.printed.append(line.strip())
            if line.strip() == text:
                return
        pytest.fail(f"the node ended without '{text}': {self.process.stderr.read() if self.process.stderr else ''}")

    def end(self) -> tuple[int, str]:
        out, err = self.process.communicate(timeout=30)
        self.printed += out.splitlines()
        return self.process.returncode, err


@pytest.fixture
def tiny(tmp_path: Path) -> Iterator[object]:
    started: list[Tiny] = []

    def start(*arguments: str, block_at: str = "", executor: str = "events") -> Tiny:
        started.append(Tiny(tmp_path, block_at, *arguments, executor=executor))
        return started[-1]

    yield start
    for node in started:
        if node.process.poll() is None:
            node.process.kill()
            node.process.communicate()


@pytest.mark.parametrize(
    ("moment", "number"),
    [
        ("imported early", signal.SIGINT),
        ("imported rclpy", signal.SIGTERM),
        ("initialised", signal.SIGTERM),
        ("created", signal.SIGINT),
        ("spinning", signal.SIGINT),
        ("spinning", signal.SIGTERM),
    ],
)
def test_a_signal_at_any_moment_ends_the_node_without_a_traceback(tiny, moment: str, number: int) -> None:
    node = tiny(block_at=moment)
    node.wait_for(moment)
    node.process.send_signal(number)
    status, errors = node.end()
    assert status == 0
    assert "Traceback" not in errors
    assert ("closed" in node.printed) == (moment == "spinning")


@pytest.mark.parametrize(
    ("program", "status", "said"),
    [
        ("replay_node", 130, "nothing was replayed"),
        ("recorder_node", 130, "nothing was recorded"),
        ("tip_pose_node", 0, ""),
    ],
)
def test_a_node_with_something_to_do_says_that_it_was_not_done(
    tmp_path: Path, program: str, status: int, said: str
) -> None:
    (tmp_path / f"{program}.py").write_text(
        "from boom_node import early\nprint('here', flush=True)\nimport time\ntime.sleep(60)"
    )
    node = subprocess.Popen(
        [sys.executable, "-m", program], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert node.stdout is not None and node.stdout.readline() == "here\n"
    node.send_signal(signal.SIGINT)
    _, errors = node.communicate(timeout=20)
    assert (node.returncode, errors.strip()) == (status, f"boom: stopped before it began: {said}" if said else "")


def test_a_node_that_the_middleware_does_not_let_go_of_ends_and_shows_where_it_hangs(tiny) -> None:
    node = tiny(block_at="letting go")
    node.wait_for("spinning")
    node.process.send_signal(signal.SIGTERM)
    status, errors = node.end()
    assert status == 1
    assert "closed" in node.printed
    assert "Timeout (0:00:01)!" in errors and "in destroy_node" in errors


def test_the_fall_back_executor_runs_the_node_too(tiny) -> None:
    node = tiny(executor="single")
    node.wait_for("spinning")
    node.process.send_signal(signal.SIGTERM)
    assert node.end()[0] == 0
    assert "closed" in node.printed


def test_a_node_that_waits_for_a_clock_says_that_nobody_publishes_one(tiny) -> None:
    node = tiny("-p", "use_sim_time:=true")
    assert node.process.stderr is not None
    assert any("use_sim_time is set, and nothing publishes /clock" in line for line in node.process.stderr)


@pytest.mark.parametrize("moment", ["finish", "raise"])
def test_a_node_may_end_itself_with_one_line_and_is_closed(tiny, moment: str) -> None:
    node = tiny(block_at=moment)
    status, errors = node.end()
    assert status == 2
    last = {"finish": "the partner is missing", "raise": "the file is gone"}[moment]
    assert errors.strip().splitlines()[-1] == f"boom: {last}"
    assert "Traceback" not in errors
    assert "closed" in node.printed


@pytest.mark.parametrize("executor", ["events", "single"])
def test_callbacks_that_always_raise_stop_what_moves_and_neither_end_the_node_nor_fill_the_log(
    tiny, executor: str
) -> None:
    node = tiny(block_at="fail for ever", executor=executor)
    node.wait_for("stopped safely")
    node.wait_for("still here")
    node.process.send_signal(signal.SIGTERM)
    status, errors = node.end()
    assert status == 0
    own = [line for line in errors.splitlines() if "internal error, ValueError" in line]
    assert len(own) == 2, "the callback once, the executor once"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("-p", "rat:=5.0"), "did you mean 'rate'?"),
        (("-p", "rate:=5000.0"), "1 to 1000 Hz"),
        (("-p", "rate:=quick"), "give a number"),
        (("-p", "mode:=medium"), "one of fast, slow"),
        (("--params-file", "absent.yaml"), "absent.yaml"),
    ],
)
def test_a_wrong_parameter_is_one_line_and_exit_status_2(tiny, arguments: tuple[str, ...], told: str) -> None:
    status, errors = tiny(*arguments).end()
    assert status == 2
    assert told in errors
    assert "Traceback" not in errors
    assert len(errors.strip().splitlines()) == 1


def test_help_lists_the_parameters_with_units_and_starts_nothing(tiny) -> None:
    node = tiny("--", "--help")
    status, errors = node.end()
    assert (status, errors) == (0, "")
    assert "  rate  publishing rate [Hz], 1 to 1000 Hz" in node.printed
    assert "      default 'fast'" in node.printed
    assert "created" in node.printed and "spinning" not in node.printed


def test_a_parameter_file_for_a_node_of_another_name_is_refused(tiny, tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("tinny:\n  ros__parameters:\n    rate: 5.0\n")
    status, errors = tiny("--params-file", "p.yaml").end()
    assert status == 2
    assert "has nothing for /tiny" in errors


@pytest.mark.parametrize("section", ["/tiny", "tiny", "/**"])
def test_a_parameter_file_with_the_nodes_name_is_used_and_checked(tiny, tmp_path: Path, section: str) -> None:
    (tmp_path / "p.yaml").write_text(f"{section}:\n  ros__parameters:\n    rate: 5\n    names: [b, c]\n")
    node = tiny("--params-file", "p.yaml")
    node.wait_for("spinning")
    node.process.send_signal(signal.SIGTERM)
    node.end()
    assert "{'rate': 5.0, 'mode': 'fast', 'names': ['b', 'c']}" in node.printed
    (tmp_path / "p.yaml").write_text(f"{section}:\n  ros__parameters:\n    rates: 5.0\n")
    status, errors = tiny("--params-file", "p.yaml").end()
    assert status == 2
    assert "did you mean 'rate'?" in errors


POOL = """
import multiprocessing, os, sys, time
from concurrent.futures import ProcessPoolExecutor
from boom_node.children import end_with

if __name__ == "__main__":
    context = multiprocessing.get_context("forkserver")
    pool = ProcessPoolExecutor(1, mp_context=context, initializer=end_with, initargs=(os.getpid(),))
    print(pool.submit(os.getpid).result(), flush=True)
    sys.stdin.read()
"""


def test_workers_of_a_pool_end_with_a_program_that_is_killed(tmp_path: Path) -> None:
    (tmp_path / "pool.py").write_text(POOL)
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "pool.py")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        worker = os.pidfd_open(int(program.stdout.readline()))
        program.kill()
        assert select.select([worker], [], [], 20.0)[0]
        assert program.stdout.read() == ""  # nothing holds the pipe open any more
    os.close(worker)
