"""What is how likely at the end of a search: the one source of every probability that a diagnosis states, and its tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from boom_diagnosis.assumptions import MOST_CERTAIN, UNPROVED
from boom_diagnosis.case import Case
from boom_diagnosis.document import Estimate, Finding, HypothesisRow, RankingRow
from boom_diagnosis.earning import clear, needed, numbers_of
from boom_diagnosis.fitting import SLOW
from boom_diagnosis.locating import links
from boom_diagnosis.must_keep import told
from boom_diagnosis.onset import begins_within, neutral
from boom_diagnosis.proof import label_of
from boom_diagnosis.weighing import Weighed, estimates, of_effect, probabilities
from boom_model.catalogue import EFFECTS

UNTOLD = 0.49
"""At most this is claimed of an effect whose numbers' intervals all contain that it does nothing."""


@dataclass(frozen=True)
class Odds:
    """What is how likely: the one source of every probability that a diagnosis states.

    Attributes:
        unknown: that unmodelled physics acts.
        effects: of each round, effect -> that it is what was looked for there.
        tolerances: that parameters within their tolerance are all that the first round needs.
    """

    unknown: float
    effects: tuple[Mapping[str, float], ...]
    tolerances: float


def odds_of(case: Case, unknown: float, *, proved: bool = True, spared: float = 0.0, far: float = 1.0) -> Odds:
    """The probabilities of a finished search, as they are stated (four digits).

    unknown: before it is weighed with the rest. proved: by free runs over data not used; what they are worse with, or far from the
    noise floor, is not sure, nor what begins where all data are held out. What is not claimed of an effect is unknown physics,
    where tolerances alone leave a clear rest, as far as free runs are ``far`` (1) with tolerances alone and not near (0) what noise
    leaves: near it, nothing.
    An effect that explains more, but as no machine can have it, is unknown physics that looks like it.
    spared: what one-step errors said of unknown physics and free runs took back: no effect explains that either.
    """
    stated = round(min(MOST_CERTAIN, unknown), 4)
    spared = min(spared, 1.0 - stated) if case.taken else 0.0
    effects, tolerances, doubted, unlike = [], 1.0 - stated, 0.0, 0.0
    for k, weighed in enumerate(case.weighed):
        left = k == len(case.taken)  # what was not taken for gaining less than is needed is not likelier than nothing
        untold = SLOW * max(0.0, case.rounds[k].base.over(case.floor))  # fits end where a step gains less
        costs = [w.cost * untold / case.temperature for w in weighed]  # what numbers cost is told all the same
        nets = [w.net - (needed(case, w) if left else 0.0) - cost for w, cost in zip(weighed, costs, strict=True)]
        nets += [_as_none_has_it(case)] if k == 0 and case.taken and case.impossible else []
        *shares, none = (round(p * (1.0 - stated - spared), 4) for p in probabilities(nets, case.temperature + untold))
        beyond = sum(shares[len(weighed) :])
        unlike += min(beyond, MOST_CERTAIN - stated)
        none += max(0.0, beyond - (MOST_CERTAIN - stated))
        row = {w.fitted.effect: p for w, p in zip(weighed, shares, strict=False)}
        lost = 0.0
        for effect, stated_of in row.items():
            sure = effect not in case.named or (proved and _seen_before(case, effect))
            most = UNTOLD if not is_told(case, effect) else 1.0 if sure else UNPROVED
            lost, row[effect] = lost + max(0.0, stated_of - most), min(stated_of, most)
        effects.append(row)
        if k == 0 and clear(case, case.rounds[0].base):  # something is wrong, if not this
            doubted, none = far * lost, none + (1.0 - far) * lost
        elif k == 0:
            none += lost
        tolerances = tolerances if k else none + spared
    stated = min(MOST_CERTAIN, stated + doubted + unlike)
    return Odds(round(stated, 4), tuple(effects), round(tolerances, 4))


def as_its_form(case: Case, odds: Odds, unproved_by: Sequence[str]) -> Odds:
    """The odds where the first effect is foreign: what is left of one that explains more than it leaves is its form.

    Either is unknown physics, and one thing is likelier than two; so is what looks like another effect as no machine can have it.
    Not where free runs speak against the effect, or its numbers are not told.
    """
    effect = case.named[0] if case.taken else ""
    if unproved_by or not effect or not EFFECTS[effect].foreign or not is_told(case, effect):
        return odds
    left = case.rest(case.trained[1])
    if left >= case.rest(case.kept(0)) - left:
        return odds
    first = {**odds.effects[0], effect: round(odds.effects[0][effect] + odds.unknown, 4)}
    return Odds(0.0, (first, *odds.effects[1:]), odds.tolerances)


def _as_none_has_it(case: Case) -> float:
    """Net gain [nats] of the best effect that was fitted as no machine can have it: what acts is something that looks like it."""
    first = case.taken[0]
    return first.net + max(f.gain for f in case.impossible) - first.fitted.gain


def hypothesis_rows(case: Case, odds: Odds, place: str) -> tuple[HypothesisRow, ...]:
    """What was weighed in the first round, and unknown physics at the equation in doubt; the posteriors sum to one."""
    rows = [
        HypothesisRow((), (), 0.0, 0.0, 0.0, odds.tolerances),
        HypothesisRow((), (place,), 0.0, 0.0, 0.0, odds.unknown),
    ]
    for w in (*(case.weighed[0] if case.weighed else ()), *case.disproved):
        effect, gain = w.fitted.effect, w.gain + w.held_out_gain
        effects, places = ((), (_place(case, effect),)) if EFFECTS[effect].foreign else ((effect,), ())
        rows.append(HypothesisRow(effects, places, gain, w.cost, 0.0, probability_of(odds, effect)))
    total = sum(row.posterior for row in rows)
    rows = [replace(row, posterior=row.posterior / total) for row in rows]
    return tuple(sorted(rows, key=lambda row: -row.posterior))


def _place(case: Case, effect: str) -> str:
    """The first equation in which an effect's subsystem is at home."""
    return next(link.key for link in links(case.machine) if EFFECTS[effect].subsystem in link.subsystems)


def is_told(case: Case, effect: str, *, sound: bool = False) -> bool:
    """Whether the numbers of what was taken differ from nothing, or a ``sound`` machine; what was not taken has nothing to keep."""
    if case.final is None or effect not in case.named:
        return True
    return told(effect, of_effect(final_numbers(case), effect), case.size, sound=sound)


def _seen_before(case: Case, effect: str) -> bool:
    """Whether an effect acts in data that are not held out, too: else only those tell of it, and they cannot prove it."""
    if case.proving or not EFFECTS[effect].onset:
        return True
    return begins_within(effect, case.last.effects, case.bags, case.training)


def final_numbers(case: Case) -> dict[str, Estimate]:
    """All numbers of the effects that were taken, dotted names."""
    assert case.final is not None  # after a search that took something
    return numbers_of(case, case.final)


def ranking(case: Case, odds: Odds, findings: Sequence[Finding]) -> list[RankingRow]:
    """All hypotheses of the first round, those that free runs disproved with probability zero, and unknown physics.

    An effect that was found has the numbers of its finding.
    """
    found = {f.effect: f.parameters for f in findings}
    rows = []
    for w in (*(case.weighed[0] if case.weighed else ()), *case.disproved):
        effect = w.fitted.effect
        subsystem = EFFECTS[effect].subsystem
        numbers = found.get(effect) or of_effect(estimates(w.fitted, case.temperature), effect)
        rows.append(
            RankingRow(
                label_of(effect), effect, _kind(effect), subsystem,
                probability_of(odds, effect), w.gain, w.held_out_gain, numbers, _inside(w),
            )
        )  # fmt: skip
    rows.append(RankingRow("parameters within tolerance only", None, "parameters", "", odds.tolerances, 0.0, 0.0, {}))
    rows.append(RankingRow("unmodelled physics", None, "unknown", "", odds.unknown, 0.0, 0.0, {}))
    return sorted(rows, key=lambda r: -r.probability)


def probability_of(odds: Odds, effect: str) -> float:
    """That the effect is what the first round looked for; zero for what free runs disproved."""
    return odds.effects[0].get(effect, 0.0) if odds.effects else 0.0


def own_name(effect: str) -> str | None:
    """The id by which others know an effect; None of what is in nobody's list: unknown physics, to them."""
    return None if EFFECTS[effect].foreign else effect


def _kind(effect: str) -> Literal["sensors", "effect", "unknown"]:
    if EFFECTS[effect].foreign:
        return "unknown"
    return "sensors" if EFFECTS[effect].subsystem == "sensors" else "effect"


def _inside(w: Weighed) -> bool:
    """Whether the numbers that act are within their plausible ranges."""
    values = w.fitted.point.effects
    own = [c for c in w.fitted.coordinates if c.name.split(".")[1] == w.fitted.effect and not c.onset]
    return all(values[c.name] == neutral(c.name) or c.plausible[0] <= values[c.name] <= c.plausible[1] for c in own)
