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

from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.coordinates import Coordinate
from boom_diagnosis.document import LearnedCurve
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.hypotheses import LOOSENESS, noticed, problem_at
from boom_diagnosis.locating import Link, links
from boom_diagnosis.nuisances import Nuisance
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.prediction import Predictor, with_states
from boom_diagnosis.search import Scanner
from boom_diagnosis.unknown_input import Forced, Regression, forced, regress
from boom_diagnosis.weighing import Z90, posterior, precision, predictive_loss
from boom_model.learned import PLACES, VARIABLES, LearnedTerm, evaluate, parse, state_of
from boom_model.machine import Machine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_PRODUCTS = 4
WORTH = 8.0
"""Nats that a further product must gain."""
PROBE = 0.05
"""Of the place's scale: size at which a product is tried."""
LARGEST = 200.0
"""Of the place's scale: limit of a coefficient."""
REPEATED = 2
"""Times that a regression is repeated with an observer that has its term already."""
CLEAR = 0.9
"""Share of an equation's unknown input that products must explain for no others to be sought."""


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


@dataclass(frozen=True)
class Setting:
    """What a term is learnt from: recordings with the samples that are fitted and judged, and others that prove it.

    looseness: of the observer that the search settled for.
    """

    machine: Machine
    bags: Sequence[Bag]
    select: Sequence[Flags]
    judged: Sequence[Flags]
    nuisances: tuple[Nuisance, ...]
    proving: Sequence[Bag]
    looseness: float

    def problem(self, machine: Machine, z: Array, effects: Mapping[str, float], looseness: float) -> Problem:
        """Of the machine with a term or without."""
        return problem_at(machine, self.bags, self.select, self.nuisances, z, effects, looseness, self.judged)


@dataclass(frozen=True)
class Start:
    """A term to be fitted: products, the sizes to start from, and the point that it is added to.

    tolerances: derivatives that are good enough there; None where they are to be taken with the term.
    """

    equation: str
    basis: Sequence[str]
    sizes: Array
    at: Point
    looseness: float
    tolerances: Array | None


def learn(setting: Setting, at: Point, equations: Sequence[str]) -> Learned | None:
    """The best term in one of the equations (keys of ``PLACES``), or None where none improves data not used.

    Where an equation's unknown input is plain to see, its regression is the term; else products are sought in the one-step errors.
    """
    plain = learn_plainly(setting, at, equations)
    if plain:
        return plain
    problem = setting.problem(setting.machine, at.z, at.effects, setting.looseness)
    # of the machine without a term: what is learnt begins at zero
    tolerances = problem.nuisance_jacobian(problem.points([(at.z, at.effects)])[0])

    def sought(equation: str) -> Learned | None:
        start = _sought(setting, at, equation, tolerances)
        return _fitted(setting, start) if start else None

    own = [e for e in equations if e != "spool" or setting.machine.structure.spool.piloted]
    kept = [f for f in in_parallel(sought, own) if f is not None and f.held_out_gain > 0.0]
    return max(kept, key=lambda f: f.gain + f.held_out_gain) if kept else None


def learn_plainly(setting: Setting, at: Point, equations: Sequence[str]) -> Learned | None:
    """The regression of an equation's unknown input, if that is plain to see; of several equations' the likeliest."""
    tried = in_parallel(lambda start: _fitted(setting, start), _regressed(setting, at, equations))
    # data not used has confirmed it already, and may lie where it does nothing
    return min((t for t in tried if t.held_out_gain > -WORTH), key=lambda t: t.point.loss, default=None)


def _regressed(setting: Setting, at: Point, equations: Sequence[str]) -> list[Start]:
    """Terms that explain an equation's unknown input nearly whole, beside the tolerances as fitted or as they are nominally."""
    tried = dict[str, list[tuple[Regression, Array, Link]]]()
    for z in (np.zeros_like(at.z), at.z) if at.z.any() else (at.z,):
        base = setting.problem(setting.machine, z, at.effects, setting.looseness)
        numbers = base.values(z, at.effects)
        inputs = forced(base.predictor, numbers)
        for link in links(setting.machine):
            if link.key in equations and link.key != "spool":  # its input is a pressure, which no state's derivative is
                r = _regression(setting, base, numbers, inputs, link, None)
                if r and r.share > CLEAR:
                    tried.setdefault(link.key, []).append((r, z, link))
    return [_settled(setting, at, *max(found, key=lambda t: t[0].share)) for found in tried.values()]


def _settled(setting: Setting, at: Point, r: Regression, z: Array, link: Link) -> Start:
    """A regression repeated, with an observer that has its term."""
    validity = _ranges(setting.machine, at.states, _state_names(setting, at))
    for _ in range(REPEATED):  # one that lacks it shares it out to other equations, too
        machine = _with(setting.machine, link.key, r.basis, validity)
        base = setting.problem(machine, z, at.effects, setting.looseness)
        numbers = base.values(z, at.effects) | {f"learned.0.{j}": c for j, c in enumerate(r.coefficients)}
        r = _regression(setting, base, numbers, forced(base.predictor, numbers), link, r) or r
    return Start(link.key, r.basis, np.array(r.coefficients), replace(at, z=z), LOOSENESS[0], None)


def _regression(
    setting: Setting, base: Problem, numbers: Mapping[str, float], inputs: Sequence[Forced], link: Link,
    term: Regression | None,
) -> Regression | None:  # fmt: skip
    plant, _, _, _, p = base.predictor.job(0, numbers)
    runs = [np.stack([f.states[n] for n in plant.state_names], axis=-1) for f in inputs]
    products = library(link.key, _ranges(setting.machine, runs, plant.state_names))
    number = dict(zip(plant.parameter_names, p, strict=True))
    return regress(inputs, link.key, link.state, number, products, setting.select, setting.judged, term)


def _sought(setting: Setting, at: Point, equation: str, tolerances: Array) -> Start | None:
    """The products that take most away from the one-step errors, by a linear look at all; None where none takes enough."""
    validity = _ranges(setting.machine, at.states, _state_names(setting, at))
    everything = library(equation, validity)
    wide = _with(setting.machine, equation, everything, validity)
    problem = setting.problem(wide, at.z, at.effects, setting.looseness)
    base = problem.points([(at.z, at.effects)])[0]
    scanner = Scanner(problem, base, tolerances)
    probes = problem.points([(at.z, {**at.effects, f"learned.0.{j}": PROBE}) for j in range(len(everything))])
    columns = np.stack([(p.w - base.w) / PROBE for p in probes], axis=-1)
    chosen = _forward(scanner, columns)
    if not chosen:
        return None
    _, sizes = scanner.gain(columns[:, chosen])
    return Start(equation, [everything[j] for j in chosen], sizes, at, setting.looseness, tolerances)


def _fitted(setting: Setting, start: Start) -> Learned:
    """The term with its coefficients fitted together with the tolerances, and what it is worth."""
    at, basis, equation = start.at, start.basis, start.equation
    validity = _ranges(setting.machine, at.states, _state_names(setting, at))
    machine = _with(setting.machine, equation, basis, validity)
    names = tuple(
        Coordinate(f"learned.0.{j}", PLACES[equation].unit, -LARGEST, LARGEST, PROBE, False, (-LARGEST, LARGEST))
        for j in range(len(basis))
    )
    problem = setting.problem(machine, at.z, at.effects, start.looseness)
    first = _descended(problem, at, names, np.clip(start.sizes, -LARGEST, LARGEST))
    if start.tolerances is None:  # far from the machine without the term: its own gains, its own derivatives
        problem = setting.problem(machine, at.z, first.effects, start.looseness)
        first = problem.points([(at.z, first.effects)])[0]
    tolerances = problem.nuisance_jacobian(first) if start.tolerances is None else start.tolerances
    zero = {c.name: 0.0 for c in names}
    reference = problem.points([(at.z, {**at.effects, **zero})])[0]
    tried = [problem.fit(first, tolerances, names, iterations=6)]
    if start.tolerances is None:
        nominal = problem.fit_nominal(first.effects, names)
        columns = [tolerances, problem.effect_jacobian(nominal, names)]
        tried.append((nominal, np.concatenate(columns, axis=1)))
    held = _held_out_gains(setting, machine, (reference, tolerances), tried, names, start.looseness)
    best = len(tried) - 1  # tolerances that gain nothing stay where they are
    if noticed(tried[best][0].loss - tried[0][0].loss, len(at.z)) and held[0] > held[best]:
        best = 0
    point, jacobian = tried[best]
    term = LearnedTerm(
        equation, tuple(basis), tuple(point.effects[c.name] for c in names), {v: validity[v] for v in _used(basis)}
    )
    covariance = posterior(point, jacobian, len(point.z))[len(point.z) :, len(point.z) :]
    return Learned(term, point, reference.loss - point.loss, held[best], _curve(term, covariance))


def _held_out_gains(
    setting: Setting, machine: Machine, reference: tuple[Point, Array], tried: Sequence[tuple[Point, Array]],
    names: Sequence[Coordinate], looseness: float,
) -> list[float]:  # fmt: skip
    """What each point, with its Jacobian, gains over the reference on data not used [nats]."""
    count = len(setting.nuisances)
    known = [precision(point, jacobian, count) for point, jacobian in (reference, *tried)]
    if setting.proving:
        select = [bag.counted for bag in setting.proving]
        point = tried[0][0]
        others = problem_at(machine, setting.proving, select, setting.nuisances, point.z, point.effects, looseness)
        at = others.points([(p.z, p.effects) for p, _ in (reference, *tried)])
        own = others.nuisance_jacobian(at[1])
        columns = [own, *(np.concatenate([own, others.effect_jacobian(p, names)], axis=1) for p in at[1:])]
        before, *after = (predictive_loss(p.w, c, k) for p, c, k in zip(at, columns, known, strict=True))
    else:
        rows = ~reference[0].used
        before, *after = (
            predictive_loss(p.w[rows], c[rows], k) for (p, c), k in zip((reference, *tried), known, strict=True)
        )
    return [before - loss for loss in after]


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


def _state_names(setting: Setting, at: Point) -> tuple[str, ...]:
    return Predictor(setting.machine, setting.bags).plant(0, with_states(at.effects)).state_names


def _ranges(machine: Machine, runs: Sequence[Array], names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Range of each variable in the states that the observer saw, (n, NX) per recording, as far as 99 % of the samples go."""
    states = np.concatenate(runs)
    states = states[np.isfinite(states).all(axis=1)]
    stroke = machine.parameters["main_valve_spool.s_max"].value[0] if "spool_position" in names else 1.0
    result = {}
    for name, variable in VARIABLES.items():
        state = state_of(name, names)
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
    scaled = {
        v: (x if v == main else np.full(len(x), sum(term.validity[v]) / 2)) / VARIABLES[v].scale
        for v in _used(term.basis)
    }
    columns = [evaluate(text, scaled, lambda _v, _t, value: value) for text in term.basis]
    return np.stack(columns, axis=-1) * PLACES[term.equation].scale


def reading(term: LearnedTerm) -> str:
    """What the shape suggests, in words."""
    weight = {b: abs(c) for b, c in zip(term.basis, term.coefficients, strict=True)}
    main = max(weight, key=lambda b: weight[b])
    c = dict(zip(term.basis, term.coefficients, strict=True))[main]
    factors = parse(main)
    functions, variables = {f.function for f in factors}, {f.variable for f in factors}
    if "lag" in functions:
        return "has a memory: it depends on what happened before"
    if term.equation == "torque":
        if "rate" in variables:
            sided = {f.function for f in factors if f.variable == "rate"} & {"plus", "minus"}
            if (c < 0) == ("minus" in sided):
                return "driving, not dissipative: doubt it"
            spot = " at one spot" if "bump" in functions else ""
            beyond = " beyond a certain angle" if functions & {"above", "below"} else ""
            one = ", in one direction only" if sided else ""
            return f"dissipative: acts against the movement{spot}{beyond}{one}"
        if functions & {"plus", "minus"}:
            return "elastic and one-sided: something is touched beyond a certain angle"
        if variables == {"angle"}:
            return "elastic: depends on the angle alone"
        return "depends on the pressure: friction under load, or a wrong area"
    opened = next((f for f in factors if f.function == "plus" and f.variable.endswith("pressure")), None)
    if opened and len(factors) == 1:
        where = opened.variable.replace("_", " ")
        slope = c * PLACES[term.equation].scale / VARIABLES[opened.variable].scale * 6e9
        bar = opened.numbers[0] * VARIABLES[opened.variable].scale / 1e5
        what = "a relief valve: it opens" if c < 0 else "something that lets flow in"
        return f"{what} beyond {bar:.0f} bar of the {where}, {abs(slope):.2g} l/min a bar"
    if functions & {"plus", "minus"} and variables & {"spool", "rate"}:
        return "depends on the flow, in one direction only"
    if variables & {"hose_pressure", "rod_pressure", "head_pressure"}:
        return "depends on the pressure: a leak or a compliance"
    return "depends on the flow"
