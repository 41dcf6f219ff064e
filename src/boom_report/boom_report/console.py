"""The console of all commands: what others wrote (names of files, machines, topics) is shown, never obeyed.

There is no markup: ``[/red]`` in the name of a folder is five letters and a slash; our own styles are `rich.text.Text`. Characters
that a terminal would obey are written out, see ``boom_input.shown``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from boom_input.shown import printable

WIDTH = 100
"""Columns where the output is no terminal."""


class _Plain(Console):
    def on_broken_pipe(self) -> None:
        """The reader has left: the command line ends quietly by it; rich would end with status 1, which is a result."""
        raise BrokenPipeError

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)


def console_for(stream: TextIO | None = None, width: int | None = None) -> Console:
    """A console in the terminal's own width and colours; plain and `WIDTH` columns wide elsewhere."""
    out: TextIO = stream or sys.stdout
    terminal = out.isatty()
    # Escape sequences of the console's own must not be written out: it goes past the stream that does that (cli).
    out = getattr(out, "obeyed", out)
    return _Plain(
        file=out, width=width or (None if terminal else WIDTH), color_system="auto" if terminal else None,
        highlight=False, markup=False, emoji=False,
    )  # fmt: skip
