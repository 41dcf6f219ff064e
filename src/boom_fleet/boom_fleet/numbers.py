"""The numbers in which a machine can differ from its file, in units of their priors: what the screen takes derivatives of.

Numbers with a tolerance come first: z is standard normal (``boom_model.prior``). Then the leading number of each effect of the
catalogue that the watch knows too, in units of half of its plausible range, zero where the effect is absent. What is far from
linear in its numbers, as an accumulator is that runs empty elsewhere with less gas, has a difference to each point of its own
(``Effect.points``, or ``starts`` of its leading number).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from boom_estimation.unknown import Unknown
from boom_model.catalogue import EFFECTS, SUBSYSTEM_NAMES, effect_name
from boom_model.machine import Machine, Pose
from boom_model.plant import Plant
from boom_model.prior import LINKAGE, prior_of
from boom_monitor.model import suspects, switched_on

Array = NDArray[np.float64]

FRICTION = "friction"
_CERTAIN = ("constants.", "cylinder.l_", "hose_burst_valve.unit_")
"""Physics, the mechanical stops and units. All else with a tolerance is of another crane of the same make another number: a number
that is missing here is seen as an effect of the catalogue that it resembles."""
_FOLLOWS = ("pilot_valves.b0_s", "main_valve_spool.A_s", "main_valve_spool.s_max", "main_valve_orifices.A_ta_law.c1")
"""Numbers that only repeat what others say: gain of the pilot stage, units of the spool, second coefficient of an area."""
_WORK = "load"
"""Subsystem that belongs to the work and not to the machine."""
_OWN = "pose.load"
BEYOND = 1.3
"""How far beyond a point of an effect the difference to it is still taken for what it does."""


@dataclass(frozen=True)
class TrackedQuantity:
    """What may change in a machine: a direction in the space of its numbers.

    Attributes:
        name: of the effect, or of a group of numbers of the file.
        part: which of several numbers of the effect, else empty.
        subsystem: id.
        unit: of its size. scale: size of one unit of z [unit]. neutral: value of the size at z = 0.
        direction: (name, share) of the numbers that it moves.
        low, high: plausible range of z.
        sound: standard deviation, in z, of what a sound machine has of it by the catalogue: a sensor's accuracy, a made part's.
    """

    name: str
    part: str
    subsystem: str
    unit: str
    scale: float
    neutral: float
    direction: tuple[tuple[str, float], ...]
    low: float
    high: float
    sound: float = 0.0

    @property
    def id(self) -> str:
        """In the table."""
        return f"{self.name}.{self.part}" if self.part else self.name

    @property
    def words(self) -> str:
        """For people."""
        where = SUBSYSTEM_NAMES.get(self.subsystem, self.subsystem)
        said = effect_name(self.name) + (f" ({self.part})" if self.part else "")
        return f"{said}, {where}" if where not in said else said

    def size(self, z: float) -> float:
        """The size [unit] at z."""
        return self.neutral + self.scale * z


@dataclass(frozen=True)
class FarPoint:
    """A point of an effect far from nothing: its name, the values of all numbers of the effect there, and its z."""

    name: str
    values: Mapping[str, float]
    z: float


@dataclass(frozen=True)
class Numbers:
    """All numbers of a machine in a pose.

    Attributes:
        machine: with the effects of the catalogue as good as absent, as the screen runs it.
        unknowns: tolerated ones first.
        far: points that have a difference of their own, behind them.
        tolerated: how many of them have a tolerance.
        own: (k,) whether a number belongs to a recording (pose, load) and not to the machine.
        quantities: what a finding is called by.
    """

    machine: Machine
    unknowns: tuple[Unknown, ...]
    far: tuple[FarPoint, ...]
    tolerated: int
    own: NDArray[np.bool_]
    quantities: tuple[TrackedQuantity, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the unknowns and the points."""
        return (*(u.name for u in self.unknowns), *(point.name for point in self.far))


def numbers_of(machine: Machine, pose: Pose, plant: Plant) -> Numbers:
    """The numbers of a machine; ``plant``: of the machine with :func:`present`."""
    unknowns = [*_tolerated(machine, pose, plant.parameter_names)]
    tolerated = len(unknowns)
    quantities = [_friction(unknowns)] if "friction.tau_C_pos" in (u.name for u in unknowns) else []
    index = {name: k for k, name in enumerate(plant.parameter_names)}
    possible = [s for s in suspects(machine, index) if s.subsystem != _WORK]
    parts = [s.effect for s in possible]
    for s in possible:
        name = f"effects.{s.effect}.{s.parameter}"
        at = float(plant.p[index[name]])
        row = next(row for row in EFFECTS[s.effect].parameters if row.name == s.parameter)
        unknowns.append(Unknown(name, s.unit, at, s.scale, row.minimum, row.maximum))
        part = s.parameter if parts.count(s.effect) > 1 else ""
        quantities.append(
            TrackedQuantity(
                s.effect,
                part,
                s.subsystem,
                s.unit,
                s.scale,
                row.neutral,
                ((name, 1.0),),
                s.low,
                s.high,
                sound=row.accuracy / 2.0 / s.scale,
            )
        )
    far = [_far(quantity, point) for quantity in quantities for point in _points(quantity)]
    quantities += [quantity for _, quantity in far]
    own = np.array([u.name == _OWN for u in unknowns] + [False] * len(far))
    return Numbers(
        present(machine), tuple(unknowns), tuple(point for point, _ in far), tolerated, own, tuple(quantities)
    )


def _points(quantity: TrackedQuantity) -> tuple[Mapping[str, float], ...]:
    """Values of an effect's numbers far from nothing, where a search tries it and the derivative at nothing says little.

    Of a single number the starts that are more than half of its plausible range away.
    """
    effect = EFFECTS.get(quantity.name)
    if effect is None or effect.reach:
        return ()
    if effect.points:
        names = [row.name for row in effect.parameters]
        return tuple(dict(zip(names, point, strict=True)) for point in effect.points)
    row = effect.parameters[0]
    return tuple({row.name: start} for start in row.starts if abs(start - row.neutral) > quantity.scale)


def _far(quantity: TrackedQuantity, point: Mapping[str, float]) -> tuple[FarPoint, TrackedQuantity]:
    """A point of an effect, and how far a machine may have gone towards it; its size is that of the first number that moves."""
    effect = EFFECTS[quantity.name]
    neutral = {row.name: row.neutral for row in effect.parameters}
    values = {name: value for name, value in point.items() if value != neutral[name]}
    part = "towards " + ", ".join(f"{name} = {value:.2g}" for name, value in values.items())
    z = (next(iter(values.values())) - quantity.neutral) / quantity.scale
    name = f"effects.{effect.id}.{part}"
    dotted = {f"effects.{effect.id}.{name}": value for name, value in point.items()}
    low, high = sorted((0.0, BEYOND * z))
    there = replace(quantity, part=part, direction=((name, 1.0),), low=low, high=high)
    return FarPoint(name, dotted, z), there


def present(machine: Machine) -> Machine:
    """The machine with the watched effects of the catalogue as good as absent, beside its own."""
    own = {name: dict(values) for name, values in machine.effects.items()}
    watched = {name: values for name, values in switched_on(machine).items() if EFFECTS[name].subsystem != _WORK}
    return replace(machine, effects={**watched, **own})


def _tolerated(machine: Machine, pose: Pose, known: Sequence[str]) -> list[Unknown]:
    rows = []
    for key, parameter in machine.parameters.items():
        if not key.startswith(_CERTAIN) or key.startswith(LINKAGE):
            rows += list(zip(parameter.specification.components, parameter.value, strict=True))
    rows += [
        (name, value) for name, value in pose.values().items() if name in ("pose.D0", "pose.Sx", "pose.Sy", "pose.load")
    ]
    result = []
    for name, value in rows:
        prior = prior_of(machine, name, pose)
        if name in known and name not in _FOLLOWS and prior.sigma > 0.0:
            positive = prior.kind == "log_normal" or (prior.low >= 0.0 and value > 0.0)
            sigma = prior.sigma if prior.kind == "log_normal" or not positive else prior.sigma / abs(value)
            result.append(Unknown(name, "", value, sigma, prior.low, prior.high, positive and value > 0.0))
    return result


def _friction(unknowns: Sequence[Unknown]) -> TrackedQuantity:
    """Coulomb friction in both directions: a factor."""
    both = [u for u in unknowns if u.name in ("friction.tau_C_pos", "friction.tau_C_neg")]
    return TrackedQuantity(
        FRICTION, "", "friction", "-", 0.5, 1.0, tuple((u.name, 0.5 / u.sigma) for u in both), -1.5, 6.0
    )  # fmt: skip
