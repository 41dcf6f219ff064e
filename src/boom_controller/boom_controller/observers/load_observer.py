"""Load at the tip from gyro and force: a Luenberger observer of the boom's speed and the unknown mass.

    w^' = (J f_p - tau~_f - g(q_2; m)) / D(m) + 2 p (w - w^),   m^' = p^2 (w - w^) / c,   c = -(dg/dm + dD/dm w^') / D

Both poles at -p. Where gravity depends little on the load (c near zero: a folded boom with the tip above the joint) the estimate
moves slowly. A rate error far above the gyro's noise selects faster poles: a grasped load is known after 0.1 s.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.control_model import ModelQuantities
from boom_controller.blocks.limits import limited
from boom_model.regularisation import Expression

LEAST_EFFECT = 1e-4
"""rad/s^2 per kg: for c of about this size or less the load is hardly observable."""
LIGHTEST = -500.0
"""kg. Allowed below the configured load, because wrong friction may look like that."""


class LoadState(NamedTuple):
    """m^ [kg] beyond the configured load, w^ [rad/s]."""

    load: Expression = 0.0
    rate: Expression = 0.0


def observe_load(x: LoadState, q: ModelQuantities, rate: Expression, s: Any) -> LoadState:
    """One sample time with the model at the present load, the measured rate [rad/s] and the settings ``s``."""
    acceleration = (q.jacobian * q.force - q.friction - q.gravity) / q.inertia
    effect = -(q.tip_gravity + q.tip_inertia * acceleration) / q.inertia
    surprise = rate - x.rate
    noise = s.rate_surprise
    fast = ca.fmin(ca.fmax((ca.fabs(surprise) - noise) / noise, 0.0), 1.0)
    pole = -(s.load_pole + fast * (s.load_pole_fast - s.load_pole))
    load = x.load + s.sample_time * pole * pole * surprise * effect / (effect * effect + LEAST_EFFECT * LEAST_EFFECT)
    return LoadState(
        limited(load, LIGHTEST, s.largest_load),
        x.rate + s.sample_time * (acceleration + 2.0 * pole * surprise),
    )
