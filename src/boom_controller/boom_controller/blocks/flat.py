"""Control laws as one function of flat numbers: every cycle is one call, however complex the law.

    (x, u, s) -> (x', y)

x: the law's states; u: reference and measurement; s: settings; y: currents and inner quantities. The parts of a law
(observers, feedback, valve) are written as expressions, like the components of ``boom_model``, joined here, and compiled for the
machine and its pose: one or two seconds the first time, nothing later. Between two cycles of 10 ms the processor's caches
lose their content, so a cycle should touch little code and data.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from math import nan
from struct import Struct
from types import SimpleNamespace
from typing import Any

import casadi as ca

from boom_controller.blocks.buffers import compiled_on_buffers
from boom_controller.settings import LawSettings
from boom_controller.types import Measurement, Reference

_MEASURED = Measurement._fields[1:]  # all but the time
_INPUTS = Struct(f"{len(Reference._fields) + len(_MEASURED)}d")

LARGEST = 1e100
"""Limit of the sum of all states and outputs, far beyond any of them."""

Build = Callable[[Any, Reference, Measurement, Any], tuple[Any, Sequence[Any]]]
"""(states, reference, measurement without its time, settings) -> (states one sample time later, outputs), all expressions.

The first two outputs are the currents."""


class FlatLaw:
    """A law's function with its buffers.

    Args:
        name: name of the function.
        states: the states, a NamedTuple of numbers, or of such NamedTuples: the shape counts.
        build: builds the expressions.
        kind: the law's settings; only its fields are known to ``build``.
        settings: the sample time is built in, all others can change.
        further: names and values of quantities derived from the settings outside the function.

    Attributes:
        outputs: result of the last step; both currents are NaN if a state or an output is not finite.
    """

    def __init__(
        self,
        name: str,
        states: Any,
        build: Build,
        kind: type[LawSettings],
        settings: LawSettings,
        further: dict[str, float] | None = None,
    ) -> None:
        self._shape = states
        self._tunable = tuple(entry.name for entry in fields(kind) if entry.name != "sample_time")
        self._x = array("d", leaves(states))
        self._next = array("d", self._x)
        self._u = array("d", bytes(_INPUTS.size))
        self._s = array("d", self._numbers(settings, further))
        x, u, s = (ca.SX.sym(k, len(part)) for k, part in (("x", self._x), ("u", self._u), ("s", self._s)))
        given: Any = ca.vertsplit(u)
        known = dict(zip((*self._tunable, *(further or ())), ca.vertsplit(s), strict=True))
        after, results = build(
            nested(states, iter(ca.vertsplit(x))),
            Reference(*given[: len(Reference._fields)]),
            Measurement(nan, *given[len(Reference._fields) :]),  # no law may use the time
            SimpleNamespace(sample_time=settings.sample_time, **known),
        )
        later, every = leaves(after), leaves(tuple(results))
        # whatever is no number any more, the currents say so
        sound = sum(ca.fabs(value) for value in (*later, *every)) < LARGEST
        every[:2] = (ca.if_else(sound, current, nan) for current in every[:2])
        self.outputs = array("d", bytes(8 * len(every)))
        function = ca.Function(name, [x, u, s], ca.cse([ca.vertcat(*later), ca.vertcat(*every)]))
        self._evaluate = compiled_on_buffers(function, (self._x, self._u, self._s), (self._next, self.outputs))

    @property
    def states(self) -> Any:
        """The present states, in the given shape."""
        return nested(self._shape, iter(self._x))

    def start(self, states: Any) -> None:
        """Set the states."""
        self._x[:] = array("d", leaves(states))

    def change(self, settings: LawSettings, further: dict[str, float] | None = None) -> None:
        """Use other settings from the next step on; the states stay."""
        self._s[:] = array("d", self._numbers(settings, further))

    def step(self, reference: Reference, measurement: Measurement) -> array[float]:
        """Advance by one sample time; returns ``outputs``, which the next step overwrites."""
        _INPUTS.pack_into(self._u, 0, *reference, *measurement[1:])
        self._evaluate()
        self._x[:] = self._next
        return self.outputs

    def _numbers(self, settings: LawSettings, further: dict[str, float] | None) -> list[float]:
        return [getattr(settings, name) for name in self._tunable] + list((further or {}).values())


def leaves(value: Any) -> list[Any]:
    """The numbers or expressions of nested tuples, in order."""
    if isinstance(value, tuple):
        return [leaf for part in value for leaf in leaves(part)]
    return [value]


def nested(shape: Any, values: Iterator[Any]) -> Any:
    """The inverse of :func:`leaves`: as many values as it takes, in nested tuples and NamedTuples like ``shape``."""
    if isinstance(shape, tuple):
        make = getattr(type(shape), "_make", tuple)
        return make([nested(part, values) for part in shape])
    return next(values)
