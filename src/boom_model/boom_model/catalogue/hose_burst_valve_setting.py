"""The hose burst valve limits at another flow: a_30 r.

Its spring is set anew, which moves the knee; the slopes before and behind it, a_21 and a_31, stay as they are made.
"""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "hose_burst_valve_setting", "hose_burst_valve", "5.39f", "r a_30",
    ("the hose burst valve", "limits at another flow"), "plateau speed when lowering fast",
    (
        parameter("r", "-", 1.0, (0.6, 1.2), (0.1, 5.0), "factor of the limited flow", positive=True,
                  starts=(0.75, 1.12), form=0.15),  # other valves move the slopes, too
    ),
    {"limited_flow": lambda coefficient, own, at: coefficient * own.r},
    place=2, needs="hose_burst_valve",
    changes=("hose_burst_valve.a30",),
)  # fmt: skip
