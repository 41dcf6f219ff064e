"""Spool position for a wanted effect of the flows: (6.23) with piecewise linear orifice areas, solved in closed form.

    extend,  Sigma >  0:  Psi+ A_sa(s_s) + Omega+ A_tb(s_s) = Sigma,   s_s < 0
    retract, Sigma <= 0:  Psi- A_ta(s_s) + Omega- A_sb(s_s) = Sigma,   s_s > 0

The areas come from ``boom_model.main_valve_orifices``. Between the nodes they are straight (thesis Figs. 6.2, 6.3), so the left
side is too: find the segment that holds Sigma, interpolate. Nodes lie closer where the areas bend, at the edge of the dead
zone: off by less than 0.5 % of the stroke.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from boom_model import main_valve_orifices

NODES = (0.0, 0.02, 0.05, 0.1, 0.16, 0.24, 0.34, 0.43, 0.52, 0.6, 0.68, 0.76, 0.84, 0.92, 1.0, 1.25)
"""Of (x - x_0) / (1 - x_0), x = |s_s| / s_max; the last ones lie beyond the full stroke, up to the largest opening."""


class ValveMap:
    """The areas' nodes: ``extend`` and ``retract`` hold (|s_s| [m], supply area [m^2], tank area [m^2]) in ascending order."""

    def __init__(self, p: Any, e: Any) -> None:
        self.extend = _nodes(-1.0, p, e)
        self.retract = _nodes(1.0, p, e)
        self.dead_extend, self.dead_retract = self.extend[0][0], self.retract[0][0]

    def extending(self, wanted: float, psi: float, omega: float) -> float:
        """|s_s| [m] with psi A_sa + omega A_tb = wanted >= 0; the edge of the dead zone for 0, the last node if out of reach."""
        return _root(self.extend, wanted, psi, omega)

    def retracting(self, wanted: float, psi: float, omega: float) -> float:
        """|s_s| [m] with psi A_ta + omega A_sb = wanted <= 0, psi and omega <= 0."""
        return _root(self.retract, -wanted, -omega, -psi)

    def areas(self, position: float) -> tuple[float, float]:
        """(supply, tank) area [m^2] at s_s [m], as interpolated: what the root is a root of."""
        nodes = self.extend if position < 0 else self.retract
        size = min(abs(position), nodes[-1][0])
        if size <= nodes[0][0]:
            return 0.0, 0.0
        for (s0, a0, b0), (s1, a1, b1) in pairwise(nodes):
            if size <= s1:
                share = (size - s0) / (s1 - s0)
                return a0 + share * (a1 - a0), b0 + share * (b1 - b0)
        return nodes[-1][1], nodes[-1][2]


def _nodes(side: float, p: Any, e: Any) -> tuple[tuple[float, float, float], ...]:
    shift = e.valve_dead_zone.d_extend if side < 0 else e.valve_dead_zone.d_retract
    x0 = p.main_valve_orifices.x0 + shift
    result = []
    for share in NODES:
        x = min(x0 + share * (1 - x0), main_valve_orifices.LARGEST_OPENING)
        position = x * p.main_valve_spool.s_max
        supply, tank = main_valve_orifices.areas(side * position, p, e)
        result.append((position, float(supply), float(tank)))
    return tuple(result)


def _root(nodes: tuple[tuple[float, float, float], ...], wanted: float, supply: float, tank: float) -> float:
    """|s_s| at which supply A_s + tank A_t reaches ``wanted``, which must not be negative."""
    before, reached = nodes[0][0], 0.0
    for position, supply_area, tank_area in nodes[1:]:
        value = supply * supply_area + tank * tank_area
        if value >= wanted and value > reached:
            return before + (position - before) * (wanted - reached) / (value - reached)
        before, reached = position, value
    return before
