"""How well a boom followed its reference: the piston's position error (6.29), from columns or from a recording.

    e_k = s_p(q_2*,k) - s_p(q_2,k),  MAE = mean |e_k|,  MAXE = max |e_k|,  RMSE = sqrt(mean e_k^2)

q_2* is the reference after the trajectory generator, q_2 the angle of the same moment. Table 6.3 prints the three in mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_model.errors import ModelError
from boom_model.machine import Machine
from boom_recording.channels import REFERENCE_STATE
from boom_recording.recording import Recording

Array = NDArray[np.float64]

THESIS = {
    "C0": (1.3e-3, 7.9e-3, 1.9e-3), "C1": (2.9e-3, 21.5e-3, 4.4e-3), "C2": (3.8e-3, 32.5e-3, 6.1e-3),
    "C3": (3.8e-3, 33.0e-3, 6.0e-3), "C4": (3.7e-3, 32.4e-3, 5.8e-3),
}  # fmt: skip
"""Table 6.3 of the thesis: MAE, MAXE, RMSE [m] of the five configurations."""

_TABLE_STEP = 1e-3
_SAME_MOMENT_NS = 1_000_000


class TrackingError(ModelError):
    """A recording that tells nothing about tracking; the message says what is missing."""


@dataclass(frozen=True)
class Errors:
    """Mean absolute, largest absolute and root mean square error of the piston's position [m]."""

    mae: float
    maxe: float
    rmse: float

    def document(self) -> dict[str, float]:
        """In mm, as ``robustness --json`` names them."""
        return {"mae_mm": 1e3 * self.mae, "maxe_mm": 1e3 * self.maxe, "rmse_mm": 1e3 * self.rmse}


@dataclass(frozen=True)
class Tracking:
    """A followed reference: time (n,) [s], both angles (n,) [rad], the piston's error (n,) [m] and its measures."""

    time: Array
    reference: Array
    angle: Array
    error: Array
    errors: Errors


def errors(error: Array) -> Errors:
    """The three measures of (6.29) of an error (n,) [m], n > 0."""
    size = np.abs(error)
    return Errors(float(size.mean()), float(size.max()), float(np.sqrt(np.mean(error**2))))


def piston_positions(machine: Machine, angle: Array) -> Array:
    """s_p [m] of many boom angles (n,) [rad]: the linkage on a grid of 1 mrad, and straight lines between (below 1e-7 m)."""
    low, high = float(np.min(angle)), float(np.max(angle))
    grid = np.linspace(low, max(high, low + _TABLE_STEP), max(int((high - low) / _TABLE_STEP) + 2, 3))
    return np.interp(angle, grid, [machine.piston_position(float(q)) for q in grid])


def track(machine: Machine, time: Array, reference: Array, angle: Array) -> Tracking:
    """Compares columns of one grid: time (n,) [s], reference and angle (n,) [rad]. Raises TrackingError where n is zero."""
    if len(time) == 0:
        raise TrackingError("reference and angle are never known at the same time")
    error = piston_positions(machine, reference) - piston_positions(machine, angle)
    return Tracking(time, reference, angle, error, errors(error))


def of_recording(recording: Recording, machine: Machine) -> Tracking:
    """The tracking of a recording that holds ``/boom/reference_state``.

    The reference carries the stamp of the angle that it was compared with. Moments at which the reference stands still before it
    moves for the first time are left out: a boom that only rests would flatter the mean.

    Raises:
        TrackingError: the recording has no such reference, or no angle at its stamps.
    """
    wanted, shown = recording.signals.get("smooth_reference_angle"), recording.signals.get("angle")
    if wanted is None or shown is None or not wanted.valid.any() or not shown.valid.any():
        raise TrackingError(f"{recording.name}: tracking needs {REFERENCE_STATE} and /joint_states: record both")
    stamps, angles = shown.stamps_ns[shown.valid], shown.values[shown.valid]
    asked = wanted.stamps_ns[wanted.valid]
    k = np.minimum(np.searchsorted(stamps, asked - _SAME_MOMENT_NS), len(stamps) - 1)
    same = np.abs(stamps[k] - asked) <= _SAME_MOMENT_NS
    time = wanted.time[wanted.valid][same]
    reference = wanted.values[wanted.valid][same]
    rate = recording.signals["smooth_reference_rate"].values[wanted.valid][same]
    moving = np.flatnonzero(np.abs(rate) > 1e-6)
    first = int(moving[0]) if len(moving) else 0
    return track(machine, time[first:], reference[first:], angles[k[same]][first:])
