"""Cranes of other structures, as their owners would write them into a machine file."""

from __future__ import annotations

import copy
import math
from collections.abc import Collection
from typing import Any

import numpy as np

from unseen_plant.machine import Owner
from unseen_plant.sensing import Fitting

NAME = "unseen"
_TRIANGLE = {"a": (1.8075, "m"), "b": (0.44182, "m"), "phi0": (1.00043, "rad")}
_SUPPLY_DROP = 1.4e7
"""Pa over an edge without compensator, on which its area is laid out."""


def restructured(owner: Owner, needs: Collection[str], fitting: Fitting, rng: np.random.Generator) -> Owner:
    """A crane around the same boom with another linkage, valve, and equipment, each by lot; what an effect ``needs`` stays.

    The file also tells the sensors, as an owner knows them from their data sheets.
    """
    document: dict[str, Any] = copy.deepcopy(dict(owner.document))
    lots = rng.uniform(size=5)
    if lots[0] < 0.35:
        _triangle(document)
    if lots[1] < 0.35 and "gas" not in needs:
        document["accumulators"] = {"type": "none"}
    if lots[2] < 0.35 and "burst" not in needs:
        document["hose_burst_valve"] = {"type": "none"}
    if lots[3] < 0.4 and "compensated" not in needs:
        _uncompensated(document)
    if lots[4] < 0.4 and "piloted" not in needs:
        _direct(document, float(rng.uniform(0.02, 0.07)))
    document["meta"] = {**document["meta"], "name": NAME}
    document["control"] = {
        **document.get("control", {}),
        "Ts": _told(fitting.period, "s"),
        "q2_quant": _told(fitting.angle_quantum, "rad"),
        "p_quant": _told(fitting.pressure_quantum, "Pa"),
        "p_noise_psd": _told(fitting.pressure_sigma**2 * fitting.period, "Pa^2/Hz"),
    }
    return Owner(document, NAME)


def _told(value: float, unit: str, confidence: str = "medium") -> dict[str, Any]:
    return {"value": float(f"{value:.6g}"), "unit": unit, "prov": "datasheet", "conf": confidence}


def _triangle(document: dict[str, Any]) -> None:
    """The cylinder pinned directly to column and boom, with about the same lever."""
    a, b, corner = (value for value, _ in _TRIANGLE.values())
    shortest = document["cylinder"]["l_min"]["value"]
    longest = shortest + 0.98 * document["cylinder"]["l_p"]["value"]

    def angle(length: float) -> float:
        return math.acos(max(-1.0, min(1.0, (a * a + b * b - length * length) / (2.0 * a * b)))) - corner

    document["kinematics"] = {
        "type": "triangle",
        **{name: _told(value, unit, "high") for name, (value, unit) in _TRIANGLE.items()},
        "q2_stroke_min": _told(max(angle(shortest + 0.005), -0.95), "rad", "high"),
        "q2_max": _told(min(angle(longest), 1.5), "rad", "high"),
    }


def _uncompensated(document: dict[str, Any]) -> None:
    """Edges laid out for the whole pressure of the supply."""
    edges = document["main_valve_orifices"]
    share = math.sqrt(edges["dp_c"]["value"] / _SUPPLY_DROP)
    edges["compensator"] = False
    del edges["dp_c"]
    for name in ("A_sa_max", "A_sb_max"):
        edges[name] = {**edges[name], "value": float(f"{share * edges[name]['value']:.6g}")}
    edges["A_ta_law"] = {**edges["A_ta_law"], "value": f"A_sb/({2.27 * share:.5f}-{0.7 * share:.5f}*u^2)"}


def _direct(document: dict[str, Any], lag: float) -> None:
    """Currents that command the spool, without a pilot stage."""
    stroke = document["main_valve_spool"]["s_max"]
    document["pilot_valves"] = {"type": "none"}
    document["main_valve_spool"] = {
        "type": "direct", "s_max": stroke, "K_i": _told(stroke["value"] / 0.55, "m/A"), "T_s": _told(lag, "s"),
    }  # fmt: skip
