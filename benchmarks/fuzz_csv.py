"""Damages currents in CSV files as spreadsheets write them, and has `simulate` read them.

    python benchmarks/fuzz_csv.py --cases 5000 --seed 1

Every case is read; every tenth goes through `./boom simulate` for a fifth of a second. What is read nevertheless must be a table of
finite times that grow and of currents that a valve can have, with a line of the file for each row.
"""

from __future__ import annotations

import contextlib
import io
import sys
from pathlib import Path
from random import Random

import numpy as np
from fuzzing import Outcome, main, mutate, mutate_text

from boom_bringup import cli
from boom_sim import csv_currents
from boom_sim.settings import SimulationSettingError
from boom_sim.simulated_crane import LARGEST_CURRENT

_PLAIN = "time_s,retract_a,extend_a\n" + "".join(
    f"{k * 0.05:.2f},{0.3 * (k % 3):.2f},{0.1 * (k % 5):.3f}\n" for k in range(60)
)
KINDS = {
    "comma": _PLAIN.encode(),
    "semicolon": _PLAIN.replace(",", ";").encode(),
    "tab": _PLAIN.replace(",", "\t").encode(),
    "decimal comma": _PLAIN.replace(",", ";").replace(".", ",").encode(),
    "quoted, CRLF, BOM": ("\ufeff" + "".join(
        ";".join(f'"{cell}"' for cell in line.split(",")) + "\r\n" for line in _PLAIN.splitlines()
    )).encode(),
    "UTF-16": _PLAIN.replace(",", "\t").encode("utf-16"),
    "comments": ("# log book\n" + _PLAIN.replace("\n", "\n\n# next\n")).encode(),
}  # fmt: skip


def case(random: Random, folder: Path) -> Outcome:
    """Damage one file and have it read."""
    kind = random.choice(list(KINDS))
    if random.random() < 0.5 or kind == "UTF-16":
        what, damaged = mutate(random, KINDS[kind])
    else:
        what, text = mutate_text(random, KINDS[kind].decode())
        damaged = text.encode("utf-8", "surrogatepass")
    path = folder / "c.csv"
    path.write_bytes(damaged)
    try:
        times, currents = csv_currents.read(path)
    except SimulationSettingError as error:
        text = str(error)
        fault = "" if text.isprintable() and len(text) < 600 and str(path) in text else f"no plain line: {text[:60]!a}"
        answer = "refused"
    else:
        sound = np.all(np.diff(times) > 0.0) and np.all((currents >= 0.0) & (currents <= LARGEST_CURRENT))
        fault = "" if sound and len(times) == len(currents) else "no sound table"
        answer = "whole"
    if random.random() < 0.1:
        fault = fault or _simulated(path, folder, refused=answer == "refused")
    return Outcome(kind, what, answer, fault=fault)


def _simulated(path: Path, folder: Path, *, refused: bool) -> str:
    out, errors = io.StringIO(), io.StringIO()
    words = ["simulate", str(path), "--duration", "0.2", "--output", str(folder / "made")]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        status = cli.main(words)
    lines = errors.getvalue().splitlines()
    if refused:
        return "" if status == 2 and len(lines) == 1 else f"simulate: status {status}, {len(lines)} lines"
    return "" if status == 0 and not lines else f"simulate: status {status}: {errors.getvalue()[:80]!a}"


if __name__ == "__main__":
    sys.exit(main(__doc__, case, 500))
