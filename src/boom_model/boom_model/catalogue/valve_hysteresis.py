"""The metering edges lag the spool by h s_max, to one side or the other.

From one side to the other they come within a travel of 2 w s_max, w = max(h, travel): they stand at s_s + (x - s_s) h / w, and
x, a state, follows with a play, T_play x' = max(0, s_s - w s_max - x) + min(0, s_s + w s_max - x). Without ``travel`` that is a
play of h (neutral h = 0: no state, x = s_s).
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State

PLAY_TIME = 2.0e-3
"""s. How quickly the edges take up the play; far below the pilot stage's 51 ms."""
SMALLEST_TRAVEL = 1e-9
"""Over full stroke. Keeps 0 / 0 out where there is no hysteresis."""


def _position(spool: Expression, own: Any, at: Any) -> Expression:
    follower, w = own.state("metering_position"), ca.fmax(own.h, own.travel)
    half = w * at.p.main_valve_spool.s_max
    ahead, behind = ca.fmax(spool - half - follower, 0.0), ca.fmin(spool + half - follower, 0.0)
    own.rates["metering_position"] = (ahead + behind) / PLAY_TIME
    return spool + (follower - spool) * own.h / ca.fmax(w, SMALLEST_TRAVEL)


EFFECT = Effect(
    "valve_hysteresis", "main_valve", "5.39l,m",
    "metering edges lag the spool by h s_max to either side, and change sides within a travel of 2 max(h, travel) s_max",
    ("the main valve or its pilot stage", "has play"), "differs with rising or falling current",
    (
        parameter("h", "-", 0.0, (0.005, 0.06), (0.0, 0.5), "half of the hysteresis over full stroke", starts=(0.01, 0.04),
                  swallows=True, ordinary=0.0025),  # valves with a position control of their own: up to 0.5 % in all
        parameter("travel", "-", 0.0, (0.0, 0.3), (0.0, 2.0), "half of the travel between its sides; below h: a play",
                  starts=(0.0, 0.15)),
    ),
    {"metering_position": _position},
    place=2, states=(State("metering_position", "x", "m", 5e-3, -1.0, 1.0, "5.39l,m", like="spool_position"),), watched=False,
)  # fmt: skip
