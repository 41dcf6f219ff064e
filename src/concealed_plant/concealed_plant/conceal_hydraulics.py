"""Cylinder, oil, accumulators, hose burst valve, main valve, pilot stage, supply, return line: the concealed forms."""

from __future__ import annotations

from math import sqrt

import numpy as np

from concealed_plant.hidden import Array, Hidden, Scene, conceals, sign, within
from concealed_plant.kernel import FULL_FLOW, LPM, limited
from concealed_plant.plant import PERIOD, Courses


@conceals(
    "piston_leakage", "cylinder", "l/min at 100 bar", (0.003, 12.0), "turbulent, with the square root of the drop"
)
def piston_leakage(size: float, _r: Array, _scene: Scene) -> Hidden:
    """Flow past the seal."""
    return Hidden({"seal_gap": size * LPM / sqrt(1e7)})


@conceals(
    "end_cushioning",
    "cylinder",
    "Pa s/m^3",
    (1e7, 1e12),
    "a laminar gap whose resistance grows with the overlap",
    manner="ends",
    stretched=True,
)
def end_cushioning(size: float, r: Array, _scene: Scene) -> Hidden:
    """A spear enters before the end of stroke."""
    return Hidden({"spear_resistance": size, "spear_length": within(r[0], 0.05, 0.1)})


@conceals("entrained_air", "oil", "-", (5e-5, 0.1), "isothermal, going into solution with pressure (Henry)")
def entrained_air(size: float, r: Array, _scene: Scene) -> Hidden:
    """Air in the oil."""
    return Hidden({"air": size, "air_dissolves": within(r[0], 3.0e6, 6.0e6)})


@conceals(
    "accumulator_precharge",
    "accumulators",
    "-",
    (0.004, 0.8),
    "the two have not lost the same",
    twins=("accumulators.p_g0_1", "accumulators.p_g0_2"),
    tolerance=0.05,
)
def accumulator_precharge(size: float, r: Array, _scene: Scene) -> Hidden:
    """Gas lost, or too much gas filled in."""
    share = 1.0 - size if r[0] < 0.8 else 1.0 + min(size, 0.05) + 0.3 * max(size - 0.05, 0.0)
    return Hidden({"gas_lost_1": share + 0.1 * size, "gas_lost_2": share - 0.1 * size}, parameters={"r": share})


@conceals(
    "accumulator_heat_loss",
    "accumulators",
    "1/s",
    (0.001, 2.0),
    "to a wall that warms itself, faster for larger differences",
)
def accumulator_heat_loss(size: float, r: Array, _scene: Scene) -> Hidden:
    """Gas that exchanges heat."""
    return Hidden({"wall_rate": size, "wall_size": within(r[0], 4.0, 10.0)})


@conceals(
    "accumulator_restrictor",
    "accumulators",
    "-",
    (0.004, 0.8),
    "clogged: narrower and partly laminar",
    twins=("accumulators.d_1", "accumulators.d_2"),
    tolerance=0.04,
)
def accumulator_restrictor(size: float, _r: Array, _scene: Scene) -> Hidden:
    """The throats in the accumulators' ports."""
    return Hidden({"clogged": 1.0 - 0.75 * size, "clogged_viscous": 4.0e9 * size})


@conceals(
    "hose_burst_valve_lag", "hose_burst_valve", "s", (0.001, 0.4), "a poppet with mass: second order, critically damped"
)
def hose_burst_valve_lag(size: float, _r: Array, _scene: Scene) -> Hidden:
    """The poppet needs time; tau is the delay of the ramp that both forms have in common."""
    return Hidden({"poppet_frequency": 2.0 / size}, parameters={"tau": size})


@conceals(
    "hose_burst_valve_setting",
    "hose_burst_valve",
    "-",
    (0.003, 0.6),
    "the preload moves the knee, the slope at zero stays",
    twins=("hose_burst_valve.a30", "hose_burst_valve.a31", "hose_burst_valve.a21"),
    tolerance=0.03,
)
def hose_burst_valve_setting(size: float, r: Array, scene: Scene) -> Hidden:
    """The valve limits at another flow; r is its factor at the mean difference at which the undisturbed valve limits."""
    factor, drop = 1.0 - size if r[0] < 0.7 else 1.0 + size, scene.limited_drop
    flow = limited(drop, scene.m._replace(poppet_preload=factor)) / limited(drop, scene.m)
    return Hidden({"poppet_preload": factor}, parameters={"r": flow})


@conceals("valve_dead_zone", "main_valve", "-", (0.0005, 0.2), "the edges are moved bodily, their slope stays")
def valve_dead_zone(size: float, r: Array, _scene: Scene) -> Hidden:
    """Overlap differs, in one direction or in both."""
    up, down = sign(r[0]) * size, sign(r[1]) * size * within(r[2], 0.0, 1.0)
    if r[3] < 0.5:
        up, down = down, up
    return Hidden({"edge_shift_up": up, "edge_shift_down": down}, parameters={"d_extend": up, "d_retract": down})


@conceals(
    "valve_hysteresis",
    "main_valve pilot_valves",
    "-",
    (0.0003, 0.15),
    "remanence of the coil that saturates with travel, no play",
)
def valve_hysteresis(size: float, r: Array, scene: Scene) -> Hidden:
    """Position depends on whether the current rises or falls."""
    full = scene.m.spring * scene.m.spool_stroke / scene.m.spool_area
    changes = {"remanence": size * full, "remanence_width": within(r[0], 0.02, 0.05)}
    return Hidden(changes, parameters={"h": size})


@conceals(
    "flow_force", "main_valve", "m^2", (3e-8, 3e-4), "area times drop with a jet angle that turns as the edge opens"
)
def flow_force(size: float, _r: Array, _scene: Scene) -> Hidden:
    """Flow that closes the spool."""
    return Hidden({"jet": size})


@conceals(
    "spring_rate",
    "main_valve pilot_valves",
    "-",
    (0.003, 0.5),
    "a spring that hardens",
    twins=("main_valve_spool.k", "pilot_valves.h.0"),
    tolerance=0.212,
    met="spring_factor",
)
def spring_rate(size: float, r: Array, _scene: Scene) -> Hidden:
    """Return spring, or pilot gain."""
    factor = 1.0 + size if r[0] < 0.5 else 1.0 / (1.0 + size)
    return Hidden({"spring_factor": factor, "spring_hardening": 0.1 * r[1] * size}, parameters={"r": factor})


@conceals(
    "compensator_droop", "main_valve supply", "-", (0.003, 0.9), "the margin sinks with flow and with load pressure"
)
def compensator_droop(size: float, _r: Array, _scene: Scene) -> Hidden:
    """The compensator's spring yields."""
    return Hidden({"sag": size})


@conceals(
    "pilot_lag",
    "pilot_valves",
    "-",
    (0.003, 4.0),
    "slower, and not equally so where the pressure rises and where it falls",
    twins=("pilot_valves.a1_s",),
    tolerance=0.03,
)
def pilot_lag(size: float, r: Array, _scene: Scene) -> Hidden:
    """Cold oil, which leaves through another passage than it enters."""
    unlike = within(r[0], -0.4, 0.4)
    changes = {"slower_rising": 1.0 + (1.0 + unlike) * size, "slower_falling": 1.0 + (1.0 - unlike) * size}
    return Hidden(changes, parameters={"r": 1.0 + size})


@conceals("command_delay", "pilot_valves", "s", (0.0005, 0.3), "differs from command to command by up to 1.5 ms")
def command_delay(size: float, r: Array, scene: Scene) -> Hidden:
    """Dead time between current and valve."""
    count = round(scene.duration * 1000) // PERIOD
    jitter = np.random.default_rng(int(r[0] * 2**32)).uniform(-1.5, 1.5, count)
    return Hidden(late=np.maximum(0.0, 1000.0 * size + jitter), parameters={"T": size})


@conceals("pump_flow_limit", "supply", "-", (0.002, 0.75), "a hard limit that sinks with pressure")
def pump_flow_limit(size: float, _r: Array, scene: Scene) -> Hidden:
    """The pump cannot deliver the flow that the valve requests; the size is the missing share of its largest flow and a reserve."""
    return Hidden({"pump": 1.0 / (scene.peak * (1.1 - size))})


@conceals(
    "return_line_pressure", "return_line", "Pa at 120 l/min", (5e3, 6e6), "flow to the power 1.75, with a laminar share"
)
def return_line_pressure(size: float, r: Array, _scene: Scene) -> Hidden:
    """A filter that clogs."""
    laminar = within(r[0], 0.1, 0.4)
    return Hidden({"back_turbulent": (1.0 - laminar) * size, "back_laminar": laminar * size})


# ------------------------------------------------------------------------------------------------- outside the catalogue


@conceals(
    "spool_sticks",
    "main_valve pilot_valves",
    "s",
    (0.02, 5.0),
    "the spool stays where it is for a while, some times",
    known=False,
)
def spool_sticks(size: float, r: Array, scene: Scene) -> Hidden:
    """Dirt holds the spool shortly after a motion has begun."""
    time, stuck = scene.milliseconds, np.zeros(round(scene.duration * 1000))
    every = 3 if r[0] < 0.5 else 4
    for begin in scene.starts[int(r[1] * 2) :: every]:
        begin = begin + 0.15 + 0.4 * r[2]
        stuck[(time >= begin) & (time < begin + size)] = 1.0
    return Hidden(courses=Courses(stuck=stuck))


@conceals(
    "supply_disturbed", "supply main_valve", "-", (0.005, 0.95), "another function takes oil for seconds", known=False
)
def supply_disturbed(size: float, r: Array, scene: Scene) -> Hidden:
    """The share of the flow that is missing while another function moves."""
    time, share = scene.milliseconds, np.ones(round(scene.duration * 1000))
    rng = np.random.default_rng(int(r[0] * 2**32))
    for begin in scene.starts:
        if rng.uniform() < 0.55:
            begin, length = begin + rng.uniform(0.0, 1.0), rng.uniform(0.6, 2.5)
            share[(time >= begin) & (time < begin + length)] = 1.0 - size
    return Hidden(courses=Courses(supply=share))


@conceals(
    "hose_kinked",
    "return_line main_valve hose_burst_valve",
    "Pa at 120 l/min",
    (2e4, 5e8),
    "closes below an angle, outwards only",
    known=False,
)
def hose_kinked(size: float, r: Array, scene: Scene) -> Hidden:
    """The head-side hose folds when the boom is low."""
    return Hidden({"kink": size / FULL_FLOW**2, "kink_angle": scene.between(within(r[0], 0.35, 0.65))})
