"""The active effects as the equations take them: a quantity goes through the terms of all effects that change it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import SimpleNamespace
from typing import Any, Protocol

import casadi as ca

from boom_model.catalogue import CATALOGUE
from boom_model.catalogue.effect import Effect
from boom_model.regularisation import Expression
from boom_model.state import ELAPSED_TIME, State


class States(Protocol):
    """What adds states to the equations; ``rates``: name of a state -> its derivative."""

    rates: dict[str, Any]

    def add_state(self, state: State) -> Expression:
        """The symbol of the state, which is added if it is not there yet."""


class Own(SimpleNamespace):
    """What a term has for its own: the effect's parameters by name, its states."""

    def __init__(
        self, effect: Effect, numbers: Mapping[str, Expression], states: States | None, stateful: bool = True
    ) -> None:
        super().__init__(**numbers)
        self._effect, self._states, self.stateful = effect, states, stateful

    def time(self) -> Expression:
        """Time since the start of the run [s]; 0 where a component stands alone."""
        if self._states is None:
            return 0.0
        self._states.rates[ELAPSED_TIME.name] = 1.0
        return self._states.add_state(ELAPSED_TIME)

    def state(self, name: str) -> Expression:
        """One of the effect's states; it joins the equations where it is first asked for."""
        assert self._states is not None
        return self._states.add_state(next(state for state in self._effect.states if state.name == name))

    def does_something(self) -> Expression:
        """Whether one of its numbers is not the neutral one."""
        said: Expression = 0.0
        for row in self._effect.parameters:
            said = ca.logic_or(said, getattr(self, row.name) != row.neutral)
        return said

    @property
    def rates(self) -> dict[str, Any]:
        """Name of a state -> its derivative, to be set by the term."""
        assert self._states is not None
        return self._states.rates


class Terms:
    """The active effects of a machine.

    Args:
        values: id of each active effect -> its parameters, numbers or expressions.
        states: where effects put their states. Without it a component stands alone, and effects with states are left out, but for
            those that need no more than the time, which is then 0, and for what is ``stateless`` of others.
        guarded: effects without states that leave each quantity as it is while all their numbers are neutral, instead of by what
            their terms make of it: compiled code need not compute what nothing does. Derivatives by such a number are zero there.
        stateful: with what effects make of states of their own. still: effects that have none, though others of their kind do.
    """

    def __init__(
        self,
        values: Mapping[str, Mapping[str, Expression]],
        states: States | None = None,
        *,
        guarded: Collection[str] = (),
        stateful: bool = True,
        still: Collection[str] = (),
    ) -> None:
        self._values, self._guarded = values, guarded
        self._stateful = states is not None and stateful
        self._active = [
            (effect, Own(effect, values[effect.id], states, self._stateful and effect.id not in still))
            for effect in CATALOGUE
            if effect.id in values and (states is not None or effect.stateless or effect.light)
        ]

    def through(self, quantity: str, value: Expression, **at: Any) -> Expression:
        """The quantity (one of ``effect.QUANTITIES``) with what the active effects make of it, in the order of the catalogue."""
        for effect, own in self._active:
            term = (
                effect.terms.get(quantity) if self._stateful or effect.light or quantity in effect.stateless else None
            )
            if term is not None:
                changed = term(value, own, SimpleNamespace(**at))
                guarded = effect.id in self._guarded and not (effect.states and own.stateful)
                value = ca.if_else(own.does_something(), changed, value) if guarded else changed
        return value

    def numbers(self, effect: str) -> SimpleNamespace:
        """The numbers of an active effect by name."""
        return SimpleNamespace(**self._values[effect])

    def delay(self, of: str) -> float:
        """Dead time [s] of the ``command`` or the ``pressures``."""
        return float(
            sum(getattr(own, effect.parameters[0].name) for effect, own in self._active if effect.delays == of)
        )
