"""The changes made by a concealed effect, and the register of all effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from concealed_plant.plant import Courses
from concealed_plant.quantities import Quantities

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """The undisturbed recording into which an effect is put.

    Attributes:
        m: the specimen's numbers.
        duration: [s].
        low, high: range of the boom angles [rad].
        starts: times [s] at which a motion begins.
        peak: largest flow from the pump to the head side [m^3/s].
        limited_drop: mean difference over the hose burst valve while it limits [Pa], or that of its knee if it never does.
    """

    m: Quantities
    duration: float
    low: float
    high: float
    starts: Array
    peak: float
    limited_drop: float

    @property
    def milliseconds(self) -> Array:
        """Time [s] of each millisecond."""
        return np.arange(round(self.duration * 1000)) / 1000.0

    def between(self, share: float) -> float:
        """An angle inside the visited range [rad]: 0 its lower, 1 its upper end."""
        return self.low + share * (self.high - self.low)


@dataclass(frozen=True)
class Sensing:
    """Sensor properties besides noise, neutral by default. SI."""

    angle_offset: float = 0.0
    angle_skew: float = 0.0
    rate_gain: float = 1.0
    rate_lag: float = 0.0
    hose_bias: float = 0.0
    rod_bias: float = 0.0
    bias_drift: float = 0.0
    pressure_dead_time: float = 0.0
    pressure_lag: float = 0.0


@dataclass(frozen=True)
class Hidden:
    """An effect at a size.

    Attributes:
        changes: names of ``Quantities`` -> new value.
        courses, sensing: changes over time, and in the sensors.
        late: (k,) dead time of each current [ms].
        parameters: numbers for an engineer that mean the same in any functional form: name -> value.
        onset: when it begins [s], None: it acts throughout.
    """

    changes: Mapping[str, float] = field(default_factory=dict)
    courses: Courses = field(default_factory=Courses)
    sensing: Sensing = field(default_factory=Sensing)
    late: Array | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    onset: float | None = None


Builder = Callable[[float, Array, Scene], Hidden]
"""(size, five draws from 0..1, scene) -> concealed effect. The draws give shape and sign, the size the strength."""


@dataclass(frozen=True)
class Concealment:
    """One row of the register.

    Attributes:
        id: of the catalogue, or another name if ``known`` is false.
        subsystems: rightful subsystems, the best one first.
        unit: of the size.
        smallest, largest: sizes that still are this effect and not a broken crane.
        form: difference from the form in a catalogue, for the documentation.
        build: builds the effect.
        known: whether it is in the catalogue.
        manner: kind of work that shows it ("" any, see ``operator``).
        twins: numbers of the machine that it is, once they are out of tolerance.
        tolerance: size at which these leave their tolerance, 0 without them.
        stretched: only a crane with its outer boom stretched out shows it.
        met: quantity, neutral at 1, of which the operator of the first recording meets half already, because every motion shows it.
    """

    id: str
    subsystems: tuple[str, ...]
    unit: str
    smallest: float
    largest: float
    form: str
    build: Builder
    known: bool = True
    manner: str = ""
    twins: tuple[str, ...] = ()
    tolerance: float = 0.0
    stretched: bool = False
    met: str = ""


REGISTER: dict[str, Concealment] = {}


def conceals(
    name: str, subsystems: str, unit: str, sizes: tuple[float, float], form: str, **further: Any
) -> Callable[[Builder], Builder]:
    """Registers a builder; ``subsystems`` separated by blanks, ``further``: of :class:`Concealment`, by name."""

    def register(build: Builder) -> Builder:
        REGISTER[name] = Concealment(name, tuple(subsystems.split()), unit, *sizes, form, build, **further)
        return build

    return register


def sign(draw: float) -> float:
    """-1 or 1 with equal chance."""
    return 1.0 if draw < 0.5 else -1.0


def within(draw: float, low: float, high: float) -> float:
    """A draw from 0..1 stretched to low..high."""
    return low + draw * (high - low)
