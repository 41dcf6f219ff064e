"""The numbers in which a machine can differ from its file, in units of their priors: what the screen takes derivatives of.

Numbers with a tolerance come first: z is standard normal (``boom_model.prior``). Then the leading number of each effect of the
catalogue that the watch knows too, in units of half of its plausible range, zero where the effect is absent. What is far from
linear in its numbers, as an accumulator is that runs empty elsewhere with less gas, has a difference to each point of its own
(``Effect.points``, or ``starts`` of its leading number). Points at which the same numbers are another than at nothing are of one
quantity, and so is the derivative of the leading number where it alone is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log1p, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_estimation.unknown import Unknown
from boom_fleet.habits import UNKNOWN
from boom_model.catalogue import EFFECTS, SUBSYSTEM_NAMES, accumulator_precharge, effect_name
from boom_model.catalogue.effect import EffectParameter
from boom_model.machine import Machine, Pose
from boom_model.plant import Plant
from boom_model.prior import LINKAGE, prior_of
from boom_monitor.model import Suspect, suspects, switched_on

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
_GAS = accumulator_precharge.EFFECT
BEYOND = 1.3
"""How far beyond a point of an effect the difference to it is still taken for what it does."""


@dataclass(frozen=True)
class QuantityColumn:
    """How a quantity moves the numbers where its level is ``node`` [z].

    Attributes:
        direction: (name, share) of the numbers that it moves.
        low, high: range of z in which it is taken for that.
    """

    direction: tuple[tuple[str, float], ...]
    low: float
    high: float
    node: float

    @property
    def id(self) -> str:
        """The names."""
        return ", ".join(name for name, _ in self.direction)


@dataclass(frozen=True)
class TrackedQuantity:
    """What may change in a machine: a path through the space of its numbers (``boom_fleet.paths``).

    Attributes:
        name: of the effect, or of a group of numbers of the file.
        part: which of several numbers of the effect, else empty. Of several the size is that of the first.
        subsystem: id.
        unit: of its size. scale: size of one unit of z [unit]. neutral: value of the size at z = 0.
        columns: in the order of their nodes.
        sound: standard deviation, in z, of what a sound machine has of it by the catalogue: a sensor's accuracy, a made part's.
    """

    name: str
    part: str
    subsystem: str
    unit: str
    scale: float
    neutral: float
    columns: tuple[QuantityColumn, ...]
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
    """A point of an effect far from nothing: its name, the values of all its numbers there, its z, and which of them have moved."""

    name: str
    values: Mapping[str, float]
    z: float
    moved: tuple[str, ...]


@dataclass(frozen=True)
class Numbers:
    """All numbers of a machine in a pose.

    Attributes:
        machine: with the effects of the catalogue as good as absent, as the screen runs it.
        unknowns: tolerated ones first.
        far: points that have a difference of their own, behind them.
        tolerated: how many of them have a tolerance.
        own: (k,) whether a number belongs to a recording (pose, load) and not to the machine.
        steps: of the differences by the unknowns, in z.
        quantities: what a finding is called by.
    """

    machine: Machine
    unknowns: tuple[Unknown, ...]
    far: tuple[FarPoint, ...]
    tolerated: int
    own: NDArray[np.bool_]
    steps: Array
    quantities: tuple[TrackedQuantity, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the unknowns and the points."""
        return (*(u.name for u in self.unknowns), *(point.name for point in self.far))


def numbers_of(machine: Machine, pose: Pose, plant: Plant) -> Numbers:
    """The numbers of a machine; ``plant``: of the machine with :func:`present`."""
    unknowns = [*_tolerated(machine, pose, plant.parameter_names)]
    tolerated = len(unknowns)
    index = {name: k for k, name in enumerate(plant.parameter_names)}
    possible = [s for s in suspects(machine, index) if s.subsystem != _WORK]
    for s in possible:
        row, name = _row(s), f"effects.{s.effect}.{s.parameter}"
        unknowns.append(Unknown(name, s.unit, float(plant.p[index[name]]), s.scale, row.minimum, row.maximum))
    steps = _steps(unknowns)
    parts = [s.effect for s in possible]
    near = [
        _near(s, s.parameter if parts.count(s.effect) > 1 else "", step)
        for s, step in zip(possible, steps[tolerated:], strict=True)
    ]
    if "friction.tau_C_pos" in (u.name for u in unknowns):
        near = [_friction(unknowns), *near]
    far = [[_far(quantity, values) for values in _points(quantity)] for quantity in near]
    points = tuple(point for own in far for point in own)
    quantities = tuple(q for quantity, own in zip(near, far, strict=True) for q in _paths(quantity, own))
    own = np.array([u.name == _OWN for u in unknowns] + [False] * len(points))
    return Numbers(present(machine), tuple(unknowns), points, tolerated, own, steps, quantities)


def _row(suspect: Suspect) -> EffectParameter:
    return next(row for row in EFFECTS[suspect.effect].parameters if row.name == suspect.parameter)


def _steps(unknowns: Sequence[Unknown]) -> Array:
    """(k,) steps of the differences. Across a corner they reach as far as a healthy machine may be elsewhere, ``form``.

    The derivative beside the corner would be that of a few samples: with less gas an accumulator runs empty elsewhere.
    """
    scale = next((u.sigma for u in unknowns if u.name.startswith(f"effects.{_GAS.id}.")), None)
    steps = []
    for u in unknowns:
        words = u.name.split(".")
        step = max(u.step, EFFECTS[words[1]].reach) if words[0] == "effects" else u.step
        if scale is not None and words[1] == _GAS.id:
            step = -UNKNOWN[0]
        elif scale is not None and u.name in _GAS.changes:
            step = log1p(-UNKNOWN[0] * scale) / u.sigma
        steps.append(step)
    return np.array(steps)


def _near(suspect: Suspect, part: str, step: float) -> TrackedQuantity:
    """A number of an effect, by what it does beside nothing."""
    row, name = _row(suspect), f"effects.{suspect.effect}.{suspect.parameter}"
    column = QuantityColumn(((name, 1.0),), suspect.low, suspect.high, float(step))
    return TrackedQuantity(
        suspect.effect, part, suspect.subsystem, suspect.unit, suspect.scale, row.neutral, (column,),
        row.accuracy / 2.0 / suspect.scale,
    )  # fmt: skip


def _points(quantity: TrackedQuantity) -> tuple[Mapping[str, float], ...]:
    """Values of an effect's numbers far from nothing, where a search tries it and the derivative at nothing says little.

    Of a single number the starts that are more than half of its plausible range away. Before what is more than a quarter away
    stands one half way to it.
    """
    effect = EFFECTS.get(quantity.name)
    if effect is None or effect.reach:
        return ()
    row, names = effect.parameters[0], [row.name for row in effect.parameters]
    starts = [{row.name: start} for start in row.starts if abs(start - row.neutral) > quantity.scale]
    points = [dict(zip(names, point, strict=True)) for point in effect.points] or starts
    far = [_far(quantity, point) for point in points]
    result = list[Mapping[str, float]]()
    for point, own in zip(points, far, strict=True):
        nearest = min(abs(other.z) for other in far if other.moved == own.moved and other.z * own.z > 0.0)
        result += [_half(quantity, point), point] if abs(own.z) == nearest >= 0.5 else [point]
    return tuple(result)


def _half(quantity: TrackedQuantity, point: Mapping[str, float]) -> dict[str, float]:
    """Half way from nothing: of a factor in its logarithm."""
    neutral = {row.name: row.neutral for row in EFFECTS[quantity.name].parameters}
    return {n: sqrt(v * neutral[n]) if neutral[n] > 0.0 else 0.5 * (neutral[n] + v) for n, v in point.items()}


def _far(quantity: TrackedQuantity, point: Mapping[str, float]) -> FarPoint:
    """A point of an effect; its size is that of the first number that moves."""
    effect = EFFECTS[quantity.name]
    neutral = {row.name: row.neutral for row in effect.parameters}
    values = {name: value for name, value in point.items() if value != neutral[name]}
    z = (next(iter(values.values())) - quantity.neutral) / quantity.scale
    part = "towards " + ", ".join(f"{name} = {value:.2g}" for name, value in values.items())
    dotted = {f"effects.{effect.id}.{name}": value for name, value in point.items()}
    return FarPoint(f"effects.{effect.id}.{part}", dotted, z, tuple(values))


def _paths(quantity: TrackedQuantity, points: Sequence[FarPoint]) -> list[TrackedQuantity]:
    """A quantity and those of its effect's points at which others of its numbers move, too, or others alone."""
    if not points:
        return [quantity]
    leading = (EFFECTS[quantity.name].parameters[0].name,)
    result = []
    for moved in dict.fromkeys([leading, *(point.moved for point in points)]):
        columns = list(quantity.columns) if moved == leading else []
        for point in (p for p in points if p.moved == moved):
            low, high = sorted((0.0, BEYOND * point.z))
            columns.append(QuantityColumn(((point.name, 1.0),), low, high, point.z))
        part = quantity.part if moved == leading else " and ".join(moved)
        result.append(replace(quantity, part=part, columns=tuple(sorted(columns, key=lambda c: c.node))))
    return result


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
    column = QuantityColumn(tuple((u.name, 0.5 / u.sigma) for u in both), -1.5, 6.0, 1.0)
    return TrackedQuantity(FRICTION, "", "friction", "-", 0.5, 1.0, (column,))
