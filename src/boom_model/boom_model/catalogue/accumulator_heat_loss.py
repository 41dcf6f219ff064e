"""The gas of the accumulators exchanges heat with its surroundings.

Its entropy, as e = ln(p V_g^kappa / zeta_0), is a state, e' = -(1 - T_a / T) / tau with T ~ p V_g, and (3.19) holds with the
pre-charge p_g0 exp(e) and the further term p e'. T_a is the temperature at the start of the run, where the gas is taken to have
rested (1 / tau = 0: no states, adiabatic).
"""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components import accumulator
from boom_model.regularisation import Expression
from boom_model.state import State


def _adiabat(precharge: Expression, own: Any, at: Any) -> Expression:
    """``ambient`` is T_a relative to the temperature at pre-charge, on the nominal adiabat."""
    entropy, ambient = (own.state(f"accumulator_{name}_{at.number}") for name in ("entropy", "ambient"))
    volume = accumulator.gas_volume(at.pressure, precharge * ca.exp(entropy), at.p)
    held = ca.fmax(at.pressure, accumulator.LOWEST_PRESSURE)
    temperature = held * volume / (precharge * at.p.accumulators.V_g0)
    own.rates[f"accumulator_entropy_{at.number}"] = -(1 - ambient / temperature) * own.inverse_tau
    own.rates[f"accumulator_ambient_{at.number}"] = 0.0
    return precharge * ca.exp(entropy)


def _at_rest(states: Mapping[str, Expression], p: Any, e: Any) -> dict[str, Expression]:
    """The gas has rested on the nominal adiabat."""
    exponent = (p.accumulators.kappa - 1) / p.accumulators.kappa
    return {
        f"accumulator_ambient_{i}": (states[f"accumulator_pressure_{i}"] / precharge) ** exponent
        for i, (precharge, _) in enumerate(accumulator.cells(p, e), start=1)
    }


# Gas that keeps its temperature, as in foam, does so within 0.4 s; faster is the same, so that none has to be larger still.
EFFECT = Effect(
    "accumulator_heat_loss", "accumulators", "5.39g,h", "p_g0 exp(e), e' = -(1 - T_a / T) / tau",
    ("the gas of the accumulators", "exchanges heat"), "slow relaxation of p_h after a fast charge",
    (
        parameter("inverse_tau", "1/s", 0.0, (1 / 40, 1 / 5), (0.0, 2.5), "1 / time constant of the heat exchange",
                  starts=(1 / 30, 1 / 7, 1.0), ordinary=0.01),  # any gas does so within minutes
    ),
    {"adiabat": _adiabat, "entropy_rate": lambda rate, own, at: rate + own.rates[f"accumulator_entropy_{at.number}"]},
    place=2, needs="accumulators", margin=14.0, watched=False, at_rest=_at_rest,
    states=(
        State("accumulator_entropy_1", "e_1", "-", 0.1, equation="5.39g"),
        State("accumulator_ambient_1", "T_a,1", "-", 1.0, equation="5.39g"),
        State("accumulator_entropy_2", "e_2", "-", 0.1, equation="5.39h"),
        State("accumulator_ambient_2", "T_a,2", "-", 1.0, equation="5.39h"),
    ),
)  # fmt: skip
