"""Which equation is wrong, in two ways that do not share a step.

Statistical: an unknown input is allowed in one equation after the other (white noise on its derivative, of the likeliest
size); the equation where it raises the likelihood most is the one in doubt (after Kristensen, Madsen, Jorgensen 2004).
Chain: the model is forced along the measured signals, and what each equation must be given so that it follows is compared
with what a healthy machine of the same currents must be given.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.disturbances import PISTON, slipping
from boom_diagnosis.document import EquationEvidence
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.hypotheses import LOOSENESS, problem_at
from boom_diagnosis.nuisances import Nuisance
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.prediction import Predictor
from boom_diagnosis.unknown_input import forced
from boom_model.machine import Machine

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Link:
    """One equation: the state on whose derivative an unknown input acts, and the subsystems that are at home there."""

    key: str
    title: str
    equation: str
    state: str
    subsystems: tuple[str, ...]


LINKS = (
    Link("torque", "force to motion", "5.39b", "rate", ("load", "structure", "friction")),
    Link("head_flow", "flow through the hose burst valve into the cylinder", "5.39f", "head_pressure",
         ("hose_burst_valve", "cylinder", "oil")),
    Link("hose_flow", "flow into hose and accumulators", "5.39i", "hose_pressure",
         ("accumulators", "main_valve", "supply", "return_line")),
    Link("rod_flow", "flow into the rod side", "5.39d", "rod_pressure", ("main_valve", "cylinder", "supply", "return_line")),
    Link("spool", "command to spool", "5.39n", "spool_position", ("main_valve", "pilot_valves")),
)  # fmt: skip
BETWEEN = Link("piston", "motion of the piston to motion of the boom", "5.39d,f", PISTON, ("structure", "cylinder"))
"""Play or a leak: oil of one side more and of the other less than the boom's motion says, one input for both. No term is learnt
there."""
OFFERED = {"accumulators": "accumulators", "hose_burst_valve": "valve_at_the_cylinder", "pilot_valves": "pilot_valves"}
"""Subsystem -> what a machine's structure offers that has it; the others are in every machine."""
SIZES = (4.0, 25.0, 150.0)
"""Unknown inputs that are tried, in units of the disturbance that a healthy machine shows."""


def links(machine: Machine) -> tuple[Link, ...]:
    """The equations that a machine has. With no valve between hose and cylinder both are one volume, and one equation."""
    told = tuple(
        replace(
            link,
            title=_title(link, machine),
            subsystems=tuple(s for s in link.subsystems if _offered(machine, s)),
        )
        for link in LINKS
    )
    if machine.separates:
        return told
    hose, head = (next(link for link in told if link.key == key) for key in ("hose_flow", "head_flow"))
    others = (subsystem for subsystem in head.subsystems if subsystem != "hose_burst_valve")
    joined = replace(head, title="flow into the head side", subsystems=(*hose.subsystems, *others))
    return tuple(joined if link is head else link for link in told if link is not hose)


def _offered(machine: Machine, subsystem: str) -> bool:
    """Whether a machine has it: of its structure, or as an effect that stands between hose and head side."""
    added = subsystem == "hose_burst_valve" and machine.separates
    return added or machine.structure.has(OFFERED.get(subsystem, ""))


def _title(link: Link, machine: Machine) -> str:
    """In the words of this machine."""
    if link.key == "hose_flow" and not machine.structure.has("accumulators"):
        return "flow into the hose"
    return link.title.replace("hose burst", "load-holding") if machine.holds else link.title


def places(machine: Machine) -> tuple[Link, ...]:
    """What may be in doubt: the equations, and what lies between two of them."""
    return (*links(machine), BETWEEN)


def locate(
    machine: Machine, bags: Sequence[Bag], select: Sequence[Flags], nuisances: Sequence[Nuisance], z: Array,
    values: Mapping[str, float], healthy: Sequence[Bag], *, doubted: bool = True, others: Sequence[Array] = (),
) -> tuple[tuple[EquationEvidence, ...], str, list[dict[str, Array]]]:  # fmt: skip
    """Evidence per equation; whether both ways agree, in words; unknown inputs over time per recording.

    At the fitted point (z, ``values``), or, where no effect was found, at other fits (``others``) or the file's own numbers, if
    these are likelier once an unknown input is allowed: what is missing may have driven the fit far from the machine, and then the
    chain breaks where nothing is wrong.

    doubted: whether any equation is in doubt; the statistical way, which is the long one, is gone only then. Behind a valve that
    holds the load the chain cannot be forced: the pressure that carries the boom is not measured.
    """
    base = problem_at(machine, bags, select, nuisances, z, values, 1.0)
    statistical = {link.key: 0.0 for link in places(machine)}
    if doubted:
        statistical, most = _statistical(base, z, values)
        for other in (*others, np.zeros(len(z))) if not values else ():
            own = problem_at(machine, bags, select, nuisances, other, {}, 1.0)
            shares, likeliest = _statistical(own, other, {})
            if likeliest > most:
                statistical, most, base, z = shares, likeliest, own, other
    chain, inputs = _chain(base, z, values, healthy)
    if holds := machine.holds:
        chain = dict.fromkeys(chain, 0.0)
    rows = tuple(
        EquationEvidence(link.key, link.title, link.equation, link.subsystems, statistical[link.key], chain[link.key])
        for link in places(machine)
    )
    first = max(rows, key=lambda r: r.statistical)
    second = max(rows, key=lambda r: r.chain)
    if max(statistical.values()) <= 0.0:
        return rows, "No equation needs an unknown input.", inputs
    if max(chain.values()) <= 0.0:
        along = "forced along the measured signals the chain holds"
        said = "the chain cannot be forced past a valve that holds the load" if holds else along
        return rows, f"An unknown input helps most in '{first.title}'; {said}.", inputs
    if first.key == second.key or set(first.subsystems) & set(second.subsystems):
        return rows, f"Both ways of locating agree on: {first.title}.", inputs
    return rows, (
        f"Seen from one sample to the next an unknown input helps most in '{first.title}', over the whole run the chain of "
        f"measured signals breaks at '{second.title}': what is missing shows in both, and what was found is weighed by all "
        "equations."
    ), inputs  # fmt: skip


def _statistical(base: Problem, z: Array, values: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Share of each equation in what unknown inputs raise the likelihood by, and the largest with one, prior included [nats]."""
    reference, looseness = base.likelihood_at(z, values), base.predictor.looseness

    def raised(tried: tuple[Link, float]) -> float:
        link, size = tried
        return base.bearing_with(looseness, {link.state: size}).likelihood_at(z, values) - reference

    own = places(base.predictor.machine)
    found = in_parallel(raised, [(link, size) for link in own for size in SIZES])
    best = [max(0.0, *found[k : k + len(SIZES)]) for k in range(0, len(found), len(SIZES))]
    return _shares(dict(zip((link.key for link in own), best, strict=True))), reference + max(best)


def disturbed(base: Problem, at: Point, among: Sequence[Link]) -> float:
    """Log-likelihood [nats] at a point of the likeliest observer that sees disturbances: of all equations, or of one ``among``."""
    loose = base.predictor.looseness
    seeing = [(looseness, dict[str, float]()) for looseness in LOOSENESS if looseness > loose]
    seeing += [(loose, {link.state: size}) for link in among for size in SIZES]
    return max(in_parallel(lambda observer: base.bearing_with(*observer).likelihood_at(at.z, at.effects), seeing))


def _chain(
    base: Problem, z: Array, values: Mapping[str, float], healthy: Sequence[Bag]
) -> tuple[dict[str, float], list[dict[str, Array]]]:
    """What the observer must give to each equation, against a healthy machine; both observers are made very loose."""
    numbers = base.values(z, values)
    inputs = forced(base.predictor, numbers)
    reference = forced(Predictor(base.predictor.machine, healthy), {})
    equations = links(base.predictor.machine)
    plant = base.predictor.base[0]
    slip = slipping(dict(zip(plant.parameter_names, plant.p, strict=True)) | numbers)
    excess, scaled = dict.fromkeys((*(link.key for link in equations), BETWEEN.key), 0.0), []
    for own, other in zip(inputs, reference, strict=True):
        noise = {link.state: max(_size(other.corrections[link.state]), 1e-30) for link in equations}
        row = {link.key: own.corrections[link.state] / noise[link.state] for link in equations}
        # what both sides' have in common, as one slip of the piston gives them
        common, still = (
            np.sum([f.corrections[state] * by / noise[state] ** 2 for state, by in slip.items()], axis=0)
            for f in (own, other)
        )
        row[BETWEEN.key] = (
            common / max(_size(still), 1e-30) if all(noise[state] > 1e-30 for state in slip) else 0.0 * common
        )
        for key, given in row.items():
            excess[key] += max(0.0, float(np.mean(given**2)) - 1.3)
        scaled.append(row)
    broken = breaks(sum(excess[link.key] for link in equations))
    return {key: share * broken for key, share in _shares(excess).items()}, scaled


def _size(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def breaks(excess: float) -> float:
    """How far the chain breaks at all, 0 to 1: E / (E + 1); one that holds but for a little accuses no equation."""
    return excess / (excess + 1.0)


def _shares(values: Mapping[str, float]) -> dict[str, float]:
    total = sum(values.values())
    return {name: (v / total if total > 0.0 else 0.0) for name, v in values.items()}
