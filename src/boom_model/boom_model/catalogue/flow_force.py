"""The flow pushes the spool of the main valve closed: F_q = c |q| sqrt(|dp|), summed over both edges."""

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "flow_force", "main_valve", "5.39n", "F_q = c |q| sqrt(|dp|), summed over both edges, closes the spool",
    ("the flow", "pushes the spool of the main valve closed"), "gain loss with flow and pressure drop",
    (parameter("c", "N s/m^3/Pa^0.5", 0.0, (2.0, 31.0), (0.0, 1e3), "force per flow and root of the drop"),),
    {"flow_force": lambda force, own, at: force + own.c * ca.if_else(at.extend, -at.size, at.size)},
    place=3, needs="pilot_valves",
)  # fmt: skip
