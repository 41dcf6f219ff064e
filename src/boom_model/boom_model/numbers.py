"""The numbers of a machine in a pose as the components take them: for whoever builds expressions on single components."""

from __future__ import annotations

from typing import Any

from boom_model.effects import EFFECTS
from boom_model.equations import namespace
from boom_model.machine import Machine, Pose


def component_numbers(machine: Machine, pose: Pose) -> tuple[Any, Any]:
    """(p, e): the parameters by section, ``p.cylinder.A_a``, and those of all effects, neutral where the machine has none."""
    values = machine.values(pose)
    effects = {
        f"{effect.id}.{row.name}": values.get(f"effects.{effect.id}.{row.name}", row.neutral)
        for effect in EFFECTS.values()
        for row in effect.parameters
    }
    return namespace({k: v for k, v in values.items() if not k.startswith("effects.")}), namespace(effects)
