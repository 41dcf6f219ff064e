"""Terms learnt from data: unmodelled physics as a sum of coefficients times products of states.

    term = sum_j c_j prod_f f(v)

A product is written as text, factors joined by ``*``. A factor is a variable of ``VARIABLES``, or a function of one:

    v^2, v^3          power
    sign(v)           tanh(v / 0.02): direction
    abs(v)            sqrt(v^2 + 0.02^2) - 0.02
    plus(v, a)        max(0, v - a): one-sided
    minus(v, a)       max(0, a - v)
    above(v, a)       (1 + tanh((v - a) / 0.005)) / 2: beyond a corner only
    below(v, a)       1 - above(v, a)
    bump(v, a, b)     exp(-((v - a) / b)^2): one spot
    lag(v, T)         memory: T x' = v - x, x a state, zero at rest

Variables are scaled to about one, so that coefficients have the unit of the equation. They are held at the ends of
``validity``, the range of the data from which the term was learnt, so that it does not grow outside.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_model.errors import MachineError, nearest
from boom_model.regularisation import Expression
from boom_model.state import State

Array = NDArray[np.float64]

SHARPNESS = 0.02
"""Of sign and abs, in scaled units: 0.006 rad/s, 2 bar."""
EDGE = 0.005
"""Of above and below, in scaled units: 5 mrad."""
MOST_TERMS, MOST_PRODUCTS, MOST_FACTORS = 16, 32, 8
"""Limits of ``learned:``; more would take the compiler minutes."""
LARGEST, SMALLEST = 1e6, 1e-6
"""Of a number in a factor, and of a time or a width; variables are about one."""


@dataclass(frozen=True)
class Variable:
    """A variable for factors: the scaled variable is the quantity over ``scale``; ``zero_at_rest`` ones may lag."""

    unit: str
    scale: float
    zero_at_rest: bool
    meaning: str


VARIABLES: dict[str, Variable] = {
    "angle": Variable("rad", 1.0, False, "boom angle q_2"),
    "rate": Variable("rad/s", 0.3, True, "angular velocity"),
    "head_pressure": Variable("Pa", 1e7, False, "p_a"),
    "rod_pressure": Variable("Pa", 1e7, False, "p_b"),
    "hose_pressure": Variable("Pa", 1e7, False, "p_h"),
    "spool": Variable("-", 1.0, True, "spool position over full stroke, positive: retract"),
}


def state_of(variable: str, states: Collection[str]) -> str:
    """The state that a variable is, unscaled: without a valve between hose and cylinder the hose pressure is the head pressure."""
    if variable == "spool":
        return "spool_position"
    return "head_pressure" if variable == "hose_pressure" and variable not in states else variable


@dataclass(frozen=True)
class Place:
    """An equation that accepts a term: its number in the thesis, unit of the term, size of a coefficient of one."""

    equation: str
    unit: str
    scale: float
    meaning: str


PLACES: dict[str, Place] = {
    "torque": Place("5.39b", "N m", 1e4, "torque that moves the boom up"),
    "head_flow": Place("5.39f", "m^3/s", 1e-4, "flow into the head side"),
    "hose_flow": Place("5.39i", "m^3/s", 1e-4, "flow into the hose of the head side"),
    "rod_flow": Place("5.39d", "m^3/s", 1e-4, "flow into the rod side"),
    "spool": Place("5.39n", "Pa", 1e5, "pilot pressure that pushes the spool to retract"),
}


DISCREPANCY_TIME = 1.0
"""s. T of the discrepancies: what a model lacks lasts about as long as a motion. From 0.2 to 5 s it hardly matters."""
DISCREPANCY = "discrepancy_"


def discrepancy_state(place: str) -> State:
    """The state by which the equation at a place (``PLACES``) may be off, over the place's scale: T d' = -d."""
    return State(DISCREPANCY + place, "d", "-", 1.0, -1e3, 1e3, PLACES[place].equation)


@dataclass(frozen=True)
class LearnedTerm:
    """One entry of ``learned:`` in a machine file.

    Attributes:
        equation: key of PLACES. basis: products. coefficients: one for each, in units of the place's scale.
        validity: variable -> (low, high) in its unit; outside, the variable counts as its end.
    """

    equation: str
    basis: tuple[str, ...]
    coefficients: tuple[float, ...]
    validity: Mapping[str, tuple[float, float]]

    @property
    def key(self) -> tuple[Any, ...]:
        """Key of the shape of the equations."""
        return self.equation, self.basis, tuple(sorted(self.validity.items()))

    def document(self) -> dict[str, Any]:
        """As in a machine file."""
        place = PLACES[self.equation]
        return {
            "equation": self.equation, "basis": list(self.basis), "coefficients": [float(c) for c in self.coefficients],
            "unit": f"{place.scale:g} {place.unit}",
            "validity": {name: [float(a), float(b)] for name, (a, b) in self.validity.items()},
        }  # fmt: skip


_FACTOR = re.compile(r"^(?:(\w+)\(\s*(\w+)\s*((?:,\s*-?[0-9.eE+-]+\s*)*)\)|(\w+)(?:\^([23]))?)$")
_ARGUMENTS = {"sign": 0, "abs": 0, "plus": 1, "minus": 1, "above": 1, "below": 1, "bump": 2, "lag": 1}


@dataclass(frozen=True)
class Factor:
    """One factor: function ("" for the variable itself, "^2", "^3"), variable, numbers."""

    function: str
    variable: str
    numbers: tuple[float, ...]


def parse(text: str) -> tuple[Factor, ...]:
    """The factors of a product.

    Raises:
        MachineError: the message names the unreadable part.
    """
    if text.count("*") >= MOST_FACTORS:
        raise MachineError(f"learned: {text!r} has more than {MOST_FACTORS} factors")
    return tuple(_factor(part.strip(), text) for part in text.split("*"))


def _factor(part: str, text: str) -> Factor:
    match = _FACTOR.match(part)
    if match is None:
        raise MachineError(
            f"learned: {part!r} in {text!r} is neither a variable nor a function of one; see docs/diagnosis.md"
        )
    function, variable, given, plain, power = match.groups()
    if function is None:
        function, variable, given = (f"^{power}" if power else ""), plain, ""
    elif function not in _ARGUMENTS:
        raise MachineError(f"learned: no function {function} in {text!r}{nearest(function, _ARGUMENTS)}")
    if variable not in VARIABLES:
        raise MachineError(f"learned: no variable {variable} in {text!r}{nearest(variable, VARIABLES)}")
    numbers = _factor_numbers(function, given, f"learned: {part!r} in {text!r}")
    if function == "lag" and not VARIABLES[variable].zero_at_rest:
        raise MachineError(f"learned: {part!r} in {text!r}: {variable} is not zero at rest and cannot lag")
    return Factor(function, variable, numbers)


def _factor_numbers(function: str, given: str, where: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(v) for v in given.split(",") if v.strip())
    except ValueError:
        raise MachineError(f"{where}: not all of its numbers can be read") from None
    if len(numbers) != _ARGUMENTS.get(function, 0):
        raise MachineError(f"{where}: {function} takes {_ARGUMENTS.get(function, 0)} numbers")
    if not all(abs(v) <= LARGEST for v in numbers):
        raise MachineError(f"{where}: a number is not finite and within +-{LARGEST:g}")
    if function in ("lag", "bump") and not numbers[-1] >= SMALLEST:
        raise MachineError(f"{where}: its last number must be at least {SMALLEST:g}")
    return numbers


def check_learned(given: Any) -> tuple[LearnedTerm, ...]:
    """Section ``learned:`` of a machine file.

    Raises:
        MachineError: the message names the first fault.
    """
    if not isinstance(given, list):
        raise MachineError("learned: expected a list of terms with equation, basis, coefficients, unit, validity")
    if len(given) > MOST_TERMS:
        raise MachineError(f"learned: {len(given)} terms, more than {MOST_TERMS}")
    return tuple(_term(entry, f"learned[{k}]") for k, entry in enumerate(given))


def _term(entry: Any, where: str) -> LearnedTerm:
    if not isinstance(entry, dict):
        raise MachineError(f"{where}: expected equation, basis, coefficients, unit, validity")
    wanted = {"equation", "basis", "coefficients", "unit", "validity"}
    for key in entry:
        if key not in wanted:
            raise MachineError(f"{where}.{key}: no such key{nearest(str(key), wanted)}")
    for key in sorted(wanted - set(entry)):
        raise MachineError(f"{where}.{key}: missing")
    if not isinstance(entry["equation"], str) or entry["equation"] not in PLACES:
        raise MachineError(f"{where}.equation: {entry['equation']!r} is not one of {', '.join(PLACES)}")
    basis = _basis(entry["basis"], where)
    coefficients = _coefficients(entry["coefficients"], len(basis), where)
    place = PLACES[entry["equation"]]
    if str(entry["unit"]).strip() != f"{place.scale:g} {place.unit}":
        raise MachineError(f"{where}.unit: {entry['unit']!s}; expected {place.scale:g} {place.unit}")
    used = {f.variable for text in basis for f in parse(text)}
    return LearnedTerm(
        entry["equation"],
        basis,
        coefficients,
        _validity(entry["validity"], used, where),
    )


def _basis(given: Any, where: str) -> tuple[str, ...]:
    if not isinstance(given, list) or not given or not all(isinstance(b, str) for b in given):
        raise MachineError(f"{where}.basis: expected a list of products, e.g. ['sign(rate)']")
    if len(given) > MOST_PRODUCTS:
        raise MachineError(f"{where}.basis: {len(given)} products, more than {MOST_PRODUCTS}")
    return tuple(given)


def _coefficients(given: Any, count: int, where: str) -> tuple[float, ...]:
    if not isinstance(given, list) or len(given) != count:
        raise MachineError(f"{where}.coefficients: expected {count} numbers, one for each product of the basis")
    for c in given:
        if isinstance(c, bool) or not isinstance(c, int | float) or not abs(c) <= 1e12:
            raise MachineError(f"{where}.coefficients: {c!r} is not a finite number within +-1e12")
    return tuple(float(c) for c in given)


def _validity(given: Any, used: set[str], where: str) -> dict[str, tuple[float, float]]:
    if not isinstance(given, dict):
        raise MachineError(f"{where}.validity: expected variable: [low, high]")
    result = {}
    for name in sorted(used):
        pair = given.get(name)
        if (
            not isinstance(pair, list)
            or len(pair) != 2
            or not all(isinstance(v, int | float) and not isinstance(v, bool) and abs(v) <= 1e12 for v in pair)
            or not pair[0] < pair[1]
        ):
            raise MachineError(f"{where}.validity.{name}: expected [low, high] in {VARIABLES[name].unit}")
        result[name] = (float(pair[0]), float(pair[1]))
    for name in given:
        if name not in used:
            raise MachineError(f"{where}.validity.{name}: not used by the basis")
    return result


def term(
    learned: LearnedTerm,
    coefficients: list[Expression],
    quantities: Mapping[str, Expression],
    memory: Callable[[str, float, Expression], Expression],
) -> Expression:
    """The term in the unit of its place.

    Args:
        learned: the term.
        coefficients: in the order of its basis.
        quantities: variable -> quantity in its unit.
        memory: (variable, T, scaled variable) -> the lagging variable.
    """
    total: Expression = 0.0
    for text, coefficient in zip(learned.basis, coefficients, strict=True):
        product: Expression = 1.0
        for factor in parse(text):
            low, high = learned.validity[factor.variable]
            held = ca.fmin(ca.fmax(quantities[factor.variable], low), high)
            product = product * _value(factor, held / VARIABLES[factor.variable].scale, memory)
        total = total + coefficient * product
    return total * PLACES[learned.equation].scale


def evaluate(text: str, variables: Mapping[str, Array], memory: Callable[[str, float, Array], Array]) -> Array:
    """A product (n,) over scaled variables (n,); ``memory`` as in :func:`term`, for numbers.

    Raises:
        MachineError: the message names the unreadable part.
    """
    product = np.ones(len(next(iter(variables.values()))))
    for factor in parse(text):
        product = product * _value(factor, variables[factor.variable], memory, np)
    return product


def _value(f: Factor, v: Any, memory: Callable[[str, float, Any], Any], m: Any = ca) -> Any:
    """``m``: CasADi for an expression, numpy for numbers."""
    if f.function == "sign":
        return m.tanh(v / SHARPNESS)
    if f.function == "abs":
        return m.sqrt(v * v + SHARPNESS * SHARPNESS) - SHARPNESS
    if f.function == "plus":
        return m.fmax(v - f.numbers[0], 0.0)
    if f.function == "minus":
        return m.fmax(f.numbers[0] - v, 0.0)
    if f.function in ("above", "below"):
        side = 1.0 if f.function == "above" else -1.0
        return 0.5 * (1.0 + m.tanh(side * (v - f.numbers[0]) / EDGE))
    if f.function == "bump":
        return m.exp(-(((v - f.numbers[0]) / f.numbers[1]) ** 2))
    if f.function == "lag":
        return memory(f.variable, f.numbers[0], v)
    return v ** int(f.function[1]) if f.function else v
