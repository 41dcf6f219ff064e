"""Applies a mapping: columns become signals in SI, pressures gauge, and the signals of one topic get common stamps."""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches
from itertools import pairwise

import numpy as np
from scipy.signal import savgol_filter

from boom_import import units
from boom_import.candidates import ANGLE, RATE
from boom_import.errors import ImportingError
from boom_import.mapping import DERIVATIVE, Mapping, SignalMap
from boom_import.source import Column, Floats, Source, Stamps
from boom_input.channels import AMBIENT_PRESSURE_PA, BY_NAME, CHANNELS, of_topic
from boom_input.shown import quoted
from boom_input.turns import TURN, turns_away
from boom_recording.recording import Configuration, GivenConfiguration, Recording, Signal
from boom_recording.writing import START_NS

_WINDOW = (
    0.1  # s, of the derivative: an angle quantised to 0.4 mrad then gives a rate to 1 mrad/s, and a valve is slower
)
_REST = 1e-9  # rad/s
_MOST_OUTSIDE = 0.02
_AT_ONCE, _MOVES = 0.05, 0.01
"""Share of the samples that two currents in turns may have at once; rad by which a boom moves that some current still moves."""
_APART = 0.05  # s: further apart than this, nothing is interpolated
_FARTHEST = 1e30
"""Out of every range, and a number that a page can show."""
_Series = tuple[Stamps, Floats]


def convert(name: str, source: Source, mapping: Mapping) -> Recording:
    """The recording that a source holds.

    Raises:
        ImportingError: a column is missing, its values cannot be in its unit, or an entry of the mapping is open.
    """
    opened = mapping.open()
    if opened:
        raise ImportingError(f"{opened[0]} is not decided: write its column, unit and sign in the place of 'ask'")
    columns = source.by_key()
    series: dict[str, _Series] = {}
    notes: list[str] = []
    for signal, entry in mapping.signals.items():
        if isinstance(entry, SignalMap):
            column = _column(columns, entry, mapping.joint, signal)
            values = to_si(entry, column.values)
            turns = signal == ANGLE and units.BY_NAME[entry.unit].dimension == units.ANGLE  # a piston's way has none
            if turns and (away := turns_away(values)):
                values = values - away * TURN
                notes.append(
                    f"a whole turn is taken out of the angle, which is {values.min():.4g} to {values.max():.4g} rad then"
                )
            series[signal] = column.stamps_ns, _checked(signal, entry, column, values)
    if mapping.signals.get(RATE) == DERIVATIVE and ANGLE in series:
        series[RATE] = _derivative(*series[ANGLE])
    if not series:
        raise ImportingError("no signal has a column: there is nothing to import")
    notes += _on_common_stamps(series)
    first = min(int(stamps[0]) for stamps, _ in series.values())
    shift = 0 if source.dated else START_NS - first
    start = first + shift
    signals = {}
    for channel in CHANNELS:
        if channel.name in series:
            stamps, values = series[channel.name]
            stamps = stamps + shift
            time = (stamps - start) / 1e9
            signals[channel.name] = Signal(
                channel.name, channel.unit, channel.topic, stamps, time, values, np.isfinite(values)
            )
    duration = max(float(signal.time.max()) for signal in signals.values())
    recording = Recording(
        name, source.path, start, duration, signals, stored_configuration=_configuration(source, mapping)
    )
    recording.notes = notes
    return recording


def _configuration(source: Source, mapping: Mapping) -> Configuration | None:
    """What the mapping says, over what the source says; None where neither knows the pose."""
    made = GivenConfiguration(mapping.q3, mapping.q4, mapping.load).over(source.configuration)
    if made is None:
        return None
    machine = mapping.machine or made.machine
    return replace(made, machine=machine, note=f"imported from {quoted(source.path.name, 80)}")


def _column(columns: dict[str, Column], entry: SignalMap, joint: str, signal: str) -> Column:
    found = columns.get(entry.column) or columns.get(f"{entry.column}[{joint}]")
    if found is None:
        named = [column for column in columns.values() if column.name == entry.column]
        found = named[0] if len(named) == 1 else None
    if found is None and (own := entry.column.partition("/")[2]):  # of another run's files
        named = [column for column in columns.values() if column.key.partition("/")[2] == own]
        found = named[0] if len(named) == 1 else None
    if found is None:
        near = get_close_matches(entry.column, list(columns), 3, 0.0)
        has = ", ".join(f"'{quoted(key, 60)}'" for key in near)
        raise ImportingError(f"{signal}: there is no column '{quoted(entry.column, 60)}': the most alike are {has}")
    return found


def to_si(entry: SignalMap, numbers: Floats) -> Floats:
    """Numbers of a file as values of a signal [SI, pressures gauge]."""
    measure = units.BY_NAME[entry.unit]
    with np.errstate(over="ignore", invalid="ignore"):
        values = (entry.sign * entry.scale * numbers + entry.offset) * measure.factor
    values = np.clip(values, -_FARTHEST, _FARTHEST)
    if entry.part:  # the sign of the negative half is in `sign`
        values = np.maximum(values, 0.0)
    return np.asarray(values - (AMBIENT_PRESSURE_PA if entry.reference == "absolute" else 0.0))


def _checked(signal: str, entry: SignalMap, column: Column, values: Floats) -> Floats:
    channel = BY_NAME[signal]
    outside = float(np.mean((values < channel.low) | (values > channel.high)))
    if outside > _MOST_OUTSIDE:
        raise ImportingError(
            f"{signal}: {100 * outside:.0f} % of '{quoted(column.key, 60)}' in {entry.unit} lie outside "
            f"{channel.low:g} to {channel.high:g} {channel.unit}: is the unit, sign or column right?"
        )
    return values


def _derivative(stamps: Stamps, angle: Floats) -> _Series:
    """Rate [rad/s] by a quadratic fit over a window, on an even grid and back."""
    time = (stamps - stamps[0]) / 1e9
    steps = np.diff(time)
    period = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.01
    even = np.arange(0.0, time[-1] + period / 2, period)
    if len(even) > 50_000_000 or len(even) < 5:
        raise ImportingError(
            "the angle's times do not allow a derivative: give a column for the rate, or write 'rate: none'"
        )
    order = np.argsort(time, kind="stable")
    width = min(max(5, round(_WINDOW / period) | 1), len(even) - 1 + len(even) % 2)
    rate = savgol_filter(np.interp(even, time[order], angle[order]), width, 2, deriv=1, delta=period)
    rate[np.abs(rate) < _REST] = 0.0  # rounding errors of an angle at rest
    return stamps, np.asarray(np.interp(time, even, rate))


def _on_common_stamps(series: dict[str, _Series]) -> list[str]:
    """One message carries all signals of a topic: the others are interpolated to the stamps of the one with most samples."""
    notes = []
    every = np.unique(np.concatenate([stamps for stamps, _ in series.values()]))
    for topic in dict.fromkeys(BY_NAME[signal].topic for signal in series):
        own = [channel.name for channel in of_topic(topic) if channel.name in series]
        if found := _in_turns(own, series, every):
            series.update(found)
            words = "flow in turns, and are logged while they flow only: 0 A is taken else, but where the boom moves"
            notes.append(f"{' and '.join(own)} {words}")
            continue
        leader = max(own, key=lambda name: len(series[name][0]))
        stamps = series[leader][0]
        for name in own:
            if name == leader or np.array_equal(series[name][0], stamps):
                continue
            series[name] = stamps, _interpolated(stamps, *series[name])
            notes.append(f"{name} was interpolated to the times of {leader}")
    return notes


def _in_turns(names: list[str], series: dict[str, _Series], every: Stamps) -> dict[str, _Series]:
    """The currents of two solenoids that were logged while they flow only, with zeros else; {} where they were not.

    Both have pauses, and hardly ever samples at once. In a pause in which the boom still moves at last nothing is known: a logger
    that writes what changes has no samples of a current that stays.
    """
    if len(names) != 2 or any(BY_NAME[name].unit != "A" for name in names):
        return {}
    found = {name: _interpolated(every, *series[name]) for name in names}
    one, other = (np.isfinite(values) for values in found.values())
    if one.all() or other.all() or (one & other).sum() > _AT_ONCE * min(one.sum(), other.sum()):
        return {}
    angle = _interpolated(every, *series[ANGLE]) if ANGLE in series else np.zeros(len(every))
    flows = one | other
    for last, first in pairwise(np.flatnonzero(flows)):
        if not abs(angle[first] - angle[(last + first) // 2]) <= _MOVES:  # nor where the angle is not known
            flows[last + 1 : first] = True
    return {
        name: (every, np.where(np.isfinite(values) | flows & ~(one | other), values, 0.0))
        for name, values in found.items()
    }


def _interpolated(stamps: Stamps, own: Stamps, values: Floats) -> Floats:
    order = np.argsort(own, kind="stable")
    time, zero = (stamps - own[0]) / 1e9, (own[order] - own[0]) / 1e9
    period = float(np.median(np.diff(zero)))
    result = np.interp(time, zero, values[order])
    result[(time < zero[0] - period) | (time > zero[-1] + period)] = np.nan  # within one: as a value that is held
    right = np.clip(np.searchsorted(zero, time), 1, len(zero) - 1)
    result[zero[right] - zero[right - 1] > max(_APART, 3.0 * period)] = np.nan
    return np.asarray(result)
