"""The numbers of a machine as the components take them: ``p`` with its sections, ``e`` with the effects.

With these a component's function can be evaluated on its own, for instance
``hose_burst_valve.pressure_drop(flow, p, e)`` with arrays.
"""

from __future__ import annotations

from typing import Any

from boom_model.effects import EFFECTS
from boom_model.equations import namespace
from boom_model.machine import Machine, Pose


def component_parameters(machine: Machine, pose: Pose) -> tuple[Any, Any]:
    """(p, e) of a machine in a pose: ``p.cylinder.A_a``, ``e.pilot_lag.r``; effects that it does not carry are neutral."""
    values = machine.values(pose)
    p = namespace({key: value for key, value in values.items() if not key.startswith("effects.")})
    effects = {
        f"{effect.id}.{row.name}": values.get(f"effects.{effect.id}.{row.name}", row.neutral)
        for effect in EFFECTS.values()
        for row in effect.parameters
    }
    return p, namespace(effects)
