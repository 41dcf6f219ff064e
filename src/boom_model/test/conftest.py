"""Machines, plants and inputs that several tests of the model share."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import pytest
import yaml

from boom_model.catalogue import CATALOGUE, Effect, check_effects
from boom_model.catalogue.terms import Terms
from boom_model.equations import namespace
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_model.state import State


@pytest.fixture(scope="session")
def tz17() -> Machine:
    return load_machine("tz17")


@pytest.fixture(scope="session")
def other_make() -> Machine:
    return load_machine("triangle_direct")


@pytest.fixture(scope="session")
def loader() -> Machine:
    return load_machine("loader_crane")


@pytest.fixture
def document() -> dict[str, Any]:
    """The text of tz17 as a document that a test may spoil."""
    text = (resources.files("boom_model") / "machines" / "tz17.yaml").read_text(encoding="utf-8")
    loaded: dict[str, Any] = yaml.safe_load(text)
    return copy.deepcopy(loaded)


@pytest.fixture(scope="session")
def p(tz17: Machine) -> Any:
    """Parameters of tz17, folded, as nested namespaces of floats."""
    return namespace(tz17.values(tz17.pose(4.59, 0.0)))


class HeldStates:
    """Numbers for the states of effects: what a term makes of them is in ``rates``."""

    def __init__(self, **numbers: float) -> None:
        self.numbers, self.rates = numbers, dict[str, Any]()

    def add_state(self, state: State) -> float:
        return self.numbers[state.name]


@pytest.fixture(scope="session")
def effects() -> Callable[..., Terms]:
    """Terms of the active effects: effects(piston_leakage={"c": 1e-12}), others of their numbers neutral."""

    def make(states: HeldStates | None = None, **given: dict[str, float]) -> Terms:
        return Terms(check_effects(given), states)

    return make


@pytest.fixture(scope="session")
def possible(tz17: Machine) -> list[Effect]:
    """The effects that tz17 can have."""
    return [effect for effect in CATALOGUE if tz17.structure.has(effect.needs)]


@pytest.fixture(scope="session")
def held() -> type[HeldStates]:
    return HeldStates


@pytest.fixture(scope="session")
def folded(tz17: Machine) -> Plant:
    return Plant(tz17, tz17.pose(4.59, 0.0))


@pytest.fixture(scope="session")
def joystick() -> Callable[..., tuple[Any, Any]]:
    """Times (n,) and currents (n, 2) at 100 Hz as from an operator: rests, creeping, ramps, full strokes."""

    @cache
    def make(seconds: float, seed: int = 0) -> tuple[Any, Any]:
        rng = np.random.default_rng(seed)
        time = np.arange(round(seconds * 100)) * 0.01
        command = np.zeros(len(time))
        begin, direction = 100, -1.0
        while begin < len(time):
            length = int(rng.integers(60, 260))
            level = rng.uniform(0.31, 0.55)
            up, down = rng.integers(1, 60), rng.integers(20, 60)
            k = np.arange(length)
            shape = np.clip(np.minimum((k + 1) / up, (length - k) / down), 0.0, 1.0)
            end = min(begin + length, len(time))
            command[begin:end] = (direction * level * shape)[: end - begin]
            begin, direction = end + int(rng.integers(20, 150)), -direction
        return time, np.column_stack((np.maximum(command, 0.0), np.maximum(-command, 0.0)))

    return make
