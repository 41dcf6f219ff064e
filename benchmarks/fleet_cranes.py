"""A simulated fleet: cranes of the concealed plant at work over a year, of which some drift, break or are serviced.

Every crane is a specimen of its own, its numbers off by half of their standard deviations; every recording has its own operator.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_recording import writing
from boom_recording.recording import Configuration, Recording
from concealed_plant.concealments import CONCEALMENTS
from concealed_plant.detectability import DetectionSetting, outputs, scene
from concealed_plant.hidden import Hidden
from concealed_plant.machine import MachineFile, Posture, linkage, quantities, scattered
from concealed_plant.operator import Operator
from concealed_plant.plant import InitialValues, RunError, per_millisecond, run
from concealed_plant.sensing import Bus, record

Array = NDArray[np.float64]

PIECE = 30.0
"""s. The operator looks at the boom again and again, and each look is a run from the beginning: short pieces, joined."""
ATTEMPTS = 30
SCATTER = 0.5
POSES = ((0.28, 2.2), (0.28, 2.8), (0.6, 1.5))
BEGIN = int(datetime(2025, 1, 6, 7, tzinfo=UTC).timestamp())
YEAR = 365 * 86400


@dataclass(frozen=True)
class Fate:
    """What happens to a crane: size(share of the year) of a concealed effect, or factors of its numbers.

    quantity: what a finding may be called, any of them.
    """

    kind: str
    effect: str
    size: Callable[[float], float]
    quantity: tuple[str, ...]


def _ramp(begin: float, end_size: float) -> Callable[[float], float]:
    return lambda share: end_size * max(0.0, share - begin) / (1.0 - begin)


def _step(at: float, size: float) -> Callable[[float], float]:
    return lambda share: size if share >= at else 0.0


FATES = (
    Fate("drift", "accumulator_precharge", _ramp(0.15, 0.4), ("accumulator_precharge",)),
    Fate("drift", "friction", _ramp(0.2, 1.0), ("friction", "stribeck_friction", "position_dependent_friction")),
    Fate("drift", "piston_leakage", _ramp(0.2, 1.5), ("piston_leakage",)),
    Fate("drift", "return_line_pressure", _ramp(0.1, 1.0e6), ("return_line_pressure",)),
    Fate("break", "hose_burst_valve_lag", _step(0.5, 0.08), ("hose_burst_valve_lag",)),
    Fate("break", "pressure_bias", _step(0.6, 3.0e5), ("pressure_bias",)),
    Fate("service", "spring_rate", _step(0.4, 0.25), ("spring_rate", "valve_dead_zone", "edge_overlap")),
)


@dataclass(frozen=True)
class Fleet:
    """fates: of the first ones. machines: number of cranes. recordings: of each over the year. seconds: of each recording."""

    machines: int
    recordings: int
    seconds: float
    fates: tuple[Fate, ...] = FATES
    seed: int = 0

    def fate(self, machine: int) -> Fate | None:
        """What happens to a crane."""
        return self.fates[machine] if machine < len(self.fates) else None

    def names(self) -> list[str]:
        """Of the cranes: they say nothing of their fate."""
        order = np.random.default_rng([self.seed, 7]).permutation(self.machines)
        return [f"crane_{k:02d}" for k in order]

    def share(self, machine: int, number: int) -> float:
        """Time of a recording as a share of the year."""
        offset = np.random.default_rng([self.seed, 8, machine]).uniform(0.0, 0.8)
        return float((number + offset) / self.recordings)


def make(fleet: Fleet, file: Path, folder: Path) -> None:
    """Write every recording that is not there yet to FOLDER/CRANE/DATE, and what happens to FOLDER.json."""
    truth: dict[str, object] = {}
    for machine, name in enumerate(fleet.names()):
        fate = fleet.fate(machine)
        if fate is not None:
            sizes = [fate.size(fleet.share(machine, k)) for k in range(fleet.recordings)]
            truth[name] = {"kind": fate.kind, "effect": fate.effect, "quantity": fate.quantity, "sizes": sizes}
        for number in range(fleet.recordings):
            make_one(fleet, file, folder, machine, number)
    folder.with_suffix(".json").write_text(json.dumps(truth, indent=1) + "\n")


def make_one(fleet: Fleet, file: Path, folder: Path, machine: int, number: int) -> Path:
    """One recording; the same arguments give the same bytes."""
    share = fleet.share(machine, number)
    second = BEGIN + round(share * YEAR)
    path = folder / fleet.names()[machine] / datetime.fromtimestamp(second, UTC).strftime("%Y-%m-%d")
    if path.exists():
        return path
    own = np.random.default_rng([fleet.seed, 1, machine])
    book = MachineFile.read(file)
    pose = Posture(*POSES[int(own.integers(len(POSES)))], 0.0)
    draws = own.uniform(size=5)
    specimen = book.specimen(scattered(book, pose, own, SCATTER))
    fate = fleet.fate(machine)
    size = fate.size(share) if fate else 0.0
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([fleet.seed, 2, machine, number, attempt])
        try:
            recording = _recorded(book.name, specimen, pose, fate, size, draws, fleet.seconds, rng)
            break
        except RunError:
            continue
    else:
        raise RuntimeError(f"{path}: no recording within {ATTEMPTS} attempts")
    path.parent.mkdir(parents=True, exist_ok=True)
    writing.write(path, _dated(recording, second * 10**9))
    return path


def _recorded(
    name: str, specimen: MachineFile, pose: Posture, fate: Fate | None, size: float, draws: Array, seconds: float,
    rng: np.random.Generator,
) -> Recording:  # fmt: skip
    m, table = quantities(specimen, pose), linkage(specimen)
    start = InitialValues(float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.6e6, 1.6e6)))
    setting = _at_work(specimen, pose, start, seconds, rng)
    hidden = _hidden(m, setting, fate, size, draws)
    shown = outputs(m, table, setting, hidden)
    configuration = Configuration(name, pose.outer_boom_angle, pose.telescope_length, 0.0)
    return record("recording", shown, per_millisecond(setting.currents), configuration, Bus(), rng)


def _at_work(
    specimen: MachineFile, pose: Posture, start: InitialValues, seconds: float, rng: np.random.Generator
) -> DetectionSetting:
    m, table = quantities(specimen, pose), linkage(specimen)
    operator, angle, pieces, starts = Operator(m, table, rng), start.angle, [], []
    count = max(1, round(seconds / PIECE))
    for _ in range(count + ATTEMPTS):
        try:
            currents, begins = operator.drive(PIECE, angle)
            end = run(m, table, InitialValues(angle, start.rod_pressure), per_millisecond(currents), steps=2)["angle"][
                -1
            ]
        except RunError:  # he would have hit a stop: he drives another way
            continue
        starts.append(begins + len(pieces) * PIECE)
        pieces.append(currents)
        angle = float(end)
        if len(pieces) == count:
            break
    else:
        raise RunError(f"no {seconds:g} s of work within {count + ATTEMPTS} attempts")
    return DetectionSetting(specimen, pose, start, np.concatenate(pieces), np.concatenate(starts))


def _hidden(m: object, setting: DetectionSetting, fate: Fate | None, size: float, draws: Array) -> Hidden:
    if fate is None or size <= 0.0:
        return Hidden()
    if fate.effect == "friction":
        changes: Mapping[str, float] = {
            name: getattr(m, name) * (1.0 + size) for name in ("coulomb_up", "coulomb_down")
        }
        return Hidden(changes)
    plain = run(m, linkage(setting.specimen), setting.start, per_millisecond(setting.currents), steps=3)
    draws = np.array([0.3, 0.3, *draws[2:]])
    return CONCEALMENTS[fate.effect].build(size, draws, scene(m, setting, plain))


def _dated(recording: Recording, begin_ns: int) -> Recording:
    """The recording with stamps of its day."""
    moved = begin_ns - recording.start_ns
    signals = {n: replace(s, stamps_ns=s.stamps_ns + moved) for n, s in recording.signals.items()}
    return replace(recording, start_ns=begin_ns, signals=signals)
