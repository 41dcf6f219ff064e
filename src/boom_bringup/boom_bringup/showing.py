"""Progress and hints that commands print on stderr."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from boom_input.shown import typable


def diagnose_next(bags: Sequence[str], machine: str | None, configuration: Sequence[str] = ()) -> list[str]:
    """The next command to type for recordings that differ from the model: one explains, the next one proves it."""
    proof = ["--hold-out", str(bags[1])] if len(bags) > 1 else []
    words = [*proof, *(["--machine", machine] if machine else []), *configuration]
    program = os.environ.get("BOOM_PROGRAM", "boom")
    return [f"next: {typable(program, 'diagnose', str(bag), *words)}" for bag in bags[:1]]


def asked(prompt: str) -> str:
    """The line that is typed, without blanks at its ends.

    Raises:
        EOFError: there is none, or it ended without Enter: `input` would drop its last character then.
    """
    print(prompt, end="", flush=True)
    line = sys.stdin.readline()
    if not line.endswith("\n"):
        raise EOFError
    return line.strip()


QUIET = 2.0  # s: so long nothing is said in a log file


SILENT = 30.0  # s: so long a log file gets no line before it is told that work goes on


@contextmanager
def progress(total: int) -> Iterator[Callable[[str, int], None]]:
    """Show progress on stderr: a bar on a terminal; elsewhere a line for each step that starts after some seconds.

    There a step that takes long is told again every ``SILENT`` seconds.
    """
    if not sys.stderr.isatty():
        with _lines() as say:
            yield say
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from boom_report.console import console_for

    columns = (TextColumn("{task.description}", markup=False), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console_for(sys.stderr), transient=True) as bar:
        task = bar.add_task("", total=total)

        def show(text: str, done: int) -> None:
            bar.update(task, advance=done, description=text or None)

        yield show


@contextmanager
def _lines() -> Iterator[Callable[[str, int], None]]:
    begin, step, ended = time.monotonic(), "", threading.Event()
    said = time.perf_counter()

    def say(text: str, _: int) -> None:
        nonlocal step, said
        if text and time.monotonic() - begin > QUIET:
            print(f"boom: {text}", file=sys.stderr, flush=True)
        if text:
            step, said = text, time.perf_counter()

    def remind() -> None:
        nonlocal said
        first = said
        while not ended.wait(max(said + SILENT - time.perf_counter(), 0.0)):
            now = time.perf_counter()
            if now - said >= SILENT:
                said = now
                print(
                    f"boom: still working after {now - first:.0f} s{f': {step}' if step else ''}",
                    file=sys.stderr,
                    flush=True,
                )

    reminding = threading.Thread(target=remind, daemon=True)
    reminding.start()
    try:
        yield say
    finally:
        ended.set()
        reminding.join()
