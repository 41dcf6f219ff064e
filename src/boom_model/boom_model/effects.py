"""The effect catalogue: physics that the nominal model leaves out, as parameters with a neutral value.

Simulation, sensitivity, fitting, report and documentation read this one table. To add an effect is to add a row here
and its term in the component that it belongs to. An effect that is not named in ``effects:`` of the machine file stands at
its neutral values, which are put into the equations as plain numbers, so that its term folds away and costs nothing;
states that an effect brings exist only while it is active. Ids are those that others rely on (contract).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any

from boom_model.errors import MachineError, nearest


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect: neutral value, plausible range [low, high], limits outside which it is refused."""

    name: str
    unit: str
    neutral: float
    low: float
    high: float
    minimum: float
    maximum: float
    meaning: str


@dataclass(frozen=True)
class Effect:
    """One row of the catalogue.

    Attributes:
        id: name that others rely on.
        subsystem: one of the twelve subsystem ids.
        equation: equation of the thesis that the term changes.
        term: what is added, in symbols.
        parameters: its numbers.
        regime: when it shows.
        states: (name, unit) of the states that it brings while active.
        needs: structure that the machine must have, e.g. "hose_burst_valve"; empty if none.
        independent: each parameter is a term of its own; otherwise the first one leads, and without it there is no term.
        changes: components of the parameter vector that it is a change of: off by more than their tolerance they are this effect.
    """

    id: str
    subsystem: str
    equation: str
    term: str
    parameters: tuple[EffectParameter, ...]
    regime: str
    states: tuple[tuple[str, str], ...] = ()
    needs: str = ""
    independent: bool = False
    changes: tuple[str, ...] = ()

    @property
    def leading(self) -> tuple[EffectParameter, ...]:
        """The parameters at whose neutral values the term vanishes."""
        return self.parameters if self.independent else self.parameters[:1]


def _p(
    name: str, unit: str, neutral: float, rng: tuple[float, float], lim: tuple[float, float], text: str
) -> EffectParameter:
    return EffectParameter(name, unit, neutral, rng[0], rng[1], lim[0], lim[1], text)


LPM = 1.0 / 60_000.0
BAR = 1.0e5

CATALOGUE: tuple[Effect, ...] = (
    Effect(
        "payload",
        "load",
        "5.39a",
        "D += m |tip|^2, g += m g_0 (t_x cos q_2 - t_y sin q_2)",
        (_p("mass", "kg", 0.0, (50.0, 2000.0), (-500.0, 5000.0), "mass at the tip beyond the configuration's"),),
        "static head pressure, with the lever arm",
        changes=("pose.Sx", "pose.Sy", "pose.load"),
    ),
    Effect(
        "payload_change",
        "load",
        "5.39a",
        "m (1 + tanh((t - t_g) / 0.01 s)) / 2 at the tip",
        (
            _p("mass", "kg", 0.0, (50.0, 2000.0), (-2000.0, 5000.0), "mass grasped (released: negative)"),
            _p("t_g", "s", 20.0, (5.0, 50.0), (-1e5, 1e5), "when, since the start of the run"),
        ),
        "static head pressure steps, with the lever arm",
        (("elapsed_time", "s"),),
    ),
    Effect(
        "swinging_load",
        "load",
        "5.39a",
        "pendulum of mass m and length l at the tip",
        (
            _p("mass", "kg", 0.0, (100.0, 1500.0), (0.0, 5000.0), "mass that hangs"),
            _p("length", "m", 1.5, (0.8, 3.0), (0.1, 20.0), "length of the pendulum"),
            _p("zeta", "-", 0.02, (0.005, 0.1), (0.0, 2.0), "damping ratio of the pendulum"),
        ),
        "0.3 to 0.55 Hz ringing in both pressures after stops",
        (("swing_angle", "rad"), ("swing_rate", "rad/s")),
    ),
    Effect(
        "boom_flexibility",
        "structure",
        "5.39a",
        "y = q_2 + x, x'' + 2 zeta omega x' + omega^2 x = -Gamma q_2''",
        (
            _p("gain", "-", 0.0, (0.1, 1.0), (0.0, 5.0), "Gamma, share of the acceleration that excites the mode"),
            _p("f", "Hz", 2.5, (1.0, 5.0), (0.1, 50.0), "frequency of the mode"),
            _p("zeta", "-", 0.02, (0.01, 0.05), (0.0, 2.0), "damping ratio of the mode"),
        ),
        "the gyro shows it far more than the angle",
        (("bend", "rad"), ("bend_rate", "rad/s")),
    ),
    Effect(
        "stribeck_friction",
        "friction",
        "5.39b",
        "tau_C += tau_s exp(-(w / w_s)^2)",
        (
            _p("tau_s", "N m", 0.0, (600.0, 4000.0), (0.0, 1e5), "break-away above sliding friction"),
            _p("w_s", "rad/s", 0.02, (0.005, 0.05), (1e-4, 1.0), "Stribeck velocity"),
        ),
        "starts, stops and slow motion",
    ),
    Effect(
        "presliding_friction",
        "friction",
        "5.39b",
        "z instead of tau_C tanh(w / sigma), c z' = w - |w| z / tau_C",
        (_p("compliance", "rad/(N m)", 0.0, (1e-7, 1e-5), (1e-9, 1e-3), "of the bristles, 1 / sigma_0"),),
        "hysteresis at reversals",
        (("bristle_torque", "N m"),),
    ),
    Effect(
        "position_dependent_friction",
        "friction",
        "5.39b",
        "tau_C (1 + b exp(-((q_2 - q_c) / width)^2))",
        (
            _p("b", "-", 0.0, (0.2, 2.0), (-0.9, 20.0), "height of the tight spot over tau_C"),
            _p("q_c", "rad", 0.5, (0.0, 1.0), (-2.0, 2.0), "where it is"),
            _p("width", "rad", 0.1, (0.03, 0.3), (1e-3, 2.0), "how wide it is"),
        ),
        "the same angle, flips with the direction",
    ),
    Effect(
        "friction_drift",
        "friction",
        "5.39b",
        "tau_f (1 + (r - 1) (1 - exp(-t / T)))",
        (
            _p("r", "-", 1.0, (0.3, 5.0), (0.0, 20.0), "factor of the friction torque in the end"),
            _p("T", "s", 30.0, (5.0, 120.0), (0.1, 1e5), "time constant of the change"),
        ),
        "grows with time, with speed",
        (("elapsed_time", "s"),),
    ),
    Effect(
        "piston_leakage",
        "cylinder",
        "5.39c,d",
        "q_l = c (p_a - p_b)",
        (
            _p(
                "c",
                "m^3/s/Pa",
                0.0,
                (0.1 * LPM / 1e7, 5 * LPM / 1e7),
                (0.0, 1e-9),
                "laminar leakage past the piston seal",
            ),
        ),
        "sinks at standstill, p_b rises, slower both ways",
    ),
    Effect(
        "end_cushioning",
        "cylinder",
        "5.39f,m",
        "outflow passage (1 - k ramp(distance / length)) before the end of stroke",
        (
            _p("k", "-", 0.0, (0.3, 0.95), (0.0, 0.999), "share of the passage that is taken at the end"),
            _p("length", "m", 0.05, (0.02, 0.1), (1e-3, 1.0), "stroke over which the cushion acts"),
        ),
        "near the ends of stroke: p_b rises, the boom slows",
    ),
    Effect(
        "entrained_air",
        "oil",
        "5.39c,d,i",
        "beta(p) = beta (1 + a r^(1/n)) / (1 + a r^(1/n) beta / (n p_abs))",
        (_p("a", "-", 0.0, (0.002, 0.06), (0.0, 0.3), "free air over oil volume at ambient pressure"),),
        "soft below 15 bar, stiff above",
    ),
    Effect(
        "accumulator_precharge",
        "accumulators",
        "5.39g,h",
        "p_g0 r",
        (_p("r", "-", 1.0, (0.2, 1.1), (0.02, 2.0), "factor of both pre-charge pressures"),),
        "the corner in p_h' moves",
        needs="accumulators",
        changes=("accumulators.p_g0_1", "accumulators.p_g0_2"),
    ),
    Effect(
        "accumulator_heat_loss",
        "accumulators",
        "5.39g,h",
        "p_g0 exp(e), e' = -(1 - T_a / T) / tau",
        (_p("inverse_tau", "1/s", 0.0, (1 / 40, 1 / 5), (0.0, 1e3), "1 / time constant of the heat exchange"),),
        "slow relaxation of p_h after a fast charge",
        (
            ("accumulator_entropy_1", "-"),
            ("accumulator_ambient_1", "-"),
            ("accumulator_entropy_2", "-"),
            ("accumulator_ambient_2", "-"),
        ),
        needs="accumulators",
    ),
    Effect(
        "accumulator_restrictor",
        "accumulators",
        "5.39j,k",
        "d r",
        (_p("r", "-", 1.0, (0.3, 1.2), (0.0, 5.0), "factor of both orifice diameters"),),
        "time constant of p_h",
        needs="accumulators",
        changes=("accumulators.d_1", "accumulators.d_2"),
    ),
    Effect(
        "hose_burst_valve_lag",
        "hose_burst_valve",
        "5.39f",
        "q_a = G (p_h - p_a) outwards, tau G' = G_limited - G",
        (_p("tau", "s", 0.0, (0.005, 0.15), (1e-4, 2.0), "time constant of the poppet"),),
        "first 0.3 s of fast lowering",
        (("G", "m^3/s/Pa"),),
        needs="hose_burst_valve",
    ),
    Effect(
        "hose_burst_valve_setting",
        "hose_burst_valve",
        "5.39f",
        "limited branch r q_a(dp)",
        (_p("r", "-", 1.0, (0.6, 1.2), (0.1, 5.0), "factor of the limited flow"),),
        "plateau speed when lowering fast",
        needs="hose_burst_valve",
        changes=("hose_burst_valve.a21", "hose_burst_valve.a30", "hose_burst_valve.a31"),
    ),
    Effect(
        "valve_dead_zone",
        "main_valve",
        "5.39l,m",
        "x_0 + d",
        (
            _p("d_extend", "-", 0.0, (-0.1, 0.1), (-0.25, 0.5), "added overlap over full stroke, lifting"),
            _p("d_retract", "-", 0.0, (-0.1, 0.1), (-0.25, 0.5), "added overlap over full stroke, lowering"),
        ),
        "start delay, creep speed",
        independent=True,
        changes=("main_valve_orifices.x0",),
    ),
    Effect(
        "valve_hysteresis",
        "main_valve",
        "5.39l,m",
        "metering edges lag the spool by h s_max to either side, and change sides within a travel of 2 max(h, travel) s_max",
        (
            _p("h", "-", 0.0, (0.005, 0.06), (0.0, 0.5), "half of the hysteresis over full stroke"),
            _p("travel", "-", 0.0, (0.0, 0.3), (0.0, 2.0), "half of the travel between its sides; below h: a play"),
        ),
        "differs with rising or falling current",
        (("metering_position", "m"),),
    ),
    Effect(
        "flow_force",
        "main_valve",
        "5.39n",
        "F_q = c |q| sqrt(|dp|), summed over both edges, closes the spool",
        (_p("c", "N s/m^3/Pa^0.5", 0.0, (2.0, 31.0), (0.0, 1e3), "force per flow and root of the drop"),),
        "gain loss with flow and pressure drop",
        needs="pilot_valves",
    ),
    Effect(
        "spring_rate",
        "main_valve",
        "5.39n",
        "k r",
        (_p("r", "-", 1.0, (0.7, 1.3), (0.1, 10.0), "factor of the return spring (or inverse of the pilot gain)"),),
        "speed at all currents, opens earlier or later",
        needs="pilot_valves",
        changes=("main_valve_spool.k", "pilot_valves.h.0"),
    ),
    Effect(
        "compensator_droop",
        "main_valve",
        "5.39l,m",
        "supply flow q (1 - k (q / 120 l/min)^2)",
        (_p("k", "-", 0.0, (0.05, 0.5), (0.0, 1.0), "loss of supply flow at 120 l/min"),),
        "top speed, supply side only",
        needs="compensator",
    ),
    Effect(
        "pilot_lag",
        "pilot_valves",
        "5.39p,s",
        "a_1 / r, b_0 / r",
        (_p("r", "-", 1.0, (0.6, 3.0), (0.05, 50.0), "factor of the pilot valves' time constant"),),
        "slower at every edge",
        needs="pilot_valves",
        changes=("pilot_valves.a1_s",),
    ),
    Effect(
        "command_delay",
        "pilot_valves",
        "5.39p,s",
        "i(t - T)",
        (_p("T", "s", 0.0, (0.005, 0.1), (0.0, 1.0), "dead time between command and valve"),),
        "follows the edges of the command",
    ),
    Effect(
        "pump_flow_limit",
        "supply",
        "5.39l,m",
        "supply flow q / (1 + (q / q_max)^32)^(1/32)",
        (
            _p(
                "inverse_q_max",
                "s/m^3",
                0.0,
                (60_000 / 120, 60_000 / 50),
                (0.0, 60_000.0),
                "1 / largest flow of the pump",
            ),
        ),
        "speed saturates",
    ),
    Effect(
        "return_line_pressure",
        "return_line",
        "5.39l,m",
        "p_t + k q^2",
        (_p("k", "Pa s^2/m^6", 0.0, (2e5 / 2.17e-3**2, 2e6 / 2.17e-3**2), (0.0, 1e13), "rise per squared flow"),),
        "p_b when extending, p_h when lowering slowly",
    ),
    Effect(
        "angle_offset",
        "sensors",
        "ch. 4.2",
        "y = q_2 + b",
        (_p("b", "rad", 0.0, (-0.035, 0.035), (-0.5, 0.5), "IMU mounted askew"),),
        "gravity mismatch over the angle",
    ),
    Effect(
        "rate_scale",
        "sensors",
        "ch. 4.2",
        "y = a q_2'",
        (_p("a", "-", 1.0, (0.95, 1.05), (0.1, 10.0), "gain of the gyro"),),
        "integrated rate against angle, without any hydraulics",
    ),
    Effect(
        "pressure_bias",
        "sensors",
        "ch. 4.2",
        "y = p + b",
        (
            _p("hose", "Pa", 0.0, (-3e5, 3e5), (-5e6, 5e6), "offset of the hose pressure transducer"),
            _p("rod", "Pa", 0.0, (-3e5, 3e5), (-5e6, 5e6), "offset of the rod pressure transducer"),
        ),
        "level of one pressure, everywhere",
        independent=True,
    ),
    Effect(
        "pressure_delay",
        "sensors",
        "ch. 4.2",
        "y = p(t - T)",
        (_p("T", "s", 0.0, (0.005, 0.1), (0.0, 1.0), "dead time of both pressure channels"),),
        "all edges of the pressures",
    ),
)

EFFECTS: dict[str, Effect] = {effect.id: effect for effect in CATALOGUE}

SUBSYSTEM_NAMES = {
    "load": "load", "structure": "boom structure", "friction": "friction", "cylinder": "cylinder", "oil": "oil",
    "accumulators": "accumulators", "hose_burst_valve": "hose burst valve", "main_valve": "main valve",
    "pilot_valves": "pilot valves", "supply": "supply", "return_line": "return line", "sensors": "sensors",
}  # fmt: skip
"""The twelve subsystems in words."""


def effect_name(effect: str | None) -> str:
    """Name of an effect in a table: its id in words; physics of no catalogue where it has none."""
    return "physics of no catalogue" if effect is None else effect.replace("_", " ")


def check_effects(values: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """Effect id -> {parameter: value}, completed with neutral values.

    Raises:
        MachineError: unknown effect or parameter, or a value outside its limits.
    """
    result: dict[str, dict[str, float]] = {}
    for name, given in values.items():
        if name not in EFFECTS:
            raise MachineError(f"effects.{name}: no such effect{nearest(name, EFFECTS)}")
        rows = {row.name: row for row in EFFECTS[name].parameters}
        if not isinstance(given, dict):
            raise MachineError(f"effects.{name}: expected parameters, e.g. {{{next(iter(rows))}: ...}}")
        complete = {row.name: row.neutral for row in rows.values()}
        for key, value in given.items():
            if key not in rows:
                raise MachineError(f"effects.{name}.{key}: no such parameter{nearest(key, rows)}")
            row = rows[key]
            if isinstance(value, dict):
                value = value.get("value")
            if isinstance(value, str):  # YAML 1.1 takes 1.0e3 for a text
                with contextlib.suppress(ValueError):
                    value = float(value)
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise MachineError(f"effects.{name}.{key}: {value!r} is not a finite number")
            if not (value == row.neutral or row.minimum <= value <= row.maximum):
                raise MachineError(
                    f"effects.{name}.{key}: {value:g} {row.unit} is outside {row.minimum:g} .. {row.maximum:g} {row.unit}"
                )
            complete[key] = float(value)
        result[name] = complete
    return result


def is_neutral(name: str, values: dict[str, float]) -> bool:
    """Whether the effect's term vanishes: its leading parameters are at their neutral values."""
    return all(values[row.name] == row.neutral for row in EFFECTS[name].leading)


def active_effects(given: Any, has: Callable[[str], bool]) -> dict[str, dict[str, float]]:
    """The effects that are not neutral, complete and checked; ``has`` tells whether the machine has a component.

    Raises:
        MachineError: unknown effect or parameter, a value outside its limits, or a component that is not there.
    """
    if not isinstance(given, dict):
        raise MachineError("effects: expected effect ids with their parameters below")
    complete = check_effects(given)
    for name in complete:
        if not has(EFFECTS[name].needs):
            raise MachineError(f"effects.{name}: this machine has no {EFFECTS[name].needs.replace('_', ' ')}")
    return {name: values for name, values in complete.items() if not is_neutral(name, values)}
