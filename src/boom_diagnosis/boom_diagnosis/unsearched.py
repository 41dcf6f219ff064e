"""Answers to recordings in which nothing was searched, and what every answer says about its own making."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp

from boom_checks.check import RecordingCheck
from boom_diagnosis.assumptions import MOST_CERTAIN
from boom_diagnosis.document import SUBSYSTEMS, DiagnosisResult, Document, Estimate, Finding, Fit, Verdict
from boom_diagnosis.freerun import UNKNOWN
from boom_model.catalogue import CATALOGUE
from boom_model.machine import Machine
from boom_recording.recording import Recording

_ASKEW = next(effect for effect in CATALOGUE if set(effect.terms) == {"measured_angle"})


@dataclass(frozen=True)
class About:
    """What the document says about its own making."""

    seed: int
    version: str
    inputs_sha256: dict[str, str]
    command: str


def not_enough_excitation(
    recordings: Sequence[Recording], machine: Machine, about: About, why: Mapping[str, str]
) -> DiagnosisResult:
    """The answer to recordings that tell nothing; why: name of each -> why not, in words."""
    text = (
        "Record at least 45 s of joystick work: full and half current in both directions, reversals, stops, "
        "and 1 s of rest at the beginning."
    )
    document = _document("not_enough_excitation", dict.fromkeys(SUBSYSTEMS, 0.0), text, about)
    notes = tuple(f"{r.name}: {why[r.name]}" for r in recordings)
    notes += tuple(f"{r.name}: {said}" for r in recordings for said in r.warnings)
    return DiagnosisResult(
        document, machine, machine, (), (), (), "", (), (), "Nothing can be told from these recordings.",
        notes=notes, command=about.command,
    )  # fmt: skip


def spoilt(machine: Machine, about: About, checks: Sequence[RecordingCheck]) -> DiagnosisResult:
    """The answer to recordings of which one has to be repaired first; its checks say what, and which sensor slipped."""
    text = (
        "Put the recording right (signs, units and channels by a mapping of ./boom import) and diagnose it again: what is "
        "named before would explain the fault, not the machine. If all recordings of a crane say so, it may be the machine file: "
        "see what its masses and angles mean by ./boom check-machine."
    )
    subsystems = dict.fromkeys(SUBSYSTEMS, 0.0) | {"sensors": MOST_CERTAIN}
    slipped = tuple(_slipped(check) for check in checks if check.kind == "jump")
    document = _document("sensor_or_clock", subsystems, text, about, slipped)
    return DiagnosisResult(
        document, machine, machine, (), (), (), "", (), (), "No model was run: the recording comes first.", command=about.command,
    )  # fmt: skip


def _slipped(check: RecordingCheck) -> Finding:
    """An angle that jumps is askew from there on; no model says so, and none is asked."""
    number, jump = _ASKEW.parameters[0], check.measure
    return Finding(
        _ASKEW.id, _ASKEW.subsystem, _ASKEW.equation, min(MOST_CERTAIN, 1.0 / (1.0 + exp(-check.log_odds))),
        {number.name: Estimate(jump.value, number.unit, jump.interval_90)}, f"after {check.intervals_s[0][1]:.2f} s",
        check.intervals_s, (), check.sentence,
    )  # fmt: skip


def _document(
    verdict: Verdict, subsystems: Mapping[str, float], text: str, about: About, findings: tuple[Finding, ...] = ()
) -> Document:
    """Without free runs; ``text``: what to do next."""
    fit = Fit({}, {}, UNKNOWN, ())
    return Document(verdict, findings, dict(subsystems), fit, text, about.seed, about.inputs_sha256, about.version)
