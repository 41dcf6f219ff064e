"""The load-holding valve is set to another pressure: its screw was turned, its spring is weak, or another cartridge is in."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "load_holding_valve_setting", "hose_burst_valve", "5.39f", "z ~ p_a + R p_b - r p_set",
    ("the load-holding valve", "is set to another pressure"), "rod pressure while lowering",
    (
        parameter("r", "-", 1.0, (0.6, 1.6), (0.1, 5.0), "factor of the set pressure", positive=True, starts=(0.75, 1.4)),
    ),
    {"set_pressure": lambda p_set, own, at: own.r * p_set},
    place=5, needs="load_holding_valve", changes=("hose_burst_valve.p_set",),
)  # fmt: skip
