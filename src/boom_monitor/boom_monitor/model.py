"""The model of the watch: its right-hand side with all derivatives, and the possible causes of a mismatch.

The effects of the catalogue are switched on at almost zero, which provides the derivative with respect to each and
keeps the model nominal. The causes come in two lists: numbers that may be off within their tolerance and raise no
alarm (:attr:`WatchModel.tolerated`), and the effects (:attr:`WatchModel.suspects`), each in units of its
tolerance or of half of its plausible range.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_estimation.unknown import PRECHARGE_TOLERANCE
from boom_model.catalogue import EFFECTS
from boom_model.machine import Machine, Pose
from boom_model.observer import compile_abreast
from boom_model.plant import Plant
from boom_model.tolerance import TOLERANCES

Array = NDArray[np.float64]

LOAD_TOLERANCE, LOAD_SHARE = 20.0, 0.05
"""kg, and share of the configured load: the larger one counts (machine notes)."""

# Geometry, units and exponents: not what wears, and an error of theirs would show as another parameter's.
CERTAIN = (
    "kinematics.",
    "constants.",
    "cylinder.l_",
    "hose_burst_valve.unit_",
    "main_valve_orifices.n",
    "accumulators.kappa",
)
# Share of the plausible range that is as good as nothing, where an effect says no other value.
_FIRST_ONLY = 1e-6


@dataclass(frozen=True)
class Suspect:
    """An effect's parameter as a cause.

    scale: size of one unit [unit]. low, high: plausible range in such units, including neutral (zero).
    """

    effect: str
    parameter: str
    subsystem: str
    scale: float
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class ModelPoint:
    """The model at one point: derivatives of f to state (n, n), causes (n, c), currents (n, 2); y (NY,) and its derivatives.

    The arrays belong to the model and change with its next point.
    """

    f_x: Array
    f_c: Array
    f_u: Array
    y: Array
    y_x: Array
    y_c: Array


class WatchModel:
    """A machine in a pose with the effects at almost zero.

    Args:
        machine: its own effects stay; those at neutral become suspects.
        pose: locked joints and load.

    Attributes:
        plant: the compiled model.
        tolerated: names of the causes within tolerance, the first columns of the derivatives.
        suspects: the effects, the following columns.

    Raises:
        BuildError: no C compiler.
        MachineError: impossible numbers of the machine.
    """

    def __init__(self, machine: Machine, pose: Pose) -> None:
        given = {name: dict(values) for name, values in machine.effects.items()}
        self.plant = Plant(machine.with_effects({**switched_on(machine), **given}), pose)
        compile_abreast(self.plant)  # now, not when the first alarm is to be named
        index = {name: i for i, name in enumerate(self.plant.parameter_names)}
        columns: list[Array] = []
        names: list[str] = []
        for name, changes in self._tolerated(machine, pose):
            columns.append(self._column(index, changes))
            names.append(name)
        self.tolerated = tuple(names)
        self.suspects = tuple(suspects(machine, index))
        columns += [self._column(index, {f"effects.{s.effect}.{s.parameter}": s.scale}) for s in self.suspects]
        self._state, self._currents = np.zeros(len(self.plant.state_names)), np.zeros(2)
        self._evaluate, self._point = self._compiled(np.array(columns).T)

    @staticmethod
    def _column(index: Mapping[str, int], changes: Mapping[str, float]) -> Array:
        column = np.zeros(len(index))
        for name, change in changes.items():
            column[index[name]] = change
        return column

    @staticmethod
    def _tolerated(machine: Machine, pose: Pose) -> list[tuple[str, dict[str, float]]]:
        """(name, change of each component for one tolerance)."""
        result = []
        for key, parameter in machine.parameters.items():
            if key.startswith(CERTAIN):
                continue
            precharge = key.startswith("accumulators.p_g0") and not parameter.confidence
            share = PRECHARGE_TOLERANCE if precharge else parameter.tolerance
            changes = {
                c: share * v
                for c, v in zip(parameter.specification.components, parameter.value, strict=True)
                if v != 0.0
            }
            if changes:
                result.append((key, changes))
        for effect in (EFFECTS[name] for name in switched_on(machine) if name not in machine.effects):
            accurate = [row for row in effect.parameters if row.accuracy]
            result += [
                (f"{effect.id}.{row.name}", {f"effects.{effect.id}.{row.name}": row.accuracy}) for row in accurate
            ]
        masses = {name: TOLERANCES["medium"] * pose.values()[name] for name in ("pose.D0", "pose.Sx", "pose.Sy")}
        load = {"pose.load": max(LOAD_TOLERANCE, LOAD_SHARE * pose.load)}
        return [*result, ("masses of the boom", masses), ("load", load)]

    def _compiled(self, directions: Array) -> tuple[Callable[[], None], ModelPoint]:
        """A function that evaluates the model at the stored state and currents, directly into the arrays of the point."""
        m = self.plant.equations
        along = ca.DM(directions)
        by_cause = ca.densify(ca.mtimes(ca.jacobian(m.derivative, m.p), along))
        rates = ca.Function("rates", [m.x, m.u, m.p], [m.derivative])
        for k, suspect in enumerate(self.suspects, start=len(self.tolerated)):
            reach = EFFECTS[suspect.effect].reach
            if reach:
                by_cause[:, k] = (rates(m.x, m.u, m.p + reach * along[:, k]) - m.derivative) / reach
        outputs = [
            ca.jacobian(m.derivative, m.x), by_cause, ca.jacobian(m.derivative, m.u),
            m.outputs, ca.jacobian(m.outputs, m.x), ca.mtimes(ca.jacobian(m.outputs, m.p), along),
        ]  # fmt: skip
        function = ca.Function("watch", [m.x, m.u, m.p], [ca.densify(o) for o in outputs], {"cse": True})
        arrays = [np.zeros(o.shape, order="F") for o in outputs]
        buffer: Any
        buffer, evaluate = function.buffer()
        for k, array in enumerate((self._state, self._currents, self.plant.p)):
            buffer.set_arg(k, array.data)
        for k, array in enumerate(arrays):
            buffer.set_res(k, array.reshape(-1, order="F").data)
        f_x, f_c, f_u, y, y_x, y_c = arrays
        self._buffer = buffer  # holds the addresses that evaluate() uses
        return evaluate, ModelPoint(f_x, f_c, f_u, y.reshape(-1), y_x, y_c)

    def at(self, state: Array, currents: tuple[float, float]) -> ModelPoint:
        """The model with its derivatives at state (n,), currents [A]."""
        self._state[:] = state
        self._currents[:] = currents
        self._evaluate()
        return self._point


def switched_on(machine: Machine) -> dict[str, dict[str, float]]:
    """The effects that are watched, at almost nothing: effect -> its parameters."""
    return {
        effect.id: {
            row.name: row.neutral
            if row.name in effect.moving
            else row.neutral + _FIRST_ONLY * (row.high - row.low)
            if row.almost_nothing is None
            else row.almost_nothing
            for row in effect.parameters
        }
        for effect in EFFECTS.values()
        if effect.watched and machine.structure.has(effect.needs)
    }


def suspects(machine: Machine, index: Mapping[str, int]) -> list[Suspect]:
    """The leading parameters of each effect that is not in the machine file."""
    result = []
    for effect in EFFECTS.values():
        if effect.id in machine.effects or f"effects.{effect.id}.{effect.parameters[0].name}" not in index:
            continue
        for row in (row for row in effect.leading if row.name not in effect.moving):  # what it does at once
            scale = (row.high - row.low) / 2
            low, high = ((limit - row.neutral) / scale for limit in (row.low, row.high))
            result.append(
                Suspect(effect.id, row.name, effect.subsystem, scale, row.unit, min(low, 0.0), max(high, 0.0))
            )
    return result
