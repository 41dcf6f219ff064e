"""A simulated fleet: cranes of the concealed plant at work over a year, of which some drift, break or are serviced.

Every crane is a specimen of its own, its numbers off by half of their standard deviations; every recording has its own operator.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_fleet.engine import workers
from boom_input.whole import write_whole
from boom_recording import writing
from boom_recording.recording import Configuration, Recording
from concealed_plant.concealments import CONCEALMENTS
from concealed_plant.detectability import Detectability, DetectionSetting, outputs
from concealed_plant.hidden import Hidden, Scene
from concealed_plant.machine import MachineFile, Posture, linkage, quantities, scattered
from concealed_plant.operator import Operator
from concealed_plant.plant import InitialValues, RunError, per_millisecond, run
from concealed_plant.sensing import Bus, record

Array = NDArray[np.float64]

PIECE = 30.0
"""s, about. The operator looks at the boom again and again, and each look is a run from the beginning: short pieces, joined."""
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

    @property
    def twins(self) -> tuple[str, ...]:
        """Numbers of the crane that it is itself."""
        if self.effect == "friction":
            return ("friction.tau_C_pos", "friction.tau_C_neg")
        return CONCEALMENTS[self.effect].twins


def _ramp(begin: float, end_size: float, share: float) -> float:
    return end_size * max(0.0, share - begin) / (1.0 - begin)


def _step(at: float, size: float, share: float) -> float:
    return size if share >= at else 0.0


FATES = (
    Fate("drift", "accumulator_precharge", partial(_ramp, 0.15, 0.4), ("accumulator_precharge",)),
    Fate(
        "drift", "friction", partial(_ramp, 0.2, 1.0), ("friction", "stribeck_friction", "position_dependent_friction")
    ),
    Fate("drift", "piston_leakage", partial(_ramp, 0.2, 1.5), ("piston_leakage",)),
    Fate("drift", "return_line_pressure", partial(_ramp, 0.1, 1.0e6), ("return_line_pressure",)),
    Fate("break", "hose_burst_valve_lag", partial(_step, 0.5, 0.08), ("hose_burst_valve_lag",)),
    Fate("break", "pressure_bias", partial(_step, 0.6, 3.0e5), ("pressure_bias",)),
    Fate("service", "spring_rate", partial(_step, 0.4, 0.25), ("spring_rate", "valve_dead_zone", "edge_overlap")),
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

    def size(self, machine: int, number: int) -> float:
        """Of a crane's fate at a recording."""
        fate = self.fate(machine)
        return fate.size(self.share(machine, number)) if fate else 0.0

    def second(self, machine: int, number: int) -> int:
        """Begin of a recording, seconds since 1970."""
        return BEGIN + round(self.share(machine, number) * YEAR)

    def place(self, folder: Path, machine: int, number: int) -> Path:
        """Of a recording."""
        day = datetime.fromtimestamp(self.second(machine, number), UTC)
        return folder / self.names()[machine] / day.strftime("%Y-%m-%d")

    def attempts(self, machine: int, number: int) -> Iterator[np.random.Generator]:
        """Random numbers of a recording, one stream after the other until one gives a crane that keeps off its stops."""
        for attempt in range(ATTEMPTS):
            yield np.random.default_rng([self.seed, 2, machine, number, attempt])

    def told(self) -> dict[str, object]:
        """What makes it this fleet."""
        fates = [f.effect for f in self.fates]
        return {
            "machines": self.machines,
            "recordings": self.recordings,
            "seconds": self.seconds,
            "fates": fates,
            "seed": self.seed,
        }


def make(fleet: Fleet, file: Path, folder: Path, processes: int, told: Callable[[str], None]) -> None:
    """Write every recording that is not there yet to FOLDER/CRANE/DATE, and what happens to FOLDER.json.

    It may be killed and called again: a recording is moved into place when it is complete. told: called with progress.

    Raises:
        ValueError: the folder holds the recordings of another fleet.
    """
    _mine(fleet, folder)
    truth: dict[str, object] = {}
    for machine, name in enumerate(fleet.names()):
        fate = fleet.fate(machine)
        if fate is not None:
            sizes = [fate.size(fleet.share(machine, k)) for k in range(fleet.recordings)]
            truth[name] = {"kind": fate.kind, "effect": fate.effect, "quantity": fate.quantity, "sizes": sizes}
    write_whole(folder.with_suffix(".json"), json.dumps(truth, indent=1) + "\n")
    places = {f"{m} {k}": fleet.place(folder, m, k) for m in range(fleet.machines) for k in range(fleet.recordings)}
    missing = [case for case, place in places.items() if not place.exists()]
    there = len(places) - len(missing)
    told(f"{there} of {len(places)} recordings are there")

    def done(case: str, path: Path) -> None:
        nonlocal there
        there += 1
        told(f"made {path.parent.name}/{path.name}, {there} of {len(places)}")

    with workers(None, processes) as engine:
        engine.each(make_one, missing, lambda case: (fleet, file, folder, *map(int, case.split())), done)
    shutil.rmtree(_unfinished(folder), ignore_errors=True)


def _mine(fleet: Fleet, folder: Path) -> None:
    """Note which fleet a folder holds. Raises ValueError where it holds another."""
    folder.mkdir(parents=True, exist_ok=True)
    note, said = folder.with_suffix(".fleet.json"), json.dumps(fleet.told(), indent=1) + "\n"
    if note.exists() and note.read_text() != said:
        raise ValueError(
            f"{folder} holds the recordings of another fleet ({note}): give another folder, or its options"
        )
    write_whole(note, said)


def _unfinished(folder: Path) -> Path:
    return folder.with_suffix(".unfinished")


def make_one(fleet: Fleet, file: Path, folder: Path, machine: int, number: int) -> Path:
    """One recording; the same arguments give the same bytes."""
    path = fleet.place(folder, machine, number)
    if path.exists():
        return path
    book, pose, specimen, draws = _crane(fleet, file, machine)
    fate, size = fleet.fate(machine), fleet.size(machine, number)
    for rng in fleet.attempts(machine, number):
        try:
            recording = _recorded(book.name, specimen, pose, fate, size, draws, fleet.seconds, rng)
            break
        except RunError:
            continue
    else:
        raise RuntimeError(f"{path}: no recording within {ATTEMPTS} attempts")
    begun = _unfinished(folder) / f"{machine}-{number}" / path.name
    shutil.rmtree(begun, ignore_errors=True)
    begun.parent.mkdir(parents=True, exist_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    writing.write(begun, _dated(recording, fleet.second(machine, number) * 10**9))
    begun.rename(path)
    return path


def shown(fleet: Fleet, file: Path, machine: int, number: int) -> float:
    """How well a recording alone shows what has happened to its crane: d over the d at which an effect counts as detectable.

    Both by ``concealed_plant.detectability``: 1 where the part that no other number imitates has the energy of the noise. A long
    recording counts as so many minutes: through all of it a crane that does not leak would run into a stop where one that leaks
    does not. Their energies add up.
    """
    _, pose, specimen, draws = _crane(fleet, file, machine)
    fate, size = fleet.fate(machine), fleet.size(machine, number)
    if fate is None or size <= 0.0:
        return 0.0
    m, table, hidden = quantities(specimen, pose), linkage(specimen), _hidden(specimen, pose, fate, size, draws)
    minutes, ratios = max(1, round(fleet.seconds / 60.0)), []
    for rng in fleet.attempts(machine, number):
        for _ in range(minutes - len(ratios)):
            try:
                setting = _at_work(specimen, pose, hidden, fleet.seconds / minutes, rng)
                measure = Detectability(setting, rng)
                d, _ = measure.separation(outputs(m, table, setting, hidden), fate.twins)
            except RunError:
                break
            ratios.append(d / measure.detectable)
        if len(ratios) == minutes:
            return float(np.linalg.norm(ratios))
    raise RuntimeError(f"crane {machine}, recording {number}: no setting within {ATTEMPTS} attempts")


def _crane(fleet: Fleet, file: Path, machine: int) -> tuple[MachineFile, Posture, MachineFile, Array]:
    """Book, pose, specimen and draws of a crane's effects."""
    own = np.random.default_rng([fleet.seed, 1, machine])
    book = MachineFile.read(file)
    pose = Posture(*POSES[int(own.integers(len(POSES)))], 0.0)
    draws = own.uniform(size=5)
    return book, pose, book.specimen(scattered(book, pose, own, SCATTER)), draws


def _start(rng: np.random.Generator) -> InitialValues:
    return InitialValues(float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.6e6, 1.6e6)))


def _recorded(
    name: str, specimen: MachineFile, pose: Posture, fate: Fate | None, size: float, draws: Array, seconds: float,
    rng: np.random.Generator,
) -> Recording:  # fmt: skip
    hidden = _hidden(specimen, pose, fate, size, draws)
    setting = _at_work(specimen, pose, hidden, seconds, rng)
    shown = outputs(quantities(specimen, pose), linkage(specimen), setting, hidden)
    configuration = Configuration(name, pose.outer_boom_angle, pose.telescope_length, 0.0)
    return record("recording", shown, per_millisecond(setting.currents), configuration, Bus(), rng)


def _at_work(
    specimen: MachineFile, pose: Posture, hidden: Hidden, seconds: float, rng: np.random.Generator
) -> DetectionSetting:
    """The operator looks at the crane as it has become: a boom that sinks would reach a stop within ten minutes."""
    m, table = quantities(specimen, pose)._replace(**dict(hidden.changes)), linkage(specimen)
    start = _start(rng)
    operator, angle, pieces, starts = Operator(m, table, rng), start.angle, [], []
    count = max(1, round(seconds / PIECE))
    piece = seconds / count
    most = count + max(ATTEMPTS, 4 * (count - 20))  # of an hour many a piece would end at a stop
    for _ in range(most):
        try:
            currents, begins = operator.drive(piece, angle)
            end = run(m, table, InitialValues(angle, start.rod_pressure), per_millisecond(currents), steps=2)["angle"][
                -1
            ]
        except RunError:  # he would have hit a stop: he drives another way
            continue
        starts.append(begins + len(pieces) * piece)
        pieces.append(currents)
        angle = float(end)
        if len(pieces) == count:
            break
    else:
        raise RunError(f"no {seconds:g} s of work within {most} attempts")
    return DetectionSetting(specimen, pose, start, np.concatenate(pieces), np.concatenate(starts))


def _hidden(specimen: MachineFile, pose: Posture, fate: Fate | None, size: float, draws: Array) -> Hidden:
    if fate is None or size <= 0.0:
        return Hidden()
    m = quantities(specimen, pose)
    if fate.effect == "friction":
        changes: Mapping[str, float] = {
            name: getattr(m, name) * (1.0 + size) for name in ("coulomb_up", "coulomb_down")
        }
        return Hidden(changes)
    unseen = Scene(m, 0.0, 0.0, 0.0, np.empty(0), 0.0, 0.0)  # no fate goes by what a recording shows
    return CONCEALMENTS[fate.effect].build(size, np.array([0.3, 0.3, *draws[2:]]), unseen)


def _dated(recording: Recording, begin_ns: int) -> Recording:
    """The recording with stamps of its day."""
    moved = begin_ns - recording.start_ns
    signals = {n: replace(s, stamps_ns=s.stamps_ns + moved) for n, s in recording.signals.items()}
    return replace(recording, start_ns=begin_ns, signals=signals)
