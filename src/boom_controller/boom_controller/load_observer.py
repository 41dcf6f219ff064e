"""Load at the tip from gyro and force: a Luenberger observer of the boom's speed and the unknown mass.

    w^' = (J f_p - tau~_f - g(q_2; m)) / D(m) + 2 p (w - w^),   m^' = p^2 (w - w^) / c,   c = -(dg/dm + dD/dm w^') / D

Both poles at -p. Where gravity says little about the load (c near zero: a folded boom with the tip above the joint) the estimate
moves slowly. A surprise far above the gyro's noise is answered with faster poles: a load that is grasped is known after 0.1 s.
"""

from __future__ import annotations

from boom_controller.control_model import Quantities
from boom_controller.settings import Settings

LEAST_EFFECT = 1e-4
"""rad/s^2 per kg: where c is about as small, the load is hardly observable."""
LIGHTEST = -500.0
"""kg. Below the configuration's load, as a friction that is wrong may pretend."""


class LoadObserver:
    """``load`` [kg] beyond what the configuration tells."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.load = self._rate = 0.0

    def reset(self, rate: float = 0.0) -> None:
        """No load, the boom turns at ``rate`` [rad/s]."""
        self.load, self._rate = 0.0, rate

    def change(self, settings: Settings) -> None:
        """Other poles; the estimates stay."""
        self._settings = settings

    def step(self, q: Quantities, rate: float) -> None:
        """One sample time with the model at the present load and the measured rate [rad/s]."""
        s = self._settings
        acceleration = (q.jacobian * q.force - q.friction - q.gravity) / q.inertia
        effect = -(q.tip_gravity + q.tip_inertia * acceleration) / q.inertia
        surprise = rate - self._rate
        noise = s.rate_surprise
        fast = min(max((abs(surprise) - noise) / noise, 0.0), 1.0)
        pole = -(s.load_pole + fast * (s.load_pole_fast - s.load_pole))
        self._rate += s.sample_time * (acceleration + 2.0 * pole * surprise)
        self.load += s.sample_time * pole * pole * surprise * effect / (effect * effect + LEAST_EFFECT * LEAST_EFFECT)
        self.load = min(max(self.load, LIGHTEST), s.largest_load)
