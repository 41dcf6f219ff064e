"""Effects that are numbers' being off: the tolerances with that done to them.

A pre-charge lost, a transducer's zero, pressures that arrive late: as far as the tolerances of machine, sensors and log go, that is
no physics left out, and the tolerances alone must find it.
"""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.fitting import Problem
from boom_diagnosis.nuisances import CLOCKS
from boom_diagnosis.search import Fitted
from boom_input.channels import BY_NAME
from boom_model.catalogue import EFFECTS
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]


def off_themselves(problem: Problem, f: Fitted) -> list[Array]:
    """z of the tolerances that do what an effect does, wherever their limits are: empty where none can.

    A number of the effect that is one of the tolerances, too, has its value; a dead time of the pressures is one of each channel's;
    numbers that a factor changes are multiplied, or divided.
    """
    effect = EFFECTS[f.effect]
    values = {row.name: f.point.effects[f"effects.{f.effect}.{row.name}"] for row in effect.parameters}
    where = {n.name: i for i, n in enumerate(problem.nuisances)}
    moved = f.point.z.copy()
    own = [(row, f"effects.{f.effect}.{row.name}") for row in effect.leading]
    if effect.delays == "pressures":
        for i in (where[CLOCKS + n] for n in OUTPUTS if BY_NAME[n].is_pressure and CLOCKS + n in where):
            moved[i] += values[effect.parameters[0].name] / problem.nuisances[i].sigma
        return [moved]
    if all(name in where for _, name in own):
        for row, name in own:
            moved[where[name]] = (values[row.name] - row.neutral) / problem.nuisances[where[name]].sigma
        return [moved]
    factor, further = values[effect.parameters[0].name], prod(values[r.name] for r in effect.parameters if r.acts)
    changed = {
        where[name]: factor * (further if k == 1 else 1.0) for k, name in enumerate(effect.changes) if name in where
    }
    if not effect.parameters[0].positive or not changed:
        return []
    found = []
    for power in (1.0, -1.0):
        z = moved.copy()
        for i, ratio in changed.items():
            z[i] = problem.nuisances[i].multiplied(float(z[i]), ratio**power)
        found.append(z)
    return found


def within_tolerance(problem: Problem, f: Fitted) -> bool:
    """Whether an effect is no more than tolerances may do as well, with the other effects that are there."""
    wanted = off_themselves(problem, f)
    if not wanted:
        return False
    low, high = problem.limits
    others = {n: v for n, v in f.point.effects.items() if n.split(".")[1] != f.effect}
    best = min(problem.points([(z, others) for z in wanted]), key=lambda p: p.loss) if len(wanted) > 1 else None
    z = best.z if best is not None else wanted[0]
    return bool(np.all((z >= low) & (z <= high)))
