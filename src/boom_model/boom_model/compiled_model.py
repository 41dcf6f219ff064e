"""The equations of a machine in a pose, compiled: their values and derivatives at single points."""

from __future__ import annotations

import ctypes
from collections.abc import Collection
from ctypes import CDLL
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from boom_model.catalogue import CATALOGUE
from boom_model.codegen.compiled import LANES, build, build_sensitive
from boom_model.equations import Equations, Kind, full_model, reduced_model
from boom_model.errors import ModelError
from boom_model.learned import LearnedTerm
from boom_model.machine import Machine, Pose
from boom_model.sensors import OUTPUTS
from boom_model.structure import Structure

Array = NDArray[np.float64]

TOLERATED = frozenset(e.id for e in CATALOGUE if any(r.within or r.accuracy or r.ordinary for r in e.parameters))
"""Effects of which a sound machine may have a little: their numbers may be tolerances, by which passes are differentiated."""
_DOUBLE = ctypes.POINTER(ctypes.c_double)


class CompiledModel:
    """The compiled full (5.39) or reduced (5.47) model of a machine in a pose.

    Args:
        machine: the machine, its active effects included. The reduced model leaves out effects that bring states.
        pose: locked joints and load.
        kind: ``full`` or ``reduced``.
        discrepancies: with a state for each place of the full model at which something may be missing.

    Raises:
        BuildError: no C compiler.
        ModelError: an effect that this machine cannot have.
    """

    def __init__(self, machine: Machine, pose: Pose, kind: Kind = "full", *, discrepancies: bool = False) -> None:
        self.machine = machine
        self.pose = pose
        self._kind: Kind = kind
        self._discrepancies = discrepancies
        self.equations, self._library = _compiled(machine, kind, discrepancies)
        self.state_names = self.equations.state_names
        self.parameter_names = self.equations.parameters
        values = machine.values(pose)
        self.p: Array = np.array([values[name] for name in self.parameter_names])

    def derivative(self, state: ArrayLike, current: ArrayLike, parameters: Array | None = None) -> tuple[Array, Array]:
        """x' (NX,) and the Jacobian dx'/dx (NX, NX) at one point, with the inputs (NU,).

        Raises:
            ModelError: another number of inputs.
        """
        n, inputs = len(self.state_names), self.machine.structure.inputs
        f, jacobian = np.empty(n), np.empty((n, n))
        x, u = np.ascontiguousarray(state, dtype=float), np.ascontiguousarray(current, dtype=float)
        if u.shape != (len(inputs),):
            raise ModelError(f"the inputs are {', '.join(inputs)}: give {len(inputs)} numbers, not {u.shape}")
        p = self.p if parameters is None else np.ascontiguousarray(parameters, dtype=float)
        self._library.boom_derivative(pointer(p), pointer(x), pointer(u), pointer(f), pointer(jacobian))
        return f, jacobian

    def outputs(self, state: ArrayLike, current: ArrayLike | None = None, parameters: Array | None = None) -> Array:
        """y (NY,), in the order of ``OUTPUTS``, at one point, without delay; with the inputs (NU,), by default zero."""
        y, given = np.empty(len(OUTPUTS)), np.zeros(len(self.machine.structure.inputs)) if current is None else current
        x, u = np.ascontiguousarray(state, dtype=float), np.ascontiguousarray(given, dtype=float)
        p = self.p if parameters is None else np.ascontiguousarray(parameters, dtype=float)
        self._library.boom_outputs(pointer(p), pointer(x), pointer(u), pointer(y))
        return y

    def auxiliary(self, states: ArrayLike, currents: ArrayLike, parameters: Array | None = None) -> dict[str, Array]:
        """Inner quantities over time by name (flows, force, friction, ...), SI: states (n, NX), inputs (n, NU)."""
        x, u = np.asarray(states, dtype=float).T, np.asarray(currents, dtype=float).T
        p = self.p if parameters is None else parameters
        values = self._auxiliary_function.map(x.shape[1])(x, u, ca.repmat(ca.DM(p), 1, x.shape[1]))
        return dict(zip(self.equations.auxiliary, np.asarray(values, dtype=float), strict=True))

    @cached_property
    def abreast(self) -> CDLL:
        """The observer for ``LANES`` parameter vectors at once, compiled on first use."""
        return _catalogued_abreast(*_parts(self.machine), self._kind, self._discrepancies)

    def sensitive_to(self, moved: Collection[str]) -> CDLL:
        """The observer with derivatives of its innovations by the machine's numbers and by those of the effects ``moved``.

        Compiled on first use; derivatives by other effects' numbers are zero where they do nothing.
        """
        if self._kind == "reduced" or self.machine.learned:
            return build_sensitive(self.equations)
        return _catalogued_sensitive(
            *_parts(self.machine), self._discrepancies, tuple(sorted({*TOLERATED, *moved} & {*self.machine.effects}))
        )

    @cached_property
    def _auxiliary_function(self) -> Any:
        m = self.equations
        return ca.Function("auxiliary", [m.x, m.u, m.p], [ca.vertcat(*(e for _, e in m.auxiliary.values()))])

    def linearise(self, states: ArrayLike, currents: ArrayLike, parameters: Array | None = None) -> tuple[Array, Array]:
        """Dx'/dx (n, NX, NX) and dx'/du (n, NX, NU) at the points: states (n, NX), inputs (n, NU)."""
        x, u = np.ascontiguousarray(states, dtype=float), np.ascontiguousarray(currents, dtype=float)
        p = self.p if parameters is None else np.ascontiguousarray(parameters, dtype=float)
        n, size = x.shape
        by_state, by_input = np.empty((n, size, size)), np.empty((n, size, u.shape[1]))
        self._library.boom_linearise(
            pointer(p), pointer(x), pointer(u), ctypes.c_long(n), pointer(by_state), pointer(by_input)
        )
        return by_state, by_input

    def output_matrix(self, parameters: Array | None = None) -> Array:
        """Dy/dx (NY, NX); the outputs are linear in the states."""
        origin = np.zeros(len(self.state_names))
        zero = self.outputs(origin, parameters=parameters)
        columns = [self.outputs(unit, parameters=parameters) - zero for unit in np.eye(len(origin))]
        return np.column_stack(columns)


def pointer(array: Array) -> Any:
    """Pointer to the numbers of an array for C."""
    return array.ctypes.data_as(_DOUBLE)


def _compiled(machine: Machine, kind: Kind, discrepancies: bool) -> tuple[Equations, CDLL]:
    """The model's equations and its integrator, without numbers."""
    parts = _parts(machine)
    if not machine.learned:
        return _catalogued(*parts, kind, discrepancies)
    equations = _equations(*parts, kind, discrepancies, machine.learned)
    return equations, build(equations)


def _parts(machine: Machine) -> tuple[Structure, tuple[str, ...], frozenset[str]]:
    """What the equations of a machine are made of: its structure, its effects in order, and those of them without their states."""
    return machine.structure, tuple(sorted(machine.effects)), machine.still


def _equations(
    structure: Structure,
    effects: tuple[str, ...],
    still: frozenset[str],
    kind: Kind,
    discrepancies: bool,
    learned: tuple[LearnedTerm, ...] = (),
) -> Equations:
    if kind == "full":
        return full_model(structure, effects, learned, discrepancies, still=still)
    return reduced_model(structure, effects, learned)


def compile_catalogued(machine: Machine, *, sensitive: bool = False) -> None:
    """Compiles the full model of a machine with its effects, alone and side by side, with derivatives if ``sensitive``.

    Raises:
        BuildError: no C compiler.
        ModelError: an effect that this structure cannot have.
    """
    parts = _parts(machine)
    _catalogued(*parts, "full", False)
    if sensitive:
        _catalogued_sensitive(*parts, False, tuple(sorted({*TOLERATED} & {*machine.effects})))
    _catalogued_abreast(*parts, "full", False)


@lru_cache(maxsize=64)
def _catalogued(
    structure: Structure, effects: tuple[str, ...], still: frozenset[str], kind: Kind, discrepancies: bool
) -> tuple[Equations, CDLL]:
    """Cached: writing the source costs as much as a run of a minute."""
    equations = _equations(structure, effects, still, kind, discrepancies)
    return equations, build(_guarded(structure, effects, still, discrepancies) if kind == "full" else equations)


@lru_cache(maxsize=64)
def _catalogued_abreast(
    structure: Structure, effects: tuple[str, ...], still: frozenset[str], kind: Kind, discrepancies: bool
) -> CDLL:
    if kind == "full":
        return build(_guarded(structure, effects, still, discrepancies), LANES)
    return build(_catalogued(structure, effects, still, kind, discrepancies)[0], LANES)


@lru_cache(maxsize=64)
def _catalogued_sensitive(
    structure: Structure, effects: tuple[str, ...], still: frozenset[str], discrepancies: bool, moved: tuple[str, ...]
) -> CDLL:
    return build_sensitive(_guarded(structure, effects, still, discrepancies, moved))


@lru_cache(maxsize=64)
def _guarded(
    structure: Structure,
    effects: tuple[str, ...],
    still: frozenset[str],
    discrepancies: bool,
    but: tuple[str, ...] = (),
) -> Equations:
    return full_model(structure, effects, discrepancies=discrepancies, guarded={*effects} - {*but}, still=still)
