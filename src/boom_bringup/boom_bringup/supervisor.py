"""Runs the processes of a command together: if one fails, all stop, and none is left behind.

A group has any number of processes. One of them may be the main one: when it ends, the work is done and the others are
stopped. When another one ends by itself, that is a failure, and all are stopped. Stopping is SIGINT, then SIGTERM, then
SIGKILL, each with a bounded wait. SIGINT, SIGTERM and SIGHUP that reach the supervisor stop the group in the same way.
Every process is also told to die with its supervisor (`prctl PR_SET_PDEATHSIG`), so that even `kill -9` of the
supervisor leaves no orphan.

Output lines of a process are passed on with its name as prefix.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TextIO

from boom_input.ending import ending_signals

# Longest wait [s] after each signal. A node needs to write its last chunk after SIGINT; a stuck one must not hold us.
_STOP_SEQUENCE = ((signal.SIGINT, 8.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, 5.0))
_LINE_LIMIT = 1 << 20


class SupervisorError(RuntimeError):
    """A process could not be started; the message says which and why."""

    exit_status = 2


@dataclass(frozen=True)
class Program:
    """One process to run.

    Attributes:
        name: short name, put in front of its output lines.
        command: program and arguments.
        main: when it ends, the group is done.
        may_end: it may end by itself, with status 0, before the main one.
        environment: variables on top of the group's environment.
    """

    name: str
    command: Sequence[str]
    main: bool = False
    may_end: bool = False
    environment: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """How a group ended.

    Attributes:
        statuses: exit status by name; negative = ended by that signal, as in `subprocess`.
        failed: names of the processes that ended too early or with a status other than 0, in order.
        interrupted: the signal that stopped the group from outside, or None.
        killed: names that did not react to SIGINT and SIGTERM in time.
    """

    statuses: dict[str, int]
    failed: tuple[str, ...] = ()
    interrupted: signal.Signals | None = None
    killed: tuple[str, ...] = ()

    @property
    def exit_status(self) -> int:
        """Status for the shell: 0 done, 1 a process failed, 130 or 143 stopped from outside."""
        if self.interrupted is not None:
            return 128 + self.interrupted
        return 1 if self.failed else 0


class Supervisor:
    """Starts a group of processes, watches it and stops it.

    Args:
        programs: what to run; names must differ and at most one may be the main one.
        environment: environment of the processes; the supervisor's own by default.
        output: where prefixed lines go; stderr by default, so that stdout stays for results.
        on_line: called with (name, line) for every output line instead of printing it.
        stop_sequence: (signal, longest wait [s]) pairs.

    Raises:
        ValueError: two programs have one name, or more than one is the main one.
    """

    def __init__(
        self,
        programs: Sequence[Program],
        *,
        environment: Mapping[str, str] | None = None,
        output: TextIO | None = None,
        on_line: Callable[[str, str], None] | None = None,
        stop_sequence: Sequence[tuple[signal.Signals, float]] = _STOP_SEQUENCE,
    ) -> None:
        if len({program.name for program in programs}) != len(programs):
            raise ValueError("two programs have the same name")
        if sum(program.main for program in programs) > 1:
            raise ValueError("more than one program is the main one")
        self.programs = tuple(programs)
        self._environment = dict(os.environ if environment is None else environment)
        self._output = sys.stderr if output is None else output
        self._on_line = on_line or self._print
        self._stop_sequence = tuple(stop_sequence)
        self._width = max((len(program.name) for program in programs), default=0)
        self._processes: dict[str, asyncio.subprocess.Process] = {}
        self._stop_requested = asyncio.Event()
        self._interrupted: signal.Signals | None = None
        self._pipes: list[asyncio.ReadTransport] = []

    def pids(self) -> dict[str, int]:
        """Process ids by name, of those that were started."""
        return {name: process.pid for name, process in self._processes.items()}

    def stop(self) -> None:
        """Request a stop of the whole group; the run ends as if the main process had ended."""
        self._stop_requested.set()

    def run(self) -> Outcome:
        """Run the group to its end, from a program that has no event loop of its own."""
        return asyncio.run(self.run_async())

    async def run_async(self) -> Outcome:
        """Run the group to its end.

        Returns:
            How it ended. All processes have ended by then.

        Raises:
            SupervisorError: a program could not be started; those started before it are stopped first.
        """
        loop = asyncio.get_running_loop()
        handled: list[signal.Signals] = []
        for number in ending_signals():
            # Only the main thread can handle signals; elsewhere the caller stops us.
            with contextlib.suppress(ValueError, RuntimeError, NotImplementedError):
                loop.add_signal_handler(number, self._interrupt, number)
                handled.append(number)
        readers: list[asyncio.Task[None]] = []
        killed: list[str] = []
        failed: list[str] = []
        try:
            try:
                for program in self.programs:
                    readers.append(await self._start(program))
                failed = await self._watch()
            finally:
                # Shielded: a cancelled run must still stop what it has started.
                killed = await asyncio.shield(self._stop_all())
            # A process that left the session of its parent may keep the pipe open; its output is not waited for.
            if readers:
                await asyncio.wait(readers, timeout=1.0)
        finally:
            for reader in readers:
                reader.cancel()
            for pipe in self._pipes:
                pipe.close()
            for number in handled:
                loop.remove_signal_handler(number)
        statuses = {name: int(process.returncode or 0) for name, process in self._processes.items()}
        return Outcome(statuses, tuple(failed), self._interrupted, tuple(killed))

    def _interrupt(self, number: signal.Signals) -> None:
        if self._interrupted is None:
            self._interrupted = signal.Signals(number)
        self._stop_requested.set()

    @staticmethod
    def _begun_by(parent: int, program: Program) -> Callable[[], None]:
        """What a new process does first. A node gets a Ctrl-C once it handles it: a starting Python would show a traceback."""
        from boom_node.children import die_with_parent  # here, so that --help needs no other package

        ends, words = die_with_parent(parent), list(program.command)
        held = "-m" in words and "".join(words[words.index("-m") + 1 :][:1]).endswith("_node")

        def begin() -> None:
            ends()
            if held:
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})

        return begin

    async def _start(self, program: Program) -> asyncio.Task[None]:
        # Not asyncio's own pipe: its wait() would not return while a grandchild keeps the other end open.
        ours, theirs = os.pipe()
        try:
            process = await asyncio.create_subprocess_exec(
                *program.command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=theirs,
                stderr=theirs,
                env={**self._environment, **program.environment},
                # Its own session: a Ctrl-C of the terminal reaches it through us, in order.
                start_new_session=True,
                preexec_fn=self._begun_by(os.getpid(), program),
            )
        except OSError as error:
            os.close(ours)
            raise SupervisorError(f"cannot start {program.name} ({program.command[0]}): {error.strerror}") from error
        finally:
            os.close(theirs)
        self._processes[program.name] = process
        stream = asyncio.StreamReader(limit=_LINE_LIMIT)
        pipe, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(stream), os.fdopen(ours, "rb", 0)
        )
        self._pipes.append(pipe)
        return asyncio.create_task(self._read(program.name, stream))

    async def _read(self, name: str, stream: asyncio.StreamReader) -> None:
        while True:
            try:
                line = await stream.readline()
            except ValueError:
                # Longer than the limit: the stream has dropped it.
                self._on_line(name, "(a line longer than 1 MB was left out)")
                continue
            if not line:
                return
            self._on_line(name, line.decode(errors="replace").rstrip("\r\n"))

    def _print(self, name: str, line: str) -> None:
        with contextlib.suppress(BrokenPipeError):
            print(f"[{name:<{self._width}}] {line}", file=self._output, flush=True)

    async def _watch(self) -> list[str]:
        """Wait until the group has to stop; returns the names of failed processes."""
        waits = {asyncio.create_task(self._processes[program.name].wait()): program for program in self.programs}
        request = asyncio.create_task(self._stop_requested.wait())
        try:
            while waits:
                done, _ = await asyncio.wait({request, *waits}, return_when=asyncio.FIRST_COMPLETED)
                ended = [(waits.pop(task), task.result()) for task in list(waits) if task in done]
                # Ended as asked from outside: not a failure, whatever the status.
                if request in done:
                    return []
                failed = [p.name for p, status in ended if status != 0 or not (p.main or p.may_end)]
                if failed:
                    return failed
                if any(program.main for program, _ in ended):
                    return []
            return []
        finally:
            for task in (request, *waits):
                task.cancel()

    async def _stop_all(self) -> list[str]:
        """Stop the processes that still run; returns the names of those that needed SIGKILL."""
        killed: list[str] = []
        for number, patience in self._stop_sequence:
            running = {name: p for name, p in self._processes.items() if p.returncode is None}
            if not running:
                break
            for name, process in running.items():
                with contextlib.suppress(ProcessLookupError):
                    process.send_signal(number)
                if number == signal.SIGKILL:
                    killed.append(name)
            await asyncio.wait([asyncio.create_task(p.wait()) for p in running.values()], timeout=patience)
        for process in self._processes.values():
            # What a process has started itself shares its session.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
        return killed
