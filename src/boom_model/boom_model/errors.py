"""Errors of the model. Each is one plain line for the user; the commands end with ``exit_status``."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class ModelError(Exception):
    """Base of everything that boom_model raises on purpose."""

    exit_status = 2


class MachineError(ModelError):
    """A machine file is missing a key, has a misspelt key or an impossible value; the message names the key."""


class BuildError(ModelError):
    """The compiled integrator could not be built or loaded (no compiler, no room in the cache folder)."""


class SimulationError(ModelError):
    """A run left the range in which the model is valid.

    Attributes:
        time: when, in seconds of the run.
        state: name of the state that left its range, or None if the step size vanished.
    """

    def __init__(self, message: str, time: float, state: str | None) -> None:
        super().__init__(message)
        self.time = time
        self.state = state


def nearest(name: str, names: Iterable[str]) -> str:
    """The end of a message about an unknown name: the most similar one, or all."""
    known = sorted(names)
    close = difflib.get_close_matches(name, known, 1, 0.5)
    return f"; did you mean {close[0]}?" if close else f"; known: {', '.join(known)}"
