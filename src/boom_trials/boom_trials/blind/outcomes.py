"""Data for the score: the truth of a case, the answer of the diagnosis, and the errors of its model on the sealed recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, isfinite, log
from typing import Any

from boom_model.catalogue import EFFECTS

NAMING = ("identified", "ambiguous", "sensor_or_clock", "unknown_physics")
"""Verdicts that blame something beyond the machine's numbers within tolerance."""


@dataclass(frozen=True)
class ConcealedEffect:
    """One concealed effect; strength in multiples of its detectability. See ``concealed_plant.generator``."""

    effect: str
    known: bool
    subsystems: tuple[str, ...]
    strength: float
    size: float = 0.0
    unit: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    onset_s: float | None = None
    detectable: float | None = None


@dataclass(frozen=True)
class Truth:
    """The sealed answer of a case. oracle: normalised rms error of the true plant on the sealed recording, per channel."""

    name: str
    kind: str
    effects: tuple[ConcealedEffect, ...]
    wrong: Mapping[str, float]
    oracle: tuple[float, ...]

    @staticmethod
    def from_document(document: Mapping[str, Any]) -> Truth:
        """From answer.json; what the catalogue of the diagnosis has not (yet) is rightly called unknown."""
        effects = tuple(
            ConcealedEffect(
                e["effect"], e["known"] and e["effect"] in EFFECTS, tuple(e["subsystems"]), e["strength"], e["size"], e["unit"],
                e["parameters"], e["onset_s"], e["detectable"],
            )
            for e in document["effects"]
        )  # fmt: skip
        oracle = tuple(inf if error is None else float(error) for error in document["oracle"])
        return Truth(document["name"], document["kind"], effects, document["wrong"], oracle)

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the concealed effects."""
        return tuple(effect.effect for effect in self.effects)


@dataclass(frozen=True)
class NamedEffect:
    """One finding of diagnosis.json; parameters: name -> (value, lower, upper end of the 90 % interval)."""

    effect: str | None
    subsystem: str
    confidence: float
    parameters: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    alternatives: tuple[tuple[str | None, float], ...] = ()


@dataclass(frozen=True)
class Said:
    """The answer of the diagnosis. ``failure``: why there is none; the verdict is then empty."""

    verdict: str
    findings: tuple[NamedEffect, ...] = ()
    failure: str = ""

    @staticmethod
    def from_document(document: Mapping[str, Any]) -> Said:
        """From diagnosis.json (contract). Raises KeyError or TypeError for a document that violates the contract."""
        findings = tuple(
            NamedEffect(
                f["effect"],
                f["subsystem"],
                float(f["confidence"]),
                {
                    name: (float(p["value"]), float(p["interval_90"][0]), float(p["interval_90"][1]))
                    for name, p in f["parameters"].items()
                    if p["value"] is not None and None not in p["interval_90"]
                },
                tuple((a["effect"], float(a["confidence"])) for a in f["alternatives"]),
            )
            for f in document["findings"]
        )
        return Said(document["verdict"], findings)

    @property
    def first(self) -> NamedEffect | None:
        """The finding that explains most, if the verdict names something."""
        return self.findings[0] if self.verdict in NAMING and self.findings else None

    def ranking(self) -> list[str | None]:
        """Effects in the order of their stated probability: the first finding, its alternatives, further findings."""
        first = self.first
        if first is None:
            return []
        ordered = [first.effect, *(name for name, _ in sorted(first.alternatives, key=lambda pair: -pair[1]))]
        ordered += [finding.effect for finding in self.findings[1:]]
        return list(dict.fromkeys(ordered))


@dataclass(frozen=True)
class Row:
    """One case, opened.

    Attributes:
        nominal, explained: normalised rms error on the sealed recording, per channel (inf: the run stopped early).
        own_fit: the diagnosis' own held-out errors, stage -> per channel.
        seconds: duration of the diagnosis [s].
    """

    truth: Truth
    said: Said
    nominal: tuple[float, ...] = ()
    explained: tuple[float, ...] = ()
    seconds: float = 0.0
    own_fit: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def true_effect(self) -> ConcealedEffect:
        """The only concealed effect. Raises IndexError if there is none."""
        return self.truth.effects[0]

    @property
    def right_first(self) -> bool:
        """The concealed effect is named first (unknown physics, if it is in no catalogue)."""
        first = self.said.first
        if first is None or not self.truth.effects:
            return False
        return any(first.effect == (effect.effect if effect.known else None) for effect in self.truth.effects)

    @property
    def gap_closed(self) -> float | None:
        """Share of the log-gap from the nominal model to the oracle that the explained model closes; None: there is no gap.

        Means over the channels of log error. Below zero: worse than nominal; capped at -1 and -1 for a run that stopped early.
        """
        if not (self.nominal and self.explained and self.truth.oracle):
            return None
        nominal, oracle = _mean_log(self.nominal), _mean_log(self.truth.oracle)
        if nominal - oracle < SMALLEST_GAP:
            return None
        return max(-1.0, (nominal - _mean_log(self.explained)) / (nominal - oracle))


SMALLEST_GAP = 0.4
"""Least mean log error between nominal and oracle (a factor of 1.5) that counts as a gap."""
_BROKEN = 100.0


def _mean_log(errors: tuple[float, ...]) -> float:
    bounded = [min(error, _BROKEN) if isfinite(error) else _BROKEN for error in errors]
    return sum(log(max(error, 1e-6)) for error in bounded) / len(bounded) if bounded else inf
