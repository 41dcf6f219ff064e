"""The known recording behind the foreign ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from boom_recording.loading import load

DEG = 180 / math.pi
ATMOSPHERE = 101_325.0
BEGIN = datetime(2025, 6, 3, 9, 41, 7, 250_000, tzinfo=UTC)
rng = np.random.default_rng(4)


@dataclass
class Data:
    """The known recording on one grid: t [s], angle [rad], rate [rad/s], pressures [Pa gauge], currents [A]."""

    t: np.ndarray
    q: np.ndarray
    w: np.ndarray
    ph: np.ndarray
    pb: np.ndarray
    ie: np.ndarray
    ir: np.ndarray

    @property
    def temperature(self):
        """Of the oil [degC]."""
        return 38 + 4 * (1 - np.exp(-self.t / 60)) + 0.05 * rng.standard_normal(len(self.t))

    @property
    def supply(self):
        """Supply pressure [Pa]."""
        return 2.1e7 + 2e5 * rng.standard_normal(len(self.t)) - 0.1 * np.maximum(self.w, 0) * 1e7

    @property
    def dates(self):
        """Of the samples."""
        return [BEGIN + timedelta(seconds=float(s)) for s in self.t]

    @property
    def ns(self):
        """Stamps [ns] since 1970."""
        return [round(BEGIN.timestamp() * 1e9) + round(float(s) * 1e9) for s in self.t]


def data_of(bag):
    """The recording without what is missing in it."""
    table = load(bag).on_grid()
    c = table.columns
    names = ("angle", "rate", "hose_pressure", "rod_pressure", "extend_current", "retract_current")
    whole = np.logical_and.reduce([np.isfinite(c[name]) for name in names])
    return Data(table.time[whole], *(c[name][whole] for name in names))
