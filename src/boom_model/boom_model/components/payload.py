"""Steps of the load at the tip: what a crane picks up or sets down, by time or by stroke.

    m = m_L + sum_k m_k (1 + tanh((v - v_k) / w)) / 2,   v = t or s_p

By time a load is grasped within some 10 ms; by stroke it leaves the ground at the piston position v_k in every cycle, within 5 mm,
and rests on it below. Not in the thesis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca

from boom_model.regularisation import Expression
from boom_model.specification import Specification
from boom_model.tolerance import Tolerance

By = Literal["time", "stroke"]
NAME = "payload"
SECTION = f"{NAME}."
"""Section of a machine file, and the beginning of its parameters' keys."""
GRASP_TIME = 0.01
"""s. Width of the tanh with which a load is grasped or released."""
GROUND = 5.0e-3
"""m of piston position over which a load leaves the ground."""
_PLACES = {"time": ("t_k", "s", "when", -1e5, 1e5), "stroke": ("s_k", "m", "at which piston position", -1.0, 10.0)}


@dataclass(frozen=True)
class Step:
    """mass [kg] picked up (set down: negative), at a time since the start of the recording [s] or a piston position [m]."""

    mass: float
    by: By
    at: float
    tol: Tolerance | None = None


def specifications(number: int, by: By) -> tuple[Specification, Specification]:
    """Mass and place of a step as parameters of the model."""
    symbol, unit, meaning, low, high = _PLACES[by]
    return (
        Specification(f"{SECTION}mass.{number}", "m_k", "kg", "load picked up", -1e5, 1e5, "3.4"),
        Specification(f"{SECTION}at.{number}", symbol, unit, meaning, low, high, "3.4"),
    )


def on_the_hook(value: Expression, at: Expression, by: By, grasp: Expression = GRASP_TIME) -> Expression:
    """Share [-] of a load that hangs at the time or piston position ``value``; grasp: width of the tanh by time [s]."""
    return 0.5 * (1 + ca.tanh((value - at) / (grasp if by == "time" else GROUND)))


def mass(steps: Sequence[By], time: Any, position: Expression, p: Any) -> Expression:
    """Sum of the steps [kg] at a piston position [m]; ``time``: gives the time since the start of the run [s] where one asks."""
    total: Expression = 0.0
    for k, by in enumerate(steps):
        value = time() if by == "time" else position
        total = total + p.payload.mass[k] * on_the_hook(value, p.payload.at[k], by)
    return total
