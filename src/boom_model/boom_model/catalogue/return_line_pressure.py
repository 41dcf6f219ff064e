"""The pressure of the return line rises with the flow, p_t + k q^2: closed form, as an orifice in series."""

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter

# The margin is that of a return line that is nearly shut, or of a small crane: 10 bar at 30 l/min.
EFFECT = Effect(
    "return_line_pressure", "return_line", "5.39l,m", "p_t + k q^2",
    ("the pressure of the return line", "rises with the flow"), "p_b when extending, p_h when lowering slowly",
    (
        parameter("k", "Pa s^2/m^6", 0.0, (2e5 / 2.17e-3**2, 2e6 / 2.17e-3**2), (0.0, 1e13), "rise per squared flow"),
    ),
    {"tank_flow": lambda flow, own, at: flow / ca.sqrt(1 + own.k * at.conductance * at.conductance)},
    place=1, margin=25.0,
)  # fmt: skip
