"""What a column could be by itself: names, units and ranges, as a log-likelihood for each signal and unit.

Ranges are priors over machines of this kind, log-normal with these medians and spreads, and hard limits of physics. No number in
here belongs to one machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boom_import import units, words
from boom_import.source import Column, Floats

ANGLE, RATE, HOSE, ROD, EXTEND, RETRACT = (
    "angle", "rate", "hose_pressure", "rod_pressure", "extend_current", "retract_current",
)  # fmt: skip
SIGNALS = (ANGLE, RATE, HOSE, ROD, EXTEND, RETRACT)
"""What is looked for together; commands and a reference follow by their names."""
DIMENSION = {
    ANGLE: units.ANGLE, RATE: units.RATE, HOSE: units.PRESSURE, ROD: units.PRESSURE, EXTEND: units.CURRENT, RETRACT: units.CURRENT,
    "extend_current_command": units.CURRENT, "retract_current_command": units.CURRENT, "reference_angle": units.ANGLE,
    "head_pressure": units.PRESSURE, "supply_pressure": units.PRESSURE, "tank_pressure": units.PRESSURE,
}  # fmt: skip

_OTHERS = {"angle", "rate", "pressure", "current"}
_OF_SIGNAL: dict[str, dict[str, float]] = {
    ANGLE: {"angle": 1, "command": -1, "measured": 0.5, "boom": 1, "hose": -0.5, "rod": -0.5, "line": -1},
    RATE: {"rate": 1, "command": -1, "measured": 0.5, "boom": 1, "hose": -0.5, "rod": -0.5, "line": -1},
    HOSE: {
        "pressure": 1,
        "hose": 1,
        "rod": -1,
        "extend": 0.7,
        "retract": -0.7,
        "command": -1,
        "measured": 0.5,
        "boom": 1,
        "line": -1.5,
    },
    ROD: {
        "pressure": 1,
        "rod": 1,
        "hose": -1,
        "retract": 0.7,
        "extend": -0.7,
        "command": -1,
        "measured": 0.5,
        "boom": 1,
        "line": -1.5,
    },
    EXTEND: {
        "current": 1,
        "extend": 1,
        "retract": -1,
        "command": -1,
        "measured": 1,
        "boom": 1,
        "hose": 0.3,
        "rod": -0.3,
        "line": -0.5,
    },
    RETRACT: {
        "current": 1,
        "retract": 1,
        "extend": -1,
        "command": -1,
        "measured": 1,
        "boom": 1,
        "rod": 0.3,
        "hose": -0.3,
        "line": -0.5,
    },
    "extend_current_command": {"current": 1, "extend": 1, "retract": -1, "command": 1, "measured": -1, "boom": 1},
    "retract_current_command": {"current": 1, "retract": 1, "extend": -1, "command": 1, "measured": -1, "boom": 1},
    "reference_angle": {"angle": 1, "command": 1, "measured": -1, "boom": 1},
}
_QUANTITY = {ANGLE: "angle", RATE: "rate", HOSE: "pressure", ROD: "pressure", EXTEND: "current", RETRACT: "current"}

# Size of a signal (see `size`) in SI: median, spread [log], and what physics does not let it exceed.
_SIZE = {
    units.PRESSURE: (170e5, 0.5, 700e5),
    units.ANGLE: (0.7, 0.7, 7.0),
    units.RATE: (0.3, 0.8, 3.0),
    units.CURRENT: (0.7, 0.6, 5.0),
}
_LEAST_FIT, _IMPOSSIBLE = -6.0, -30.0
_STATED_WRONG = {False: 0.01, True: 0.1}  # by its author; by the message's type, which not everyone keeps to
_UNIT_PRIOR = {"bar": 0.45, "MPa": 0.2, "Pa": 0.15, "kPa": 0.05, "hPa": 0.02, "psi": 0.13, "kgf/cm2": 1e-4, "deg": 0.5,
               "rad": 0.45, "mrad": 0.03, "gon": 0.02, "rad/s": 0.5, "deg/s": 0.45, "mrad/s": 0.04, "rpm": 0.01, "A": 0.5,
               "mA": 0.5}  # fmt: skip
_OTHER_DIMENSION = -8.0
_MOST = 8
_COUNTED = 20
"""Equal steps that no measurement makes."""
_CALLED = 3.0
_CONTRACT = 40.0  # more than all that dynamics and ranges can say together


@dataclass(frozen=True)
class ColumnCandidate:
    """A column in a unit, as one signal.

    Attributes:
        column: the column.
        unit: name of the unit.
        part: "" all of it, "positive" or "negative" one half of a signed current.
        score: log-likelihood of names, unit and range.
        told: the unit is what the file states.
        scale: how many of the unit the number one is.
    """

    column: Column
    unit: str
    part: str
    score: float
    told: bool
    scale: float = 1.0

    @property
    def values(self) -> Floats:
        """(n,) in SI, with the sign of the file; of a part the half that counts."""
        values = self.column.values * (self.scale * units.BY_NAME[self.unit].factor)
        if self.part:
            return np.asarray(np.maximum(values if self.part == "positive" else -values, 0.0))
        return values


def name_evidence(column: Column, signal: str) -> float:
    """Log odds of the words of a column for a signal; a topic and field of the contract say it beyond doubt."""
    if column.signal:
        return _CONTRACT if column.signal == signal else -_CONTRACT
    found = words.features(column.name)
    weights = _OF_SIGNAL[signal]
    own = _QUANTITY.get(signal, "angle" if signal == "reference_angle" else "current")
    score = sum(weight * found.get(feature, 0.0) for feature, weight in weights.items())
    # A stated unit says what is measured, and better than words such as "valve" do.
    stated = units.parse(column.unit).measure
    if stated is None:
        score -= max((found.get(feature, 0.0) for feature in _OTHERS - {own}), default=0.0) * (
            found.get(own, 0.0) < 4.0
        )
    return score - 0.75 * found.get("other", 0.0) - found.get("nothing", 0.0)


def size(values: Floats, dimension: str) -> float:
    """How large a signal is: the span of an angle, the 99.5 % quantile of the magnitude of all else."""
    if dimension == units.ANGLE:
        low, high = np.quantile(values, (0.005, 0.995))
        return float(high - low)
    return float(np.quantile(np.abs(values), 0.995))


def unit_scores(column: Column, dimension: str) -> dict[str, float]:
    """Unit -> log-likelihood of range and stated unit."""
    stated, _, scale = units.parse(column.unit)
    magnitude = size(column.values, dimension) * scale
    if not magnitude > 0.0:
        return {}
    median, spread, limit = _SIZE[dimension]
    scores = {}
    for measure in units.OF_DIMENSION[dimension]:
        value = magnitude * measure.factor
        fit = max(-0.5 * (math.log(value / median) / spread) ** 2, _LEAST_FIT)
        low = float(column.values.min()) * scale * measure.factor
        if value > limit or (dimension == units.PRESSURE and low < -30e5):
            fit = _IMPOSSIBLE
        scores[measure.name] = fit + _stated(stated, measure, dimension, column.by_type)
    return scores


def _stated(stated: units.UnitOfMeasure | None, measure: units.UnitOfMeasure, dimension: str, by_type: bool) -> float:
    prior = math.log(_UNIT_PRIOR[measure.name])
    if stated is None:
        return prior
    wrong = _STATED_WRONG[by_type]
    if stated.dimension != dimension:
        return prior + (_OTHER_DIMENSION if not by_type else math.log(wrong) - 2.0)
    return math.log(1 - wrong) if stated.name == measure.name else math.log(wrong) + prior


def candidates(columns: list[Column], signal: str) -> list[ColumnCandidate]:
    """The best candidates for a signal, best first; at most eight."""
    dimension = DIMENSION[signal]
    found: list[ColumnCandidate] = []
    for column in columns:
        stated, _, scale = units.parse(column.unit)
        if not (column.by_type or column.signal) and _counts(column.values):
            continue
        if stated is not None and not column.by_type and _of_something_else(stated, dimension):
            continue
        names = name_evidence(column, signal)
        for unit, score in unit_scores(column, dimension).items():
            told = stated is not None and stated.name == unit
            if dimension != units.CURRENT:
                found.append(ColumnCandidate(column, unit, "", names + score, told, scale))
            elif _is_signed(column.values):
                # The words of a signed current name both directions or none.
                both = name_evidence(column, EXTEND if signal == RETRACT else RETRACT)
                found += [
                    ColumnCandidate(column, unit, part, min(names, both, 4.0) + score, told, scale)
                    for part in ("positive", "negative")
                ]
            else:
                found.append(ColumnCandidate(column, unit, "", names + score, told, scale))
    found.sort(key=lambda c: -c.score)
    return [c for c in found[:_MOST] if c.score > found[0].score - 25.0]


def _counts(values: Floats) -> bool:
    """Whether a column counts its rows, or the time."""
    steps = np.diff(values)
    return bool(len(steps) > _COUNTED and steps[0] != 0.0 and np.ptp(steps) <= 1e-6 * abs(steps[0]))


def _of_something_else(stated: units.UnitOfMeasure, dimension: str) -> bool:
    """Whether a stated unit is none that somebody may have meant: a pressure is in no amperes, though its transmitter is."""
    electrical = units.CURRENT in (stated.dimension, dimension)
    return stated.dimension in ("other", units.TIME, units.RATIO) or (electrical and stated.dimension != dimension)


def transmitters(columns: list[Column], signal: str) -> list[Column]:
    """Columns in mA or V that are called like this signal: what the transmitter gives."""
    named = [c for c in columns if not c.by_type and units.parse(c.unit).measure in units.ELECTRICAL]
    return [c for c in named if name_evidence(c, signal) >= _CALLED]


def _is_signed(values: Floats) -> bool:
    low, high = np.quantile(values, (0.01, 0.99))
    return bool(low < -0.1 * max(high, 1e-12) and high > 0.1 * -low)


def ratio_columns(columns: list[Column]) -> list[Column]:
    """Columns in percent: a current only if somebody says how many amperes 100 % are."""
    return [c for c in columns if (m := units.parse(c.unit).measure) is not None and m.dimension == units.RATIO]
