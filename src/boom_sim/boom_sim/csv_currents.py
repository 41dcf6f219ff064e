"""Currents from a CSV file: a header line ``time_s,retract_a,extend_a``, then numbers; held from line to line."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_sim.settings import SettingError
from boom_sim.simulated_crane import LARGEST_CURRENT

COLUMNS = ("time_s", "retract_a", "extend_a")

Array = NDArray[np.float64]


def read(path: Path) -> tuple[Array, Array]:
    """Times (m,) [s] and currents (m, 2) [A].

    Raises:
        SettingError: not readable, another header, a line that is no number, times that do not grow, an impossible current.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise SettingError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or 'not a text file'}") from None
    header = tuple(cell.strip().lower() for cell in lines[0]) if lines else ()
    if header != COLUMNS:
        raise SettingError(f"{path}: the first line must be {','.join(COLUMNS)}")
    rows: list[tuple[float, float, float]] = []
    for number, cells in enumerate(lines[1:], 2):
        if not any(cell.strip() for cell in cells):
            continue
        try:
            t, retract, extend = (float(cell) for cell in cells)
        except ValueError:
            raise SettingError(f"{path}, line {number}: expected three numbers, found {','.join(cells)!r}") from None
        if not math.isfinite(t) or (rows and t <= rows[-1][0]):
            raise SettingError(f"{path}, line {number}: time {t:g} s: times must be finite and grow from line to line")
        for current in (retract, extend):
            if not 0.0 <= current <= LARGEST_CURRENT:
                raise SettingError(f"{path}, line {number}: current {current} A: allowed is 0 .. {LARGEST_CURRENT:g} A")
        rows.append((t, retract, extend))
    if not rows:
        raise SettingError(f"{path}: holds no currents, only a header")
    table = np.array(rows)
    return table[:, 0], table[:, 1:]
