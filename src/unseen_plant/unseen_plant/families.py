"""What a concealed effect changes, and the register of families: each an effect with several functional forms to draw from."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unseen_plant.layout import STEP, WIDTH, CraneNumbers

Array = NDArray[np.float64]
Change = Callable[[Array], Array]


@dataclass(frozen=True)
class Site:
    """The crane and the undisturbed recording into which an effect is laid.

    Attributes:
        c: numbers of the crane.
        duration: of the recording [s].
        low, high: range of the boom angle [rad].
        pressure: quantiles 0.1, 0.5, 0.9 of the hose pressure [Pa].
        torque: mean torque of the cylinder [N m].
        peak: largest flow of the supply [m^3/s].
        late: draws in 0..1 for what happens at some time; another recording of the same crane has its own.
        noise: seed of courses that are random.
    """

    c: CraneNumbers
    duration: float
    low: float
    high: float
    pressure: tuple[float, float, float]
    torque: float
    peak: float
    late: Array
    noise: int

    @property
    def time(self) -> Array:
        """Time at the start of each step of the grid [s]."""
        return np.arange(round(self.duration / STEP), dtype=np.float64) * STEP

    def angle(self, share: float) -> float:
        """An angle [rad]: 0 the lowest visited, 1 the highest."""
        return self.low + share * (self.high - self.low)

    def wander(self, correlation: float) -> Array:
        """A random course of unit variance with a correlation time [s]."""
        rng, pole = np.random.default_rng(self.noise), np.exp(-STEP / correlation)
        kicks = rng.standard_normal(len(self.time)) * np.sqrt(1.0 - pole**2)
        course = np.empty(len(kicks))
        value = float(rng.standard_normal())
        for k, kick in enumerate(kicks):
            value = pole * value + kick
            course[k] = value
        return course

    def switching(self, mean: float) -> Array:
        """A course that switches between 0 and 1, each for some ``mean`` [s]."""
        rng, course, at, on = np.random.default_rng(self.noise), np.zeros(len(self.time)), 0.0, False
        while at < self.duration:
            lasting = float(rng.uniform(0.5, 1.5)) * mean
            course[round(at / STEP) : round((at + lasting) / STEP)] = float(on)
            at, on = at + lasting, not on
        return course


@dataclass(frozen=True)
class Laid:
    """An effect of one size and form.

    Attributes:
        crane: fields of ``CraneNumbers`` -> new value.
        rows: row of e -> form, size and shape numbers.
        courses: column of u -> course on the grid.
        moving: states that move for it.
        starts: their values at rest.
        currents: what becomes of the currents (n, 2) on their way to the valve.
        senses: what becomes of angle, rate, hose and rod pressure (n, 4) on their way to the recorder.
        parameters: numbers with the meaning that an engineer gives them.
        onset: when it begins [s]; None: it acts throughout.
    """

    crane: Mapping[str, float] = field(default_factory=dict)
    rows: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    courses: Mapping[int, Array] = field(default_factory=dict)
    moving: tuple[int, ...] = ()
    starts: Mapping[int, float] = field(default_factory=dict)
    currents: tuple[Change, ...] = ()
    senses: tuple[Change, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    onset: float | None = None

    def __post_init__(self) -> None:
        if any(len(row) > WIDTH for row in self.rows.values()):
            raise ValueError("a form has more shape numbers than there is room for")


Layer = Callable[[float, int, Array, Site], Laid]
"""(size, form from 1, eight draws in 0..1, site) -> what it changes."""


@dataclass(frozen=True)
class Family:
    """An effect with its forms.

    Attributes:
        name: id of the contract, or a name of its own if not ``known``.
        subsystems: where it is rightly placed, the best first.
        equation: of the thesis, that it changes.
        unit, low, high: of the size: largest and smallest that still is this effect.
        forms: what distinguishes each form, in words.
        lay: makes it.
        known: whether the contract's list has it.
        needs: fields of ``CraneNumbers`` that tell the structure it presumes.
        stretched: it takes a crane stretched out.
        style: kind of work that shows it, "" any.
        twins: numbers of the machine that it is, once they are off by more than their tolerance: they are not off by themselves.
        coupled: it has an equation of motion of its own; two of these are not concealed together.
    """

    name: str
    subsystems: tuple[str, ...]
    equation: str
    unit: str
    low: float
    high: float
    forms: tuple[str, ...]
    lay: Layer
    known: bool = True
    needs: tuple[str, ...] = ()
    stretched: bool = False
    style: str = ""
    twins: tuple[str, ...] = ()
    coupled: bool = False


FAMILIES: dict[str, Family] = {}


def family(
    name: str, subsystems: str, equation: str, unit: str, sizes: tuple[float, float], forms: str, **further: Any
) -> Callable[[Layer], Layer]:
    """Registers a family; ``subsystems`` separated by blanks, ``forms`` by semicolons."""

    def register(lay: Layer) -> Layer:
        told = tuple(form.strip() for form in forms.split(";"))
        FAMILIES[name] = Family(name, tuple(subsystems.split()), equation, unit, *sizes, told, lay, **further)
        return lay

    return register


def among(draw: float, low: float, high: float) -> float:
    """A draw from 0..1 stretched to low..high."""
    return low + draw * (high - low)


def decades(draw: float, low: float, high: float) -> float:
    """The same on a logarithmic scale."""
    return float(low * (high / low) ** draw)


def side(draw: float) -> float:
    """-1 or 1."""
    return 1.0 if draw < 0.5 else -1.0


def whole(draw: float, count: int) -> int:
    """A number 1..count."""
    return min(int(draw * count), count - 1) + 1


def known() -> tuple[str, ...]:
    """Ids of the contract's list."""
    return tuple(name for name, row in FAMILIES.items() if row.known)


def outside() -> tuple[str, ...]:
    """Names of what the contract's list has not."""
    return tuple(name for name, row in FAMILIES.items() if not row.known)


def gather() -> None:
    """Fill the register from every module ``family_*`` of the package."""
    for module in sorted(m.name for m in pkgutil.iter_modules([str(Path(__file__).parent)])):
        if module.startswith("family_"):
            importlib.import_module(f"unseen_plant.{module}")
