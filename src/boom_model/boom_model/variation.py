"""Machines drawn at random from the ranges of Table 6.1 and of the effect catalogue, for robustness tests.

Table 6.1: pre-charge 0.76 .. 1.1 of nominal (both together), beta 0.2 .. 1.0, tau_f 0.5 .. 1.5 (the cylinder friction
(3.7) only), load 0 .. 2000 kg. Effects: their parameters uniformly from [low, high] of the catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boom_model.catalogue import CATALOGUE
from boom_model.machine import Machine, Pose

PRECHARGE, BULK_MODULUS, FRICTION, LOAD = (0.76, 1.1), (0.2, 1.0), (0.5, 1.5), (0.0, 2000.0)
"""Table 6.1: factors of the nominal values; the load in kg."""


@dataclass(frozen=True)
class Variation:
    """A drawn machine in a drawn pose. ``factors``: factors of Table 6.1; ``effects``: active effects."""

    machine: Machine
    pose: Pose
    factors: dict[str, float]
    effects: dict[str, dict[str, float]]


def draw(machine: Machine, rng: np.random.Generator, most_effects: int = 2) -> Variation:
    """One variation of ``machine``: Table 6.1, 1 .. ``most_effects`` effects, a tabulated pose or any other.

    A machine without accumulators keeps its other numbers; effects that it cannot have are not drawn. The generator is
    used in a fixed order, so that a seed gives the same variation everywhere.

    Raises:
        MachineError: a number of the file is so near the end of its range that a factor leaves it.
    """
    factors = {name: float(rng.uniform(*bounds)) for name, bounds in (
        ("p_g0", PRECHARGE), ("beta", BULK_MODULUS), ("tau_f", FRICTION),
    )}  # fmt: skip
    load = float(rng.uniform(*LOAD))
    changed = {"fluid.beta": machine.parameters["fluid.beta"].value[0] * factors["beta"]}
    for key in machine.structure.friction.sizes:
        changed[key] = machine.parameters[key].value[0] * factors["tau_f"]
    for key in machine.structure.accumulators.precharges:
        changed[key] = machine.parameters[key].value[0] * factors["p_g0"]
    possible = [effect for effect in CATALOGUE if machine.structure.has(effect.needs)]
    count = int(rng.integers(1, most_effects + 1))
    chosen = rng.choice(len(possible), size=count, replace=False)
    effects = {
        possible[k].id: {
            row.name: float(rng.uniform(row.low, row.high)) for row in possible[k].parameters if not row.fixed
        }
        for k in chosen
    }
    return Variation(
        machine.with_values(changed).with_effects(effects), _pose(machine, load, rng), factors | {"load": load}, effects
    )


def _pose(machine: Machine, load: float, rng: np.random.Generator) -> Pose:
    body = machine.document["rigid_body"]
    tabulated = machine.tabulated
    limits = body.get("joint_limits", {})
    k = int(rng.integers(len(tabulated) + 1))
    anywhere = [float(v) for v in rng.uniform(size=2)]
    if k == len(tabulated) and "planar" in body and "q3" in limits and "q4_per_stage" in limits:
        low, high = limits["q3"]
        stages = 2 * limits["q4_per_stage"][1]
        return machine.pose(low + (high - low) * anywhere[0], stages * anywhere[1], load)
    chosen = tabulated[k % len(tabulated)]
    return machine.pose(chosen.outer_boom_angle, chosen.telescope_length, load)
