"""The hose burst valve limits at another flow: its limited branches times r, a_21 r, a_30 r, a_31 r, which keeps the node."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "hose_burst_valve_setting", "hose_burst_valve", "5.39f", "limited branch r q_a(dp)",
    ("the hose burst valve", "limits at another flow"), "plateau speed when lowering fast",
    (
        parameter("r", "-", 1.0, (0.6, 1.2), (0.1, 5.0), "factor of the limited flow", positive=True,
                  starts=(0.75, 1.12), form=0.15),  # a set spring moves the knee, and not the slope before it
    ),
    {"limited_flow": lambda coefficient, own, at: coefficient * own.r},
    place=2, needs="hose_burst_valve",
    changes=("hose_burst_valve.a21", "hose_burst_valve.a30", "hose_burst_valve.a31"),
)  # fmt: skip
