"""From opened cases to the table of the trial: every measure with its count, its 95 % bounds and the requirement.

Shares carry the exact bounds of Clopper and Pearson. Nothing here reads files or knows how a case was made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.stats import beta, binom

from boom_model.catalogue import EFFECTS
from boom_trials.blind.outcomes import NAMING, Row

T = TypeVar("T")

CONFIDENT = 0.9
ONSET_TOLERANCE = 0.3
BINS = 10
OWN_STAGES = ("nominal", "parameters_only", "explained", "noise_floor")
"""Stages in the held-out errors that a diagnosis reports itself."""
ONE_OF_PAIR, NONE_OF_PAIR = "pair, one of them first", "pair, none of them first"
"""Kinds of pairs by the first name."""
KINDS = ("healthy", "parameters", ONE_OF_PAIR, NONE_OF_PAIR, "idle")
"""Cases without a single effect."""


@dataclass(frozen=True)
class Measure:
    """One line of the table.

    Attributes:
        key: short name for the JSON document.
        title: name in tables.
        value: measured value; None: there was no case.
        low, high: 95 % bounds of a share or a median, the lower one of a calibration error; None: no bound (a median of fewer
            than six).
        count: number of cases.
        least, most: the requirement; None: no limit.
        unit: "%" or another.
    """

    key: str
    title: str
    value: float | None
    count: int
    low: float | None = None
    high: float | None = None
    least: float | None = None
    most: float | None = None
    unit: str = "%"

    @property
    def met(self) -> bool | None:
        """Whether the requirement is met; None without a requirement or a value, or if there are too few cases.

        It is missed only if the bounds miss it too: a value that misses by chance does not count.
        """
        if self.value is None or (self.least is None and self.most is None):
            return None
        if (self.least is None or self.value >= self.least) and (self.most is None or self.value <= self.most):
            return True
        below = self.least is not None and self.high is not None and self.high < self.least
        above = self.most is not None and self.low is not None and self.low > self.most
        return False if below or above else None

    @property
    def too_few(self) -> bool:
        """The value misses the requirement, but within chance for so few cases."""
        return self.value is not None and (self.least is not None or self.most is not None) and self.met is None


def share_bounds(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper-Pearson bounds of a share (0..1)."""
    tail = (1.0 - level) / 2.0
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, count - hits + 1))
    high = 1.0 if hits == count else float(beta.ppf(1.0 - tail, hits + 1, count - hits))
    return low, high


def measures(rows: Sequence[Row]) -> list[Measure]:
    """The table of the trial, in its order."""
    visible = [r for r in rows if r.truth.kind == "effect" and r.true_effect.strength >= 1.0]
    healthy = [r for r in rows if r.truth.kind == "healthy"]
    wrong = [r for r in rows if r.truth.kind == "parameters"]
    outside = [r for r in rows if r.truth.kind == "outside"]
    pairs = [r for r in rows if r.truth.kind == "pair"]
    unknown = [r for r in outside if r.said.verdict == "unknown_physics"]
    errors = onset_errors(rows)
    return [
        _share(
            "right_first",
            "right effect named first, at 1 x detectability and above",
            visible,
            lambda r: r.right_first,
            85,
        ),
        _share("right_three", "right effect among the first three", visible, _among_three, 95),
        _share("right_subsystem", "right subsystem", visible, right_subsystem, 93),
        _share("wrong_confident", "wrong effect named with a confidence of 0.9 or more", rows, wrong_and_sure, most=3),
        _share("false_alarm", "false alarm on a healthy machine", healthy, alarmed, most=2),
        _share("wrong_parameters", "wrong parameters reported as physics", wrong, alarmed, most=5),
        _share("outside", "unmodelled physics recognised as unknown", outside, lambda r: r in unknown, 85),
        _median(
            "outside_gap", "held-out log-gap that the learnt term closes, median", [r.gap_closed for r in unknown], 50
        ),
        _share("pair_both", "pairs: both named", pairs, lambda r: _found(r) == 2, 70),
        _share("pair_one", "pairs: at least one named", pairs, lambda r: _found(r) >= 1, 95),
        _share("onset", f"onset within {ONSET_TOLERANCE} s", errors, lambda e: e <= ONSET_TOLERANCE, 100),
        _median(
            "gap_closed", "held-out log-gap from nominal to oracle closed, median", [r.gap_closed for r in visible], 75
        ),
        _share("coverage", "true parameter inside the stated 90 % interval", inside_intervals(rows), bool, 80, 97),
        _calibration(rows),
    ]


def right_subsystem(row: Row) -> bool:
    """The first finding names a rightful subsystem of the concealed effect."""
    first = row.said.first
    return first is not None and any(first.subsystem in effect.subsystems for effect in row.truth.effects)


def alarmed(row: Row) -> bool:
    """The verdict names something beyond the machine's numbers."""
    return row.said.verdict in NAMING


def wrong_and_sure(row: Row) -> bool:
    """A wrong effect of the catalogue is named first with confidence."""
    first = row.said.first
    return (
        first is not None
        and first.effect is not None
        and first.confidence >= CONFIDENT
        and first.effect not in row.truth.names
    )


def onset_errors(rows: Iterable[Row]) -> list[float]:
    """|said - true| [s] of the onsets of effects that were named and begin during the recording."""
    errors = []
    for row in rows:
        for effect in row.truth.effects:
            for finding in row.said.findings:
                if effect.onset_s is None or finding.effect != effect.effect:
                    continue
                onset = EFFECTS[effect.effect].onset
                if onset in finding.parameters:
                    errors.append(abs(finding.parameters[onset][0] - effect.onset_s))
    return errors


def inside_intervals(rows: Iterable[Row]) -> list[bool]:
    """For each parameter of a rightly named effect with the same meaning in both forms: whether the interval holds the truth."""
    inside = []
    for row in rows:
        for effect in row.truth.effects:
            for finding in row.said.findings:
                if finding.effect != effect.effect or row.said.verdict not in NAMING:
                    continue
                for name, true in effect.parameters.items():
                    if name in finding.parameters:
                        _, low, high = finding.parameters[name]
                        inside.append(low <= true <= high)
    return inside


def confidence_bins(rows: Iterable[Row], count: int = BINS) -> list[tuple[float, float, int]]:
    """(mean confidence, share right, number) of first findings in bins of equal width; empty bins are left out."""
    pairs = [(r.said.first.confidence, r.right_first) for r in rows if r.said.first is not None]
    result = []
    for k in range(count):
        inside = [(c, right) for c, right in pairs if min(int(c * count), count - 1) == k]
        if inside:
            result.append((float(np.mean([c for c, _ in inside])), float(np.mean([r for _, r in inside])), len(inside)))
    return result


def by_strength(rows: Iterable[Row]) -> dict[float, tuple[int, int, int, int]]:
    """Strength -> (cases, right first, among three, named nothing) of single effects."""
    result: dict[float, tuple[int, int, int, int]] = {}
    for row in rows:
        if row.truth.kind == "effect":
            n, first, three, silent = result.get(row.true_effect.strength, (0, 0, 0, 0))
            result[row.true_effect.strength] = (
                n + 1, first + row.right_first, three + _among_three(row), silent + (row.said.first is None),
            )  # fmt: skip
    return dict(sorted(result.items()))


def held_out_stages(rows: Iterable[Row]) -> list[tuple[str, list[tuple[float, ...]]]]:
    """(model, its errors per case and channel) of single effects at 1 x and above: sealed recording, then the diagnosis' own.

    Cases without that number are left out, and models without any case.
    """
    chosen = [r for r in rows if r.truth.kind == "effect" and r.true_effect.strength >= 1.0]
    stages = [
        ("sealed recording, nominal model", [r.nominal for r in chosen]),
        ("sealed recording, explained model", [r.explained for r in chosen]),
        ("sealed recording, oracle", [r.truth.oracle for r in chosen]),
    ]
    for stage in OWN_STAGES:
        title = f"its own held-out part, {stage.replace('_', ' ')}"
        stages.append((title, [r.own_fit.get(stage, ()) for r in chosen]))
    filled = [(title, [e for e in errors if e]) for title, errors in stages]
    return [(title, errors) for title, errors in filled if errors]


def label(row: Row) -> str:
    """The answer in one word: the effect named first, or the verdict."""
    if row.said.failure:
        return "failed"
    first = row.said.first
    if first is None:
        return row.said.verdict if row.said.verdict not in NAMING else "unknown_physics"
    return first.effect or "unknown_physics"


def confusion(rows: Iterable[Row]) -> dict[str, Counter[str]]:
    """True effect (at 1 x detectability and above), or kind of case -> counted answers."""
    table: dict[str, Counter[str]] = {}
    for row in rows:
        if row.truth.kind in ("effect", "outside"):
            if row.true_effect.strength < 1.0:
                continue
            name = row.true_effect.effect
        else:
            name = kind(row)
        table.setdefault(name, Counter())[label(row)] += 1
    return table


def kind(row: Row) -> str:
    """Kind of a case; for a pair whether one of its effects was named first."""
    if row.truth.kind != "pair":
        return row.truth.kind
    return ONE_OF_PAIR if row.right_first else NONE_OF_PAIR


def worst(rows: Sequence[Row], count: int = 10) -> list[tuple[float, str, Row]]:
    """The worst cases first: severity, fault in words, row. Cases without a fault are left out."""
    judged = [(*_fault(row), row) for row in rows]
    return sorted((entry for entry in judged if entry[0] > 0), key=lambda entry: -entry[0])[:count]


def _fault(row: Row) -> tuple[float, str]:
    """Severity of the fault of a case (0: none), and the fault in words."""
    true = " and ".join(f"{e.effect} ({e.strength:g} x)" for e in row.truth.effects) or row.truth.kind
    first = row.said.first
    if row.said.failure:
        return 4.0, f"{true}: no answer: {row.said.failure}"
    if wrong_and_sure(row):
        assert first is not None
        return 3.0 + first.confidence, f"{true}: named {first.effect} with confidence {first.confidence:.2f}"
    if row.truth.kind in ("healthy", "parameters") and alarmed(row):
        return 2.5 + (first.confidence if first else 0.0), f"{true}: said {label(row)}, nothing was concealed"
    strength = max((e.strength for e in row.truth.effects), default=0.0)
    if row.truth.kind in ("effect", "outside", "pair") and strength >= 1.0 and not row.right_first:
        return 1.0 + min(strength, 3.0) / 3.0, f"{true}: said {label(row)}"
    closed = row.gap_closed
    if row.truth.kind == "effect" and strength >= 1.0 and closed is not None and closed < 0.5:
        return 0.5 - closed / 2.0, f"{true}: named, but only {100 * closed:.0f} % of the held-out gap is closed"
    return 0.0, ""


def _among_three(row: Row) -> bool:
    return row.true_effect.effect in row.said.ranking()[:3]


def _found(row: Row) -> int:
    if row.said.verdict not in NAMING:
        return 0
    return len(set(row.truth.names) & {finding.effect for finding in row.said.findings})


def _share(
    key: str,
    title: str,
    cases: Sequence[T],
    hit: Callable[[T], bool],
    least: float | None = None,
    most: float | None = None,
) -> Measure:
    count, hits = len(cases), sum(bool(hit(case)) for case in cases)
    if count == 0:
        return Measure(key, title, None, 0, least=least, most=most)
    low, high = share_bounds(hits, count)
    return Measure(key, title, 100 * hits / count, count, 100 * low, 100 * high, least, most)


def _median(key: str, title: str, values: Iterable[float | None], least: float) -> Measure:
    known = sorted(value for value in values if value is not None)
    if not known:
        return Measure(key, title, None, 0, least=least)
    low, high = median_bounds(known)
    return Measure(
        key, title, 100 * float(np.median(known)), len(known), None if low is None else 100 * low,
        None if high is None else 100 * high, least,
    )  # fmt: skip


def median_bounds(ordered: Sequence[float], level: float = 0.95) -> tuple[float, float] | tuple[None, None]:
    """Bounds of the median for any distribution: two of the values, in ascending order; None for fewer than six."""
    outside = int(binom.ppf((1.0 - level) / 2.0, len(ordered), 0.5))
    return (ordered[outside - 1], ordered[-outside]) if outside else (None, None)


def _calibration(rows: Sequence[Row]) -> Measure:
    bins = confidence_bins(rows)
    total = sum(n for _, _, n in bins)
    title, most = "expected calibration error of the confidence", 0.07
    if not total:
        return Measure("calibration", title, None, 0, most=most, unit="")
    error = sum(n * abs(said - right) for said, right, n in bins) / total
    return Measure("calibration", title, error, total, max(0.0, error - _by_chance(bins)), most=most, unit="")


def _by_chance(bins: Sequence[tuple[float, float, int]], draws: int = 2000) -> float:
    """The calibration error that a confidence which means what it says exceeds once in twenty such trials."""
    rng = np.random.default_rng(0)
    total = sum(n for *_, n in bins)
    errors = sum(np.abs(rng.binomial(n, said, draws) - n * said) for said, _, n in bins) / total
    return float(np.quantile(errors, 0.95))
