"""The state of a boom that has rested: p_a = p_h, p_o,i = max(p_h, p_g0,i), spool and pilot states zero (machine notes).

Behind a valve that holds the load p_a is what carries the boom, at least p_h. Once for numbers (``plant``) and once for C code.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from boom_model.catalogue import EFFECTS
from boom_model.catalogue.terms import Terms
from boom_model.component_numbers import components_of
from boom_model.components import equation_of_motion, oil, payload
from boom_model.equations import Equations, valve_holds
from boom_model.regularisation import Expression
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]

START = ("angle", "hose_pressure", "rod_pressure", "balanced")
"""s of :func:`start_state`: q_2 [rad], p_h and p_b [Pa gauge], and 1 where p_h is to be what carries the boom, else 0."""

_RESTING = ("angle", "hose_pressure", "rod_pressure")
"""Channels that tell a state at rest; so are the states called that they show."""
_SETTLING, _SETTLED = 6, 1e-9
"""Steps to that state at most, and the share of what is shown that counts as none."""


def settled(m: Equations, values: dict[str, Expression], p: Any, e: Terms) -> list[Expression]:
    """x (NX,) at rest, in the order of the states.

    Args:
        m: the model.
        values: q_2 [rad] as ``angle``; p_h, p_a, p_b [Pa gauge] as ``hose_pressure``, ``head_pressure``, ``rod_pressure``.
        p: the machine's numbers (``component_numbers``).
        e: the terms of its active effects.
    """
    values = dict(values)
    for name in (
        "hose_pressure",
        "head_pressure",
        "rod_pressure",
    ):  # a transducer may read vacuum; oil at rest leaves no void
        values[name] = ca.fmax(values[name], oil.VOID)
    for component in m.structure:
        values |= component.rest(values, p, e)
    position = m.structure.linkage.piston_position(values["angle"], p)
    values["load"] = equation_of_motion.load_mass(
        p, e, position, payload.mass(m.structure.steps, lambda: 0.0, position, p)
    )
    for effect in (EFFECTS[name] for name in m.effects):
        if effect.at_rest:
            values |= effect.at_rest(values, p, e)
    return [values.get(name, 0.0) for name in m.state_names]


def shown(plant: Any, wanted: Array, parameters: Array | None, inputs: Any) -> Array:
    """State at rest of a plant at which its sensors show ``wanted``: angle [rad], p_h, p_b [Pa gauge], NaN where not measured.

    The outputs are linear in the states, but what else depends on these, as a sag does on the angle, asks for some steps.
    """
    which = [OUTPUTS.index(n) for n in _RESTING]
    own = np.array([float(n == "angle" or n.endswith("_pressure")) for n in plant.state_names])
    slope = (plant.outputs(own, None, parameters) - plant.outputs(0.0 * own, None, parameters))[which]
    sought = wanted
    for _ in range(_SETTLING):
        state = np.asarray(plant.rest_state(*sought.tolist(), parameters, inputs))
        lacking = (wanted - plant.outputs(state, inputs, parameters)[which]) / slope
        lacking[~np.isfinite(wanted)] = 0.0
        if np.all(np.abs(lacking) <= _SETTLED * np.abs(np.nan_to_num(wanted))):
            break
        sought = sought + lacking
    return state


def carrying(m: Equations, angle: Expression, rod_pressure: Expression, inputs: Expression | None = None) -> Expression:
    """p_a [Pa] that carries the boom without friction, p_a A_a = g / J + p_b A_b; negative for a boom that hangs.

    inputs: (NU,) that act, by default none; they tell where the other joints stand.
    """
    at = ca.vertcat(*(angle if name == "angle" else 0.0 for name in m.state_names))
    torque, jacobian = (m.auxiliary[name][1] for name in ("gravity_torque", "jacobian"))
    force = ca.substitute(
        torque / jacobian, ca.vertcat(m.x, m.u), ca.vertcat(at, ca.SX.zeros(m.u.numel()) if inputs is None else inputs)
    )
    area_a, area_b = (m.p[m.parameters.index(f"cylinder.{name}")] for name in ("A_a", "A_b"))
    return (force + rod_pressure * area_b) / area_a


def start_state(m: Equations) -> tuple[Any, Any]:
    """(s, x(s, p)): the start as ``START`` has it, and the state at rest there, both symbolic."""
    s = ca.SX.sym("s", len(START))
    angle, hose, rod, balanced = (s[k] for k in range(len(START)))
    p, e = components_of({name: m.p[k] for k, name in enumerate(m.parameters)})
    free = carrying(m, angle, rod)  # below zero the boom hangs, and the rod side carries it
    rod = rod + balanced * ca.fmax(-free, 0.0) * p.cylinder.A_a / p.cylinder.A_b
    hose = ca.if_else(balanced, ca.fmax(free, 0.0), hose)
    head = ca.fmax(carrying(m, angle, rod), hose) if valve_holds(m.structure, m.effects) else hose
    values = {"angle": angle, "hose_pressure": hose, "head_pressure": head, "rod_pressure": rod}
    return s, ca.vertcat(*settled(m, values, p, e))


@lru_cache(maxsize=64)
def settled_function(m: Equations) -> Any:
    """:func:`settled` of (q_2, p_h, p_a, p_b) and p."""
    at = ca.SX.sym("at", 4)
    values = dict(zip(("angle", "hose_pressure", "head_pressure", "rod_pressure"), ca.vertsplit(at), strict=True))
    numbers = components_of({name: m.p[k] for k, name in enumerate(m.parameters)})
    return ca.Function("settled", [at, m.p], [ca.densify(ca.vertcat(*settled(m, values, *numbers)))])


@lru_cache(maxsize=64)
def carrying_function(m: Equations) -> Any:
    """:func:`carrying` of q_2, p_b, p and u."""
    at, u = ca.SX.sym("at", 2), ca.SX.sym("u", m.u.numel())
    return ca.Function("carrying", [at, m.p, u], [carrying(m, at[0], at[1], u)])


def evaluated(function: Any, *arguments: ArrayLike) -> Array:
    """What a function of dense vectors gives; by its buffers, which takes a fifth of the time of a call (measured).

    Raises:
        ValueError: a vector of another length.
    """
    given = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
    if [argument.size for argument in given] != [function.nnz_in(k) for k in range(function.n_in())]:
        raise ValueError(f"{function.name()}: vectors of other lengths than its arguments")
    result = np.empty(function.nnz_out(0))
    buffer, evaluate = function.buffer()
    for k, argument in enumerate(given):
        buffer.set_arg(k, argument.data)
    buffer.set_res(0, result.data)
    evaluate()
    return result
