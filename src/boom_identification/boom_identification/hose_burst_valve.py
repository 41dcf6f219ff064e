"""Coefficients of the hose burst valve by constrained least squares, (5.28)-(5.36), Fig. 5.9.

    q = a_11 d + a_12 sqrt(d) (d >= 0),   a_21 d + a_22 d^2 (node <= d < 0),   a_30 + a_31 d (d < node)

with d in bar and q in l/min. The second and third branch meet with equal value and slope at the node (5.29), which gives
two linear constraints; the first-order conditions (5.35) are one linear system, solved here in closed form. The norms of
(5.30a) are squared, as in least squares. The points come from the data sheet's curve or from recordings.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from boom_identification import estimate
from boom_identification.estimate import Identified, NotDetermined
from boom_identification.stationary import Points
from boom_model.component_numbers import component_parameters
from boom_model.components import hose_burst_valve
from boom_model.machine import Machine, Pose

Array = NDArray[np.float64]

NODE_BAR = -22.0
"""bar. Node of the branches in the thesis (machine notes: it prints +22)."""
COLUMNS = ("pressure_drop_bar", "flow_lpm")
FEWEST_POINTS = 3
"""A branch."""
NAMES = ("a11", "a12", "a21", "a22", "a30", "a31")
_FREE = ("a11", "a12", "a21", "a30", "a31")
_SEEN_BAR = 0.5
"""bar. Smallest range of drops over which a branch counts as seen."""


class CurveError(ValueError):
    """A file of data-sheet points that cannot be used; the message says why."""

    exit_status = 2


@dataclass(frozen=True)
class HoseBurstValveResult:
    """Points of Fig. 5.9 and the fit.

    Attributes:
        source: source of the points, in words.
        drop_bar, flow_lpm: (n,) the points.
        coefficients: (6,) in the order of `NAMES`; None if a branch is not seen.
        node_bar: node of the branches. residual_lpm: rms.
        estimates: estimates for a machine file; only from data-sheet points.
    """

    source: str
    drop_bar: Array
    flow_lpm: Array
    coefficients: Array | None
    node_bar: float
    residual_lpm: float
    estimates: tuple[Identified, ...] = ()
    not_determined: tuple[NotDetermined, ...] = ()

    def flow(self, drop_bar: Array) -> Array:
        """Q (n,) [l/min] of the fit at drops (n,) [bar].

        Raises:
            ValueError: there is no fit.
        """
        if self.coefficients is None:
            raise ValueError("the hose burst valve was not determined")
        return np.asarray(_design(drop_bar, self.node_bar) @ self.coefficients, float)


def constrained_fit(drop_bar: Array, flow_lpm: Array, node_bar: float = NODE_BAR) -> Array:
    """(6,) coefficients that minimise the squared error under (5.29): drops (n,) [bar], flows (n,) [l/min].

    Raises:
        ValueError: a branch has too few points.
    """
    branches = (drop_bar >= 0.0, (drop_bar < 0.0) & (drop_bar >= node_bar), drop_bar < node_bar)
    for chosen, name in zip(branches, ("free flow", "limited flow", "plateau"), strict=True):
        if chosen.sum() < FEWEST_POINTS:
            raise ValueError(f"{int(chosen.sum())} points on the branch of the {name}, {FEWEST_POINTS} are needed")
    design = _design(drop_bar, node_bar)
    demands = np.array([[0, 0, node_bar, node_bar**2, -1.0, -node_bar], [0, 0, 1.0, 2 * node_bar, 0, -1.0]])
    # (5.35): gradient of the Lagrangian and both demands zero
    system = np.block([[2 * design.T @ design, demands.T], [demands, np.zeros((2, 2))]])
    right = np.concatenate((2 * design.T @ flow_lpm, np.zeros(2)))
    return np.asarray(np.linalg.solve(system, right)[:6], float)


def read_curve(path: Path) -> tuple[Array, Array]:
    """(drops [bar], flows [l/min]) of a CSV file with the header ``pressure_drop_bar,flow_lpm``.

    Raises:
        CurveError: not readable, another header, a line that is not a pair of numbers, too few points.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise CurveError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or 'not a text file'}") from None
    header = tuple(cell.strip().lower() for cell in lines[0]) if lines else ()
    if header != COLUMNS:
        raise CurveError(f"{path}: the first line must be {','.join(COLUMNS)}")
    rows = []
    for number, cells in enumerate(lines[1:], 2):
        if not any(cell.strip() for cell in cells):
            continue
        try:
            drop, flow = (float(cell) for cell in cells)
        except ValueError:
            raise CurveError(f"{path}, line {number}: expected two numbers, found {','.join(cells)!r}") from None
        if not np.isfinite([drop, flow]).all():
            raise CurveError(f"{path}, line {number}: the numbers must be finite")
        rows.append((drop, flow))
    if len(rows) < 3 * FEWEST_POINTS:
        raise CurveError(
            f"{path}: {len(rows)} points, at least {FEWEST_POINTS} on each of the three branches are needed"
        )
    table = np.array(rows)
    return table[:, 0], table[:, 1]


def from_curve(drop_bar: Array, flow_lpm: Array, source: str) -> HoseBurstValveResult:
    """The fit to points of the data sheet (n,); every point counts as a separate measurement.

    The node has the least squared error: the machine file's node follows from the same coefficients (5.29), so that a
    rounded one would bend both branches near it.

    Raises:
        ValueError: a branch has too few points, or the fit bends the wrong way.
    """
    node = _best_node(drop_bar, flow_lpm)
    a = constrained_fit(drop_bar, flow_lpm, node)
    if not (a[2] > a[5] >= 0.0 and a[4] < 0.0 and a[0] >= 0.0 and a[1] >= 0.0):
        raise ValueError("the points do not have the shape of (5.28): free flow upwards, a plateau downwards")
    design = _design(drop_bar, node)
    residual = flow_lpm - design @ a
    # two of six are tied by (5.29): the free ones are a_11, a_12, a_30, a_31, the rest follow linearly
    tie = np.zeros((6, 4))
    tie[0, 0] = tie[1, 1] = tie[4, 2] = tie[5, 3] = 1.0
    tie[3, 2], tie[2, 2], tie[2, 3] = -1.0 / node**2, 2.0 / node, 1.0
    reduced = design @ tie
    covariance = tie @ estimate.cluster_covariance(reduced, residual, np.arange(len(residual))) @ tie.T
    units = {"a11": "l/min/bar", "a12": "l/min/bar^0.5", "a21": "l/min/bar", "a30": "l/min", "a31": "l/min/bar"}
    estimates = tuple(
        Identified(
            f"hose_burst_valve.{name}", float(a[NAMES.index(name)]), units[name],
            estimate.interval(float(a[NAMES.index(name)]), float(covariance[NAMES.index(name), NAMES.index(name)])),
            f"(5.36), {len(drop_bar)} points of {source}",
        )
        for name in _FREE
    )  # fmt: skip
    rms = float(np.sqrt(np.mean(residual**2)))
    return HoseBurstValveResult(source, drop_bar, flow_lpm, a, node, rms, estimates)


def _best_node(drop_bar: Array, flow_lpm: Array) -> float:
    """Node [bar] of the least squared error, with enough points on both sides of it; ``NODE_BAR`` if there are too few."""
    negative = np.sort(drop_bar[drop_bar < 0.0])
    if len(negative) < 2 * FEWEST_POINTS:
        return NODE_BAR  # constrained_fit names the branch
    low, high = float(negative[FEWEST_POINTS]), float(negative[-FEWEST_POINTS])

    def error(node: float) -> float:
        return float(np.sum((flow_lpm - _design(drop_bar, node) @ constrained_fit(drop_bar, flow_lpm, node)) ** 2))

    coarse = np.linspace(low, high, 30)[1:]
    best = int(np.argmin([error(float(node)) for node in coarse]))
    around = float(coarse[max(best - 1, 0)]), float(coarse[min(best + 1, len(coarse) - 1)])
    return float(minimize_scalar(error, bounds=around, method="bounded", options={"xatol": 1e-4}).x)


def from_recordings(points: Points, machine: Machine, pose: Pose) -> HoseBurstValveResult:
    """Points (dp_ha, q_a) of recordings, with the friction that the machine file states, and the fit to them.

    p_a is not measured: it follows from the balance of torques, so that errors of friction or load appear in dp_ha here;
    conversely, friction follows from dp_ha (5.38). Recordings determine one only if the other is given; the fit is
    therefore shown and never written to a machine file.
    """
    p, e = component_parameters(machine, pose)
    tau = np.asarray(machine.structure.friction.torque(points.angle, points.rate, points.jacobian, p, e), float).ravel()
    force = (points.gravity_torque + points.inertia * points.acceleration + tau) / points.jacobian
    head = (force + points.rod_pressure * p.cylinder.A_b) / p.cylinder.A_a
    drop = (points.hose_pressure - head) / p.hose_burst_valve.unit_pressure
    flow = points.piston_velocity * p.cylinder.A_a / p.hose_burst_valve.unit_flow
    # noise must not decide the branch: below the resolution of the balance the flow's direction does
    drop = np.where(flow > 0, np.maximum(drop, 0.0), np.minimum(drop, -1e-9))
    why = "only the sum of friction and pressure drop is visible; give points of the data sheet, or friction measured separately"
    reasons = tuple(NotDetermined(f"hose_burst_valve.{name}", why, excitation=False) for name in _FREE)
    _, node = hose_burst_valve.smooth_node(p.hose_burst_valve.a21, p.hose_burst_valve.a30, p.hose_burst_valve.a31)
    source = "recordings, with the machine file's friction"
    seen = np.abs(drop) > _SEEN_BAR
    try:
        a = constrained_fit(drop[seen], flow[seen], float(node))
    except ValueError:  # a branch that the recordings do not reach
        return HoseBurstValveResult(source, drop, flow, None, float(node), float("nan"), (), reasons)
    residual = flow - _design(drop, float(node)) @ a
    rms = float(np.sqrt(np.mean(residual**2)))
    return HoseBurstValveResult(source, drop, flow, a, float(node), rms, (), reasons)


def _design(drop_bar: Array, node_bar: float) -> Array:
    """(n, 6) of (5.32): each point in the columns of its branch."""
    d = np.asarray(drop_bar, float)
    free, limited, plateau = d >= 0.0, (d < 0.0) & (d >= node_bar), d < node_bar
    root = np.sqrt(np.maximum(d, 0.0))
    return np.column_stack((free * d, free * root, limited * d, limited * d**2, plateau * 1.0, plateau * d))
