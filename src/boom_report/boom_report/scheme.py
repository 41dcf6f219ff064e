"""The hydraulic scheme of a machine as inline SVG, for the reports and for the moving crane: one drawing.

What is drawn follows from the components of the machine file: accumulators by their number, the valve at the cylinder, pilot stage,
compensator, the spool's neutral, anti-cavitation valves, linkage. A subsystem that the file does not have is drawn dashed where
there is evidence for it. A report colours the subsystems by evidence; the page of the moving crane colours what carries
``data-pressure`` and moves what carries ``data-flow`` and ``data-spool``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from boom_model.catalogue import EFFECTS, SUBSYSTEM_NAMES
from boom_model.machine import Machine
from boom_report.channels import probability
from boom_report.templates import render

_STEPS = (0.05, 0.2, 0.5, 0.8, 1.01)
"""Upper limits of the probability; ``--heat-0`` and so on are their colours. Lightness falls with evidence, so that it survives a
black and white print."""
_KEYS = ("below 0.05", "to 0.2", "to 0.5", "to 0.8", "above 0.8")
_CELLS = {1: (98,), 2: (64, 132), 3: (48, 98, 148)}
"""Where the accumulators stand, by their number; more than three are not told apart."""


def heat(value: float) -> int:
    """The step of a probability, 0 to 4."""
    return next(step for step, limit in enumerate(_STEPS) if value < limit)


def scheme(machine: Machine, subsystems: Mapping[str, float] | None = None) -> Markup:
    """The drawing of a machine.

    Args:
        machine: whose components are drawn.
        subsystems: the probability that something is wrong in each (missing: zero); None: nothing is said of it.
    """
    given = subsystems or {}
    p = {name: min(max(float(given.get(name, 0.0)), 0.0), 1.0) for name in SUBSYSTEM_NAMES}
    has = components(machine)
    order = sorted(SUBSYSTEM_NAMES, key=lambda name: p[name])  # what is in doubt lies on top
    drawn = [name for name in order if has.get(name, True) or _doubted(p[name])]
    parts = [_part(name, p[name], has) for name in drawn]
    said = ", ".join(f"{part['title']} {part['probability']}" for part in reversed(parts) if part["doubted"])
    return render(
        "boom_report/scheme.html",
        said=said or ("No subsystem is in doubt" if subsystems is not None else machine.name),
        parts=parts,
        has=has,
        keys=list(enumerate(_KEYS)) if subsystems is not None else [],
    )


def components(machine: Machine) -> dict[str, Any]:
    """What of the scheme a machine has: by subsystem where the whole of it may be absent, else by component."""
    s = machine.structure
    holds = machine.holds
    accumulators = max(1, len(s.accumulators.precharges)) if s.accumulators.name != "none" else 0
    middle = sum(machine.angle_limits) / 2
    return {
        "accumulators": bool(accumulators),
        "cells": _CELLS[min(accumulators, 3)] if accumulators else (98,),
        "hose_burst_valve": machine.separates,
        "holds": holds,
        "pilot_valves": s.pilot_valves.present,
        "compensator": s.supply.name is True,
        "port_valves": s.port_valves.name is True,
        "vents": s.neutral.vents or any("neutral_area" in EFFECTS[effect].terms for effect in machine.effects),
        "levers": len(s.linkage.bars(middle, machine.numbers)) > 1,
    }


def _doubted(value: float) -> bool:
    return value >= _STEPS[0]


def _part(name: str, value: float, has: Mapping[str, Any]) -> dict[str, object]:
    x, y, anchor = _LABELS[name]
    title = "load-holding valve" if name == "hose_burst_valve" and has["holds"] else SUBSYSTEM_NAMES[name]
    present = has.get(name, True)
    return {
        "name": name, "heat": heat(value), "doubted": _doubted(value), "title": title, "present": present,
        "label": "boom" if name == "structure" else title, "probability": probability(value), "x": x, "y": y, "anchor": anchor,
    }  # fmt: skip


# Where the name is written: x, y, anchor.
_LABELS = {
    "structure": (240, 78, "middle"), "load": (503, 226, "middle"), "cylinder": (246, 350, "start"),
    "oil": (172, 350, "end"), "friction": (246, 317, "start"), "hose_burst_valve": (246, 431, "start"),
    "accumulators": (32, 394, "start"), "main_valve": (392, 606, "start"), "pilot_valves": (244, 603, "end"),
    "supply": (258, 636, "end"), "return_line": (360, 638, "start"), "sensors": (412, 386, "end"),
}  # fmt: skip
