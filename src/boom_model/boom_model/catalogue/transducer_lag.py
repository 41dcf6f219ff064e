"""A pressure transducer is slow, by a first order of its own: a filter, a clogged bore, air before its membrane.

    (T + T_0) s' = p - s,   y = p + (s - p) T / (T + T_0)

which is s' = (p - s) / T, y = s, down to nothing at T = 0.
"""

from typing import Any

from boom_model.catalogue.effect import Effect, EffectParameter, Term, parameter
from boom_model.regularisation import Expression
from boom_model.state import State

SHORTEST = 2e-3
"""s. T_0; a transducer that is not filtered takes about as long."""


def _shown(side: str) -> Term:
    def shown(pressure: Expression, own: Any, _at: Any) -> Expression:
        s, lag = own.state(f"shown_{side}_pressure"), getattr(own, side)
        own.rates[f"shown_{side}_pressure"] = (pressure - s) / (lag + SHORTEST)
        return pressure + (s - pressure) * lag / (lag + SHORTEST)

    return shown


def _lag(side: str) -> EffectParameter:
    # as little as a transducer that is not filtered takes is no effect, and no more than its latency
    return parameter(
        side, "s", 0.0, (0.01, 0.15), (0.0, 2.0), f"time constant of the {side} pressure transducer", ordinary=5e-3
    )


EFFECT = Effect(
    "transducer_lag", "sensors", "ch. 4.2", "y = s, T s' = p - s",
    ("a pressure transducer", "is slow"), "edges of one pressure, which are round where the other one's are not",
    (_lag("hose"), _lag("rod")),
    {"measured_hose_pressure": _shown("hose"), "measured_rod_pressure": _shown("rod")},
    place=3, independent=True, watched=False,
    states=(
        State("shown_hose_pressure", "s_h", "Pa", 1e6, -1e8, 1e8, equation="ch. 4.2"),
        State("shown_rod_pressure", "s_b", "Pa", 1e6, -1e8, 1e8, equation="ch. 4.2"),
    ),
    at_rest=lambda states, p, e: {
        "shown_hose_pressure": states["hose_pressure"], "shown_rod_pressure": states["rod_pressure"],
    },
)  # fmt: skip
