"""Friction breaks away above its sliding value (Stribeck)."""

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "stribeck_friction", "friction", "5.39b", "tau_C += tau_s exp(-(w / w_s)^2)",
    ("the friction", "breaks away above its sliding value"), "starts, stops and slow motion",
    (
        parameter("tau_s", "N m", 0.0, (600.0, 4000.0), (0.0, 1e5), "break-away above sliding friction"),
        parameter("w_s", "rad/s", 0.02, (0.005, 0.05), (1e-4, 1.0), "Stribeck velocity", positive=True,
                  starts=(0.008, 0.025)),
    ),
    {"coulomb_friction": lambda size, own, at: size + own.tau_s * ca.exp(-((at.rate / own.w_s) ** 2))},
    place=1,
)  # fmt: skip
