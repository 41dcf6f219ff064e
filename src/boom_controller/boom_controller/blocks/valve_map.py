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

from boom_model.regularisation import Expression
from boom_model.slots import Metering
from boom_model.structure import Structure

NODES = (0.0, 0.02, 0.05, 0.1, 0.16, 0.24, 0.34, 0.43, 0.52, 0.6, 0.68, 0.76, 0.84, 0.92, 1.0, 1.25)
"""Nodes in (x - x_0) / (1 - x_0), x = |s_s| / s_max; the last ones lie beyond the full stroke, up to the largest opening."""


class ValveMap:
    """The valve of a machine.

    The areas' nodes: ``extend`` and ``retract`` hold (|s_s| [m], supply area [m^2], tank area [m^2]) in ascending order.
    """

    def __init__(self, structure: Structure, p: Any, e: Any) -> None:
        self._structure, self._p, self._e = structure, p, e
        self.extend = _nodes(structure.metering, -1.0, p, e)
        self.retract = _nodes(structure.metering, 1.0, p, e)
        self.dead_extend, self.dead_retract = self.extend[0][0], self.retract[0][0]

    def extending(self, wanted: Expression, psi: Expression, omega: Expression) -> Expression:
        """|s_s| [m] with psi A_sa + omega A_tb = wanted >= 0; the edge of the dead zone for 0, the last node if out of reach."""
        return _root(self.extend, wanted, psi, omega)

    def retracting(self, wanted: Expression, psi: Expression, omega: Expression) -> Expression:
        """|s_s| [m] with psi A_ta + omega A_sb = wanted <= 0, psi and omega <= 0."""
        return _root(self.retract, -wanted, -omega, -psi)

    def through_dead_zone(self, spool: Expression, speed: Expression, whole: Expression) -> Expression:
        """s_s* [m] with its jump across the dead zone made a ramp over ``speed`` [m/s], positive lifts; ``whole``: its end."""
        share = ca.fmin(ca.fabs(speed) / whole, 1.0)
        edge = ca.if_else(speed > 0, -self.dead_extend, self.dead_retract)
        agree = ca.if_else(speed > 0, spool < 0, spool >= 0)
        return ca.if_else(agree, spool, edge) * share

    def flows(self, hose_pressure: Expression, rod_pressure: Expression, cushions: tuple[Any, Any]) -> FlowsNow:
        """What flows at each node under these pressures [Pa]; ``cushions``: of rod side and hose."""
        p, e, metering, supply = self._p, self._e, self._structure.metering, self._structure.supply
        sides = []
        for sign, nodes in ((-1.0, self.extend), (1.0, self.retract)):
            rows = []
            for position, *_ in nodes:
                flows = metering.flows(sign * position, hose_pressure, rod_pressure, p, e, supply, cushions)
                rows.append((position, flows.head, flows.rod, flows.force))
            sides.append(rows)
        return FlowsNow(*sides)


class FlowsNow:
    """The valve's flows at the present pressures, straight between its nodes: (|s_s| [m], q_h, q_b [m^3/s], F_q [N]) each."""

    def __init__(self, extend: list[tuple[Any, ...]], retract: list[tuple[Any, ...]]) -> None:
        self._extend, self._retract = extend, retract

    def at(self, position: Expression) -> tuple[Expression, Expression, Expression]:
        """(q_h, q_b) into the ports and the closing force at s_s [m]; nothing flows inside the dead zone."""
        size = ca.fabs(position)
        sides = zip(*(_interpolated(nodes, size) for nodes in (self._extend, self._retract)), strict=True)
        head, rod, force = (ca.if_else(position < 0, *both) for both in sides)
        return head, rod, force

    def spool(self, sigma: Expression, a: Expression, b: Expression, largest: Expression) -> Expression:
        """s_s* [m], at most ``largest``, with a q_h - b q_b = Sigma [N/s]; a, b [N/m^3]: force per volume of both chambers."""
        extend, retract = (
            _crossing([(s, sign * (a * q_h - b * q_b)) for s, q_h, q_b, _ in nodes], sign * sigma)
            for sign, nodes in ((1.0, self._extend), (-1.0, self._retract))
        )
        return ca.if_else(sigma > 0, -ca.fmin(extend, largest), ca.fmin(retract, largest))


def _nodes(metering: Metering, side: float, p: Any, e: Any) -> tuple[tuple[float, float, float], ...]:
    x0 = float(metering.overlap(side, p, e))
    result = []
    for share in NODES:
        x = min(x0 + share * (1 - x0), metering.largest_opening)
        position = x * p.main_valve_spool.s_max
        supply, tank = metering.areas(side * position, p, e)
        result.append((position, float(supply), float(tank)))
    return tuple(result)


def _interpolated(nodes: list[tuple[Any, ...]], size: Expression) -> list[Expression]:
    held = ca.fmin(size, nodes[-1][0])
    values: list[Expression] = list(nodes[-1][1:])
    for before, after in reversed(list(pairwise(nodes))):
        if after[0] > before[0]:
            share = (held - before[0]) / (after[0] - before[0])
            inside = held <= after[0]
            values = [
                ca.if_else(inside, low + share * (high - low), value)
                for low, high, value in zip(before[1:], after[1:], values, strict=True)
            ]
    return [ca.if_else(held <= nodes[0][0], 0.0, value) for value in values]


def _root(
    nodes: tuple[tuple[float, float, float], ...], wanted: Expression, supply: Expression, tank: Expression
) -> Expression:
    """|s_s| at which supply A_s + tank A_t reaches ``wanted``, which must not be negative."""
    return _crossing([(position, supply * a_supply + tank * a_tank) for position, a_supply, a_tank in nodes], wanted)


def _crossing(nodes: list[tuple[Any, Any]], wanted: Expression) -> Expression:
    """|s_s| at which the value of the nodes (|s_s|, value) first reaches ``wanted``; nothing flows at the first one."""
    result: Expression = nodes[-1][0]
    # backwards, so that the first segment in which it is reached counts
    for (before, reached), (position, value) in reversed(list(pairwise([(nodes[0][0], 0.0), *nodes[1:]]))):
        inside = before + (position - before) * (wanted - reached) / (value - reached)
        result = ca.if_else(ca.logic_and(value >= wanted, value > reached), inside, result)
    return result
