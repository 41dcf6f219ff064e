"""The numbers of a machine as the components take them: ``p`` with its sections, ``e`` with the terms of its effects.

With these a component's function can be evaluated separately, for instance
``hose_burst_valve.pressure_drop(flow, p, e)`` with arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from boom_model.catalogue.terms import Terms
from boom_model.equations import namespace
from boom_model.machine import Machine, Pose


def component_parameters(machine: Machine, pose: Pose) -> tuple[Any, Terms]:
    """(p, e) of a machine in a pose: ``p.cylinder.A_a``, ``e.through("bulk_modulus", ...)``."""
    return components_of(machine.values(pose))


def components_of(values: Mapping[str, float]) -> tuple[Any, Terms]:
    """(p, e) of a parameter vector by dotted name."""
    p = namespace({key: value for key, value in values.items() if not key.startswith("effects.")})
    effects: dict[str, dict[str, float]] = {}
    for key, value in values.items():
        if key.startswith("effects."):
            _, effect, name = key.split(".")
            effects.setdefault(effect, {})[name] = value
    return p, Terms(effects)
