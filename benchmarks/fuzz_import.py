"""Reads foreign recordings of every kind that were cut or garbled, and proposes a mapping for what can still be read.

    python benchmarks/fuzz_import.py --cases 2000 --seed 1

What cannot be read must be refused in one plain line that begins with the file; what is read must have finite values.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
from foreign_recordings import KINDS, Data
from fuzzing import Outcome, main, mutate

from boom_import import assembly, reading
from boom_import.errors import ImportingError


def _small() -> Data:
    """A few seconds of a boom that swings."""
    t = np.arange(0, 4, 0.01)
    drive = np.sin(2 * t)
    raised, lowered = np.maximum(drive, 0) * 0.5, np.maximum(-drive, 0) * 0.5
    return Data(t, 0.4 - 0.1 * np.cos(2 * t), 0.2 * drive, 9e6 + 3e6 * drive, 3e6 - 2e6 * drive, raised, lowered)


@cache
def _whole(kind: str) -> dict[str, bytes]:
    """The files of an undamaged recording of the kind, by their path."""
    with tempfile.TemporaryDirectory() as folder:
        KINDS[kind](_small(), Path(folder))
        return {str(p.relative_to(folder)): p.read_bytes() for p in Path(folder).rglob("*") if p.is_file()}


def case(random: Random, folder: Path) -> Outcome:
    """Damage one file and have it read."""
    kind = random.choice(list(KINDS))
    shutil.rmtree(folder / kind, ignore_errors=True)
    files = _whole(kind)
    victim = max(files, key=lambda name: len(files[name]))
    what, data = mutate(random, files[victim])
    for name, content in files.items():
        path = folder / kind / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data if name == victim else content)
    given = next((folder / kind).iterdir())
    try:
        source = reading.read([given])
        assembly.propose(source)
    except ImportingError as error:
        text = str(error)
        plain = text.isprintable() and len(text) < 800 and text.startswith(str(given))
        return Outcome(kind, what, "refused", fault="" if plain else f"no plain line: {text[:80]!a}")
    sound = all(np.isfinite(c.values).all() and len(c.values) == len(c.stamps_ns) for c in source.columns)
    return Outcome(kind, what, "told" if source.notes else "whole", fault="" if sound else "no sound columns")


if __name__ == "__main__":
    sys.exit(main(__doc__, case, 500))
