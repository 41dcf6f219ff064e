"""Play between spool and metering edges, as the effect ``valve_hysteresis`` of the machine file tells it, and its inverse.

    edges at s_s + (x - s_s) h / w,   w = max(h, travel),   x follows the spool within +- w s_max

A wanted position of the edges that lies beyond what they reach on this side has the spool take up the play: h s_max further. In
between, where the edges move little or not at all with the spool, the inverse is steep, and its slope is limited.
"""

from __future__ import annotations

from collections.abc import Mapping

from boom_controller.blocks.limits import limited
from boom_model.catalogue.valve_hysteresis import EFFECT
from boom_model.regularisation import Expression

LEAST_SLOPE = 0.15
"""Of the edges against the spool within the play: below it noise would drive the spool to and fro."""


class Play:
    """The play of a machine with these effects; ``stroke``: s_max [m], ``neutral``: where the edges stand at s_s = 0 [m].

    Without effect and offset the edges are where the spool is.
    """

    def __init__(self, effects: Mapping[str, Mapping[str, float]], stroke: float, neutral: float = 0.0) -> None:
        self._neutral = neutral
        given = effects.get(EFFECT.id, {"h": 0.0, "travel": 0.0})
        half, travel = given["h"], max(given["h"], given["travel"])
        self._share = half / travel if travel else 0.0
        self._offset, self._reach = half * stroke, travel * stroke

    def after(self, x: Expression, spool: Expression) -> Expression:
        """State x [m] once the spool is at ``spool`` [m]."""
        centred = spool + self._neutral
        return limited(x, centred - self._reach, centred + self._reach)

    def edges(self, x: Expression, spool: Expression) -> Expression:
        """Position of the metering edges [m]."""
        centred = spool + self._neutral
        return centred + (x - centred) * self._share

    def spool(self, x: Expression, edges: Expression) -> Expression:
        """Position of the spool [m] for a wanted one of the edges [m]."""
        if not self._reach:
            return edges - self._neutral
        slope = max(1.0 - self._share, LEAST_SLOPE)
        return edges + limited((edges - x) * (1.0 / slope - 1.0), -self._offset, self._offset) - self._neutral
