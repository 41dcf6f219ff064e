"""Within ``length`` of an end of stroke the outflow of the chamber that shrinks passes a throttle.

It takes up to the share k of the outflow's passage.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression


def left_open(distance: Expression, own: Any) -> Expression:
    """Share of the passage [-] that is left for the outflow, ``distance`` [m] before the end of stroke."""
    return 1 - own.k * ca.fmin(ca.fmax(1 - distance / own.length, 0.0), 1.0)


EFFECT = Effect(
    "end_cushioning", "cylinder", "5.39f,m", "outflow passage (1 - k ramp(distance / length)) before the end of stroke",
    ("the cylinder", "is cushioned near the end of its stroke"), "near the ends of stroke: p_b rises, the boom slows",
    (
        parameter("k", "-", 0.0, (0.3, 0.95), (0.0, 0.999), "share of the passage that is taken at the end"),
        parameter("length", "m", 0.05, (0.02, 0.1), (1e-3, 1.0), "stroke over which the cushion acts", positive=True,
                  starts=(0.03, 0.08)),
    ),
    {
        "rod_passage": lambda passage, own, at: passage * left_open(at.distance, own),
        "head_flow": lambda flow, own, at: ca.if_else(flow < 0, flow * left_open(at.position, own), flow),
    },
    place=2,
)  # fmt: skip
