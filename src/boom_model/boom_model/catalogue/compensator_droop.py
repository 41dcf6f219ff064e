"""The pressure compensator droops with the flow: the supply loses in proportion to its square."""

from boom_model.catalogue.effect import Effect, parameter

Q_REFERENCE = 2.0e-3
"""m^3/s (120 l/min), full flow."""

EFFECT = Effect(
    "compensator_droop", "main_valve", "5.39l,m", "supply flow q (1 - k (q / 120 l/min)^2)",
    ("the pressure compensator", "droops with the flow"), "top speed, supply side only",
    (
        parameter("k", "-", 0.0, (0.05, 0.5), (0.0, 50.0), "loss of supply flow at 120 l/min", possible=(0.0, 1.0), surely=True,
                  flow_power=-2, accuracy=0.05),  # data sheets: the flow of a compensated valve is constant within 2 to 5 %
    ),
    {"supply_flow": lambda flow, own, at: flow * (1 - own.k * (flow / Q_REFERENCE) ** 2)},
    place=5, needs="compensator",
)  # fmt: skip
