"""Friction gives way elastically before it slides: bristles (LuGre, without bristle damping) instead of the tanh.

Their torque z is a state, c z' = w - |w| z / tau_C, with the compliance c of the bristles (neutral c = 0: no state).
Source: Canudas de Wit et al. 1995.
"""

from typing import Any

import casadi as ca

from boom_model.catalogue.effect import Effect, parameter
from boom_model.regularisation import Expression
from boom_model.state import State

ANOTHER_FORM = 2.0
"""Factor beyond the plausible range up to which the compliance may be fitted to friction of another form. Far softer bristles are a
spring, not friction; far stiffer ones do nothing, but an observer that corrects them follows other torques, too."""
NOISE = 5e3
"""N m/sqrt(s). How far the bristles are bent when the boom came to rest decides with which force it starts, and a form that is not
the machine's does not know."""


def _torque(_: Expression, own: Any, at: Any) -> Expression:
    z = own.state("bristle_torque")
    own.rates["bristle_torque"] = (at.rate - ca.fabs(at.rate) * z / at.coulomb) / own.compliance
    return z


EFFECT = Effect(
    "presliding_friction", "friction", "5.39b", "z instead of tau_C tanh(w / sigma), c z' = w - |w| z / tau_C",
    ("the friction", "gives way elastically before it slides"), "hysteresis at reversals",
    (
        parameter("compliance", "rad/(N m)", 0.0, (1e-7, 1e-5), (1e-9, 1e-3), "of the bristles, 1 / sigma_0",
                  positive=True, starts=(2e-7, 1.5e-6, 8e-6), possible=(1e-7 / ANOTHER_FORM, 1e-5 * ANOTHER_FORM), gains=1e-6),
    ),
    {"sliding_friction": _torque},
    place=2, watched=False,
    states=(State("bristle_torque", "z", "N m", 4e3, equation="5.39b", standstill_noise=NOISE, corrected=True),),
)  # fmt: skip
