"""Signals for the page of the moving crane: on one grid, in whole steps, compressed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_identification.validation import noise_limits
from boom_input.channels import PREDICTED, SENSORS
from boom_model.machine import Machine
from boom_report.packing import runs, steps
from boom_report.validation.verdict import WINDOW, WINDOW_FACTOR

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """What the page shows of a recording.

    Attributes:
        name: of the recording.
        period: [s] of the grid, which begins at 0.
        measured: channel -> (n,) [SI, gauge], NaN without a sample.
        models: label of a model -> channel -> (n,).
        limits: channel -> rms difference over a second beyond which machine and model part, see :func:`limits`.
    """

    name: str
    period: float
    measured: Mapping[str, Array]
    models: Mapping[str, Mapping[str, Array]]
    limits: Mapping[str, float]

    def thinned(self, most: int) -> Series:
        """The same with at most ``most`` samples, one of every so many."""
        step = max(1, -(-max((len(v) for v in self.measured.values()), default=0) // most))

        def every(values: Mapping[str, Array]) -> dict[str, Array]:
            return {name: v[::step] for name, v in values.items()}

        models = {label: every(values) for label, values in self.models.items()}
        return Series(self.name, self.period * step, every(self.measured), models, self.limits)

    def document(self) -> dict[str, Any]:
        """As the page reads it; ``marks``: for each model where it parts from the machine."""
        return {
            "name": self.name,
            "period": self.period,
            "measured": {name: steps(v) for name, v in self.measured.items()},
            "models": [
                {"label": label, "values": {n: steps(v) for n, v in values.items()}, "marks": self.marks(label)}
                for label, values in self.models.items()
            ],
        }

    def marks(self, label: str) -> list[dict[str, Any]]:
        """Where a model of this label parts from the machine: channel, start and end [s], largest difference [SI]."""
        found = []
        for name, limit in self.limits.items():
            if name not in self.measured or name not in self.models[label]:
                continue
            error = self.models[label][name] - self.measured[name]
            for first, last in runs(_rms(error, round(WINDOW / self.period)) > limit):
                beyond = first + np.flatnonzero(
                    np.abs(error[first:last]) > limit
                )  # the window looks ahead, a mark does not
                if not len(beyond):
                    continue
                a, b = int(beyond[0]), int(beyond[-1]) + 1
                found.append(
                    {"channel": name, "start": a * self.period, "end": b * self.period,
                     "largest": float(np.nanmax(np.abs(error[a:b])))}
                )  # fmt: skip
        return sorted(found, key=lambda mark: mark["start"])


def limits(machine: Machine) -> dict[str, float]:
    """Rms difference [SI] over a second beyond which machine and model part: as a validation tells where a recording differs."""
    judged = noise_limits(machine)
    return {s.name: WINDOW_FACTOR * (judged[s.judging] or np.inf) for s in PREDICTED if s.name != "rate"}


def shown() -> list[dict[str, Any]]:
    """The channels as the page names them: key, label, unit for people and how many of it one SI unit is."""
    return [{"name": s.name, "label": s.label, "unit": s.shown.name, "scale": s.shown.scale} for s in SENSORS]


def _rms(error: Array, width: int) -> Array:
    """Root mean square (n,) over a window of ``width`` samples around each; samples that are missing do not count."""
    window = np.ones(max(1, min(width, len(error))))
    known = np.isfinite(error)
    count = np.convolve(known.astype(float), window, "same")
    total = np.convolve(np.where(known, error, 0.0) ** 2, window, "same")
    rms: Array = np.sqrt(np.maximum(total, 0.0) / np.maximum(count, 1.0))
    return np.where(known, rms, 0.0)


NEXT = 0.75
"""Times between two samples, from one of them: with some jitter the next one is nearer."""


def on_grid(time: Mapping[str, Array], values: Mapping[str, Array], period: float, count: int) -> dict[str, Array]:
    """Samples at their own times (n,) [s] on a grid of ``count`` periods: the nearest within one period, NaN without.

    Of a channel that is sampled more seldom, the nearest where no sample is lost.
    """
    at = np.arange(count) * period
    result = {}
    for name, v in values.items():
        known = np.isfinite(v)
        own, v = time[name][known], v[known]
        column = np.full(count, np.nan)
        if len(own):
            right = np.clip(np.searchsorted(own, at), 0, len(own) - 1)
            left = np.maximum(right - 1, 0)
            nearest = np.where(np.abs(own[left] - at) < np.abs(own[right] - at), left, right)
            usual = float(np.median(np.diff(own))) if len(own) > 1 else 0.0
            near = np.abs(own[nearest] - at) <= max(period, NEXT * usual)
            column[near] = v[nearest[near]]
        result[name] = column
    return result
