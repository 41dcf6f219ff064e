"""Opens a case: turns answer, diagnosis and sealed recording into one row of the score."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from boom_estimation.free_run import predict
from boom_input.whole import write_whole
from boom_model.catalogue import beginning
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.sensors import OUTPUTS
from boom_recording.loading import load
from boom_trials.blind.outcomes import Row, Said, Truth
from boom_trials.blind.plants import MACHINE
from boom_trials.blind.scoring import OWN_STAGES
from concealed_plant.generator import HOLD_OUT

OUTCOME, DIAGNOSIS = "outcome.json", "diagnosis"
ROW = "row.json"
PREDICTED = 0.99
"""Least share of the samples that a complete run predicts."""


@dataclass(frozen=True)
class Trace:
    """One channel of the sealed recording for a picture: time [s], measured, nominal and explained values [SI]."""

    name: str
    time: tuple[float, ...]
    lines: Mapping[str, tuple[float, ...]]


def judge(case: str, blind: Path, sealed: Path, machine: str) -> dict[str, Any]:
    """The row of a case as a JSON document, kept in sealed/CASE/row.json so that it is computed once."""
    kept = sealed / case / ROW
    if kept.exists():
        return dict(json.loads(kept.read_text(encoding="utf-8")))
    answer = json.loads((sealed / case / "answer.json").read_text(encoding="utf-8"))
    outcome = json.loads((blind / case / OUTCOME).read_text(encoding="utf-8"))
    document, failure = None, outcome["failure"]
    if not failure:
        try:
            document = json.loads((blind / case / DIAGNOSIS / "diagnosis.json").read_text(encoding="utf-8"))
            Said.from_document(document)
        except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
            document, failure = None, f"diagnosis.json is not like the contract: {error!r}"
    nominal = _believed(blind / case, machine)
    row = {
        "answer": answer,
        "said": document,
        "failure": failure,
        "seconds": outcome["seconds"],
        "nominal": _errors(sealed / case / HOLD_OUT, nominal),
        "explained": _errors(
            sealed / case / HOLD_OUT, _explained(blind / case, answer, nominal) if document else nominal
        ),
    }
    write_whole(kept, json.dumps(row))
    return row


def row_of(document: Mapping[str, Any]) -> Row:
    """The row of a document of ``judge``."""
    said = Said("", failure=document["failure"] or "no answer")
    if document["said"] is not None:
        said = Said.from_document(document["said"])
    nominal, explained = (
        tuple(math.inf if e is None else float(e) for e in document[key]) for key in ("nominal", "explained")
    )
    fit = (document["said"] or {}).get("fit", {}).get("held_out", {})
    own = {stage: tuple(math.inf if e is None else float(e) for e in fit.get(stage) or ()) for stage in OWN_STAGES}
    return Row(Truth.from_document(document["answer"]), said, nominal, explained, float(document["seconds"]), own)


def traces(case: str, blind: Path, sealed: Path, machine: str, points: int = 600) -> list[Trace]:
    """The sealed recording beside the nominal and the explained model, thinned for a picture."""
    recording = load(sealed / case / HOLD_OUT)
    answer = json.loads((sealed / case / "answer.json").read_text(encoding="utf-8"))
    nominal = _believed(blind / case, machine)
    runs = {"nominal": predict(recording, nominal, "full").values}
    explained = _explained(blind / case, answer, nominal)
    if explained is not None:
        with contextlib.suppress(MachineError):
            runs["explained"] = predict(recording, explained, "full").values
    result = []
    for name in OUTPUTS:
        signal = recording.signals[name]
        step = max(1, len(signal.time) // points)
        lines = {"measured": signal.values} | {label: values[name] for label, values in runs.items()}
        result.append(
            Trace(name, _floats(signal.time[::step]), {label: _floats(v[::step]) for label, v in lines.items()})
        )
    return result


def _believed(case: Path, machine: str) -> Machine:
    """The owner's machine: the case's own, or the trial's."""
    own = case / MACHINE
    return load_machine(str(own) if own.exists() else machine)


def _floats(values: Any) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _explained(case: Path, answer: Mapping[str, Any], nominal: Machine) -> Machine | None:
    """The machine that the diagnosis wrote, the nominal one if it wrote none, None if it is not one.

    A load is grasped at a different time in every recording: like the oracle, the machine is told when.
    """
    path = case / DIAGNOSIS / "machine.yaml"
    if not path.exists():
        return nominal
    try:
        machine = load_machine(str(path))
        onsets = [e["hold_out_onset_s"] for e in answer["effects"] if e["hold_out_onset_s"] is not None]
        if onsets:
            effects = beginning(machine.effects, onsets[0])
            machine = machine if effects == machine.effects else machine.with_effects(effects)
    except MachineError:
        return None
    return machine


def _errors(bag: Path, machine: Machine | None) -> list[float | None]:
    """Normalised rms error per channel of a machine's free run; None if it stopped early or could not run."""
    recording = load(bag)
    if machine is None:
        return [None] * len(OUTPUTS)
    try:
        prediction = predict(recording, machine, "full")
    except MachineError:
        return [None] * len(OUTPUTS)
    result: list[float | None] = []
    for name in OUTPUTS:
        signal = recording.signals[name]
        error = (prediction.values[name] - signal.values)[signal.valid]
        predicted = np.isfinite(error)  # a sample before the first current, or behind the last one, is not
        spread = float(np.std(signal.values[signal.valid]))
        whole = predicted.mean() > PREDICTED and not prediction.stopped
        result.append(float(np.sqrt(np.mean(error[predicted] ** 2))) / spread if whole and spread > 0 else None)
    return result
