"""Where everything lies in the arrays that the compiled equations work on: numbers, states, effects, courses over time."""

from __future__ import annotations

from typing import NamedTuple, Protocol, overload


class Values(Protocol):
    """A state, its rates, a row of courses or of an effect: an array of one dimension, for the type checker."""

    def __getitem__(self, k: int, /) -> float:
        """One value."""

    def __setitem__(self, k: int, value: float, /) -> None:
        """Change one value."""


class EffectTable(Protocol):
    """All effects: an array of two dimensions, for the type checker."""

    @overload
    def __getitem__(self, k: int, /) -> Values: ...
    @overload
    def __getitem__(self, k: tuple[int, int], /) -> float: ...


class CraneNumbers(NamedTuple):
    """Every number of one crane [SI], a structure told by ``bars``, ``burst``, ``gas``, ``piloted``, ``compensated`` (1 or 0)."""

    g: float
    rho: float
    beta: float
    C_d: float
    p_t: float
    p_s: float
    A_a: float
    A_b: float
    stroke: float
    V_a: float
    V_b: float
    V_h: float
    bars: float
    foot_x: float
    foot_y: float
    pivot_x: float
    pivot_y: float
    att_x: float
    att_y: float
    L1: float
    L2: float
    side_a: float
    side_b: float
    corner: float
    l_min: float
    q_low: float
    q_high: float
    inertia: float
    S_x: float
    S_y: float
    tip_x: float
    tip_y: float
    load: float
    tau_up: float
    tau_down: float
    k_up: float
    k_down: float
    sigma: float
    burst: float
    a11: float
    a12: float
    a21: float
    a30: float
    a31: float
    d_lin: float
    gas: float
    V_g: float
    p_1: float
    p_2: float
    d_1: float
    d_2: float
    kappa: float
    piloted: float
    A_s: float
    s_max: float
    k_s: float
    m_s: float
    d_v: float
    f_c: float
    sigma_s: float
    K_i: float
    T_s: float
    pole: float
    feed: float
    through: float
    h_2: float
    h_1: float
    h_0: float
    compensated: float
    dp_c: float
    x_sa: float
    x_tb: float
    x_sb: float
    x_ta: float
    n_open: float
    A_sa: float
    A_tb: float
    A_sb: float
    out_0: float
    out_1: float
    A_ac: float
    p_open: float
    load_reach: float
    load_off_x: float
    load_off_y: float
    load_gyration: float


# States. The first eleven are those of (5.40); the others move only where an effect needs them.
ANGLE, RATE, P_A, P_B, P_H, P_O1, P_O2, SPOOL, SPOOL_RATE, LAG_IN, LAG_OUT = range(11)
SWING, SWING_RATE, BEND, BEND_RATE, BRISTLE, BRISTLE_2, BRISTLE_3 = range(11, 18)
GAS_1, GAS_2, WALL, POPPET, POPPET_RATE, PLAY, PLAY_2 = range(18, 25)
RELIEF, RELIEF_RATE, SEAT, WARMTH, BASE, BASE_RATE, RETURN, LATCH = range(25, 33)
STATES = 33
BASIC = tuple(range(11))

# Effects: row of the array e, whose columns are form (0: off), size, and shape numbers.
(
    E_SWING, E_BEND, E_BREAKAWAY, E_BRISTLE, E_TIGHT, E_WARM, E_LEAK, E_CUSHION, E_AIR, E_CAVITY, E_HEAT, E_RESTRICT,
    E_POPPET, E_SETTING, E_HOLDING, E_SOFT_EDGE, E_PLAY, E_FLOW_FORCE, E_SPRING, E_DROOP, E_POLE, E_PUMP, E_SAG, E_RETURN,
    E_CENTRE, E_GROUND, E_STOP, E_KINK, E_STICKING, E_RELIEF, E_SEAT, E_BASE, E_SEEP, E_STUCK_SPOOL,
) = range(34)  # fmt: skip
SLOTS, WIDTH = 34, 10

# Courses over time: columns of the array u, which has a row for each step of the grid. All are neutral at 0.
U_IN, U_OUT, U_LOAD, U_FRICTION, U_SUPPLY, U_PRECHARGE, U_CENTRE, U_POLE, U_THIN, U_TILT = range(10)
COURSES = 10

STEP = 5.0e-3
"""s. Steps of the grid: inputs hold in between, outputs are kept at its ends."""
