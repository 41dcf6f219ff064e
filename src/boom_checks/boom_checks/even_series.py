"""The signals of a recording on one time grid, smoothed and differentiated; what a defect has masked stays unknown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from boom_identification.signals import smoothed, stretches, window_samples
from boom_input.channels import BY_NAME
from boom_recording.recording import Recording, Signal

Array = NDArray[np.float64]

PERIOD = 0.01
"""s. Grid of all that follows; slower topics are interpolated, faster ones thinned out."""
WINDOW = 0.15
"""s. Savitzky-Golay window: passes what a boom and its pressures do, and takes a third of the sensors' noise."""
SHORTEST = 5.0
"""s. Less tells nothing: a motion lasts as long."""
SLOW, WIDE = 0.05, 0.5
"""Share of the largest rate that a boom which leans on a stop does not reach, and of the largest current that it does not follow:
more than any dead zone."""
GAP = 0.15
"""s. Longer stretches without a sample stay unknown; a topic of 10 Hz has none."""


@dataclass(frozen=True)
class EvenSeries:
    """Signals on a common grid.

    Attributes:
        time: (n,) [s].
        columns: signal name -> (n,) [SI], interpolated; NaN where it is not known.
    """

    time: Array
    columns: Mapping[str, Array]
    _cache: dict[tuple[str, int], Array] = field(default_factory=dict, repr=False)

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def smooth(self, name: str, derivative: int = 0) -> Array:
        """(n,) the smoothed signal, or its derivative [unit/s^derivative]."""
        key = (name, derivative)
        if key not in self._cache:
            values = self.columns[name]
            result = np.full(len(values), np.nan)
            for first, end in stretches(np.isfinite(values)):
                result[first:end] = smoothed(values[first:end], PERIOD, WINDOW, derivative)
            self._cache[key] = result
        return self._cache[key]

    @property
    def command(self) -> Array:
        """(n,) i_- - i_+ [A], smoothed: positive lifts."""
        return self.smooth("extend_current") - self.smooth("retract_current")

    @property
    def largest_current(self) -> float:
        """Of both directions [A], as recorded and smoothed; 0 without a sample."""
        return float(np.nanmax(np.abs(self.command), initial=0.0))

    @property
    def leaning(self) -> NDArray[np.bool_]:
        """(n,) whether the boom stands against its command: it leans on a stop, which carries with the pressures.

        What is shut in then keeps it there until it moves again.
        """
        if not {"rate", "extend_current", "retract_current"} <= set(self.columns):
            return np.zeros(len(self.time), dtype=bool)
        rate = np.abs(self.smooth("rate"))
        still = rate < SLOW * np.nanmax(rate, initial=0.0)
        result = still & (np.abs(self.command) > WIDE * self.largest_current)
        for first, end in stretches(still):
            result[first:end] = np.logical_or.accumulate(result[first:end])
        return np.asarray(result)

    def known(self, *names: str) -> bool:
        """Whether these signals are known together for long enough to say something."""
        if not set(names) <= set(self.columns):
            return False
        together = np.logical_and.reduce([np.isfinite(self.smooth(name)) for name in names])
        return bool(together.sum() * PERIOD >= SHORTEST)

    def plausible(self) -> EvenSeries:
        """The same without what is outside its channel's range: once units and signs are put right, that is no measurement."""
        changed = {}
        for name, values in self.columns.items():
            channel = BY_NAME[name]
            outside = (values < channel.low) | (values > channel.high)
            if outside.any():
                changed[name] = np.where(outside, np.nan, values)
        return self.with_columns(changed) if changed else self

    def without(self, name: str) -> EvenSeries:
        """The same without a signal."""
        return EvenSeries(
            self.time, {key: value for key, value in self.columns.items() if key != name}, {**self._cache}
        )

    def with_columns(self, changed: Mapping[str, Array]) -> EvenSeries:
        """The same with other values of some signals."""
        kept = {key: value for key, value in self._cache.items() if key[0] not in changed}
        return EvenSeries(self.time, {**self.columns, **changed}, kept)

    def moved(self, names: Sequence[str], steps: int | NDArray[np.int64]) -> EvenSeries:
        """The same with the values of ``steps`` samples later in these signals; the first or the last one where there is none.

        A boom rests there. What is smoothed moves along, as a delay and a filter may change places.
        """
        wanted = np.arange(len(self.time)) + steps
        at = np.clip(wanted, 0, len(self.time) - 1)
        later = self.with_columns({name: self.columns[name][at] for name in names})
        for name in names:
            later._cache[name, 0] = self.smooth(name)[at]
            later._cache[name, 1] = np.where(at == wanted, self.smooth(name, 1)[at], 0.0)
        return later


UNITS = 1e6
"""Largest ratio of two units that are taken for one another."""


def even_series(recording: Recording) -> EvenSeries:
    """The signals of a recording on a grid of ``PERIOD``.

    Samples that were masked because they lie outside the plausible range are used where their neighbours do, too: a unit or
    a sign that is wrong makes all of them implausible, and is to be found here. Signals without a sample are left out; without a
    gyro the rate is the derivative of the angle.
    """
    time = np.arange(0.0, recording.duration, PERIOD)
    columns = {name: _on_grid(signal, time) for name, signal in recording.signals.items()}
    series = EvenSeries(time, {name: values for name, values in columns.items() if np.isfinite(values).any()})
    if "rate" in series or "angle" not in series:
        return series
    return series.with_columns({"rate": series.smooth("angle", 1)})


def _on_grid(signal: Signal, time: Array) -> Array:
    result = np.full(len(time), np.nan)
    kept = (signal.valid | _implausible(signal)) & np.isfinite(signal.values) & np.isfinite(signal.time)
    own, first = np.unique(signal.time[kept], return_index=True)
    if len(own) < window_samples(PERIOD, WINDOW):
        return result
    values = signal.values[kept][first]
    result = np.interp(time, own, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(own, time), 1, len(own) - 1)
    result[own[after] - own[after - 1] > GAP] = np.nan
    return result


def _implausible(signal: Signal) -> NDArray[np.bool_]:
    """Masked samples outside the channel's range among others of that kind: five in a row, not a flash."""
    channel = BY_NAME[signal.name]
    finite = np.where(np.isfinite(signal.values), signal.values, 0.0)
    middle = median_filter(finite, 5, mode="nearest")
    far = UNITS * max(-channel.low, channel.high)  # no unit makes more of it: it is no measurement
    return ~signal.valid & (np.abs(middle) < far) & ((middle < channel.low) | (middle > channel.high))


def seldom(*signals: Signal) -> str:
    """That the first of these signals that is all one gap was sampled too seldom, in words; empty: none is."""
    for signal in signals:
        time, words = signal.time[signal.valid], signal.name.replace("_", " ")
        if len(time) == 1 < len(signal.time):
            return f"of {len(signal.time)} samples of the {words} one can be used: look at its stamps"
        apart = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
        if apart > GAP:
            return f"the {words} was sampled every {apart:.2g} s, and {GAP:g} s are the most: log 100 samples a second"
    return ""
