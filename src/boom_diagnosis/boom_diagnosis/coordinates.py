"""The effects as coordinates of a search: where to start, how far a step goes, how wide the prior is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import log

from boom_model.effects import EFFECTS, Effect, EffectParameter

MARGIN = 1.5
"""The prior reaches so far beyond the catalogue's plausible range, in widths of it."""
MARGINS = {"pressure_bias": 8.0, "angle_offset": 3.0, "accumulator_heat_loss": 12.0, "return_line_pressure": 5.0}
"""The same for what a careless hand can do at will, for gas that keeps its temperature, as in foam (within half a second), and
for a return line that is nearly shut."""
STEP, FACTOR_STEP = 1.5e-3, 3e-3
"""Of differences: share of an effect's range, and relative change of a positive number. As small as those of the tolerances, or an
effect that is a number's being off would have another derivative than that number."""
LOADS = ("payload", "payload_change")
"""Effects that may be less than nothing: as much as a load that was told to hang there. Of others that are plausible on one side of
neutral there are none on the other."""
DELAYS, DELAY_STEP = ("command_delay", "pressure_delay"), 0.05
"""Effects that move samples between intervals, and the share of their range."""


@dataclass(frozen=True)
class Coordinate:
    """One number that is searched.

    Attributes:
        name: component of the parameter vector.
        unit: of the number.
        low, high: limits of the search; the prior is flat in between (in the logarithm if ``positive``).
        step: of the differences [unit; relative if ``positive``].
        plausible: range of the catalogue.
    """

    name: str
    unit: str
    low: float
    high: float
    step: float
    positive: bool
    plausible: tuple[float, float]

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


# Effects whose first numbers are tried at several places, because the answer is far from linear in them.
_STARTS: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "swinging_load": {"length": (0.8, 1.3, 2.0, 3.0)},
    "boom_flexibility": {"f": (1.0, 1.25, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0)},
    "stribeck_friction": {"w_s": (0.008, 0.025)},
    "presliding_friction": {"compliance": (2e-7, 1.5e-6, 8e-6)},
    "position_dependent_friction": {"q_c": (0.1, 0.3, 0.5, 0.7, 0.9), "width": (0.06, 0.2)},
    "friction_drift": {"T": (8.0, 30.0)},
    "end_cushioning": {"length": (0.03, 0.08)},
    "entrained_air": {"a": (0.006, 0.03)},
    "accumulator_precharge": {"r": (0.35, 0.7, 1.08)},
    "accumulator_heat_loss": {"inverse_tau": (1 / 30, 1 / 7, 1.0)},
    "accumulator_restrictor": {"r": (0.45, 0.75, 1.15)},
    "hose_burst_valve_lag": {"tau": (0.008, 0.03, 0.1)},
    "hose_burst_valve_setting": {"r": (0.75, 1.12)},
    "valve_hysteresis": {"h": (0.01, 0.04), "travel": (0.0, 0.15)},
    "pilot_lag": {"r": (0.75, 1.6)},
    "command_delay": {"T": (0.01, 0.04)},
    "pump_flow_limit": {"inverse_q_max": tuple(60_000 / q for q in (120, 100, 85, 70, 60, 50, 42, 35))},
    "pressure_delay": {"T": (0.01, 0.04)},
    "spring_rate": {"r": (0.88, 1.12)},
}
# Where the first number goes while a companion is tried: about a third of its range.
_SHARE = 0.35
_POSITIVE = {
    ("swinging_load", "length"), ("boom_flexibility", "f"), ("stribeck_friction", "w_s"),
    ("presliding_friction", "compliance"), ("position_dependent_friction", "width"), ("friction_drift", "T"),
    ("friction_drift", "r"), ("end_cushioning", "length"), ("accumulator_precharge", "r"),
    ("accumulator_restrictor", "r"), ("hose_burst_valve_lag", "tau"), ("hose_burst_valve_setting", "r"),
    ("spring_rate", "r"), ("pilot_lag", "r"), ("swinging_load", "zeta"), ("boom_flexibility", "zeta"),
    ("rate_scale", "a"),
}  # fmt: skip


def coordinates(effect: Effect) -> tuple[Coordinate, ...]:
    """The numbers of an effect, each once."""
    return tuple(_coordinate(effect.id, row) for row in effect.parameters)


def _coordinate(effect: str, row: EffectParameter) -> Coordinate:
    positive = (effect, row.name) in _POSITIVE
    width = row.high - row.low
    margin = MARGINS.get(effect, MARGIN)
    low, high = max(row.minimum, row.low - margin * width), min(row.maximum, row.high + margin * width)
    if row.neutral == 0.0 and row.low > 0.0 and not positive:
        low = -row.high if effect in LOADS else 0.0
    if positive:
        low, high = max(row.minimum, row.low / 3.0, 1e-12), min(row.maximum, row.high * 3.0)
    share = DELAY_STEP if effect in DELAYS else STEP
    step = FACTOR_STEP if positive else share * max(abs(row.low), abs(row.high))
    if row.name == "t_g":
        low, high, step = 0.0, 1e4, 0.1
    name = f"effects.{effect}.{row.name}"
    return Coordinate(name, row.unit, low, high, step, positive, (row.low, row.high))


def starts(effect: Effect, lasting: float) -> list[dict[str, float]]:
    """Values from which an effect is tried: one dictionary a run. ``lasting``: duration of the recording [s]."""
    given = _STARTS.get(effect.id, {})
    first = effect.parameters[0]
    if effect.independent:  # one number after the other
        return [
            {f"effects.{effect.id}.{r.name}": _SHARE * r.high if r is row else r.neutral for r in effect.parameters}
            for row in effect.parameters
        ]
    base = {f"effects.{effect.id}.{row.name}": row.neutral for row in effect.parameters}
    base[f"effects.{effect.id}.{first.name}"] = first.neutral + _SHARE * (first.high - first.neutral)
    result = [base]
    for name, values in given.items():
        result = [{**point, f"effects.{effect.id}.{name}": value} for point in result for value in values]
    if effect.id == "payload_change":  # the time is searched without runs, see search.onset
        return [{**base, "effects.payload_change.t_g": 0.5 * lasting}]
    return result


def all_coordinates(effects: Iterable[str]) -> tuple[Coordinate, ...]:
    """Coordinates of several effects, in their order."""
    return tuple(c for effect in effects for c in coordinates(EFFECTS[effect]))
