"""Makes a case: a recording for the blind side, and for the sealed side the answer and a second recording of the same crane.

The second recording is never shown to a diagnosis: models are judged on it. The error of the oracle, a free run of the true plant
on the second recording's measured currents, is stored with it; no model can be better.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_input.whole import write_whole
from boom_recording import writing
from boom_recording.recording import Configuration, Recording
from concealed_plant.cases import CaseSpec, pair
from concealed_plant.concealments import CONCEALMENTS
from concealed_plant.detectability import (
    Detectability,
    DetectionSetting,
    Sized,
    TooFaintError,
    outputs,
    scene,
    together,
)
from concealed_plant.hidden import Hidden
from concealed_plant.machine import (
    DEVIATIONS_IN_TOLERANCE,
    DRAWN,
    MachineFile,
    Posture,
    linkage,
    load_deviation,
    quantities,
    scattered,
)
from concealed_plant.operator import Operator
from concealed_plant.plant import InitialValues, RunError, per_millisecond, run
from concealed_plant.sensing import SEEN, Bus, record

Array = NDArray[np.float64]

DURATION = 60.0
SCATTER = 0.5
"""Standard deviations by which every number of every crane differs from the machine file."""
ATTEMPTS = 400
"""Largest number of attempts; most failures take a tenth of a second, and operators at the end of stroke often leave the range."""
PAIR_ATTEMPTS = 50
"""Attempts with a pair before another one is drawn: a spring that is off by half keeps most booms from reaching the cushion."""
RECORDING, HOLD_OUT, ANSWER = "recording", "hold_out", "answer.json"
_POSES = ((4.59, 0.0), (0.28, 2.2), (0.28, 2.8))
# Numbers that are an effect of the catalogue when they are far off: wrong by no more than their tolerance.
_TWINS = (
    "accumulators.p_g0_1", "accumulators.p_g0_2", "accumulators.d_1", "accumulators.d_2", "main_valve_spool.k", "pilot_valves.h.0",
    "main_valve_orifices.x0", "pilot_valves.a1_s", "hose_burst_valve.a30", "hose_burst_valve.a31", "hose_burst_valve.a21",
    "rigid_body.moment",
)  # fmt: skip


class GenerationError(RuntimeError):
    """A case could not be made in the allowed attempts."""

    exit_status = 2


@dataclass(frozen=True)
class TrueEffect:
    """A concealed effect. strength: requested multiple of the detectability; detectable: the size at 1 x; size [unit].

    onset_s, hold_out_onset_s: when it begins in the recording and in the second one [s], None if it acts throughout.
    """

    effect: str
    known: bool
    subsystems: tuple[str, ...]
    strength: float
    detectable: float | None
    size: float
    unit: str
    parameters: dict[str, float]
    onset_s: float | None
    hold_out_onset_s: float | None


@dataclass(frozen=True)
class Answer:
    """The sealed side of a case.

    Attributes:
        name, kind: of the case.
        effects: what is concealed, none for healthy machines.
        wrong: keys of the machine file -> standard deviations by which they are off, beyond the scatter of every crane.
        oracle: normalised rms error of the true plant on the second recording, per channel; None where it stood still.
        pose: q3 [rad], q4 [m], configured load [kg].
    """

    name: str
    kind: str
    effects: tuple[TrueEffect, ...]
    wrong: dict[str, float]
    oracle: tuple[float | None, ...]
    pose: tuple[float, float, float]
    attempts: int = 1

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self)


@dataclass
class _Crane:
    """A specimen in a pose, and how it was drawn."""

    specimen: MachineFile
    told: Posture
    true: Posture
    wrong: dict[str, float] = field(default_factory=dict)


def make_case(spec: CaseSpec, machine: str | Path, blind: Path, sealed: Path) -> Path:
    """Writes blind/NAME/recording, sealed/NAME/hold_out and sealed/NAME/answer.json; returns the answer's path.

    An existing case is left unchanged. The same ``spec`` gives the same files.

    Raises:
        GenerationError: no recording could be made in ``ATTEMPTS`` attempts.
        MachineFileError: the machine file lacks a number.
    """
    answer = sealed / spec.name / ANSWER
    if answer.exists():
        return answer
    for folder in (blind / spec.name, sealed / spec.name):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    file = MachineFile.read(machine)
    reason = ""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([*spec.seed, attempt])
        try:
            truth, first, second = _attempt(_drawn(spec, attempt), file, rng, attempt)
        except (RunError, TooFaintError) as error:
            reason = str(error)
            continue
        writing.write(blind / spec.name / RECORDING, first)
        writing.write(sealed / spec.name / HOLD_OUT, second)
        write_whole(answer, json.dumps(truth.document(), indent=1, sort_keys=True) + "\n")
        return answer
    raise GenerationError(f"case {spec.name} ({spec.kind}) could not be made in {ATTEMPTS} attempts: {reason}")


def _drawn(spec: CaseSpec, attempt: int) -> CaseSpec:
    """The case, or another one for a pair that no crane shows after ``PAIR_ATTEMPTS`` attempts."""
    turn = attempt // PAIR_ATTEMPTS
    if spec.kind != "pair" or turn == 0:
        return spec
    return replace(spec, effects=pair(np.random.default_rng([*spec.seed, ATTEMPTS + turn])))


def _attempt(
    spec: CaseSpec, file: MachineFile, rng: np.random.Generator, attempt: int
) -> tuple[Answer, Recording, Recording]:
    crane = _crane(spec, file, rng)
    manner = _manner(spec)
    setting = _at_work(crane, rng, manner, _halfway(spec))
    detectability = Detectability(setting, rng)
    rows = [(CONCEALMENTS[name], strength, rng.uniform(size=5)) for name, strength in spec.effects]
    sized: list[Sized] = []
    for row, strength, draws in rows:
        if spec.kind == "idle":
            sized.append(_unseen(detectability, row.build, (row.smallest * row.largest) ** 0.5, draws))
        else:
            sized.append(detectability.size_for(row, draws, strength))
    hidden = together([each.hidden for each in sized])
    shown = detectability.seen(hidden)
    if spec.kind == "pair":
        for (row, _, _), other in zip(rows, reversed(sized), strict=True):
            if detectability.beside(shown, other.outputs, row.twins) < detectability.detectable:
                raise TooFaintError(f"{row.id} is not seen beside the other")
    bus = Bus(loss=float(rng.choice([0.0, 0.002, 0.01])))
    configuration = Configuration(file.name, crane.told.outer_boom_angle, crane.told.telescope_length, crane.told.load)
    first = record("recording", shown, per_millisecond(setting.currents), configuration, bus, rng)
    second, oracle, onset = _second(crane, manner, rows, sized, hidden, configuration, bus, rng)
    effects = tuple(
        TrueEffect(
            row.id, row.known, row.subsystems, strength, each.detectable, each.size, row.unit, dict(each.hidden.parameters),
            each.hidden.onset, None if each.hidden.onset is None else onset,
        )
        for (row, strength, _), each in zip(rows, sized, strict=True)
    )  # fmt: skip
    pose = (crane.told.outer_boom_angle, crane.told.telescope_length, crane.told.load)
    answer = Answer(spec.name, spec.kind, effects, crane.wrong, oracle, pose, attempts=attempt + 1)
    return answer, first, second


def _unseen(detectability: Detectability, build: Any, size: float, draws: Array) -> Sized:
    """An effect of medium size in a recording that is not meant to show it."""
    hidden = build(size, draws, detectability.scene)
    changed = detectability.seen(hidden)
    return Sized(size, None, hidden, changed)


def _manner(spec: CaseSpec) -> str:
    if spec.kind == "idle":
        return "idle"
    return next((CONCEALMENTS[name].manner for name, _ in spec.effects if CONCEALMENTS[name].manner), "")


def _crane(spec: CaseSpec, file: MachineFile, rng: np.random.Generator) -> _Crane:
    """A specimen in a pose that suits the case."""
    names = [name for name, _ in spec.effects]
    if any(CONCEALMENTS[name].stretched for name in names) or rng.uniform() < 0.5:
        q3, q4 = _POSES[int(rng.integers(1, 3))]
    elif rng.uniform() < 0.5:
        q3, q4 = _POSES[0]
    else:
        q3, q4 = float(rng.uniform(0.1, 1.5)), float(rng.uniform(0.5, 3.0))
    load = float(np.round(rng.uniform(100.0, 350.0))) if rng.uniform() < 0.25 and q4 > 0 else 0.0
    told = Posture(q3, q4, load)
    off = load_deviation(load) * SCATTER * rng.standard_normal() if load else 0.0
    own = {key for name in names for key in CONCEALMENTS[name].twins}  # off by what is concealed and nothing else
    scatter = scattered(file, told, rng, SCATTER)
    wrong = _wrong(rng) if spec.kind == "parameters" else {}
    # what is concealed is off by that and nothing else, and a number that is wrong by so much is no further off
    specimen = file.specimen({key: f for key, f in scatter.items() if key not in own and key not in wrong})
    factors = {
        key: 1.0 + deviations * file.tolerance(key, told) / DEVIATIONS_IN_TOLERANCE for key, deviations in wrong.items()
    }
    return _Crane(specimen.specimen(factors), told, Posture(q3, q4, load + off), wrong)


def _wrong(rng: np.random.Generator) -> dict[str, float]:
    """One to three keys and by how many standard deviations they are off."""
    chosen = rng.choice(len(DRAWN), size=int(rng.integers(1, 4)), replace=False)
    result = {}
    for key in (DRAWN[int(k)] for k in chosen):
        if key.startswith("kinematics."):
            continue  # the linkage was measured; a crane whose bars are of other lengths is another crane
        most = DEVIATIONS_IN_TOLERANCE if key in _TWINS else 4.0
        result[key] = float(rng.uniform(1.0, most)) * (1.0 if rng.uniform() < 0.5 else -1.0)
    return result or {"friction.tau_C_pos": float(rng.uniform(1.0, 4.0))}


def _halfway(spec: CaseSpec) -> dict[str, float]:
    """The machine that the operator of the first recording drives: half of an effect that changes every motion, else healthy.

    The undisturbed and the affected crane both run on these currents; driving a machine in between keeps both in range.
    """
    rows = ((CONCEALMENTS[name], strength) for name, strength in spec.effects)
    return {row.met: 1.0 + 0.75 * row.tolerance * strength for row, strength in rows if row.met}


def _at_work(crane: _Crane, rng: np.random.Generator, manner: str, changes: Mapping[str, float]) -> DetectionSetting:
    """The crane driven by an operator as if it had ``changes``. Raises RunError."""
    m, table = quantities(crane.specimen, crane.true), linkage(crane.specimen)
    start = InitialValues(
        float(rng.uniform(1.0, 1.3) if manner == "ends" else rng.uniform(0.25, 0.7)), float(rng.uniform(0.6e6, 1.6e6))
    )
    currents, starts = Operator(m._replace(**dict(changes)), table, rng).drive(DURATION, start.angle, manner)
    return DetectionSetting(crane.specimen, crane.true, start, currents, starts)


def _second(
    crane: _Crane, manner: str, rows: list[Any], sized: list[Sized], hidden: Hidden, configuration: Configuration, bus: Bus,
    rng: np.random.Generator,
) -> tuple[Recording, tuple[float | None, ...], float | None]:  # fmt: skip
    """The same crane with the same physics at other work, with as many operators as needed; events in time are drawn anew.

    With the oracle's error, and the time at which the physics begins there. Raises RunError if none stays in range.
    """
    left = ATTEMPTS
    while True:
        try:
            setting = _at_work(crane, rng, manner, hidden.changes)
            return _recorded_again(setting, rows, sized, hidden, configuration, bus, rng)
        except RunError:
            left -= 1
            if left == 0:
                raise


def _recorded_again(
    setting: DetectionSetting, rows: list[Any], sized: list[Sized], hidden: Hidden, configuration: Configuration, bus: Bus,
    rng: np.random.Generator,
) -> tuple[Recording, tuple[float | None, ...], float | None]:  # fmt: skip
    table, m = linkage(setting.specimen), quantities(setting.specimen, setting.pose)
    there = scene(m, setting, run(m, table, setting.start, per_millisecond(setting.currents)))
    laid = together([row.build(each.size, draws, there) for (row, _, draws), each in zip(rows, sized, strict=True)])
    same = Hidden(hidden.changes, laid.courses, hidden.sensing, laid.late)
    shown = outputs(m, table, setting, same)
    recording = record(HOLD_OUT, shown, per_millisecond(setting.currents), configuration, bus, rng)
    measured = DetectionSetting(setting.specimen, setting.pose, setting.start, _as_measured(recording), setting.starts)
    return recording, _errors(outputs(m, table, measured, same), recording), laid.onset


def _as_measured(recording: Recording) -> Array:
    """Measured currents (k, 2) of every 10 ms; a lost sample repeats the previous one."""
    count = round(DURATION * 100)
    columns = []
    for name in ("retract_current", "extend_current"):
        signal = recording.signals[name]
        last = np.searchsorted(signal.time, np.arange(count) / 100.0 + 0.005) - 1
        columns.append(signal.values[np.maximum(last, 0)])
    return np.stack(columns, axis=-1)


def _errors(predicted: Array, recording: Recording) -> tuple[float | None, ...]:
    """Normalised rms error per channel: rms(predicted - measured) / standard deviation of the measured; None: it stood still."""
    result: list[float | None] = []
    for k, name in enumerate(SEEN):
        signal = recording.signals[name]
        at = np.interp(signal.time, np.arange(1, len(predicted) + 1) / 1000.0, predicted[:, k])
        spread = float(np.std(signal.values))
        result.append(float(np.sqrt(np.mean((at - signal.values) ** 2))) / spread if spread > 0.0 else None)
    return tuple(result)
