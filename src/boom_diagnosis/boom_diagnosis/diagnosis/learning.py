"""A term learnt from the data for an equation that the catalogue cannot repair.

Products of states, direction and memory are tried like effects: the difference that each makes in the one-step errors,
freed of what the tolerances can imitate. The best are taken one after the other, a few at most, and fitted together; the
term is kept only if it improves data that was not used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.diagnosis.bag_samples import Bag
from boom_diagnosis.diagnosis.coordinates import Coordinate
from boom_diagnosis.diagnosis.document import LearnedCurve
from boom_diagnosis.diagnosis.fitting import Point, Problem
from boom_diagnosis.diagnosis.hypotheses import problem_at
from boom_diagnosis.diagnosis.nuisances import Nuisance
from boom_diagnosis.diagnosis.prediction import Predictor, with_states
from boom_diagnosis.diagnosis.search import Scanner
from boom_diagnosis.diagnosis.weighing import Z90, posterior, precision, predictive_loss
from boom_model.learned import PLACES, VARIABLES, LearnedTerm, parse
from boom_model.machine import Machine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_PRODUCTS = 4
WORTH = 8.0
"""Nats that a further product must gain."""
PROBE = 0.05
"""Of the place's scale: size at which a product is tried."""
LARGEST = 30.0
"""Of the place's scale: limit of a coefficient."""


@dataclass(frozen=True)
class Learned:
    """A term with the fit that it belongs to, its gain on data used and not used [nats]."""

    term: LearnedTerm
    point: Point
    gain: float
    held_out_gain: float
    curve: LearnedCurve


def library(equation: str, validity: Mapping[str, tuple[float, float]]) -> list[str]:
    """Products that are tried in an equation; spots and corners lie within the range of the data."""
    low, high = validity["angle"]
    spots = [f"{low + (high - low) * s:.3g}" for s in (0.1, 0.3, 0.5, 0.7, 0.9)]
    width = f"{max(0.15 * (high - low), 0.02):.3g}"
    if equation == "torque":
        return [
            "sign(rate)", "rate", "rate*abs(rate)", "plus(rate,0)", "minus(rate,0)", "lag(rate,0.1)", "lag(rate,0.5)",
            "lag(rate,2)", "angle", "angle^2", "hose_pressure", "sign(rate)*hose_pressure", "sign(rate)*rod_pressure",
            "sign(rate)*angle", "rate*angle", "sign(rate)*lag(rate,0.5)",
            *(f"bump(angle,{s},{width})" for s in spots),
            *(f"sign(rate)*bump(angle,{s},{width})" for s in spots),
            *(f"minus(angle,{s})" for s in spots[:3]),
            *(f"plus(angle,{s})" for s in spots[2:]),
            *(f"rate*minus(angle,{s})" for s in spots[:2]),
        ]  # fmt: skip
    if equation == "spool":
        return [
            "sign(rate)", "spool", "spool^3", "sign(spool)", "abs(spool)", "lag(spool,0.1)", "lag(spool,1)",
            "plus(spool,0.3)", "minus(spool,-0.3)", "spool*hose_pressure", "spool*rod_pressure", "rate", "lag(rate,0.3)",
        ]  # fmt: skip
    return [
        "spool", "abs(spool)", "plus(spool,0.28)", "minus(spool,-0.28)", "plus(spool,0.28)*hose_pressure",
        "plus(spool,0.28)*rod_pressure", "minus(spool,-0.28)*hose_pressure", "minus(spool,-0.28)*rod_pressure", "rate",
        "plus(rate,0)", "minus(rate,0)", "rate*abs(rate)", "plus(rate,0)*hose_pressure", "minus(rate,0)*hose_pressure",
        "hose_pressure", "rod_pressure", "head_pressure", "lag(rate,0.3)", "lag(rate,2)", "lag(spool,0.3)",
        *(f"rate*bump(angle,{s},{width})" for s in spots[::2]),
    ]  # fmt: skip


def learn(
    machine: Machine, bags: Sequence[Bag], select: Sequence[Flags], judged: Sequence[Flags],
    nuisances: Sequence[Nuisance], at: Point, equations: Sequence[str], looseness: float,
    proving: Sequence[Bag] = (),
) -> Learned | None:  # fmt: skip
    """The best term in one of the equations (keys of ``PLACES``), or None where none improves data not used."""
    found: list[Learned | None] = []
    tolerances = None  # the same in all: what is learnt begins at zero
    for equation in equations:
        learned, tolerances = _learn_in(
            machine, bags, select, judged, nuisances, at, equation, looseness, proving, tolerances
        )
        found.append(learned)
    kept = [f for f in found if f is not None and f.held_out_gain > 0.0]
    return max(kept, key=lambda f: f.gain + f.held_out_gain) if kept else None


def _learn_in(
    machine: Machine, bags: Sequence[Bag], select: Sequence[Flags], judged: Sequence[Flags],
    nuisances: Sequence[Nuisance], at: Point, equation: str, looseness: float, proving: Sequence[Bag],
    known: Array | None,
) -> tuple[Learned | None, Array]:  # fmt: skip
    validity = _ranges(machine, bags, at)
    everything = library(equation, validity)
    wide = _with(machine, equation, everything, validity)
    problem = problem_at(wide, bags, select, nuisances, at.z, at.effects, looseness, judged)
    base = problem.points([(at.z, at.effects)])[0]
    tolerances = problem.nuisance_jacobian(base) if known is None else known
    scanner = Scanner(problem, base, tolerances)
    probes = problem.points([(at.z, {**at.effects, f"learned.0.{j}": PROBE}) for j in range(len(everything))])
    columns = np.stack([(p.w - base.w) / PROBE for p in probes], axis=-1)
    chosen = _forward(scanner, columns)
    if not chosen:
        return None, tolerances
    basis = [everything[j] for j in chosen]
    _, sizes = scanner.gain(columns[:, chosen])
    small = _with(machine, equation, basis, validity)
    narrow = problem_at(small, bags, select, nuisances, at.z, at.effects, looseness, judged)
    names = tuple(
        Coordinate(f"learned.0.{j}", PLACES[equation].unit, -LARGEST, LARGEST, PROBE, False, (-LARGEST, LARGEST))
        for j in range(len(basis))
    )
    start = _descended(narrow, at, names, np.clip(sizes, -LARGEST, LARGEST))
    point, jacobian = narrow.fit(start, tolerances, names, iterations=6)
    reference = narrow.points([(at.z, {**at.effects, **{c.name: 0.0 for c in names}})])[0]
    term = LearnedTerm(
        equation, tuple(basis), tuple(point.effects[c.name] for c in names), {v: validity[v] for v in _used(basis)}
    )
    without, with_ = precision(reference, tolerances, len(at.z)), precision(point, jacobian, len(at.z))
    if proving:
        others = problem_at(
            small, proving, [bag.counted for bag in proving], nuisances, point.z, point.effects, looseness
        )
        before, after = others.points([(reference.z, reference.effects), (point.z, point.effects)])
        own = others.nuisance_jacobian(after)
        both = np.concatenate([own, others.effect_jacobian(after, names)], axis=1)
        held = predictive_loss(before.w, own, without) - predictive_loss(after.w, both, with_)
    else:
        rows = ~point.used
        held = predictive_loss(reference.w[rows], tolerances[rows], without) - predictive_loss(
            point.w[rows], jacobian[rows], with_
        )
    covariance = posterior(point, jacobian, len(point.z))[len(point.z) :, len(point.z) :]
    return Learned(term, point, reference.loss - point.loss, held, _curve(term, covariance)), tolerances


def _forward(scanner: Scanner, columns: Array) -> list[int]:
    """Products taken one after the other while each gains enough."""
    chosen: list[int] = []
    gained = 0.0
    while len(chosen) < MOST_PRODUCTS:
        tried = [
            (scanner.gain(columns[:, [*chosen, j]])[0], j) for j in range(columns.shape[1])
            if j not in chosen and float(np.abs(columns[:, j]).max()) > 0.0
        ]  # fmt: skip
        if not tried:
            break
        best, j = max(tried)
        if best - gained < WORTH:
            break
        chosen.append(j)
        gained = best
    return chosen


def _descended(problem: Problem, at: Point, names: Sequence[Coordinate], sizes: Array) -> Point:
    """The best of a few points on the way to the linear answer."""
    wanted = [
        (at.z, {**at.effects, **{c.name: float(share * v) for c, v in zip(names, sizes, strict=True)}})
        for share in (1.0, 0.5, 0.2, 0.0)
    ]
    return min(problem.points(wanted), key=lambda p: p.loss)


def _ranges(machine: Machine, bags: Sequence[Bag], at: Point) -> dict[str, tuple[float, float]]:
    """Range of each variable in the states that the observer saw, as far as 99 % of the samples go."""
    names = Predictor(machine, bags).plant(0, with_states(at.effects)).state_names
    states = np.concatenate(at.states)
    states = states[np.isfinite(states).all(axis=1)]
    stroke = machine.parameters["main_valve_spool.s_max"].value[0] if "spool_position" in names else 1.0
    result = {}
    for name, variable in VARIABLES.items():
        state = "spool_position" if name == "spool" else name
        if state not in names:
            continue
        scale = stroke if name == "spool" else 1.0
        low, high = np.percentile(states[:, names.index(state)] / scale, [0.5, 99.5])
        room = 0.02 * variable.scale
        result[name] = (float(f"{low - room:.4g}"), float(f"{high + room:.4g}"))
    return result


def _used(basis: Sequence[str]) -> list[str]:
    return sorted({f.variable for text in basis for f in parse(text)})


def _with(
    machine: Machine, equation: str, basis: Sequence[str], validity: Mapping[str, tuple[float, float]]
) -> Machine:
    entry = LearnedTerm(equation, tuple(basis), (0.0,) * len(basis), {v: validity[v] for v in _used(basis)})
    return replace(machine, learned=(entry,))


def _curve(term: LearnedTerm, covariance: Array) -> LearnedCurve:
    """The term over the variable that moves it most, others in the middle of their range; covariance: of the coefficients."""
    place = PLACES[term.equation]
    formula = " ".join(f"{c:+.3g} {b}" for c, b in zip(term.coefficients, term.basis, strict=True))
    names = _used(term.basis)
    main = max(names, key=lambda v: sum(abs(c) for c, b in zip(term.coefficients, term.basis, strict=True) if v in b))
    low, high = term.validity[main]
    x = np.linspace(low, high, 121)
    columns = _evaluate(term, main, x)
    y = columns @ np.array(term.coefficients)
    band = Z90 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", columns, covariance, columns), 0.0))
    return LearnedCurve(
        place.equation, f"{place.scale:g} {place.unit} x ({formula})", reading(term), main, VARIABLES[main].unit, place.unit,
        x, y, y - band, y + band,
    )  # fmt: skip


def _evaluate(term: LearnedTerm, main: str, x: Array) -> Array:
    """Its products (len(x), len(basis)) over one variable; the others in the middle of their range, memories settled."""
    columns = []
    for text in term.basis:
        product = np.ones(len(x))
        for f in parse(text):
            v = (x if f.variable == main else np.full(len(x), sum(term.validity[f.variable]) / 2)) / VARIABLES[
                f.variable
            ].scale
            product = product * _factor(f.function, f.numbers, v)
        columns.append(product * PLACES[term.equation].scale)
    return np.stack(columns, axis=-1)


def _factor(function: str, numbers: tuple[float, ...], v: Array) -> Array:
    import casadi as ca

    from boom_model.learned import Factor, _value

    x = ca.SX.sym("x")
    f = ca.Function("f", [x], [_value(Factor(function, "rate", numbers), x, lambda _v, _t, value: value)])
    return np.asarray(f(v.reshape(1, -1)), dtype=float).ravel()


def reading(term: LearnedTerm) -> str:
    """What the shape suggests, in words."""
    weight = {b: abs(c) for b, c in zip(term.basis, term.coefficients, strict=True)}
    main = max(weight, key=lambda b: weight[b])
    c = dict(zip(term.basis, term.coefficients, strict=True))[main]
    functions = {f.function for f in parse(main)}
    variables = {f.variable for f in parse(main)}
    if "lag" in functions:
        return "has a memory: it depends on what happened before"
    if term.equation == "torque":
        if "sign" in functions or variables == {"rate"}:
            spot = " at one spot" if "bump" in functions else ""
            one = ", in one direction only" if functions & {"plus", "minus"} else ""
            kind = "dissipative" if (c < 0) != ("minus" in functions) else "driving, not dissipative: doubt it"
            return f"{kind}: acts against the movement{spot}{one}" if kind == "dissipative" else kind
        if functions & {"plus", "minus"}:
            return "elastic and one-sided: something is touched beyond a certain angle"
        if variables == {"angle"}:
            return "elastic: depends on the angle alone"
        return "depends on the pressure: friction under load, or a wrong area"
    if functions & {"plus", "minus"} and variables & {"spool", "rate"}:
        return "depends on the flow, in one direction only"
    if variables & {"hose_pressure", "rod_pressure", "head_pressure"}:
        return "depends on the pressure: a leak or a compliance"
    return "depends on the flow"
