"""The effects as coordinates of a search: where to start, how far a step goes, how wide the prior is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import log

from boom_diagnosis.sizes import THESIS, MachineSize, sized
from boom_model.catalogue import EFFECTS, Effect, EffectParameter

STEP, FACTOR_STEP = 1.5e-3, 3e-3
"""Of differences: share of an effect's range, and relative change of a positive number. As small as those of the tolerances, or an
effect that is a number's being off would have another derivative than that number."""
BEFORE = -1.0
"""s. A time before the recording."""
DELAY_STEP = 0.05
"""The same share for an effect that moves samples between intervals."""


@dataclass(frozen=True)
class Coordinate:
    """One number that is searched.

    Attributes:
        name: component of the parameter vector.
        unit: of the number.
        low, high: limits of the search; the prior is flat in between (in the logarithm if ``positive``).
        step: of the differences [unit; relative if ``positive``].
        plausible: range of the catalogue.
        form: standard deviation in the inner coordinate to which it means anything.
        onset: whether it is the time at which its effect begins.
        delay: whether it moves samples between the observer's intervals.
    """

    name: str
    unit: str
    low: float
    high: float
    step: float
    positive: bool
    plausible: tuple[float, float]
    form: float = 0.0
    onset: bool = False
    delay: bool = False

    def inner(self, value: float) -> float:
        """Value -> coordinate in which the prior is flat."""
        return log(value) if self.positive else value

    @property
    def width(self) -> float:
        """Of the prior, in the inner coordinate."""
        return self.inner(self.high) - self.inner(self.low)

    @property
    def precision(self) -> float:
        """Of the prior, in the inner coordinate: 12 / width^2, as a flat density has it."""
        return 12.0 / self.width**2


# Where the first number goes while a companion is tried: about a third of its range.
_SHARE = 0.35


def coordinates(effect: Effect, size: MachineSize = THESIS) -> tuple[Coordinate, ...]:
    """The numbers of an effect in a machine of this size, each once."""
    own = sized(effect, size)
    return tuple(_coordinate(own, row) for row in own.parameters if not row.fixed)


def _coordinate(effect: Effect, row: EffectParameter) -> Coordinate:
    width, onset = row.high - row.low, row.name in (effect.onset, effect.release)
    low, high = max(row.minimum, row.low - effect.margin * width), min(row.maximum, row.high + effect.margin * width)
    if row.neutral == 0.0 and row.low > 0.0 and not row.positive:
        low = -row.high if effect.load else 0.0
    if row.positive:
        low, high = max(row.minimum, row.low / 3.0, 1e-30), min(row.maximum, row.high * 3.0)
    else:
        low, high = min(low, row.neutral), max(high, row.neutral)
    share = DELAY_STEP if effect.delays else STEP
    step = FACTOR_STEP if row.positive else share * max(abs(row.low), abs(row.high))
    if onset:
        low, high, step = BEFORE, 1e4, 0.1
    name = f"effects.{effect.id}.{row.name}"
    return Coordinate(
        name, row.unit, low, high, step, row.positive, (row.low, row.high), row.form, onset, bool(effect.delays)
    )


def starts(
    effect: Effect, lasting: float, size: MachineSize = THESIS, angles: tuple[float, float] = (0.0, 1.0),
    load: float | None = None,
) -> list[dict[str, float]]:  # fmt: skip
    """Values from which an effect is tried: one dictionary a run.

    lasting: duration of the recording [s]. angles: least and largest in it [rad]. load: the one that is told [kg].
    """
    effect = sized(effect, size)
    first = effect.parameters[0]
    if effect.points:
        names = [f"effects.{effect.id}.{row.name}" for row in effect.parameters]
        return [dict(zip(names, point, strict=True)) for point in effect.points]
    if effect.independent:  # one number after the other
        return [
            {
                f"effects.{effect.id}.{r.name}": r.neutral + (_SHARE * (r.high - r.neutral) if r is row else 0.0)
                for r in effect.parameters
            }
            for row in effect.parameters
            if not row.of
        ]
    base = {f"effects.{effect.id}.{row.name}": row.neutral for row in effect.parameters}
    base[f"effects.{effect.id}.{first.name}"] = first.neutral + _SHARE * (first.high - first.neutral)
    result = [base]
    for row in effect.parameters:
        if row.name == effect.onset:  # the time is searched without runs, see search.onset
            result = [{**point, f"effects.{effect.id}.{row.name}": 0.5 * lasting} for point in result]
        elif (effect.parameters[0].name, row.name) in effect.steps:  # as well, from the beginning
            name, time = (f"effects.{effect.id}.{own}" for own in (row.name, effect.onset))
            result += [{**point, name: 0.5 * (row.low + row.high), time: BEFORE} for point in result]
        elif row.starts:
            low, span = (angles[0], angles[1] - angles[0]) if row.visited else (0.0, 1.0)
            tried = [low + span * v for v in row.starts]
            result = [{**point, f"effects.{effect.id}.{row.name}": v} for point in result for v in tried]
    return _of_told(effect, result, load) if effect.told and load is not None else result


def _of_told(effect: Effect, points: list[dict[str, float]], load: float) -> list[dict[str, float]]:
    """Starts of a load that is the one that is told: so heavy, and none where none is."""
    mass, told = (f"effects.{effect.id}.{name}" for name in (effect.parameters[0].name, effect.told))
    fixed = {f"effects.{effect.id}.{row.name}": load for row in effect.parameters if row.fixed}
    points = [{**point, **fixed} for point in points if load > 0.0 or not point[told]]
    return [{**point, mass: load} if point[told] else point for point in points]


def idle(effects: Mapping[str, float]) -> set[str]:
    """Names of the numbers that need states and are neutral, and of those that shape them; effects: values by dotted name."""
    still = set[str]()
    for effect in {name.split(".")[1] for name in effects if name.startswith("effects.")}:
        prefix, rows = f"effects.{effect}.", EFFECTS[effect].parameters
        gone = {r.name for r in rows if r.name in EFFECTS[effect].moving and effects.get(prefix + r.name) == r.neutral}
        still |= {prefix + r.name for r in rows if r.name in gone or r.of in gone}
    return still


def has_valleys(effect: Effect) -> bool:
    """Whether the catalogue has starts of several of an effect's numbers, which trade off against one another."""
    several = sum(bool(row.starts) and row.name != effect.told for row in effect.parameters) > 1
    return bool(effect.points) or (several and not effect.onset)


def all_coordinates(effects: Iterable[str], size: MachineSize = THESIS) -> tuple[Coordinate, ...]:
    """Coordinates of several effects, in their order."""
    return tuple(c for effect in effects for c in coordinates(EFFECTS[effect], size))
