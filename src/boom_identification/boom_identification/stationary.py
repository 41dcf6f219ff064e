"""Stationary points of recordings of the machine, (5.14): what ch. 5.2 and 5.3 are identified from.

Angle rate, pressures and currents are smoothed and differentiated by a Savitzky-Golay filter on the recording's 100 Hz
grid. Missing samples are bridged for the filter, up to 30 ms; their own points do not count. A
point is stationary where currents, pressures and rate have been nearly constant for a settling time, which the pilot
stage (51 ms) and the creeping spool (f_c / sigma_s over k: 94 ms) need.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_estimation.joint_torque import joint_torque
from boom_identification import signals
from boom_input.channels import CURRENTS
from boom_model.component_numbers import component_parameters
from boom_model.components import accumulator, cylinder, equation_of_motion
from boom_model.machine import Machine, Pose
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Recording

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

PERIOD = 0.01
"""s. Grid of the recordings (ch. 4.2)."""
WINDOW = 0.25
"""s. Savitzky-Golay window."""
BRIDGED = 3
"""Samples that may be missing in a row within a window."""
SETTLING = 0.3
"""s. All signals must have been nearly constant for this time."""
LARGEST_PRESSURE_RATE = 1.0e6
"""Pa/s. Oil and gas then store a few percent of a usual flow, which `Points` holds."""
LARGEST_ACCELERATION = 0.05
"""rad/s^2."""
LARGEST_SPOOL_RATE = 0.1
"""1/s, of s_s / s_s^max."""
SMALLEST_RATE = 0.01
"""rad/s. Below it the boom counts as resting: friction has no direction there, and flows are within noise."""
_CHANNELS = (*OUTPUTS, *(channel.name for channel in CURRENTS))


@dataclass(frozen=True)
class Points:
    """Stationary points of several recordings, arrays (n,), SI.

    Attributes:
        group: number of the stretch that a point belongs to. bag: number of its recording.
        time: [s]. angle, rate, acceleration: [rad], [rad/s], [rad/s^2]. hose_pressure, rod_pressure: [Pa].
        spool: s_s / s_s^max by (5.18). jacobian: [m/rad]. gravity_torque: [N m]. inertia: [kg m^2].
        head_storage, rod_storage: flow [m^3/s] stored in oil and accumulators, from the machine file's numbers and the
            measured pressures; (5.15) leaves it out, but an accumulator fills and empties for seconds behind its orifice.
        excluded: reason -> number of samples that are not points.
        bags: names of the recordings.
    """

    group: NDArray[np.int64]
    bag: NDArray[np.int64]
    time: Array
    angle: Array
    rate: Array
    acceleration: Array
    hose_pressure: Array
    rod_pressure: Array
    spool: Array
    jacobian: Array
    gravity_torque: Array
    inertia: Array
    head_storage: Array
    rod_storage: Array
    excluded: dict[str, int] = field(default_factory=dict)
    bags: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rate)

    @property
    def piston_velocity(self) -> Array:
        """w_p (n,) [m/s], (3.13b)."""
        return self.jacobian * self.rate

    def where(self, chosen: Flags) -> Points:
        """A selection of the points; ``excluded`` is unchanged."""
        arrays = {name: getattr(self, name)[chosen] for name in _ARRAYS}
        return Points(**arrays, excluded=self.excluded, bags=self.bags)


_ARRAYS = (
    "group", "bag", "time", "angle", "rate", "acceleration", "hose_pressure", "rod_pressure", "spool", "jacobian",
    "gravity_torque", "inertia", "head_storage", "rod_storage",
)  # fmt: skip


def pose_of(recording: Recording, machine: Machine) -> Pose:
    """Configured pose and load of the recording; an unknown load counts as none.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    c = recording.configuration
    load = 0.0 if math.isnan(c.load_mass) else c.load_mass
    return machine.pose(c.outer_boom_angle, c.telescope_length, load)


def stationary_points(recordings: Sequence[Recording], machine: Machine) -> Points:
    """The points of all recordings, each in its own pose.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    excluded = dict.fromkeys(("missing samples", "at rest", "changing", "spool closed or not settled"), 0)
    parts: list[dict[str, Array]] = []
    groups = 0
    for number, recording in enumerate(recordings):
        columns, counted = _points(recording, machine)
        for reason, count in counted.items():
            excluded[reason] += count
        columns["group"] += groups
        groups += int(columns["group"].max() - groups + 1) if len(columns["group"]) else 0
        columns["bag"] = np.full(len(columns["time"]), number)
        parts.append(columns)
    merged = {name: np.concatenate([part[name] for part in parts]) if parts else np.empty(0) for name in _ARRAYS}
    for name in ("group", "bag"):
        merged[name] = merged[name].astype(np.int64)
    return Points(**merged, excluded=excluded, bags=tuple(r.name for r in recordings))  # type: ignore[arg-type]


def _points(recording: Recording, machine: Machine) -> tuple[dict[str, Array], dict[str, int]]:
    pose = pose_of(recording, machine)
    p, e = component_parameters(machine, pose)
    table = recording.on_grid(PERIOD)
    if not np.isfinite(table.columns["rate"]).any():  # no gyro: the window smooths the angle's derivative
        table.columns["rate"] = np.gradient(table.columns["angle"], PERIOD)
    known = np.logical_and.reduce([np.isfinite(table.columns[name]) for name in _CHANNELS])
    n = len(table.time)
    raw = {name: np.full(n, np.nan) for name in _CHANNELS}
    for first, end in _bridged(known):
        for name in _CHANNELS:
            own = np.flatnonzero(np.isfinite(table.columns[name][first:end])) + first
            raw[name][first:end] = np.interp(table.time[first:end], table.time[own], table.columns[name][own])

    def filtered(values: Array, derivative: int = 0) -> Array:
        result = np.full(n, np.nan)
        for first, end in signals.stretches(np.isfinite(values)):
            result[first:end] = signals.smoothed(values[first:end], PERIOD, WINDOW, derivative)
        return result

    current = {name: filtered(raw[name]) for name in ("retract_current", "extend_current")}
    s = machine.structure
    position = s.spool.position(current["retract_current"], current["extend_current"], p, s.pilot_valves)
    spool = np.asarray(position / p.main_valve_spool.s_max, np.float64)  # (5.18), (5.27b)
    lag = s.spool.settling(p, e, s.pilot_valves)
    rate, acceleration = filtered(raw["rate"]), filtered(raw["rate"], 1)
    hose_rate, rod_rate = filtered(raw["hose_pressure"], 1), filtered(raw["rod_pressure"], 1)
    into_gas = np.full(n, np.nan)
    hose = filtered(raw["hose_pressure"])
    for first, end in signals.stretches(np.isfinite(hose)):
        into_gas[first:end] = _accumulator_flow(hose[first:end], s.accumulators.cells(p, e), p)
    with np.errstate(invalid="ignore"):
        constant = np.abs(hose_rate) < LARGEST_PRESSURE_RATE
        constant &= np.abs(rod_rate) < LARGEST_PRESSURE_RATE
        constant &= np.abs(acceleration) < LARGEST_ACCELERATION
        creep = filtered(spool, 1)
        still = np.abs(creep) < LARGEST_SPOOL_RATE
        moving = np.abs(rate) > SMALLEST_RATE
        # The spool must be where its sign says the boom goes; else it closes, or its dead zone is crossed.
        agrees = np.sign(spool) == -np.sign(rate)
    # While the currents still drift, the spool lags behind (5.18) by the time constants of pilot stage and spool.
    spool = spool - creep * lag
    settled = _held(still, round(SETTLING / PERIOD))
    usable = known & np.isfinite(rate) & np.isfinite(acceleration) & np.isfinite(creep)
    chosen = usable & moving & constant & settled & agrees
    counted = {
        "missing samples": int((~usable).sum()),
        "at rest": int((usable & ~moving).sum()),
        "changing": int((usable & moving & ~constant).sum()),
        "spool closed or not settled": int((usable & moving & constant & ~(settled & agrees)).sum()),
    }
    group = np.cumsum(np.diff(np.concatenate(([False], chosen)).astype(np.int8)) == 1) - 1
    k = np.flatnonzero(chosen)
    columns: dict[str, Any] = {
        "group": group[k].astype(np.int64), "time": table.time[k], "angle": filtered(raw["angle"])[k],
        "rate": rate[k], "acceleration": acceleration[k], "hose_pressure": hose[k],
        "rod_pressure": filtered(raw["rod_pressure"])[k], "spool": spool[k],
    }  # fmt: skip
    plant = Plant(machine, pose)
    states = np.tile(plant.rest_state(0.0, 1e6, 1e6), (len(k), 1))
    states[:, 0], states[:, 1] = columns["angle"], columns["rate"]
    inner = dict.fromkeys(("jacobian", "gravity_torque", "piston_position"), np.empty(0))
    if len(k):
        inner |= plant.auxiliary(states, np.zeros((len(k), 2)))
    columns |= {name: inner[name] for name in ("jacobian", "gravity_torque")}
    asked = joint_torque(recording, machine, pose)
    columns["gravity_torque"] += asked.at(*(columns[name] for name in ("time", "angle", "rate", "acceleration")))
    position, beta = inner["piston_position"], p.fluid.beta
    head = (cylinder.head_volume(position, p) + p.cylinder.V_h) / beta
    columns["head_storage"] = head * hose_rate[k] + into_gas[k]
    columns["rod_storage"] = cylinder.rod_volume(position, p) / beta * rod_rate[k]
    columns["inertia"] = np.full(len(k), float(equation_of_motion.inertia(pose.load, p)))
    return columns, counted


def _accumulator_flow(hose_pressure: Array, cells: Sequence[tuple[float, float]], p: Any) -> Array:
    """q_o (n,) [m^3/s] into all accumulators behind p_h (n,) [Pa] on the grid, (3.19), (5.39j,k), from rest.

    cells: pre-charge [Pa] and diameter of the orifice [m] of each.
    Steps of a tenth of the grid; an accumulator that would run past the hose's pressure within one has reached it.
    """
    fine = np.interp(np.arange(0.0, len(hose_pressure) - 0.05, 0.1), np.arange(len(hose_pressure)), hose_pressure)
    total = np.zeros(len(hose_pressure))
    for charge, diameter in cells:
        p_h, p_o = ca.SX.sym("p_h"), ca.SX.sym("p_o")
        flow = accumulator.orifice_flow(p_h, p_o, charge, diameter, p)
        reached = p_o + 0.1 * PERIOD * accumulator.pressure_rate(p_o, flow, charge, p.fluid.beta, p)
        after = ca.if_else((reached - p_h) * (p_o - p_h) < 0, ca.fmax(p_h, charge), reached)
        step = ca.Function("step", [p_o, p_h], [after, flow])
        _, flows = step.mapaccum(len(fine))(max(float(fine[0]), charge), fine[None, :])
        total += np.asarray(flows, float).ravel()[::10][: len(total)]
    return total


def _bridged(known: Flags) -> list[tuple[int, int]]:
    """Stretches in which at most BRIDGED samples in a row are not known."""
    runs = signals.stretches(known)
    joined: list[tuple[int, int]] = []
    for first, end in runs:
        if joined and first - joined[-1][1] <= BRIDGED:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((first, end))
    return joined


def _held(flags: Flags, count: int) -> Flags:
    """Where a flag has been true for the last ``count`` samples."""
    since = np.zeros(len(flags), bool)
    for first, end in signals.stretches(flags):
        since[first + count : end] = True
    return since
