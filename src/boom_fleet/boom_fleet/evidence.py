"""Whether a machine has changed: one posterior for the screen's decision and for the comparison of a machine with its past.

Recording r of a machine has the numbers z_r = theta + eta_r + sum_c v_c(delta_c g_c(t_r)), with

    theta ~ N(0, s^2)                 the machine's own numbers: s = 1 where they have a tolerance, ``form`` for an effect, as a
                                      healthy machine may seem to have one: its form is not the model's; and beside it what
                                      the catalogue says that a sound one has of it: a sensor's accuracy, a made part's
    eta_r ~ N(0, (wander s)^2)        what differs from day to day: temperature, work
    delta_c ~ N(0, 1), in its range   a change of a quantity along its path v_c (``boom_fleet.paths``): a step (g = 0, then 1), a
                                      ramp (g grows by 1 in a year), or a step that seems to be of another size in each recording
                                      (``boom_fleet.designs``)

and log L_r(z_r) from the screen (``boom_fleet.screen``). All of it is Gaussian and piecewise linear, so the odds of "nothing
changed" against "quantity c, this way, since then" are exact. A step at the first recording says that the machine was outside its
file's tolerance from the beginning. ``form``, of each effect, and ``wander`` are found from the fleet (``boom_fleet.habits``).
``wander`` is the same for all; how little the model's form fits is each machine's own, so every probability is integrated over a
factor of ``form``, log-normal about the fleet's (``FORM_SPREAD``).

Of one effect a healthy machine may seem to have far more than is usual: five times (``ODD``), always alike, or another size in
every recording, as one motion shows it and another does not. Where that is likelier than any change it is taken for granted.

Decision: a machine is raised where P(nothing further changed) < ``false_alarms`` / number of machines, so that in one night no more
than ``false_alarms`` machines are expected to be raised for nothing, and where the next recording shows it, too
(``boom_fleet.judging``). A change that matters to nobody raises nothing (``UNIMPORTANT``). That and the priors below are all that
is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logsumexp, softmax

from boom_fleet.designs import ChangeCandidate, Design, Shape, WeighedChange, weigh
from boom_fleet.past import YEAR, Direction, Evidence, MachinePast
from boom_fleet.paths import Path, likeliest_levels, straight

Array = NDArray[np.float64]

FALSE_ALARMS = 0.05
"""Machines raised for nothing that are accepted, per night of the fleet."""
OUTSIDE = 0.05
"""Probability that a machine is outside its file's tolerance when it is first seen."""
RATE = 1.0
"""Changes of a machine per year; as many of each shape."""
MOST_CHANGES = 4
UNIMPORTANT = 0.05
"""Share of half of a quantity's plausible range below which a change matters to nobody: it is taken for granted, and not told."""
ODD = 5.0
"""How much more of one effect than is usual a healthy machine may seem to have: always, or anew in every recording."""
ODDLY = 0.05
"""Probability of either, as that of being outside."""
MOST_ODD = 4
FORMS = (0.003, 0.006, 0.012, 0.025, 0.05, 0.1, 0.2)
WANDERS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Values of ``form`` and ``wander`` that are compared."""
ROUGH = 0.1
"""Standard deviation of a size over the size: what a change does is taken for linear between the points of its path."""
FORM_SPREAD = 1.0
"""Standard deviation of ln(form) over the machines of a fleet."""
_QUANTILE = 1.6448536269514722


@dataclass(frozen=True)
class Change:
    """A change of a machine.

    Attributes:
        quantity: id. shape, begin: how, and index of the first recording that shows it (step) or of the last before it (ramp).
        since: earliest and latest time [s] of the change, 90 %.
        size: at the last recording, and 90 % interval, in z.
        probability: of this quantity, beside the changes before it. alternatives: other quantities and their probabilities.
    """

    quantity: str
    shape: Shape
    begin: int
    since: tuple[float, float]
    size: float
    interval: tuple[float, float]
    probability: float
    alternatives: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class ChangeHistory:
    """What a machine's recordings up to one of them say.

    Attributes:
        changes: that matter, in the order in which they explain most.
        unchanged: probability that nothing beyond them has changed.
        odds: logarithm of the odds for the first change against none.
    """

    changes: tuple[Change, ...]
    unchanged: float
    odds: float


class MachinePosterior:
    """What a machine's recordings say of its changes, integrated over how little the model's form fits it.

    Args:
        pasts: ln of the prior of each ``form``, and the recordings as it has them. paths: the quantities.
    """

    def __init__(self, pasts: Sequence[tuple[float, MachinePast]], paths: Sequence[Path]) -> None:
        self._priors, self._pasts = zip(*pasts, strict=True)
        self.times, self.paths = self._pasts[0].times, tuple(paths)
        self._straight = tuple(straight(column, path.id) for path in paths for column in path.columns)

    def history(self, count: int, threshold: float) -> ChangeHistory:
        """What the first ``count`` recordings say; changes are added as long as P(nothing further) < ``threshold``.

        What matters to nobody is taken for granted, so that what matters is found beside it.
        """
        accepted: list[WeighedChange] = []
        found: list[Change] = []
        pasts: Sequence[MachinePast] = self._pasts
        first = 0.0
        while True:
            pasts, weighed, odds = self._beside_odd(pasts, count, accepted)
            unchanged = float(expit(-odds))
            if not accepted:
                first = odds
            if unchanged >= threshold or len(found) == MOST_CHANGES or len(accepted) == 2 * MOST_CHANGES or not weighed:
                return ChangeHistory(tuple(found), unchanged, first)
            change = self._told(weighed, count)
            if abs(change.size) > UNIMPORTANT:
                found.append(change)
            accepted.append(max(weighed, key=lambda w: w.log_odds))

    def levels(self, path: Path) -> tuple[Array, Array]:
        """Level (n,) of a quantity in each recording beyond the first, and its standard deviations, in z."""
        known = [prior + log_likelihood(past) for prior, past in zip(self._priors, self._pasts, strict=True)]
        likeliest: MachinePast = self._pasts[int(np.argmax(known))]
        return likeliest_levels(path, *Design(likeliest, len(self.times), ()).sizes(path.columns))

    def _beside_odd(
        self, pasts: Sequence[MachinePast], count: int, accepted: Sequence[WeighedChange]
    ) -> tuple[Sequence[MachinePast], list[WeighedChange], float]:
        """The recordings of a machine as odd as it is likelier to be than to have changed; the odds of each change and of any."""
        for _ in range(MOST_ODD):
            known, designs = self._known(pasts, count, accepted)
            weighed = self._weigh(count, ("step", "ramp"), known, designs)
            odd = self._odd(count, known, designs)
            if not odd or odd[0].log_odds <= max(0.0, *(w.log_odds for w in weighed)):
                break
            uneven = self._weigh(count, ("uneven",), known, designs)
            if max((w.log_odds for w in uneven), default=0.0) > odd[0].log_odds:
                weighed = [*weighed, *uneven]
                break
            pasts = [odd[0].of(past) for past in pasts]
        healthy = logsumexp([0.0, *(o.log_odds for o in odd)])
        return pasts, weighed, float(logsumexp([-np.inf, *(w.log_odds for w in weighed)]) - healthy)

    def _known(
        self, pasts: Sequence[MachinePast], count: int, accepted: Sequence[WeighedChange]
    ) -> tuple[Array, list[Design]]:
        """Log evidence of every ``form`` with what is accepted."""
        designs = [Design(past, count, accepted) for past in pasts]
        rows = zip(self._priors, pasts, designs, strict=True)
        return np.array([prior + past.constant(count) + design.log_evidence for prior, past, design in rows]), designs

    def _weigh(
        self, count: int, shapes: Sequence[Shape], known: Array, designs: Sequence[Design]
    ) -> list[WeighedChange]:
        """The odds of each candidate beside what is accepted; none of one recording."""
        candidates = self._candidates(count, shapes)
        return weigh(candidates, designs, known) if candidates else []

    def _odd(self, count: int, known: Array, designs: Sequence[Design]) -> list[_Odd]:
        """What a healthy machine may seem to have instead of a change, the likeliest first."""
        result, unchanged = [], np.logaddexp.reduce(known)
        for direction in (column for path in self.paths for column in path.columns if column.usual):
            for restless in (False, True):
                shape = np.eye(count) if restless else np.ones((count, count))
                spread = (ODD * direction.usual) ** 2 * shape
                gained = np.logaddexp.reduce(known + [d.supposed(direction, spread) for d in designs])
                result.append(_Odd(float(gained - unchanged) + log(ODDLY / len(self._straight)), direction, restless))
        return sorted(result, key=lambda o: -o.log_odds)

    def _candidates(self, count: int, shapes: Sequence[Shape]) -> list[ChangeCandidate]:
        result = []
        paths = self._straight if "uneven" in shapes else self.paths
        each = 1.0 / len(paths)
        for path in paths:
            if "step" in shapes:
                result.append(ChangeCandidate(path, "step", 0, OUTSIDE * each))
            for k in range(1, count):
                passed = RATE * (self.times[k] - self.times[k - 1]) / YEAR
                result += [ChangeCandidate(path, shape, k - (shape == "ramp"), passed * each / 3.0) for shape in shapes]
        return result

    def _told(self, weighed: Sequence[WeighedChange], count: int) -> Change:
        best = max(weighed, key=lambda w: w.log_odds)
        probability = softmax([w.log_odds for w in weighed])
        shares: dict[str, float] = {}
        for w, p in zip(weighed, probability, strict=True):
            shares[w.candidate.path.id] = shares.get(w.candidate.path.id, 0.0) + float(p)
        own = best.candidate.path.id
        others = tuple(
            sorted(((k, s) for k, s in shares.items() if k != own and s > 0.01), key=lambda row: -row[1])[:4]
        )
        same = [w for w in weighed if w.candidate.path.id == own]
        size, deviation = self._size(same, count)
        return Change(
            own, best.candidate.shape, best.candidate.begin, self._since(same), size,
            (size - _QUANTILE * deviation, size + _QUANTILE * deviation), shares[own], others,
        )  # fmt: skip

    def _size(self, weighed: Sequence[WeighedChange], count: int) -> tuple[float, float]:
        """Mean and standard deviation of the size at the last recording, over all beginnings and both shapes."""
        share = softmax([w.log_odds for w in weighed])
        last = np.array([w.candidate.course(self.times[:count])[-1] for w in weighed])
        sizes, deviations = (last * np.array([getattr(w, n) for w in weighed]) for n in ("size", "deviation"))
        mean = float(share @ sizes)
        return mean, sqrt(float(share @ (deviations**2 + (sizes - mean) ** 2)) + (ROUGH * mean) ** 2)

    def _since(self, weighed: Sequence[WeighedChange]) -> tuple[float, float]:
        """Earliest and latest beginning: the shortest set of them that holds 90 %."""
        ordered = sorted(weighed, key=lambda w: -w.log_odds)
        held = np.cumsum(softmax([w.log_odds for w in ordered]))
        kept = [w.candidate for w in ordered[: int(np.searchsorted(held, 0.9)) + 1]]
        early = [self.times[c.begin if c.shape == "ramp" else max(0, c.begin - 1)] for c in kept]
        late = [self.times[c.begin + (c.shape == "ramp")] for c in kept]
        return float(min(early)), float(max(late))


class _Odd(NamedTuple):
    """A machine that seems to have far more of an effect than is usual, always or anew in every recording: log odds of it."""

    log_odds: float
    direction: Direction
    restless: bool

    def of(self, past: MachinePast) -> MachinePast:
        """The recordings of such a machine."""
        size = ODD * self.direction.usual
        return past.restless(self.direction, size) if self.restless else past.wide(self.direction, size)


def log_likelihood(past: MachinePast) -> float:
    """Of an unchanged machine, up to what depends on no hypothesis."""
    count = len(past.times)
    return past.constant(count) + Design(past, count, ()).log_evidence


def posterior(
    evidence: Sequence[Evidence], kinds: NumberKinds, form: float, wander: float, paths: Sequence[Path]
) -> MachinePosterior:
    """Of a machine of a fleet with this ``form`` and ``wander``."""
    pasts = []
    for own_form in FORMS:
        prior = -0.5 * (log(own_form / form) / FORM_SPREAD) ** 2
        pasts.append((prior, MachinePast(evidence, *spreads(kinds, own_form, wander))))
    return MachinePosterior(pasts, paths)


class NumberKinds(NamedTuple):
    """What the numbers of a machine are, each (k,).

    Attributes:
        effects: 0 for a number that is not an effect's, else how much more than ``form`` healthy machines seem to have of it.
        own: which numbers are drawn anew for every recording.
        sound: standard deviation of what a sound machine has of an effect by the catalogue.
    """

    effects: Array
    own: NDArray[np.bool_]
    sound: Array


def spreads(kinds: NumberKinds, form: float, wander: float) -> tuple[Array, Array]:
    """``spread`` and ``wander`` (k,) of :class:`MachinePast`. What a sensor is off by does not differ from day to day."""
    spread = np.where(kinds.effects > 0.0, form * kinds.effects, np.where(kinds.own, 1e-3, 1.0))
    return np.hypot(spread, kinds.sound), np.where(kinds.own, 1.0, wander * spread)
