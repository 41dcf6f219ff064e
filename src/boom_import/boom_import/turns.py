"""Angles of foreign files without the whole turns that their sensors add."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from boom_import import units
from boom_import.source import Source
from boom_input import turns
from boom_input.shown import quoted


def without_turns(source: Source) -> None:
    """Takes whole turns out of every column that is told to be an angle and jumps by them; with a note."""
    for k, column in enumerate(source.columns):
        told = units.parse(column.unit)
        if told.measure is None or told.measure.dimension != units.ANGLE:
            continue
        turn = turns.TURN / (told.measure.factor * told.scale)
        order = np.argsort(column.stamps_ns, kind="stable")
        values = column.values.copy()
        values[order], jumps = turns.without_turns(column.values[order], turn)
        if len(jumps):
            source.columns[k] = replace(column, values=values)
            source.notes.append(
                f"'{quoted(column.key, 60)}': it jumps by whole turns ({len(jumps)} times): turns of {turn:.6g} "
                f"{quoted(column.unit, 12)} are taken out"
            )
