"""Orifice areas of the main valve from stationary points, (5.14)-(5.18) and (5.27), Figs. 5.7, 5.8, 6.2, 6.3.

    A_a = |w_p| A_a / (C_d sqrt(2 / rho) sqrt(dp)),  dp = dp_c (extend) or p_h - p_t (retract); A_b likewise       (5.17)

over the stationary spool position (5.18). Three models are fitted: P-splines of A / A_0 over s_s / s_s^max (5.27), monotone
and zero in the dead zone; polygons for the controller (Figs. 6.2, 6.3); and the law of the machine file, whose numbers a
simulation uses. Everything is relative to A_s, k and dp_c, which come from data sheets (5.8)-(5.12) and from no recording.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from boom_identification import estimate, splines
from boom_identification.estimate import Identified, NotDetermined
from boom_identification.splines import PSpline
from boom_identification.stationary import Points
from boom_model.component_numbers import component_parameters
from boom_model.machine import Machine, Pose
from boom_model.slots import NO_CUSHIONS, Supply
from boom_model.specification import number

Array = NDArray[np.float64]

SIDES = ("extend", "retract")
EDGES = {"A_sa": ("a", "extend"), "A_tb": ("b", "extend"), "A_ta": ("a", "retract"), "A_sb": ("b", "retract")}
"""Edge -> port and direction in which it meters."""
DEFAULT_A0 = 1.0e-4
"""m^2. A_0 of (5.27a), if the machine file does not state it."""
LEAST_DROP = 1.0e5
"""Pa. Smaller pressure drops over an edge do not determine its area."""
SMALLEST_SPREAD = 0.15
"""Smallest range of s_s / s_s^max over which areas make a curve."""
FEWEST_GROUPS = 6
POLYGON_NODES = 5
FLOW_NOISE = 1.0e-5
"""m^3/s. Errors of the flows below this are noise (rate noise over the filter's window times J A_a)."""
STORAGE_ERROR = 0.3
"""Share of the flow into oil and accumulators by which the machine file's numbers may be off (confidence low)."""
LARGEST_STORAGE = 0.1
"""Share of the flow: a point of (5.17) that stores more is not stationary."""
LAW = {
    "x0": "-",
    "n": "-",
    "A_sa_max": "m^2",
    "A_tb_max": "m^2",
    "A_sb_max": "m^2",
    "A_ta_law.c0": "-",
    "A_ta_law.c1": "-",
}
_CATALOGUE = ("main_valve_spool.k", "main_valve_spool.A_s", "main_valve_orifices.dp_c")
_RELATIVE = "no sensor measures the spool: pilot gain and spring, areas and compensator margin act as products; data sheet values"
_OF_SIDE = {"extend": ("A_sa_max", "A_tb_max"), "retract": ("A_sb_max", "A_ta_law.c0", "A_ta_law.c1")}


@dataclass(frozen=True)
class PortAreas:
    """One port, Fig. 5.7 (a) or 5.8 (b).

    Attributes:
        port: ``a`` or ``b``.
        spool: (n,) s_s / s_s^max. area: (n,) [m^2] measured.
        spline: of area / A_0; None if not determined, with the reason in ``why``.
    """

    port: str
    spool: Array
    area: Array
    spline: PSpline | None
    why: str = ""


@dataclass(frozen=True)
class MainValveResult:
    """All results for the areas.

    Attributes:
        A_0: [m^2]. dead_zone: x_0 of the splines. ports: a and b.
        polygons: edge -> (nodes s_s / s_s^max >= 0, areas [m^2]); only edges that were seen.
        estimates, not_determined: of the law in the machine file.
        law: edge -> (s_s / s_s^max, area [m^2]) of the fitted law, for pictures.
        residual_lpm: rms error of the flows under that law [l/min].
    """

    A_0: float
    dead_zone: float
    ports: tuple[PortAreas, PortAreas]
    polygons: dict[str, tuple[Array, Array]]
    estimates: tuple[Identified, ...]
    not_determined: tuple[NotDetermined, ...]
    law: dict[str, tuple[Array, Array]]
    residual_lpm: float

    def document(self) -> dict[str, object]:
        """As in ``identify --json``: areas for a controller."""
        return {
            "A_0": self.A_0,
            "splines": {
                f"A_{port.port}": {
                    "nodes": port.spline.nodes.tolist(), "coefficients": port.spline.coefficients.tolist(),
                    "degree": splines.DEGREE, "smoothing": port.spline.smoothing, "covered": list(port.spline.covered),
                }
                for port in self.ports if port.spline is not None
            },
            "piecewise_linear": {
                edge: {"spool": nodes.tolist(), "area_m2": areas.tolist()}
                for edge, (nodes, areas) in self.polygons.items()
            },
        }  # fmt: skip


def identify_main_valve(
    points: Points, machine: Machine, pose: Pose, smoothing: float | None = None
) -> MainValveResult:
    """Areas of all four edges; ``smoothing``: lambda of (5.24), None: cross-validation."""
    p, _ = component_parameters(machine, pose)
    a_0 = number(machine.document["main_valve_orifices"].get("A_0", DEFAULT_A0))
    points = points.where(np.abs(points.spool) <= machine.structure.metering.largest_opening)
    found, missing, values, residual = _law(points, machine, pose)
    dead_zone = values["x0"]
    drop = {"a": points.hose_pressure - p.fluid.p_t, "b": points.rod_pressure - p.fluid.p_t}
    ports, polygons, law = [], {}, {}
    for port in ("a", "b"):
        area = _areas(points, port, machine.structure.supply, p)
        metered = np.where(_metered_by_tank(points, port), drop[port] > LEAST_DROP, True)
        good = np.isfinite(area) & metered
        chosen = points.where(good)
        area = area[good]
        spline, why = _spline(chosen, area / a_0, dead_zone, smoothing)
        ports.append(PortAreas(port, chosen.spool, area, spline, why))
        for edge, (own, side) in EDGES.items():
            mask = (chosen.spool < 0) == (side == "extend")
            if own == port and _seen(chosen.where(mask)):
                size = np.abs(chosen.spool[mask])
                nodes = np.linspace(dead_zone, float(size.max()), POLYGON_NODES)
                polygons[edge] = (nodes, splines.piecewise_linear(size, area[mask], nodes.tolist()))
    for edge, (port, side) in EDGES.items():
        if edge in polygons:
            x = np.linspace(0.0, 1.0, 101) * (-1.0 if side == "extend" else 1.0)
            law[edge] = (x, _law_area(x, port, values, machine, pose))
    if machine.structure.pilot_valves.present:
        missing = (*missing, *(NotDetermined(key, _RELATIVE, excitation=False) for key in _CATALOGUE))
    return MainValveResult(a_0, dead_zone, (ports[0], ports[1]), polygons, found, missing, law, residual)


def _metered_by_tank(points: Points, port: str) -> NDArray[np.bool_]:
    return (points.spool > 0) if port == "a" else (points.spool < 0)


def _areas(points: Points, port: str, supply: Supply, p: Any) -> Array:
    """(5.17), with the little flow that is stored: area (n,) [m^2] of the edge that meters here; NaN where it is not small."""
    f, c = p.fluid, p.cylinder
    piston = c.A_a if port == "a" else c.A_b
    pressure = points.hose_pressure if port == "a" else points.rod_pressure
    stored = points.head_storage if port == "a" else -points.rod_storage
    flow = points.piston_velocity * piston + stored
    drop = np.where(_metered_by_tank(points, port), pressure - f.p_t, supply.drop(pressure, p))
    with np.errstate(invalid="ignore", divide="ignore"):
        area = np.abs(flow) / (f.C_d * np.sqrt(2.0 / f.rho * drop))
        return np.asarray(np.where(np.abs(stored) < LARGEST_STORAGE * np.abs(flow), area, np.nan), np.float64)


def _seen(points: Points) -> bool:
    if len(np.unique(points.group)) < FEWEST_GROUPS:
        return False
    low, high = np.percentile(np.abs(points.spool), [2, 98])
    return bool(high - low >= SMALLEST_SPREAD)


def _spline(points: Points, area: Array, dead_zone: float, smoothing: float | None) -> tuple[PSpline | None, str]:
    if len(area) == 0:
        return None, "no stationary points"
    low, high = min(float(points.spool.min()), -1.0), max(float(points.spool.max()), 1.0)
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        if not _seen(points.where(np.sign(points.spool) == sign)):
            return None, f"too few spool positions on the side to {side}"
    nodes = splines.dead_zone_nodes(low, high, dead_zone)
    try:
        return splines.monotone_fit(points.spool, area, points.group, nodes, dead_zone, smoothing), ""
    except ValueError as error:
        return None, str(error)


def _law(
    points: Points, machine: Machine, pose: Pose
) -> tuple[tuple[Identified, ...], tuple[NotDetermined, ...], dict[str, float], float]:
    """The machine file's law, fitted to the flows at both ports of all points on the sides with data."""
    prior = {key: machine.parameters[f"main_valve_orifices.{key}"].value[0] for key in LAW}
    sides = [s for s, sign in zip(SIDES, (-1, 1), strict=True) if _seen(points.where(np.sign(points.spool) == sign))]
    free = ["x0", "n", *(key for side in sides for key in _OF_SIDE[side])] if sides else []
    missing = [
        NotDetermined(f"main_valve_orifices.{key}", f"too few spool positions on the side to {side}")
        for side in SIDES if side not in sides for key in _OF_SIDE[side]
    ]  # fmt: skip
    if not free:
        missing += [NotDetermined(f"main_valve_orifices.{key}", "the valve hardly opens") for key in ("x0", "n")]
        return (), tuple(missing), prior, float("nan")
    used = points.where(np.isin(np.sign(points.spool), [(-1 if s == "extend" else 1) for s in sides]))
    free = [key for key in free if prior[key] != 0.0]  # of 0 no share can be sought
    # A number that the points do not tell keeps its old value, and the others are fitted to that.
    while free:
        try:
            found, rms = _fit(used, machine, pose, prior, free)
        except ValueError as error:
            missing += [NotDetermined(f"main_valve_orifices.{key}", str(error)) for key in free]
            break
        vague = [
            NotDetermined(e.key, why)
            for e in found
            if (why := estimate.too_wide(e, machine.parameters[e.key].tolerance))
        ]
        if not vague:
            values = {e.key.removeprefix("main_valve_orifices."): e.value for e in found}
            return tuple(found), tuple(missing), prior | values, rms
        # x_0 and n first: without them the areas are often clear
        shape = [n for n in vague if n.parameter.rpartition(".")[2] in ("x0", "n")]
        missing += shape or vague
        gone = {n.parameter for n in shape or vague}
        free = [key for key in free if f"main_valve_orifices.{key}" not in gone]
    return (), tuple(missing), prior, float("nan")


def _fit(
    used: Points, machine: Machine, pose: Pose, prior: dict[str, float], free: list[str]
) -> tuple[list[Identified], float]:
    """Estimates of the ``free`` numbers of the law, the others at their ``prior``, and the rms error of the flows [l/min].

    Raises:
        ValueError: the points do not separate the numbers.
    """
    p, _ = component_parameters(machine, pose)
    target = np.concatenate(
        (
            used.piston_velocity * p.cylinder.A_a + used.head_storage,
            used.rod_storage - used.piston_velocity * p.cylinder.A_b,
        )
    )
    weight = np.hypot(FLOW_NOISE, STORAGE_ERROR * np.concatenate((used.head_storage, used.rod_storage)))
    predicted = _predicted(used, machine, pose)
    specifications = [machine.parameters[f"main_valve_orifices.{key}"].specification for key in free]
    start = np.array([prior[key] for key in free])
    edges = np.sort(np.array([(s.minimum, s.maximum) for s in specifications]).T / start, axis=0)

    def residuals(z: Array) -> Array:
        flows = predicted(prior | dict(zip(free, z * start, strict=True)))
        return np.asarray((flows - target) / weight, np.float64)

    fit = least_squares(
        residuals, np.ones(len(free)), bounds=(edges[0], edges[1]), loss="soft_l1", f_scale=3.0, x_scale=0.1
    )
    residual = residuals(fit.x)
    groups = np.concatenate((used.group, used.group))
    covariance = estimate.cluster_covariance(_jacobian(residuals, fit.x), residual, groups)
    how = "(5.17), stationary points, relative to A_s, k and dp_c"
    found = []
    for k, key in enumerate(free):
        value = float(fit.x[k] * start[k])
        bounds = estimate.interval(value, float(covariance[k, k]) * start[k] ** 2)
        found.append(Identified(f"main_valve_orifices.{key}", value, LAW[key], bounds, how))
    return found, float(np.sqrt(np.mean((residual * weight) ** 2))) * 6e4


def _jacobian(function: Callable[[Array], Array], x: Array) -> Array:
    columns = []
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = 1e-5
        columns.append((function(x + step) - function(x - step)) / 2e-5)
    return np.column_stack(columns)


def _predicted(points: Points, machine: Machine, pose: Pose) -> Callable[[dict[str, float]], Array]:
    """Function from numbers of the law to the flows (2 n,) [m^3/s] at ports a and b, by the model's own equation."""
    p, e = component_parameters(machine, pose)
    symbols = {key: ca.SX.sym(key) for key in LAW}
    _set(p.main_valve_orifices, symbols)
    spool, hose, rod = (ca.SX.sym(name) for name in ("s", "p_h", "p_b"))
    s = machine.structure
    flows = s.metering.flows(spool * p.main_valve_spool.s_max, hose, rod, p, e, s.supply, NO_CUSHIONS)
    order = list(LAW)
    function = ca.Function("flows", [spool, hose, rod, *(symbols[key] for key in order)], [flows.head, flows.rod])
    inputs = [points.spool[None, :], points.hose_pressure[None, :], points.rod_pressure[None, :]]
    mapped = function.map(len(points))

    def predicted(values: dict[str, float]) -> Array:
        numbers = [np.full((1, len(points)), values[key]) for key in order]
        head, rod_flow = mapped(*inputs, *numbers)
        return np.concatenate((np.asarray(head, float).ravel(), np.asarray(rod_flow, float).ravel()))

    return predicted


def _law_area(x: Array, port: str, values: dict[str, float], machine: Machine, pose: Pose) -> Array:
    """Area [m^2] of the law at spool positions x (n,): its flow at one pressure, over that of an area of one."""
    p, e = component_parameters(machine, pose)
    _set(p.main_valve_orifices, values)
    pressure = p.fluid.p_t + 1e6
    s = machine.structure
    flows = s.metering.flows(x * p.main_valve_spool.s_max, pressure, pressure, p, e, s.supply, NO_CUSHIONS)
    flow = np.abs(np.asarray(flows.head if port == "a" else flows.rod, float).ravel())
    drop = np.where((x > 0) == (port == "a"), 1e6, s.supply.drop(pressure, p))
    return np.asarray(flow / (p.fluid.C_d * np.sqrt(2.0 / p.fluid.rho * drop)), np.float64)


def _set(orifices: object, values: Mapping[str, object]) -> None:
    for key, value in values.items():
        *path, last = key.split(".")
        node = orifices
        for part in path:
            node = getattr(node, part)
        setattr(node, last, value)
