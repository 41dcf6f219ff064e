"""The spool of the main valve has another overlap, on either side its own."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.errors import MachineError

LARGEST_OVERLAP = 0.95
"""Of the stroke: largest dead zone, x_0 + d."""
MADE_TO = 0.003
"""Over full stroke: the edges of a spool are made to some 20 um."""


def check_overlaps(effect: str, values: Mapping[str, float], machine: Any) -> None:
    """A dead zone x_0 + d is not negative and leaves something of the stroke.

    Raises:
        MachineError: names the effect's parameter and its range.
    """
    for key, (name, change) in product(machine.structure.metering.overlaps, values.items()):
        overlap = machine.parameters[key].value[0]
        if not 0.0 <= overlap + change <= LARGEST_OVERLAP:
            raise MachineError(
                f"effects.{effect}.{name}: {change:g} is outside {-overlap:g} .. {LARGEST_OVERLAP - overlap:g}, "
                f"with which {key} = {overlap:g} stays within 0 .. {LARGEST_OVERLAP:g} of the stroke"
            )


def _check(values: Mapping[str, float], machine: Any) -> None:
    check_overlaps("valve_dead_zone", values, machine)


EFFECT = Effect(
    "valve_dead_zone", "main_valve", "5.39l,m", "x_0 + d",
    ("the spool of the main valve", "has another overlap"), "start delay, creep speed",
    (
        parameter("d_extend", "-", 0.0, (-0.1, 0.1), (-0.25, 0.5), "added overlap over full stroke, lifting"),
        parameter("d_retract", "-", 0.0, (-0.1, 0.1), (-0.25, 0.5), "added overlap over full stroke, lowering",
                  within="main_valve_orifices.x0", accuracy=MADE_TO),
    ),
    {"overlap": lambda overlap, own, at: overlap + ca.if_else(at.position < 0, own.d_extend, own.d_retract)},
    place=1, independent=True, changes=("main_valve_orifices.x0",), check=_check,
)  # fmt: skip
