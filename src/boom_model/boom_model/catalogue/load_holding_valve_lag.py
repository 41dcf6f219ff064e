"""The poppet of the load-holding valve follows its pilot slowly: its damping orifice is small or clogged, or it sticks.

T z' with T = 2 ms + tau (``components.load_holding_valve``). Every poppet needs some milliseconds, and a boom on such a valve
swings while lowering by as much as these let it: up to the accuracy a sound valve is as slow.
"""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "load_holding_valve_lag", "hose_burst_valve", "5.39f", "(T + tau) z' = ..",
    ("the poppet of the load-holding valve", "follows its pilot slowly"), "as lowering begins, and swinging while lowering",
    (
        parameter("tau", "s", 0.0, (0.03, 0.5), (0.0, 5.0), "further time constant of the load-holding valve's poppet",
                  starts=(0.06, 0.2), accuracy=0.025),  # 5 to 25 ms by data sheets
    ),
    {"poppet_time": lambda time, own, at: time + own.tau},
    place=4, needs="load_holding_valve",
)  # fmt: skip
