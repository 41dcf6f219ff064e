"""Spool position for a wanted effect of the flows: (6.23) with piecewise linear orifice areas, solved in closed form.

    extend,  Sigma >  0:  Psi+ A_sa(s_s) + Omega+ A_tb(s_s) = Sigma,   s_s < 0
    retract, Sigma <= 0:  Psi- A_ta(s_s) + Omega- A_sb(s_s) = Sigma,   s_s > 0

The areas come from the machine's metering edges. Between the nodes they are straight (thesis Figs. 6.2,
6.3), so the left side is too: find the segment that holds Sigma, interpolate. Nodes lie closer where the areas bend, at the
edge of the dead zone: off by less than 0.5 % of the stroke.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import casadi as ca

from boom_controller.blocks.control_model import ModelQuantities
from boom_model.regularisation import Expression
from boom_model.slots import Metering

NODES = (0.0, 0.02, 0.05, 0.1, 0.16, 0.24, 0.34, 0.43, 0.52, 0.6, 0.68, 0.76, 0.84, 0.92, 1.0, 1.25)
"""Nodes in (x - x_0) / (1 - x_0), x = |s_s| / s_max; the last ones lie beyond the full stroke, up to the largest opening."""


class ValveMap:
    """The areas' nodes: ``extend`` and ``retract`` hold (|s_s| [m], supply area [m^2], tank area [m^2]) in ascending order."""

    def __init__(self, metering: Metering, p: Any, e: Any) -> None:
        self.extend = _nodes(metering, -1.0, p, e)
        self.retract = _nodes(metering, 1.0, p, e)
        self.dead_extend, self.dead_retract = self.extend[0][0], self.retract[0][0]

    def extending(self, wanted: Expression, psi: Expression, omega: Expression) -> Expression:
        """|s_s| [m] with psi A_sa + omega A_tb = wanted >= 0; the edge of the dead zone for 0, the last node if out of reach."""
        return _root(self.extend, wanted, psi, omega)

    def retracting(self, wanted: Expression, psi: Expression, omega: Expression) -> Expression:
        """|s_s| [m] with psi A_ta + omega A_sb = wanted <= 0, psi and omega <= 0."""
        return _root(self.retract, -wanted, -omega, -psi)

    def spool(
        self, sigma: Expression, q: ModelQuantities, a: Expression, b: Expression, largest: Expression
    ) -> Expression:
        """s_s* [m] of (6.23) for Sigma [N/s], at most ``largest``; a, b [N/m^3] are force per volume of both chambers."""
        return ca.if_else(
            sigma > 0,
            -ca.fmin(self.extending(sigma, a * q.extend_supply, -b * q.extend_tank), largest),
            ca.fmin(self.retracting(sigma, a * q.retract_tank, -b * q.retract_supply), largest),
        )

    def through_dead_zone(self, spool: Expression, speed: Expression, whole: Expression) -> Expression:
        """s_s* [m] with its jump across the dead zone made a ramp over ``speed`` [m/s], positive lifts; ``whole``: its end."""
        share = ca.fmin(ca.fabs(speed) / whole, 1.0)
        edge = ca.if_else(speed > 0, -self.dead_extend, self.dead_retract)
        agree = ca.if_else(speed > 0, spool < 0, spool >= 0)
        return ca.if_else(agree, spool, edge) * share

    def areas(self, position: Expression) -> tuple[Expression, Expression]:
        """(supply, tank) area [m^2] at s_s [m], as interpolated, the function whose root is sought."""
        sides = [_areas(nodes, ca.fabs(position)) for nodes in (self.extend, self.retract)]
        supply, tank = (ca.if_else(position < 0, *both) for both in zip(*sides, strict=True))
        return supply, tank


def _nodes(metering: Metering, side: float, p: Any, e: Any) -> tuple[tuple[float, float, float], ...]:
    x0 = float(metering.overlap(side, p, e))
    result = []
    for share in NODES:
        x = min(x0 + share * (1 - x0), metering.largest_opening)
        position = x * p.main_valve_spool.s_max
        supply, tank = metering.areas(side * position, p, e)
        result.append((position, float(supply), float(tank)))
    return tuple(result)


def _areas(nodes: tuple[tuple[float, float, float], ...], opening: Expression) -> tuple[Expression, Expression]:
    size = ca.fmin(opening, nodes[-1][0])
    supply: Expression = nodes[-1][1]
    tank: Expression = nodes[-1][2]
    for (s0, a0, b0), (s1, a1, b1) in reversed(list(pairwise(nodes))):
        if s1 > s0:
            share = (size - s0) / (s1 - s0)
            inside = size <= s1
            supply = ca.if_else(inside, a0 + share * (a1 - a0), supply)
            tank = ca.if_else(inside, b0 + share * (b1 - b0), tank)
    closed = size <= nodes[0][0]
    return ca.if_else(closed, 0.0, supply), ca.if_else(closed, 0.0, tank)


def _root(
    nodes: tuple[tuple[float, float, float], ...], wanted: Expression, supply: Expression, tank: Expression
) -> Expression:
    """|s_s| at which supply A_s + tank A_t reaches ``wanted``, which must not be negative."""
    ends = [(position, supply * supply_area + tank * tank_area) for position, supply_area, tank_area in nodes[1:]]
    result = nodes[-1][0]
    # backwards, so that the first segment in which it is reached counts
    for (before, reached), (position, value) in reversed(list(pairwise([(nodes[0][0], 0.0), *ends]))):
        inside = before + (position - before) * (wanted - reached) / (value - reached)
        result = ca.if_else(ca.logic_and(value >= wanted, value > reached), inside, result)
    return result
