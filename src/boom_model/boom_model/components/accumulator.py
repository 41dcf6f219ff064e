"""Diaphragm accumulator behind an orifice, (3.16)-(3.19) = (5.39g,h) and (5.39j,k).

    p_o' = kappa beta p_o q_o / (kappa p_o V_g0 + (beta - kappa p_o) (zeta_0 / p_o)^(1/kappa)),  zeta_0 = p_g0 V_g0^kappa
    q_o = sgn(p_h - p_o) C_d pi d^2 / 4 sqrt(2 / rho) sqrt(|p_h - p_o|),  0 while p_h < p_o <= p_g0

The gate of (5.39j,k) is smoothed: the outflow is multiplied by u / sqrt(1 + u^2), u = max(0, p_o - p_g0) / GATE_WIDTH;
as a jump it overshoots and costs ten times the steps. Valid for p_o > 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import casadi as ca

from boom_model.regularisation import Expression, power, signed_sqrt
from boom_model.slots import Accumulators, Wiring, register
from boom_model.specification import Specification

GATE_WIDTH = 5.0e3
"""Pa."""
LOWEST_PRESSURE = 1.0e4
"""Pa. Keeps (3.19) finite."""

SPECIFICATIONS = (
    Specification("accumulators.V_g0", "V_g0", "m^3", "gas volume at pre-charge, both", 1e-6, 0.1, "3.16"),
    Specification("accumulators.p_g0_1", "p_g0,1", "Pa", "pre-charge pressure, accumulator 1", 1e5, 4e7, "3.16"),
    Specification("accumulators.p_g0_2", "p_g0,2", "Pa", "pre-charge pressure, accumulator 2", 1e5, 4e7, "3.16"),
    Specification("accumulators.d_1", "d_1", "m", "orifice diameter, accumulator 1", 1e-5, 0.05, "3.20"),
    Specification("accumulators.d_2", "d_2", "m", "orifice diameter, accumulator 2", 1e-5, 0.05, "3.20"),
    Specification("accumulators.kappa", "kappa", "-", "isentropic exponent of the gas", 1.0, 2.0, "3.16"),
)


def gas_volume(pressure: Expression, precharge: Expression, p: Any) -> Expression:
    """V_g = (zeta_0 / p_o)^(1/kappa) [m^3] at the pressure p_o [Pa], (3.16)."""
    return p.accumulators.V_g0 * power(precharge / ca.fmax(pressure, LOWEST_PRESSURE), 1 / p.accumulators.kappa)


def oil_volume(pressure: Expression, precharge: Expression, p: Any) -> Expression:
    """V_o = V_g0 - V_g [m^3], zero below pre-charge, (5.44)."""
    return p.accumulators.V_g0 - gas_volume(ca.fmax(pressure, precharge), precharge, p)


def pressure_rate(
    pressure: Expression,
    flow: Expression,
    precharge: Expression,
    bulk_modulus: Expression,
    p: Any,
    entropy_rate: Expression = 0.0,
) -> Expression:
    """p_o' [Pa/s] for the flow q_o [m^3/s] into the accumulator, (3.19); ``entropy_rate`` e' [1/s] of exchanged heat."""
    a = p.accumulators
    held = ca.fmax(pressure, LOWEST_PRESSURE)
    stiffness = a.kappa * held
    volume = gas_volume(pressure, precharge, p)
    driven = stiffness * flow + held * entropy_rate * volume
    return bulk_modulus * driven / (stiffness * a.V_g0 + (bulk_modulus - stiffness) * volume)


def orifice_flow(
    hose_pressure: Expression, pressure: Expression, precharge: Expression, diameter: Expression, p: Any
) -> Expression:
    """q_o [m^3/s] from the hose into the accumulator, (5.39j,k)."""
    drop = hose_pressure - pressure
    u = ca.fmax(pressure - precharge, 0.0) / GATE_WIDTH
    gate = ca.if_else(drop < 0, u / ca.sqrt(1 + u * u), 1.0)
    return gate * p.fluid.C_d * (pi / 4) * diameter**2 * ca.sqrt(2 / p.fluid.rho) * signed_sqrt(drop)


def compliance(pressure: Expression, precharge: Expression, bulk_modulus: Expression, p: Any) -> Expression:
    """dV / dp [m^3/Pa] of an accumulator at rest with the line, 0 below pre-charge: the denominator of (5.45).

    (V_o / beta) + V_g / (kappa p_o), which is (3.19) with q_o = V' solved for q_o / p_o'.
    """
    a = p.accumulators
    volume = gas_volume(pressure, precharge, p)
    stiffness = a.kappa * ca.fmax(pressure, LOWEST_PRESSURE)
    filled = (a.V_g0 - volume) / bulk_modulus + volume / stiffness
    return ca.if_else(pressure > precharge, filled, 0.0)


def cells(p: Any, e: Any) -> tuple[tuple[Expression, Expression], ...]:
    """Pre-charge pressure [Pa] and orifice diameter [m] of both."""
    a = p.accumulators
    numbers = (a.p_g0_1, a.d_1), (a.p_g0_2, a.d_2)
    return tuple(
        (e.through("precharge", precharge, number=k), e.through("throat", diameter, number=k))
        for k, (precharge, diameter) in enumerate(numbers, 1)
    )


def compliances(pressure: Expression, bulk_modulus: Expression, p: Any, e: Any) -> tuple[Expression, ...]:
    """dV / dp [m^3/Pa] of both, :func:`compliance`."""
    return tuple(compliance(pressure, precharge, bulk_modulus, p) for precharge, _ in cells(p, e))


def _flow(w: Wiring, hose_pressure: Expression) -> Expression:
    p, e = w.p, w.e
    total: Any = 0
    for i, (precharge, diameter) in enumerate(cells(p, e), 1):
        name = f"accumulator_pressure_{i}"
        p_o = w.add_pressure(name, f"p_o,{i}")
        adiabat = e.through("adiabat", precharge, number=i, pressure=p_o, p=p)
        heat = e.through("entropy_rate", 0.0, number=i)
        flow = orifice_flow(hose_pressure, p_o, adiabat, diameter, p)
        w.rates[name] = pressure_rate(p_o, flow, adiabat, p.fluid.beta, p, heat)
        total = total + flow
    return total


def _rest(states: Mapping[str, Expression], p: Any, e: Any) -> dict[str, Expression]:
    pressure = states["hose_pressure"]
    return {
        f"accumulator_pressure_{i}": ca.fmax(pressure, precharge) for i, (precharge, _) in enumerate(cells(p, e), 1)
    }


def _data(p: Any) -> tuple[tuple[str, str], ...]:
    gas = p.accumulators
    value = f"{gas.V_g0 * 1e3:.2f} l each, {gas.p_g0_1 / 1e5:.0f} and {gas.p_g0_2 / 1e5:.0f} bar"
    return (("accumulators: gas and pre-charge", value),)


register(Accumulators(
    name="two_diaphragm", meaning="two accumulators behind orifices at the hose of the head side",
    term="p_o' = kappa beta p_o q_o / (kappa p_o V_g0 + (beta - kappa p_o) V_g)", equation="5.39g,h,j,k",
    specifications=SPECIFICATIONS, offers=frozenset({"accumulators"}), data=_data, rest=_rest, flow=_flow,
    compliances=compliances, cells=cells, precharges=("accumulators.p_g0_1", "accumulators.p_g0_2"),
))  # fmt: skip
register(Accumulators(name="none", meaning="no accumulators", term="q_o = 0"))
