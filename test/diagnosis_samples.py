"""Recordings for the tests of validation: those of the repository, and small ones whose truth is known."""

import functools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from boom_identification.validation import BagValidation, validate
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_recording.loading import load
from boom_recording.recording import BLOCK, Configuration, Recording
from boom_recording.writing import from_columns

BAGS = Path(__file__).parents[1] / "bags"
FOLDED = Configuration("tz17", 4.59, 0.0, 0.0)
PERIOD = 0.01


@functools.cache
def tz17() -> Machine:
    return load_machine("tz17")


@functools.cache
def validated(name: str) -> BagValidation:
    return validate(load(BAGS / name), tz17())


def joystick(time: np.ndarray) -> np.ndarray:
    """Currents (n, 2) [A]: rest, lift, rest, lower, rest."""
    currents = np.zeros((len(time), 2))
    currents[(time > 1.5) & (time < 3.0), 1] = 0.45
    currents[(time > 4.0) & (time < 5.5), 0] = 0.45
    return currents


def simulated(
    duration: float, currents: np.ndarray, *, angle: float = 0.4, name: str = "made", machine: Machine | None = None
) -> Recording:
    """A recording that the full model made, without noise: sampled at the stamps of the currents."""
    time = np.arange(round(duration / PERIOD)) * PERIOD
    machine = machine or tz17()
    plant = Plant(machine, machine.pose(FOLDED.outer_boom_angle, FOLDED.telescope_length, 0.0), "full")
    run = plant.run(time, currents, time, plant.equilibrium(angle), tolerance=1e-6)
    columns = {key: run.output(key) for key in ("angle", "rate", "hose_pressure", "rod_pressure")}
    columns |= {"retract_current": currents[:, 0], "extend_current": currents[:, 1]}
    return from_columns(name, time, columns, FOLDED)


def constant(duration: float = 2.0, **values: float) -> Recording:
    """A recording in which nothing changes: signals SI, pressures gauge; what is not given is zero."""
    time = np.arange(round(duration / PERIOD)) * PERIOD
    names = ("angle", "rate", "hose_pressure", "rod_pressure", "retract_current", "extend_current")
    return from_columns("constant", time, {n: np.full(len(time), values.get(n, 0.0)) for n in names}, FOLDED)


def joined(pieces: Sequence[Recording], name: str = "shift") -> Recording:
    """Recordings one behind the other, as one."""
    first, begin = pieces[0], 0.0
    moved: list[tuple[int, Recording]] = []
    for piece in pieces:
        moved.append((round(begin * 1e9) + first.start_ns - piece.start_ns, piece))
        begin += BLOCK
    signals = {}
    for key, signal in first.signals.items():
        stamps = np.concatenate([p.signals[key].stamps_ns + by for by, p in moved])
        signals[key] = replace(
            signal, stamps_ns=stamps, time=(stamps - first.start_ns) / 1e9,
            values=np.concatenate([p.signals[key].values for _, p in moved]),
            valid=np.concatenate([p.signals[key].valid for _, p in moved]),
        )  # fmt: skip
    return replace(first, name=name, duration=begin, signals=signals)
