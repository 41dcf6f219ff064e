"""A hypothesis as a problem of estimation, and its experiments linearised along passes of the observer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.numbers import Number, Priors, SizePriors
from boom_estimation.recursion import Exact, LinearisedPass, difference_columns
from boom_estimation.system import Columns, Model, Pass, System, Values

Array = NDArray[np.float64]

REUSE = 0.3
"""How far numbers may be from where their columns were taken: standard deviations, or quarters of a flat prior's range."""


@dataclass(frozen=True)
class HypothesisProblem:
    """A hypothesis to be fitted.

    Attributes:
        effects: what the equations have beside the machine's own. numbers: that may move.
        sizes: priors of the discrepancies' sizes: of each place, then of each number that wanders.
        wandering: indices of the numbers that may wander about their value, because an effect's form is not exactly known; their
            discrepancies count in shares of what the number is off its neutral value.
        scales: (c) -> that, in inner coordinates (k,).
    """

    system: System
    effects: tuple[str, ...]
    numbers: tuple[Number, ...]
    sizes: SizePriors
    wandering: tuple[int, ...] = ()
    scales: Callable[[Array], Array] = lambda c: np.zeros(0)

    @property
    def models(self) -> Sequence[Model]:
        """Of every experiment."""
        return self.system.models(self.effects)

    def values(self, c: Array, experiment: str) -> dict[str, float]:
        """Numbers of an experiment by name."""
        return {n.name: n.value(float(v)) for n, v in zip(self.numbers, c, strict=True) if n.own in ("", experiment)}


Known = Sequence[LinearisedPass | None] | None
"""Linearisations of every experiment, whose columns may be good enough where they are wanted."""


def linearise(
    problem: HypothesisProblem, c: Array, v: Array, gains: Sequence[Array] | None, known: Known
) -> list[LinearisedPass]:
    """Every experiment along a pass with these numbers; ``gains`` as they are, or those of ``v`` along a followed trajectory.

    Raises:
        FloatingPointError: a model that cannot be run with these numbers.
    """
    models = problem.models
    jobs: list[Callable[[], LinearisedPass]] = [
        lambda k=k, m=m: _linearise(problem, m, c, v, None if gains is None else gains[k], known[k] if known else None)  # type: ignore[misc]
        for k, m in enumerate(models)
    ]
    return [job() for job in jobs] if len(jobs) == 1 else _together(jobs)


def _together(jobs: Sequence[Callable[[], LinearisedPass]]) -> list[LinearisedPass]:
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda job: job(), jobs))


def _linearise(
    problem: HypothesisProblem, model: Model, c: Array, v: Array, gain: Array | None, known: LinearisedPass | None
) -> LinearisedPass:
    values = problem.values(c, model.name)
    if gain is None:
        gain = model.first_gain()
        followed = model.observe(values, gain, coarse=True)
        loose = LinearisedPass(model, followed, gain, model.tangent(values, followed), None)
        gain = loose.run(np.exp(v[: len(model.places)]), gain=True).gain
        assert gain is not None
    along = model.observe(values, gain)
    if not along.complete:
        raise FloatingPointError(f"{model.name}: the model cannot be run with these numbers")
    tangent = model.tangent(values, along)
    found = LinearisedPass(model, along, gain, tangent, _exact(problem, model, c, gain, along, tangent.output, known))
    return found.wandering(problem.wandering, problem.scales(c)) if problem.wandering else found


def _exact(
    problem: HypothesisProblem,
    model: Model,
    c: Array,
    gain: Array,
    along: Pass,
    output: Array,
    known: LinearisedPass | None,
) -> Exact:
    """Transitions, and the columns of the numbers by differences of passes; those known from nearby are taken as they are."""
    values = problem.values(c, model.name)
    exact = _usable(problem, model, c, known)
    at = {n.name: float(x) for n, x in zip(problem.numbers, c, strict=True)}
    missing = [j for j, name in enumerate(at) if exact is None or name not in exact.at]
    others, steps = [], []
    for j in missing:
        there, n = c.copy(), problem.numbers[j]
        steps.append(n.step if c[j] + n.step <= n.high else -n.step)
        there[j] += steps[-1]
        others.append(problem.values(there, model.name))
    transition = model.transitions(values, along) if exact is None else exact.transition
    pairs = pairs_of(model, values, others, gain)
    fresh = difference_columns(model.name, pairs, np.array(steps), gain, transition, output)
    if exact is None:
        return Exact(transition, fresh, at)
    taken = list(exact.at)
    order = [taken.index(name) if name in exact.at else len(taken) + missing.index(j) for j, name in enumerate(at)]
    columns = Columns.joined(exact.columns, fresh).chosen(order)
    return Exact(transition, columns, {name: exact.at.get(name, x) for name, x in at.items()})


def _usable(problem: HypothesisProblem, model: Model, c: Array, known: LinearisedPass | None) -> Exact | None:
    """Derivatives that were taken with the same states, no further away than ``REUSE``."""
    if known is None or known.exact is None or known.model.state_names != model.state_names:
        return None
    width = Priors.of(problem.numbers).width
    for n, x, w in zip(problem.numbers, c, width, strict=True):
        if n.name in known.exact.at and abs(x - known.exact.at[n.name]) > REUSE * w:
            return None
    return known.exact


def pairs_of(model: Model, values: Values, others: Sequence[Values], gain: Array) -> list[tuple[Pass, Pass] | None]:
    """For each of ``others`` a pass with ``values`` and one with it; None where it is the same."""
    changed = [other for other in others if other != values]
    passes = iter(model.beside(values, changed, gain))
    return [next(passes) if other != values else None for other in others]
