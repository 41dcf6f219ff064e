"""The pressures arrive late, applied where the outputs are sampled (``boom_model.plant``)."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "pressure_delay", "sensors", "ch. 4.2", "y = p(t - T)",
    ("the pressures", "arrive late"), "all edges of the pressures",
    (parameter("T", "s", 0.0, (0.005, 0.1), (0.0, 1.0), "dead time of both pressure channels", starts=(0.01, 0.04),
               ordinary=7.5e-3),),  # response time of a transducer, and the wait for its message
    place=5, delays="pressures", watched=False,
)  # fmt: skip
