"""One metering edge opens earlier or later than its partner: the edge to the tank against the one from the supply.

Of both sides together the overlap is another one: ``valve_dead_zone``.
"""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.catalogue.valve_dead_zone import MADE_TO, check_overlaps
from boom_model.regularisation import Expression

OVERLAP = "main_valve_orifices.x0"


def _overlap(overlap: Expression, own: Any, at: Any) -> Expression:
    return overlap + ca.if_else(at.position < 0, own.d_extend, own.d_retract) if at.edge == "tank" else overlap


def _check(values: Mapping[str, float], machine: Any) -> None:
    check_overlaps("edge_overlap", values, machine)


EFFECT = Effect(
    "edge_overlap", "main_valve", "5.39l,m", "x_0 + d of the edge to the tank",
    ("one edge of the main valve", "opens earlier or later than its partner"),
    "pressure level while creeping; intensification where meter-out opens late",
    (
        parameter("d_extend", "-", 0.0, (-0.05, 0.05), (-0.25, 0.5), "added overlap of b to tank over full stroke, lifting",
                  within=OVERLAP, accuracy=MADE_TO),
        parameter("d_retract", "-", 0.0, (-0.05, 0.05), (-0.25, 0.5), "added overlap of a to tank over full stroke, lowering",
                  within=OVERLAP, accuracy=MADE_TO),
    ),
    {"overlap": _overlap},
    place=6, independent=True, check=_check,
)  # fmt: skip
