"""Section ``payload`` of a machine file: how well loads are known, and in which steps they are picked up."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any

from boom_model.components.payload import By, Step
from boom_model.errors import MachineError, nearest
from boom_model.specification import number
from boom_model.tolerance import Tolerance, check_tolerance

MOST_STEPS = 8
_FORM = "{mass: ..., time: ...} or {mass: ..., stroke: ...}"


def check_payload(section: Any) -> tuple[Tolerance | None, Mapping[str, tuple[Step, ...]], Mapping[float, float]]:
    """Tolerance of the load of a configuration; steps by name of the recording ("": every other one); load told -> load [kg].

    Raises:
        MachineError: names the first key that is missing, misspelt or impossible.
    """
    known = ("tol", "steps", "recordings", "told")
    if not isinstance(section, dict):
        raise MachineError("payload: expected tol, steps, recordings or told below it")
    for key in section:
        if key not in known:
            raise MachineError(f"payload.{key}: no such key{nearest(str(key), known)}")
    tolerance = check_tolerance(section["tol"], "payload", ()) if "tol" in section else None
    recordings = section.get("recordings") or {}
    if not isinstance(recordings, dict):
        raise MachineError("payload.recordings: expected the name of a recording with its steps")
    listed = {f"payload.recordings.{name}": (str(name), steps) for name, steps in recordings.items()}
    if "steps" in section:
        listed["payload.steps"] = ("", section["steps"])
    return (
        tolerance,
        {name: _steps(steps, where) for where, (name, steps) in listed.items()},
        _told(section.get("told") or {}),
    )


def _told(given: Any) -> dict[float, float]:
    """Keys of YAML are read as texts."""
    try:
        pairs = {float(load): number(value) for load, value in given.items()}
    except (AttributeError, TypeError, ValueError):
        pairs = {nan: nan}  # outside of everything
    if not all(0.0 <= kg <= 1e5 for pair in pairs.items() for kg in pair):
        raise MachineError(
            "payload.told: expected {load that a configuration tells: load that it is}, kg of 0 to 100000"
        )
    return pairs


def _steps(given: Any, where: str) -> tuple[Step, ...]:
    if not isinstance(given, list) or len(given) > MOST_STEPS:
        raise MachineError(f"{where}: expected a list of at most {MOST_STEPS} steps, each {_FORM}")
    return tuple(_step(entry, f"{where}[{k}]") for k, entry in enumerate(given))


def _step(entry: Any, where: str) -> Step:
    if not isinstance(entry, dict) or set(entry) - {"tol"} not in ({"mass", "time"}, {"mass", "stroke"}):
        raise MachineError(f"{where}: expected {_FORM}")
    by: By = "time" if "time" in entry else "stroke"
    mass, at = number(entry["mass"]), number(entry[by])
    if not abs(mass) <= 1e5 or not 0.0 <= at <= 1e5:
        raise MachineError(f"{where}: {_FORM}: kg up to 100000, {by} [{'s' if by == 'time' else 'm'}] of 0 to 100000")
    return Step(mass, by, at, check_tolerance(entry["tol"], where, (mass,)) if "tol" in entry else None)
