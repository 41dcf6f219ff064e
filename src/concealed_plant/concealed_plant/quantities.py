"""Every number of the concealed plant by name; the default of an effect's number is its neutral value.

One flat record of floats, because that is what machine code reads fast. SI throughout; pressures are gauge.
"""

from __future__ import annotations

from typing import NamedTuple


class Quantities(NamedTuple):
    """Numbers of the machine, followed by those of the concealed effects."""

    # --- body, locked in its pose
    gravity: float
    inertia: float  # kg m^2, without load
    moment_x: float  # kg m
    moment_y: float
    tip_x: float  # m
    tip_y: float
    load: float  # kg
    # --- oil and cylinder
    density: float
    bulk: float
    discharge: float
    tank: float
    area_a: float
    area_b: float
    stroke: float
    dead_a: float
    dead_b: float
    hose: float
    # --- friction of the cylinder, as a torque
    coulomb_up: float
    coulomb_down: float
    viscous_up: float
    viscous_down: float
    slip: float  # rad/s
    # --- hose burst valve; l/min and bar as its data sheet
    hbv_11: float
    hbv_12: float
    hbv_21: float
    hbv_30: float
    hbv_31: float
    hbv_knee: float  # bar, regularisation at zero
    # --- accumulators
    gas: float
    precharge_1: float
    precharge_2: float
    throat_1: float
    throat_2: float
    kappa: float
    # --- spool
    spool_area: float
    spool_stroke: float
    spring: float
    spool_mass: float
    spool_damping: float
    spool_coulomb: float
    spool_slip: float
    # --- metering edges
    overlap: float
    progression: float
    margin: float
    edge_sa: float
    edge_tb: float
    edge_sb: float
    out_0: float
    out_1: float
    refill: float
    refill_opens: float
    # --- pilot stage
    pole: float
    gain: float
    through: float
    curve_2: float
    curve_1: float
    curve_0: float

    # ------------------------------------------------------------------ bodies, for joints that move
    inertia_scale: float = 1.0
    moment_scale: float = 1.0
    # ------------------------------------------------------------------ load, structure
    load_gyration: float = 0.0  # kg m^2, own inertia of a stiffly held extra load
    extra_load: float = 0.0  # kg, times the course of the load over time
    pendulum_mass: float = 0.0
    pendulum_length: float = 1.5
    pendulum_drag: float = 0.02
    bend_share: float = 0.0
    bend_frequency: float = 2.5  # Hz
    bend_loss: float = 0.02
    rock_compliance: float = 0.0  # rad/(N m)
    rock_frequency: float = 1.0
    rock_loss: float = 0.08
    rest_angle: float = -10.0  # rad, below it something carries the boom
    rest_stiffness: float = 0.0  # N m/rad
    play: float = 0.0  # m, in the pin of the cylinder
    # ------------------------------------------------------------------ friction
    stiction: float = 0.0  # N m
    stiction_rate: float = 0.02
    tight: float = 0.0
    tight_angle: float = 0.5
    tight_below: float = 0.1  # rad, flank towards smaller angles
    tight_above: float = 0.1
    slider_share: float = 0.0  # of the Coulomb torque that sliders carry; the rest stays a tanh
    slider_stiffness: float = 1.0e6  # N m/rad
    # ------------------------------------------------------------------ cylinder, oil, accumulators
    seal_gap: float = 0.0  # m^3/s/Pa^0.5
    spear_length: float = 0.05
    spear_resistance: float = 0.0  # Pa s/m^3 at the very end
    air: float = 0.0
    air_dissolves: float = 4.0e6  # Pa
    gas_lost_1: float = 1.0
    gas_lost_2: float = 1.0
    wall_rate: float = 0.0  # 1/s, gas to wall
    wall_size: float = 6.0  # heat capacity of the wall over that of the gas
    clogged: float = 1.0  # factor of both throats
    clogged_viscous: float = 0.0  # Pa s/m^3
    # ------------------------------------------------------------------ hose burst valve, hose
    poppet_frequency: float = 0.0  # rad/s, 0: no inertia
    poppet_preload: float = 1.0
    kink: float = 0.0  # Pa s^2/m^6, outwards
    kink_angle: float = 0.4
    # ------------------------------------------------------------------ valve, pilot stage, supply, return
    edge_shift_up: float = 0.0
    edge_shift_down: float = 0.0
    jet: float = 0.0
    spring_factor: float = 1.0
    spring_hardening: float = 0.0
    remanence: float = 0.0  # Pa
    remanence_width: float = 0.03  # A
    slower_rising: float = 1.0
    slower_falling: float = 1.0
    sag: float = 0.0
    pump: float = 0.0  # 1 / (m^3/s)
    back_turbulent: float = 0.0  # Pa at full flow
    back_laminar: float = 0.0  # Pa at full flow
