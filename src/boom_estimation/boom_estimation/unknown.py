"""The unknowns: one number each, with prior value, prior uncertainty and bounds.

A fit works in z = (number - nominal) / sigma, of positive numbers z = ln(number / nominal) / sigma, so that the prior of
every unknown is a standard normal. sigma comes from the tolerance of the machine file (notes: high 3 %, medium 10 %, low
30 %, none 15 %, pre-charge 5 %).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, inf, log

import numpy as np
from numpy.typing import NDArray

from boom_model.catalogue import EFFECTS
from boom_model.errors import MachineError, nearest
from boom_model.machine import Machine
from boom_model.plant import Plant

Array = NDArray[np.float64]

PRECHARGE_TOLERANCE = 0.05
"""Tolerances of the machine notes; a machine file's own confidence has priority."""
_STEP = 0.02
_SMALLEST_STEP, _LARGEST_STEP = 1e-3, 1e-2


@dataclass(frozen=True)
class Unknown:
    """One number to be estimated.

    Attributes:
        name: component of the parameter vector (``friction.tau_C_pos``, ``pilot_valves.h.0``, ``effects.ID.NAME``), or
            another name if ``factor_of`` is given.
        unit: SI unit.
        nominal: prior value; start of the search unless another start is given.
        sigma: standard deviation of the prior: relative (of the logarithm) if ``log``, else in ``unit``.
        low, high: bounds.
        log: whether the logarithm is searched; for numbers that are positive by definition.
        factor_of: components that are multiplied by this number.
        bag: name of the only recording for which it holds; empty for all.
        prior: whether the prior counts in the fit (else it only scales the search).
    """

    name: str
    unit: str
    nominal: float
    sigma: float
    low: float = -inf
    high: float = inf
    log: bool = False
    factor_of: tuple[str, ...] = ()
    bag: str = ""
    prior: bool = True

    def value(self, z: float) -> float:
        """The number for z, held inside the bounds."""
        number = self.nominal * exp(self.sigma * z) if self.log else self.nominal + self.sigma * z
        return min(max(number, self.low), self.high)

    def z(self, value: float) -> float:
        """Z of a number."""
        return log(value / self.nominal) / self.sigma if self.log else (value - self.nominal) / self.sigma

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of z."""
        low = -inf if (self.log and self.low <= 0.0) or self.low == -inf else self.z(self.low)
        return low, inf if self.high == inf else self.z(self.high)

    @property
    def step(self) -> float:
        """Step of z for finite differences: far above the integrator's noise, small enough to be linear."""
        if not self.log:
            return _STEP
        return min(max(_STEP * self.sigma, _SMALLEST_STEP), _LARGEST_STEP) / self.sigma


def machine_unknown(machine: Machine, name: str, *, widen: float = 1.0, least: float = 0.0, bag: str = "") -> Unknown:
    """An unknown for a component of the machine file, its prior from the file's confidence.

    widen: sigma over tolerance; least: smallest relative sigma.

    Raises:
        MachineError: this machine has no such number.
    """
    found = next((p for p in machine.parameters.values() if name in p.specification.components), None)
    if found is None:
        known = [c for p in machine.parameters.values() for c in p.specification.components]
        raise MachineError(f"{name}: no such parameter{nearest(name, known)}")
    spec = found.specification
    value = found.value[spec.components.index(name)]
    tolerance = found.tolerance
    if spec.key.startswith("accumulators.p_g0") and not found.confidence:
        tolerance = PRECHARGE_TOLERANCE
    relative = max(widen * tolerance, least)
    positive = spec.minimum >= 0.0 and value > 0.0
    sigma = relative if positive else relative * max(abs(value), 1e-3 * min(abs(spec.maximum), 1e3))
    return Unknown(name, spec.unit, value, sigma, spec.minimum, spec.maximum, positive, bag=bag)


def effect_unknown(
    effect: str, parameter: str, *, nominal: float | None = None, sigma: float | None = None, bag: str = ""
) -> Unknown:
    """An unknown for a parameter of the effect catalogue; sigma is half of its plausible range unless given.

    nominal: start of the search, by default the neutral value. The logarithm is searched if neutral value or nominal
    and the whole plausible range are positive.

    Raises:
        KeyError: no such effect.
        StopIteration: no such parameter.
    """
    row = next(row for row in EFFECTS[effect].parameters if row.name == parameter)
    start = row.neutral if nominal is None else nominal
    positive = start > 0.0 and row.low > 0.0 and row.minimum >= 0.0
    spread = 0.5 * (log(row.high / row.low) if positive else row.high - row.low)
    return Unknown(
        f"effects.{effect}.{parameter}", row.unit, start, spread if sigma is None else sigma,
        row.minimum, row.maximum, positive, bag=bag,
    )  # fmt: skip


def with_effects_present(machine: Machine, effects: Mapping[str, Mapping[str, float]]) -> Machine:
    """The machine with these effects in its equations even if they are neutral, so that they can be estimated.

    Effects of the machine itself stay. An effect that divides by its neutral value (time constant of a lag) must be
    given a small value instead.
    """
    complete = {
        name: {row.name: row.neutral for row in EFFECTS[name].parameters} | dict(given)
        for name, given in effects.items()
    }
    return replace(machine, effects=dict(machine.effects) | complete)


def parameters(plant: Plant, unknowns: Sequence[Unknown], z: Array, bag: str) -> Array:
    """The plant's parameter vector (NP,) for z (m,); unknowns of other recordings are left out."""
    p = plant.p.copy()
    for unknown, position in zip(unknowns, z, strict=True):
        if unknown.bag and unknown.bag != bag:
            continue
        value = unknown.value(float(position))
        if unknown.factor_of:
            for name in unknown.factor_of:
                p[plant.parameter_names.index(name)] *= value
        else:
            p[plant.parameter_names.index(unknown.name)] = value
    return p
