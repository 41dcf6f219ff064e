"""The supply pressure is not the constant of the file: another level, and it falls with the flow that is taken.

    p_s (1 + a) - k q^2:   q = C sqrt(p_s (1 + a) - p) / sqrt(1 + k C^2)

C is the conductance of the edge; k in closed form, as an orifice in series. Where the supply pressure is recorded it drives the
model, and a does not act.
"""

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "supply_variation", "supply", "5.39l,m", "p_s (1 + a) - k q^2",
    ("the supply pressure", "is not the one of the file"), "speed, most against a high load",
    (
        parameter("a", "-", 0.0, (-0.15, 0.15), (-0.9, 2.0), "how far its level is off"),
        parameter("k", "Pa s^2/m^6", 0.0, (0.0, 4e12), (0.0, 1e14), "fall per squared flow",
                  accuracy=2.5e11),  # 10 bar at 120 l/min: lines and filters between gauge and valve
    ),
    {
        "supply_pressure": lambda pressure, own, at: pressure * (1 + own.a),
        "supply_flow": lambda flow, own, at: flow / ca.sqrt(1 + own.k * at.conductance**2),
    },
    place=2, needs="constant_supply", independent=True, changes=("fluid.p_s",),
)  # fmt: skip
