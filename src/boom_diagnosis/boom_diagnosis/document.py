"""What a diagnosis says: ``diagnosis.json`` (contract), and beside it the arrays that the report draws.

:class:`Document` is the machine-readable answer. :class:`DiagnosisResult` holds it together with series, maps and tables.
SI units; times in seconds since the start of the recording; channels in the order of ``OUTPUTS``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from boom_checks.check import RecordingCheck
from boom_checks.doubts import FirstLook
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Event, Recording

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

Verdict = Literal[
    "identified", "ambiguous", "unknown_physics", "parameters_only", "sensor_or_clock", "no_mismatch", "not_enough_excitation"
]  # fmt: skip
SUBSYSTEMS = (
    "load", "structure", "friction", "cylinder", "oil", "accumulators", "hose_burst_valve", "main_valve", "pilot_valves",
    "supply", "return_line", "sensors",
)  # fmt: skip
STAGES = ("nominal", "parameters_only", "explained")


# ------------------------------------------------------------------------------------------------------ diagnosis.json


@dataclass(frozen=True)
class Estimate:
    """A number with its 90 % interval [unit]."""

    value: float
    unit: str
    interval_90: tuple[float, float]

    def document(self) -> dict[str, Any]:
        """As in ``diagnosis.json``."""
        return {"value": self.value, "unit": self.unit, "interval_90": list(self.interval_90)}


@dataclass(frozen=True)
class Alternative:
    """What else the finding could be; effect None: unmodelled physics."""

    effect: str | None
    confidence: float


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong; ``effect`` None where the catalogue has no name for it.

    Attributes:
        parameters: of the effect (or machine-file keys with dots for parameters outside their tolerance).
        regime: when it shows, in words.
        intervals_s: (start, end) [s] in the first recording given, where it shows most.
        evidence: one sentence for an engineer.
        like: id of the catalogue's term that acts as it does, where that is no part of the crane; ``machine.yaml`` has it.
    """

    effect: str | None
    subsystem: str
    equation: str
    confidence: float
    parameters: Mapping[str, Estimate]
    regime: str
    intervals_s: tuple[tuple[float, float], ...]
    alternatives: tuple[Alternative, ...]
    evidence: str
    like: str = ""

    def document(self) -> dict[str, Any]:
        """As in ``diagnosis.json``."""
        return {
            "effect": self.effect,
            "subsystem": self.subsystem,
            "equation": self.equation,
            "confidence": self.confidence,
            "parameters": {name: p.document() for name, p in self.parameters.items()},
            "regime": self.regime,
            "intervals_s": [list(pair) for pair in self.intervals_s],
            "alternatives": [{"effect": a.effect, "confidence": a.confidence} for a in self.alternatives],
            "evidence": self.evidence,
            **({"like": self.like} if self.like else {}),
        }


@dataclass(frozen=True)
class Fit:
    """Normalised rms errors of free runs, one per channel (rms error / standard deviation of the measured channel).

    Median over the bags. ``training``, ``held_out``: stage -> one number per channel; NaN where runs end early. ``far``: blocks
    of long recordings in which the explained machine errs far more than noise does. The last two: see ``open_numbers.py``.
    """

    training: Mapping[str, tuple[float, ...]]
    held_out: Mapping[str, tuple[float, ...]]
    noise_floor: tuple[float, ...]
    held_out_bags: tuple[str, ...]
    far: tuple[str, ...] = ()
    open_numbers: tuple[float, ...] = ()
    all_fitted: tuple[float, ...] = ()

    def document(self) -> dict[str, Any]:
        """As in ``diagnosis.json``."""
        return {
            "channels": list(OUTPUTS),
            "training": {stage: list(self.training[stage]) for stage in STAGES if stage in self.training},
            "held_out": {
                "bags": list(self.held_out_bags),
                **{stage: list(self.held_out[stage]) for stage in STAGES if stage in self.held_out},
                "noise_floor": list(self.noise_floor),
                **{name: list(said) for name in ("open_numbers", "all_fitted") if (said := getattr(self, name))},
            },
        }


@dataclass(frozen=True)
class RankingRow:
    """One hypothesis of the ranking, the best first.

    Attributes:
        kind: none, sensors, parameters, effect, unknown.
        gain: what the hypothesis gains in log-likelihood over "parameters within tolerance", on data used for fitting;
            ``held_out_gain``: on data not used. [nats]
        inside: False where the estimate lies outside the plausible range of the catalogue.
    """

    label: str
    effect: str | None
    kind: Literal["none", "sensors", "parameters", "effect", "unknown"]
    subsystem: str
    probability: float
    gain: float
    held_out_gain: float
    parameters: Mapping[str, Estimate]
    inside: bool = True
    note: str = ""

    def document(self) -> dict[str, Any]:
        """As in ``diagnosis.json``."""
        return {
            "hypothesis": self.label,
            "effect": self.effect,
            "kind": self.kind,
            "probability": self.probability,
            "gain_nats": self.gain,
            "held_out_gain_nats": self.held_out_gain,
            "parameters": {name: p.document() for name, p in self.parameters.items()},
        }


@dataclass(frozen=True)
class HypothesisRow:
    """One hypothesis that was weighed.

    Attributes:
        effects: ids. unknown: places of unknown physics.
        cost: what its numbers cost the evidence [nats]. log_likelihood, log_prior: [nats], the latter against nothing.
    """

    effects: tuple[str, ...]
    unknown: tuple[str, ...]
    log_likelihood: float
    cost: float
    log_prior: float
    posterior: float

    def document(self) -> dict[str, Any]:
        """As in ``diagnosis.json``."""
        return {
            "effects": list(self.effects),
            "unknown": list(self.unknown),
            "log_likelihood": self.log_likelihood,
            "cost": self.cost,
            "log_prior": self.log_prior,
            "posterior": self.posterior,
        }


@dataclass(frozen=True)
class Document:
    """``diagnosis.json``: every probability that terminal and report show is one of these.

    ranking: what the first finding could be, the likeliest first.
    checks: name of a recording and what is doubtful about it before any physics.
    hypotheses: all that were weighed, the likeliest first; their posteriors sum to one.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    subsystems: Mapping[str, float]
    fit: Fit
    next_experiment: str
    seed: int
    inputs_sha256: Mapping[str, str]
    version: str
    ranking: tuple[RankingRow, ...] = ()
    checks: tuple[tuple[str, RecordingCheck], ...] = ()
    hypotheses: tuple[HypothesisRow, ...] = ()

    @property
    def spoilt(self) -> tuple[str, RecordingCheck] | None:
        """The recording, and what has to be repaired in it before any physics can be named."""
        return next(((name, check) for name, check in self.checks if check.spoils), None)

    def document(self) -> dict[str, Any]:
        """As in the contract; numbers that are not finite become null (JSON knows no NaN)."""
        result = {
            "verdict": self.verdict,
            "checks": [{"bag": name, **check.document()} for name, check in self.checks],
            "findings": [finding.document() for finding in self.findings],
            "ranking": [row.document() for row in self.ranking],
            "hypotheses": [row.document() for row in self.hypotheses],
            "subsystems": {name: self.subsystems.get(name, 0.0) for name in SUBSYSTEMS},
            "fit": self.fit.document(),
            "next_experiment": self.next_experiment,
            "seed": self.seed,
            "inputs_sha256": dict(self.inputs_sha256),
            "version": self.version,
        }
        return {key: _finite(value) for key, value in result.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# ----------------------------------------------------------------------------------------------- what the report draws


@dataclass(frozen=True)
class ChannelFit:
    """One measured channel of a recording and what the models said about it.

    Attributes:
        time: (n,) [s]. measured: (n,) [SI]. valid: (n,), False = not to be used.
        noise: standard deviation of sensor noise and quantisation [SI].
        stages: nominal, parameters_only, explained -> (n,) free run [SI], NaN where there is none.
    """

    name: str
    unit: str
    time: Array
    measured: Array
    valid: Flags
    noise: float
    stages: Mapping[str, Array]


@dataclass(frozen=True)
class BagResult:
    """One recording.

    Attributes:
        held_out: True where nothing was fitted to it; ``held_out_from`` [s]: from there on, if only its end was held out
            (None: all or nothing of it).
        channels: by name, in the order of ``boom_input.channels.SENSORS``; those that the model does not predict have no stages.
        windows: (start, end) [s] in which the nominal model differs from the recording by more than noise.
        equations: equation key -> (n,) smoothed unknown input over ``time``, in units of its own 1-sigma.
        time: (n,) [s] of ``equations`` and ``regime``.
        regime: (n,) index into DiagnosisResult.regimes, -1 where nothing was measured.
    """

    name: str
    held_out: bool
    held_out_from: float | None
    duration: float
    events: tuple[Event, ...]
    channels: Mapping[str, ChannelFit]
    windows: tuple[tuple[float, float], ...]
    time: Array
    equations: Mapping[str, Array]
    regime: NDArray[np.int64]


@dataclass(frozen=True)
class Regime:
    """One cell of the map over regimes: what the boom did, for how long, how large the mismatch is there.

    mismatch: channel -> mean squared innovation of the nominal model over that of a healthy machine (1 = noise).
    """

    label: str
    direction: Literal["rest", "extending", "retracting"]
    detail: str
    seconds: float
    mismatch: Mapping[str, float]
    explained: Mapping[str, float]


@dataclass(frozen=True)
class EquationEvidence:
    """How much an equation is in doubt, in two independent ways; both are shares that sum to one over the equations.

    Attributes:
        key: torque, head_flow, hose_flow, rod_flow, spool, piston, sensors.
        equation: number in the thesis. subsystems: those whose effects act there.
        statistical: share of the likelihood gained by an unknown input there.
        chain: share of the mismatch that appears at this link when it is driven by measured signals.
    """

    key: str
    title: str
    equation: str
    subsystems: tuple[str, ...]
    statistical: float
    chain: float


@dataclass(frozen=True)
class LadderStep:
    """A model of the ladder nominal -> parameters -> + effect 1 -> ...; errors as in ``fit``, one per channel."""

    label: str
    training: tuple[float, ...]
    held_out: tuple[float, ...]


@dataclass(frozen=True)
class LearnedCurve:
    """A term learnt from data: over its main variable, others at their median. SI.

    formula: what goes into the machine file. reading: what its shape suggests, in words.
    """

    equation: str
    formula: str
    reading: str
    variable: str
    variable_unit: str
    value_unit: str
    x: Array
    y: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Experiment:
    """A proposed recording: currents (n, 2) [A] at ``time`` (n,) [s], and the pairs of hypotheses it would separate.

    expected: (n, NY) what the likeliest hypothesis would measure [SI].
    separation: (hypothesis, hypothesis, standard deviations apart now, standard deviations apart then).
    """

    text: str
    time: Array
    currents: Array
    expected: Array
    separation: tuple[tuple[str, str, float, float], ...]


@dataclass(frozen=True)
class DiagnosisResult:
    """All that the report shows.

    Attributes:
        machine: as given. explained: with what was found (what goes to machine.yaml).
        agreement: whether both ways of locating agree, in words.
        remaining: what stays unexplained, in words; empty where nothing does.
        tolerances_used: machine-file key -> estimate, of parameters that moved within their tolerance.
        notes: what the reader must know (masked samples, an unknown load, ...). command: the command line.
        wrong: keys of a number that is wrong in the machine file and of those wrong by its factor. or_wrong: others in its place.
        looks: what each recording says before any model. searched: recordings of ``bags`` if they are stretches of long ones.
    """

    document: Document
    machine: Machine
    explained: Machine
    bags: tuple[BagResult, ...]
    regimes: tuple[Regime, ...]
    equations: tuple[EquationEvidence, ...]
    agreement: str
    ladder: tuple[LadderStep, ...]
    learned: tuple[LearnedCurve, ...]
    remaining: str
    tolerances_used: Mapping[str, Estimate] = field(default_factory=dict)
    experiment: Experiment | None = None
    notes: tuple[str, ...] = ()
    command: str = ""
    wrong: tuple[str, ...] = ()
    or_wrong: tuple[str, ...] = ()
    looks: tuple[FirstLook, ...] = ()
    searched: tuple[Recording, ...] = ()
