"""Effects that are numbers' being off: the tolerances with that done to them.

A pre-charge lost, a transducer's zero, pressures that arrive late: as far as the tolerances of machine, sensors and log go, that is
no physics left out: the tolerances fitted from there reach what the effect does, and it gains nothing over them.
"""

from __future__ import annotations

from itertools import product
from math import isclose, prod

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
    numbers that a factor changes are multiplied, or divided, together or one of them.
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
    ratios = [factor * (further if k == 1 else 1.0) for k in range(len(effect.changes))]
    there = [(where[n], ratio) for n, ratio in zip(effect.changes, ratios, strict=True) if n in where]
    changed = {i: ratio for i, ratio in there if not isclose(ratio, 1.0)}
    if not effect.parameters[0].positive or not changed:
        return []
    found = []
    for numbers, power in product((changed, *({i: ratio} for i, ratio in changed.items())), (1.0, -1.0)):
        z = moved.copy()
        for i, ratio in numbers.items():
            z[i] = problem.nuisances[i].multiplied(float(z[i]), ratio**power)
        found.append(z)
    return found
