"""The effect catalogue: physics that the nominal model leaves out, one effect a file, found here by itself.

Simulation, sensitivity, fitting, report and documentation read this one catalogue. To add an effect is to add a file with its
``EFFECT``. An effect that is not named in ``effects:`` of the machine file has no term in the equations and costs nothing;
states that an effect brings exist only while it is active. Ids are those that others rely on (contract).
"""

from __future__ import annotations

import contextlib
import importlib
import pkgutil
from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any

from boom_model.catalogue.effect import SUBSYSTEM_NAMES, Effect, EffectParameter
from boom_model.errors import MachineError, nearest

__all__ = [
    "CATALOGUE", "EFFECTS", "SUBSYSTEM_NAMES", "Effect", "EffectParameter", "active_effects", "beginning",
    "check_effects", "effect_name", "is_neutral",
]  # fmt: skip


def _found() -> tuple[Effect, ...]:
    """The effects of all files, by subsystem and place."""
    names = (module.name for module in pkgutil.iter_modules(__path__) if module.name not in ("effect", "terms"))
    effects = [importlib.import_module(f"{__name__}.{name}").EFFECT for name in sorted(names)]
    order = list(SUBSYSTEM_NAMES)
    return tuple(sorted(effects, key=lambda effect: (order.index(effect.subsystem), effect.place)))


CATALOGUE: tuple[Effect, ...] = _found()

EFFECTS: dict[str, Effect] = {effect.id: effect for effect in CATALOGUE}


def effect_name(effect: str | None) -> str:
    """Name of an effect in a table: its id in words; unmodelled physics where it has none."""
    return "unmodelled physics" if effect is None else effect.replace("_", " ")


def check_effects(values: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """Effect id -> {parameter: value}, completed with neutral values.

    Raises:
        MachineError: unknown effect or parameter, or a value outside its limits.
    """
    result: dict[str, dict[str, float]] = {}
    for name, given in values.items():
        if name not in EFFECTS:
            raise MachineError(f"effects.{name}: no such effect{nearest(name, EFFECTS)}")
        rows = {row.name: row for row in EFFECTS[name].parameters}
        if not isinstance(given, dict):
            raise MachineError(f"effects.{name}: expected parameters, e.g. {{{next(iter(rows))}: ...}}")
        result[name] = {row.name: row.neutral for row in rows.values()}
        for key, value in given.items():
            if key not in rows:
                raise MachineError(f"effects.{name}.{key}: no such parameter{nearest(key, rows)}")
            result[name][key] = _checked(f"effects.{name}.{key}", value, rows[key])
    return result


def _checked(key: str, value: Any, row: EffectParameter) -> float:
    if isinstance(value, dict):
        value = value.get("value")
    if isinstance(value, str):  # YAML 1.1 takes 1.0e3 for a text
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise MachineError(f"{key}: {value!r} is not a finite number")
    if not (value == row.neutral or row.minimum <= value <= row.maximum):
        unit = "" if row.unit == "-" else f" {row.unit}"
        raise MachineError(f"{key}: {value:g}{unit} is outside {row.minimum:g} .. {row.maximum:g}{unit}")
    return float(value)


def is_neutral(name: str, values: dict[str, float]) -> bool:
    """Whether the effect's term vanishes: the parameters that act by themselves are at their neutral values."""
    effect = EFFECTS[name]
    return all(values[row.name] == row.neutral for row in effect.parameters if row.acts or row in effect.leading)


def active_effects(given: Any, has: Callable[[str], bool]) -> dict[str, dict[str, float]]:
    """The effects that are not neutral, complete and checked; ``has`` tells whether the machine has a component.

    Raises:
        MachineError: unknown effect or parameter, a value outside its limits, or a component that is not there.
    """
    if not isinstance(given, dict):
        raise MachineError("effects: expected effect ids with their parameters below")
    complete = check_effects(given)
    for name in complete:
        if not has(EFFECTS[name].needs):
            raise MachineError(f"effects.{name}: this machine has {EFFECTS[name].lacking}")
    return {name: values for name, values in complete.items() if not is_neutral(name, values)}


def beginning(effects: Mapping[str, Mapping[str, float]], time: float) -> dict[str, dict[str, float]]:
    """The effects, those that begin at a time beginning at this one [s]: in another recording it is another."""
    result = {name: dict(values) for name, values in effects.items()}
    for name in result:
        if EFFECTS[name].onset:
            result[name][EFFECTS[name].onset] = time
    return result
