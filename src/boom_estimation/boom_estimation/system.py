"""What the estimation needs to know of a machine: states, outputs, numbers, and places where something may be missing.

    x' = f(x, u, p) + B d,   T d_k' = -d_k + noise of the stationary deviation s_k,   y = h(x, p) + noise

x includes the discrepancies d. Whatever can say this can be estimated and diagnosed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Values = Mapping[str, float]
"""Name of a number -> value, where it differs from the machine's own."""


@dataclass(frozen=True)
class Pass:
    """One pass of an observer over an experiment.

    Attributes:
        states: (n, NX) at the beginning of each interval. innovations: (n, NY), 0 where nothing was measured.
        valid: (n, NY) whether it was. share: (n, NY) when in the interval.
        complete: False if the model could not be run to the end.
        beside: (n, NY) by how much the innovations would differ with no change of the states; None for not at all.
    """

    states: Array
    innovations: Array
    valid: Flags
    share: Array
    complete: bool
    beside: Array | None = None


@dataclass(frozen=True)
class Tangent:
    """A model linearised at the beginning of each interval of a pass: good enough for gains and for how noise enters.

    Attributes:
        jacobian: (n, NX, NX) dx'/dx.
        held: (n, NX, r) change of x' by noise that is constant in an interval, one standard deviation each.
        density: (n, NX) intensity squared of white noise on x' [unit^2/s].
        output: (NY, NX) dy/dx.
    """

    jacobian: Array
    held: Array
    density: Array
    output: Array


@dataclass(frozen=True)
class Columns:
    """What c numbers change, per unit of their inner coordinates.

    Attributes:
        ends: (n, NX, c) of the state at the end of each interval, beyond what the state at its beginning does.
        outputs: (n, NY, c) of y, beyond what the states do.
        begin: (NX, c) of the first state.
    """

    ends: Array
    outputs: Array
    begin: Array

    @classmethod
    def none(cls, states: int, outputs: int, intervals: int) -> Columns:
        """No numbers."""
        return cls(np.zeros((intervals, states, 0)), np.zeros((intervals, outputs, 0)), np.zeros((states, 0)))

    @classmethod
    def joined(cls, first: Columns, second: Columns) -> Columns:
        """Those of both, one behind the other."""
        pairs = ((first.ends, second.ends), (first.outputs, second.outputs), (first.begin, second.begin))
        return cls(*(np.concatenate(pair, axis=-1) for pair in pairs))

    def chosen(self, which: Sequence[int]) -> Columns:
        """Those with these indices, in their order."""
        chosen = list(which)
        return Columns(self.ends[..., chosen], self.outputs[..., chosen], self.begin[..., chosen])


class Model(Protocol):
    """One experiment with the equations of one set of effects.

    Attributes:
        name: of the experiment. interval: [s]. state_names: (NX,).
        counted: (n,) intervals whose innovations tell about the machine.
        places: where something may be missing; discrepancies: (q,) index of the state of each. memory: T [s].
        variance: (NY,) of the sensors' noise. spread: (NX,) standard deviation of the initial state.
    """

    name: str
    interval: float
    state_names: tuple[str, ...]
    counted: Flags
    places: tuple[str, ...]
    discrepancies: NDArray[np.int64]
    memory: float
    variance: Array
    spread: Array

    def first_gain(self) -> Array:
        """(n, NX, NY) a gain with which any machine of this kind is followed."""

    def observe(self, values: Values, gain: Array, *, coarse: bool = False) -> Pass:
        """A pass with these numbers."""

    def beside(self, values: Values, others: Sequence[Values], gain: Array) -> list[tuple[Pass, Pass]]:
        """For each of ``others`` a pass with ``values`` and one with it, so alike that their difference is a good derivative."""

    def tangent(self, values: Values, along: Pass) -> Tangent:
        """The equations linearised along a pass."""

    def transitions(self, values: Values, along: Pass) -> Array:
        """(n, NX, NX) what the beginning of each interval of a pass changes at its end."""


class System(Protocol):
    """A machine and its experiments.

    Attributes:
        places: as in :class:`Model`.
        experiments: names.
    """

    places: tuple[str, ...]
    experiments: tuple[str, ...]

    def models(self, effects: Sequence[str]) -> Sequence[Model]:
        """The model of every experiment with these effects."""
