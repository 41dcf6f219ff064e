"""Readings of a recording: as it is, or with a sign, a unit or two channels put right; the likeliest is told.

Every reading is scored by all relations; a fault has prior odds of 1 to 1000. A second fault is looked for in what the first
leaves. Two faults may explain the same (a command turned round, or angle and rate turned round): then the sentence names both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_checks.check import CheckKind, IntervalValue, RecordingCheck
from boom_checks.even_series import PERIOD, EvenSeries
from boom_checks.mechanics import Mechanics
from boom_checks.relations import MOTION, PRESSURES, RELATIONS, contact_gain, linkage
from boom_identification.signals import stretches
from boom_input.channels import AMBIENT_PRESSURE_PA, BY_NAME

Array = NDArray[np.float64]

PRIOR = -math.log(1000.0)
"""A recording in a thousand has a given fault."""
WEIGHED = MOTION | PRESSURES
"""What the force balance looks at."""
MOST_FAULTS = 3
ALIKE = math.log(20.0)
"""Readings closer than that are not told apart."""
STILL = 2e-3
"""rad. A boom whose angle changes by less does not move, whatever its unit is: the rate is noise, whose unit nothing tells."""
Z_90 = 1.645
"""Half an interval of 90 % over the standard deviation."""


@dataclass(frozen=True)
class FaultReading:
    """A fault, and what puts it right.

    Attributes:
        kind, words: of the check.
        channels: what is wrong.
        repair: (series) -> signals as they should be.
        measured: (series, boom) -> the number that shows it.
        shrinks: factor on the angle. A density grows by its inverse, so a reading is charged log(shrinks) a second: else
            every angle would be told as degrees, because a boom that hardly moves needs nothing of its pressures.
        by_forces: the linkage's range does not tell it: that is a number of the file, which may be wrong.
    """

    kind: CheckKind
    words: str
    channels: tuple[str, ...]
    repair: Callable[[EvenSeries], Mapping[str, Array]]
    measured: Callable[[EvenSeries, Mechanics], IntervalValue]
    shrinks: float = 1.0
    by_forces: bool = False

    @property
    def topic(self) -> str:
        """The topics of its channels."""
        return ", ".join(dict.fromkeys(BY_NAME[name].topic for name in self.channels))


def _scaled(factor: float, *names: str) -> Callable[[EvenSeries], Mapping[str, Array]]:
    return lambda series: {name: factor * series.columns[name] for name in names}


def _counted_from(zero: float, direction: float) -> Callable[[EvenSeries], Mapping[str, Array]]:
    """Angle [rad] and rate of a sensor that reads ``zero`` where the boom is horizontal, and counts upwards (1) or downwards."""
    return lambda series: {
        "angle": direction * (series.columns["angle"] - zero), "rate": direction * series.columns["rate"]
    }  # fmt: skip


def _swapped(first: str, second: str) -> Callable[[EvenSeries], Mapping[str, Array]]:
    return lambda series: {first: series.columns[second], second: series.columns[first]}


def _turned_on_the_wire(name: str) -> Callable[[EvenSeries], Mapping[str, Array]]:
    """A sign may be wrong before or behind the step from gauge to absolute; the wire's is what a bag holds."""
    return lambda series: {name: -(series.columns[name] + AMBIENT_PRESSURE_PA) - AMBIENT_PRESSURE_PA}


def _from_bar(*names: str) -> Callable[[EvenSeries], Mapping[str, Array]]:
    return lambda series: {n: 1e5 * (series.columns[n] + AMBIENT_PRESSURE_PA) - AMBIENT_PRESSURE_PA for n in names}


def _raised(*names: str) -> Callable[[EvenSeries], Mapping[str, Array]]:
    return lambda series: {name: series.columns[name] + AMBIENT_PRESSURE_PA for name in names}


def _slope(name: str, unit: str, x: Array, y: Array) -> IntervalValue:
    """Slope of y over x through the origin, with its interval; errors last a second."""
    known = np.isfinite(x) & np.isfinite(y)
    u, v = x[known], y[known]
    power = max(float(u @ u), 1e-12)
    slope = float(u @ v) / power
    seconds = max(len(u) * PERIOD, 1.0)
    half = Z_90 * float(np.sqrt(np.mean((v - slope * u) ** 2) / seconds / (power / len(u))))
    return IntervalValue(name, slope, unit, (slope - half, slope + half))


def _answer(series: EvenSeries, boom: Mechanics) -> IntervalValue:
    speed = boom.lever(series.smooth("angle")) * series.smooth("rate")
    return _slope("piston speed per ampere of extend minus retract current", "m/s/A", series.command, speed)


def _derivative(series: EvenSeries, _: Mechanics) -> IntervalValue:
    return _slope("derivative of the angle over the rate", "-", series.smooth("rate"), series.smooth("angle", 1))


def mean_measure(name: str, unit: str, values: Array) -> IntervalValue:
    """The mean with its interval; what it varies by lasts a second."""
    known = values[np.isfinite(values)]
    middle = float(np.mean(known)) if len(known) else math.nan
    half = Z_90 * float(np.std(known)) / math.sqrt(max(len(known) * PERIOD, 1.0)) if len(known) else math.nan
    return IntervalValue(name, middle, unit, (middle - half, middle + half))


def _level(name: str) -> Callable[[EvenSeries, Mechanics], IntervalValue]:
    channel = BY_NAME[name]
    what = f"mean of the {name.replace('_', ' ')}, {'gauge' if channel.is_pressure else 'as recorded'}"
    return lambda series, _: mean_measure(what, channel.unit, series.columns[name])


def _largest(series: EvenSeries, _: Mechanics) -> IntervalValue:
    top = series.largest_current
    return IntervalValue("largest current, as recorded", top, "A", (top, top))


def _miss(series: EvenSeries, boom: Mechanics) -> IntervalValue:
    angle, rate, acceleration = series.smooth("angle"), series.smooth("rate"), series.smooth("rate", 1)
    need = boom.need(series.time, angle, rate, acceleration, series.smooth("rod_pressure"))
    return mean_measure("hose pressure minus what the boom needs", "Pa", series.smooth("hose_pressure") - need)


_HOSE, _ROD = "hose_pressure", "rod_pressure"
_CURRENTS, _BOOM, _BOTH = ("retract_current", "extend_current"), ("angle", "rate"), (_HOSE, _ROD)
_DEGREE = math.pi / 180
READINGS: tuple[FaultReading, ...] = (
    FaultReading("sign", "the command has the wrong sign: the extend current lowers the boom and the retract current lifts it",
            _CURRENTS, _swapped(*_CURRENTS), _answer),
    FaultReading("sign", "angle and rate have the wrong sign: they fall where command and pressures lift the boom",
            _BOOM, _scaled(-1.0, *_BOOM), _answer),
    FaultReading("units", "the angle counts from the vertical and falls while the boom is lifted, where 0 is horizontal",
            _BOOM, _counted_from(math.pi / 2, -1.0), _level("angle"), by_forces=True),
    FaultReading("units", "the angle is 90 degrees too large, where 0 is horizontal",
            _BOOM, _counted_from(math.pi / 2, 1.0), _level("angle"), by_forces=True),
    FaultReading("units", "the angle is 90 degrees too small, where 0 is horizontal",
            _BOOM, _counted_from(-math.pi / 2, 1.0), _level("angle"), by_forces=True),
    FaultReading("sign", "the angle has the wrong sign: its derivative is minus the measured rate",
            ("angle",), _scaled(-1.0, "angle"), _derivative),
    FaultReading("sign", "the rate has the wrong sign: it is minus the derivative of the measured angle",
            ("rate",), _scaled(-1.0, "rate"), _derivative),
    FaultReading("sign", "the hose pressure has the wrong sign: it reads below vacuum",
            (_HOSE,), _turned_on_the_wire(_HOSE), _level(_HOSE)),
    FaultReading("sign", "the rod pressure has the wrong sign: it reads below vacuum",
            (_ROD,), _turned_on_the_wire(_ROD), _level(_ROD)),
    FaultReading("swapped_channels", "hose and rod pressure are swapped: exchanged, they carry the boom",
            _BOTH, _swapped(*_BOTH), _miss),
    FaultReading("units", "hose and rod pressure are in bar, where Pa are due", _BOTH, _from_bar(*_BOTH), _level(_HOSE)),
    FaultReading("units", "the hose pressure is in bar, where Pa are due", (_HOSE,), _from_bar(_HOSE), _level(_HOSE)),
    FaultReading("units", "the rod pressure is in bar, where Pa are due", (_ROD,), _from_bar(_ROD), _level(_ROD)),
    FaultReading("units", "the currents are in mA, where A are due", _CURRENTS, _scaled(1e-3, *_CURRENTS), _largest),
    FaultReading("units", "the pressures are gauge, where absolute ones are due: they read up to an atmosphere below vacuum",
            _BOTH, _raised(*_BOTH), _level(_ROD)),
    FaultReading("units", "angle and rate are in degrees, where rad are due",
            _BOOM, _scaled(_DEGREE, *_BOOM), _level("angle"), _DEGREE),
    FaultReading("units", "the angle is in degrees, where rad are due",
            ("angle",), _scaled(_DEGREE, "angle"), _derivative, _DEGREE),
    FaultReading("units", "the rate is in degrees per second, where rad/s are due",
            ("rate",), _scaled(_DEGREE, "rate"), _derivative),
)  # fmt: skip


def reading_checks(series: EvenSeries, boom: Mechanics) -> tuple[list[RecordingCheck], EvenSeries]:
    """The faults of sign, unit and channel, the likeliest first, and the series with them repaired."""
    found: list[RecordingCheck] = []
    readings = READINGS if moves(series) else [r for r in READINGS if not set(r.channels) <= set(_BOOM)]
    for _ in range(MOST_FAULTS):
        as_read = [relation(series, boom) for relation, _ in RELATIONS]
        seconds = float(np.isfinite(series.columns["angle"]).sum()) * PERIOD
        gains = [
            _gain(reading, series, boom, as_read) + seconds * math.log(reading.shrinks) + PRIOR for reading in readings
        ]
        best = int(np.argmax(gains))
        if not gains[best] > 0.0:
            break
        if set(readings[best].channels) & WEIGHED and gains[best] <= contact_gain(series, boom) + PRIOR:
            break
        alike = [k for k in np.argsort(gains)[::-1] if k != best and gains[k] > gains[best] - ALIKE]
        found.append(_told(readings[best], [readings[k] for k in alike], series, boom, gains[best]))
        series = series.with_columns(readings[best].repair(series))
        readings = [
            reading for k, reading in enumerate(readings) if k != best
        ]  # what is right once it is put right is told once
    return found, series


def moves(series: EvenSeries) -> bool:
    """Whether the boom moves in a recording."""
    angle = series.smooth("angle")
    return float(np.nanmax(angle, initial=-np.inf) - np.nanmin(angle, initial=np.inf)) > STILL


def _gain(reading: FaultReading, series: EvenSeries, boom: Mechanics, as_read: list[float]) -> float:
    """By how much the relations that look at its channels hold better with the fault repaired."""
    repaired, touched = series.with_columns(reading.repair(series)), set(reading.channels)
    return sum(
        relation(repaired, boom) - before
        for (relation, channels), before in zip(RELATIONS, as_read, strict=True)
        if channels & touched and not (reading.by_forces and relation is linkage)
    )


def _told(
    reading: FaultReading, others: list[FaultReading], series: EvenSeries, boom: Mechanics, odds: float
) -> RecordingCheck:
    known = np.logical_and.reduce([np.isfinite(series.columns[name]) for name in reading.channels])
    measure = reading.measured(series, boom)
    sentence = f"{reading.words} ({measure.text})"
    sentence += "".join(f"; or {other.words}" for other in others)
    intervals = tuple((float(series.time[a]), float(series.time[b - 1])) for a, b in stretches(known))
    return RecordingCheck(reading.kind, reading.topic, intervals, sentence, measure, odds)
