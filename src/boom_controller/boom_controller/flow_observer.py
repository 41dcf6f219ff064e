"""What the oil does, learnt while running: how soft each chamber is, and how much flow the valve's model misses.

Compliance of a chamber, against the nominal one:  int k (q - A v) dt = kappa (p - p_0), k the nominal dp/dV. Both
sides pass the same high-pass filter; kappa follows by a normalised gradient, only while the pressure
moves. The regression is on the pressure, which is measured, so that an error of the modelled flow does not bias kappa.

Flow that the model misses, as a piston speed:  d^' = w (v + f_p' / K - Q - d^), Q the speed that the modelled flows would give.
"""

from __future__ import annotations

from math import exp

from boom_controller.settings import Settings

SOFTEST, STIFFEST = 8.0, 0.7
"""Limits of kappa: air in the oil (beta x 0.2, Table 6.1) with a margin."""
FORGETTING = 2.0
"""1/s, of the high-pass filter."""
LARGEST_MISSED = 0.05
"""m/s."""


class ChamberCompliance:
    """kappa [-] of one chamber."""

    def __init__(self) -> None:
        self.ratio = 1.0
        self._volume = self._moved = self._pressure = 0.0

    def reset(self, pressure: float) -> None:
        """Nominal oil; the chamber rests at ``pressure`` [Pa]."""
        self.ratio, self._volume, self._moved, self._pressure = 1.0, 0.0, 0.0, pressure

    def step(self, pressure: float, expected_rate: float, settings: Settings, trusted: bool = True) -> None:
        """One sample time: p [Pa], k (q - A v) [Pa/s] of the nominal chamber; ``trusted``: False only filters."""
        t = settings.sample_time
        keep = exp(-FORGETTING * t)
        self._volume = keep * self._volume + t * expected_rate
        self._moved = keep * self._moved + pressure - self._pressure
        self._pressure = pressure
        if trusted:
            y, size = self._moved, settings.compliance_pressure
            change = settings.compliance_gain * t * y * (self._volume - self.ratio * y) / (size * size + y * y)
            self.ratio = min(max(self.ratio + change, STIFFEST), SOFTEST)


class MissedFlow:
    """``speed`` [m/s]: v + f_p' / K - Q, low-pass filtered."""

    def __init__(self) -> None:
        self.speed = self._force = 0.0

    def reset(self, force: float) -> None:
        """Nothing is missed; f_p [N] stands."""
        self.speed, self._force = 0.0, force

    def step(self, velocity: float, modelled: float, force: float, stiffness: float, settings: Settings) -> None:
        """One sample time: v and Q [m/s], f_p [N], K [N/m]."""
        share = -settings.flow_pole
        gained = settings.sample_time * (velocity - modelled - self.speed) + (force - self._force) / stiffness
        self._force = force
        self.speed = min(max(self.speed + share * gained, -LARGEST_MISSED), LARGEST_MISSED)
