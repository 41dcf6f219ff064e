"""What a command shows on stderr while it works."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_QUIET = 10.0  # s: so long nothing is said in a log file


@contextmanager
def progress(total: int) -> Iterator[Callable[[str, int], None]]:
    """Shows on stderr what is being done: a bar on a terminal, elsewhere a line for what begins after some seconds."""
    if not sys.stderr.isatty():
        begin = time.monotonic()

        def say(text: str, _: int) -> None:
            if text and time.monotonic() - begin > _QUIET:
                print(f"boom: {text}", file=sys.stderr, flush=True)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)

        def show(text: str, done: int) -> None:
            bar.update(task, advance=done, description=text or None)

        yield show
