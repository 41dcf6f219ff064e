"""Load at the tip from gyro and force: a Luenberger observer of the boom's speed and the unknown mass.

    w^' = (J f_p - tau~_f - g(q_2; m)) / D(m) + 2 p (w - w^),   m^' = p^2 (w - w^) / c,   c = -(dg/dm + dD/dm w^') / D

Both poles at -p; with modes between cylinder and IMU the gains are those of ``mode_observer``.
Where gravity depends little on the load (c near zero: a folded boom with the tip above the joint) the estimate
moves slowly. A rate error far above the gyro's noise selects faster poles: a grasped load is known after 0.1 s.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.control_model import ModelQuantities
from boom_controller.blocks.limits import limited
from boom_controller.observers.mode_observer import Modes
from boom_controller.settings import QUICKEST
from boom_controller.types import Measurement, Reference
from boom_model.components.equation_of_motion import inertia
from boom_model.regularisation import Expression

LEAST_EFFECT = 1e-4
"""rad/s^2 per kg: for c of about this size or less the load is hardly observable."""
SAFE_POLE = -2.0
"""1/s. Once an oscillation was recognised: far below what bends or swings."""
LIGHTEST = -500.0
"""kg. Allowed below no load, because wrong friction may look like that; the configured load may not be there."""
LEAST_INERTIA = 0.5
"""Share of the empty boom's inertia that no such load takes away: a light boom would have none, and the law no number."""


LASTING = 1.0
"""s. The boom sags under the load that is estimated with this lag: what swings does not move the reference."""


class LoadState(NamedTuple):
    """m^ [kg] beyond the configured load, w^ [rad/s], states of the modes, m^ that lasts [kg]."""

    load: Expression = 0.0
    rate: Expression = 0.0
    modes: tuple[Expression, ...] = ()
    lasting: Expression = 0.0


class LoadObserver:
    """The observer of a machine, with the modes that its file tells; ``gains``: slow, fast, safe, see :meth:`gains`."""

    def __init__(self, modes: Modes, p: Any) -> None:
        self.modes = modes
        empty, reach = float(inertia(0.0, p)), float(p.pose.tip[0] ** 2 + p.pose.tip[1] ** 2)
        self._lightest = max(LIGHTEST, (LEAST_INERTIA - 1.0) * empty / reach) - float(p.pose.load)
        self.start = LoadState(modes=(0.0,) * len(modes.names))

    def gains(self, s: Any) -> dict[str, float]:
        """Gains for the settings ``s``, by name, for :class:`boom_controller.blocks.flat.FlatLaw`."""
        named: dict[str, float] = {}
        for word, pole in (("slow", s.load_pole), ("fast", s.load_pole_fast), ("safe", SAFE_POLE)):
            gain = self.modes.gain(min(-pole, QUICKEST / s.sample_time))
            named |= {f"{word}_{k}": value for k, value in enumerate((gain.rate, gain.missing, *gain.states))}
        return named

    def resting(self, m: Measurement) -> tuple[LoadState, Measurement]:
        """The state of a boom that rests where the IMU shows this angle, and the sample at the cylinder."""
        angle, modes = self.modes.at_rest(m.angle)
        return self.start._replace(modes=modes), m._replace(angle=angle)

    def wanted(self, x: LoadState, r: Reference) -> Reference:
        """The reference at the cylinder: without what the modes add at rest to the angle where it is measured."""
        return self.modes.wanted(r, x.lasting)

    def seen(self, x: LoadState, m: Measurement) -> Measurement:
        """Angle and rate at the cylinder: without what the modes add to them where they are measured."""
        beyond = self.modes.at(x.modes, m.angle, m.rate, 1.0, 0.0, 0.0)
        return m._replace(angle=m.angle - beyond.angle, rate=m.rate - beyond.rate)

    def step(
        self, x: LoadState, q: ModelQuantities, m: Measurement, safe: Expression, s: Any, known: Expression = 1.0
    ) -> LoadState:
        """One sample time with the model at the present load, the sample at the cylinder, settings with ``gains``.

        known: how far what is measured tells of the force, 0 to 1: what the boom needs tells nothing of the load.
        """
        torque = q.jacobian * q.force - q.friction - q.gravity
        point = (m.angle, m.rate, q.inertia, torque, 0.0)
        acceleration = self.modes.at(x.modes, *point).acceleration
        effect = -(q.tip_gravity + q.tip_inertia * acceleration) / q.inertia
        surprise, noise = m.rate - x.rate, s.rate_surprise
        fast = ca.fmin(ca.fmax((ca.fabs(surprise) - noise) / noise, 0.0), 1.0)

        def gain(k: int) -> Expression:
            slow: Expression = getattr(s, f"slow_{k}")
            usual = slow + fast * (getattr(s, f"fast_{k}") - slow)
            return ca.if_else(safe, getattr(s, f"safe_{k}"), usual)

        t = s.sample_time
        if x.modes:  # their filter is one whole: d stands for what the assumed force lacks of a swing, too
            known = ca.if_else(known > 0.0, 1.0, 0.0)
        load = x.load + known * t * gain(1) * surprise * effect / (effect * effect + LEAST_EFFECT * LEAST_EFFECT)
        own = tuple(gain(2 + k) for k in range(len(x.modes)))
        return LoadState(
            limited(load, self._lightest, s.largest_load),
            x.rate + t * (acceleration + gain(0) * surprise),
            self.modes.after(x.modes, own, surprise, t, *point),
            x.lasting + t / LASTING * (x.load - x.lasting),
        )
