import asyncio
import os
import select
import signal
import subprocess
import sys

import pytest

from boom_bringup.supervisor import Program, Supervisor, SupervisorError

# Plain Python without site packages: starts in 10 ms.
PYTHON = [sys.executable, "-I", "-S", "-c"]
WAIT = "import signal, sys; print('up', flush=True)\nwhile True: signal.pause()"
CAREFUL = (
    "import os, signal, sys\n"
    # Not print(): the signal may come while the line before is still being printed.
    "def stop(number, frame):\n    os.write(1, b'got %d\\n' % number); os._exit(0)\n"
    "signal.signal(signal.SIGINT, stop); signal.signal(signal.SIGTERM, stop)\n"
    "print('up', flush=True)\n"
    "while True: signal.pause()"
)
STUBBORN = (
    "import signal\n"
    "for n in (2, 15): signal.signal(n, signal.SIG_IGN)\n"
    "print('up', flush=True)\n"
    "while True: signal.pause()"
)


def is_gone(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def has_ended(pidfd):
    """Wait for the end of a process that is not ours to wait for: its pidfd becomes readable."""
    ended = select.select([pidfd], [], [], 10)[0]
    os.close(pidfd)
    return bool(ended)


class Group:
    """A supervisor whose output lines are kept, and that calls `when` for each of them."""

    def __init__(self, programs, when=None, **options):
        self.lines = []
        self.when = when
        self.supervisor = Supervisor(programs, on_line=self.take, **options)

    def take(self, name, line):
        self.lines.append((name, line))
        if self.when:
            self.when(self, name, line)

    def all_up(self):
        return sum(line == "up" for _, line in self.lines) == len(self.supervisor.programs)

    def run(self):
        return asyncio.run(asyncio.wait_for(self.supervisor.run_async(), 30))


def test_the_others_are_stopped_when_the_main_one_ends():
    group = Group(
        [Program("node", [*PYTHON, CAREFUL]), Program("work", [*PYTHON, "import sys; sys.stdin.read()"], main=True)]
    )

    outcome = group.run()

    assert outcome.statuses["work"] == 0
    assert outcome.failed == ()
    assert outcome.exit_status == 0
    assert all(is_gone(pid) for pid in group.supervisor.pids().values())


def test_all_stop_when_one_fails():
    def kill_one(group, name, line):
        if group.all_up():
            os.kill(group.supervisor.pids()["b"], signal.SIGKILL)

    group = Group([Program(name, [*PYTHON, CAREFUL]) for name in "abc"], kill_one)

    outcome = group.run()

    assert outcome.failed == ("b",)
    assert outcome.statuses == {"a": 0, "b": -signal.SIGKILL, "c": 0}
    assert outcome.exit_status == 1
    assert ("a", "got 2") in group.lines


def test_ending_early_is_a_failure_unless_allowed():
    end = [*PYTHON, "print('bye')"]

    def run(may_end):
        group = Group([Program("a", end, may_end=may_end), Program("b", [*PYTHON, WAIT])])
        group.when = lambda g, name, line: g.supervisor.stop() if may_end and ("a", "bye") in g.lines else None
        return group.run()

    assert run(False).failed == ("a",)
    assert run(True).failed == ()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_passed_on(number):
    def signal_us(group, name, line):
        if line == "up" and group.all_up():
            os.kill(os.getpid(), number)

    group = Group([Program(name, [*PYTHON, CAREFUL]) for name in "ab"], signal_us)

    outcome = group.run()

    assert outcome.interrupted == number
    assert outcome.exit_status == 128 + number
    assert outcome.statuses == {"a": 0, "b": 0}
    assert {("a", "got 2"), ("b", "got 2")} <= set(group.lines)


def test_a_process_that_ignores_every_request_is_killed():
    sequence = ((signal.SIGINT, 0.05), (signal.SIGTERM, 0.05), (signal.SIGKILL, 5.0))
    group = Group(
        [Program("stubborn", [*PYTHON, STUBBORN])], lambda g, n, line: g.supervisor.stop(), stop_sequence=sequence
    )

    outcome = group.run()

    assert outcome.killed == ("stubborn",)
    assert outcome.statuses == {"stubborn": -signal.SIGKILL}


def test_what_a_process_has_started_goes_with_it():
    code = (
        "import signal, subprocess, sys\n"
        f"child = subprocess.Popen([sys.executable, '-I', '-S', '-c', {STUBBORN!r}], stdout=subprocess.PIPE)\n"
        "child.stdout.readline(); print(child.pid, flush=True)"
    )
    code += "\nsignal.pause()"
    watches = []

    def watch(group, name, line):
        watches.append(os.pidfd_open(int(line)))
        group.supervisor.stop()

    Group([Program("parent", [*PYTHON, code])], watch, stop_sequence=((signal.SIGKILL, 5.0),)).run()

    assert has_ended(watches[0])


def test_killing_the_supervisor_leaves_no_orphan():
    code = (
        "from boom_bringup.supervisor import Program, Supervisor\n"
        f"program = Program('node', {[*PYTHON, WAIT]!r})\n"
        "group = Supervisor([program], on_line=lambda n, line: print(group.pids()['node'], flush=True))\n"
        "group.run()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as supervisor:
        child = int(supervisor.stdout.readline())
        watch = os.pidfd_open(child)
        supervisor.kill()
        supervisor.wait()

    assert has_ended(watch)


def test_a_program_that_does_not_exist_is_named_and_the_others_are_stopped():
    group = Group([Program("good", [*PYTHON, WAIT]), Program("bad", ["/no/such/program"])])

    with pytest.raises(SupervisorError, match="cannot start bad"):
        group.run()
    assert all(is_gone(pid) for pid in group.supervisor.pids().values())


def test_lines_carry_the_name_of_their_process(capsys):
    Supervisor([Program("talker", [*PYTHON, "print('hello')"], main=True)]).run()

    assert capsys.readouterr().err == "[talker] hello\n"


def test_an_endless_line_does_not_stop_the_output():
    group = Group([Program("noisy", [*PYTHON, "print('x' * 3_000_000); print('after')"], main=True)])

    group.run()

    assert ("noisy", "after") in group.lines


def test_two_programs_of_one_name_are_refused():
    with pytest.raises(ValueError, match="same name"):
        Supervisor([Program("a", ["x"]), Program("a", ["y"])])
