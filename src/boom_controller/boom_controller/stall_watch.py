"""Recognises a load that cannot be held: the valve is open to lift, and the supply does not deliver.

Of the head side alone: delivered speed v + f_h' / K_h, f_h = A_a p_h, against the speed Q = q_h / A_a that the open valve
would give with its full pressure margin: less than a quarter of it for ``stall_time``. With an unlimited supply that does not
happen, however heavy the load is: what does not move the piston compresses the oil.
"""

from __future__ import annotations

from boom_controller.settings import Settings

LEAST_SPEED = 0.02
"""m/s. Below it the valve is as good as closed."""
DELIVERED_SHARE = 0.25
SMOOTHING = 10.0
"""1/s, of the delivered speed."""


class StallWatch:
    """``reason`` is empty while the supply delivers."""

    def __init__(self) -> None:
        self.reason = ""
        self._delivered = self._elapsed = self._force = 0.0

    def reset(self, force: float) -> None:
        """All is well; f_h [N] stands."""
        self.reason, self._delivered, self._elapsed, self._force = "", 0.0, 0.0, force

    def step(
        self,
        velocity: float,
        modelled: float,
        force: float,
        stiffness: float,
        load: float,
        pressure: float,
        settings: Settings,
    ) -> None:
        """One sample time: v and Q [m/s], f_h [N], K_h [N/m], estimated load [kg], p_h [Pa]."""
        t = settings.sample_time
        gained = t * (velocity - self._delivered) + (force - self._force) / stiffness
        self._force = force
        self._delivered += SMOOTHING * gained
        stalled = modelled > LEAST_SPEED and self._delivered < DELIVERED_SHARE * modelled
        self._elapsed = self._elapsed + t if stalled else 0.0
        if self._elapsed > settings.stall_time and not self.reason:
            self.reason = (
                f"the load of about {load:.0f} kg cannot be held: the valve is open to lift and the supply delivers too little "
                f"at p_h = {pressure / 1e5:.0f} bar"
            )
