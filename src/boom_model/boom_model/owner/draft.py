"""The machine file that follows from the answers: numbers in SI, each with source, note and a proposed tolerance.

The valve has four edges; all else is asked. Tolerances are what was found on cranes that exist: known lengths and areas are sure,
flows of edges are off by 1.6, the oil's stiffness by 2, volumes of hoses by 3, friction by 6; the overlaps of the four edges are
unequal.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping

from boom_input.shown import quoted
from boom_model.errors import MachineError
from boom_model.owner.entry import Entry, in_flow_style
from boom_model.owner.linkages import linkage
from boom_model.owner.questions import Answer
from boom_model.rigid_body import LockedBody
from boom_model.slots import NeutralPosition
from boom_model.structure import structure

BAR, LPM, MILLI, LITRE = 1e5, 1 / 60_000, 1e-3, 1e-3
DENSITY, COEFFICIENT = 870.0, 0.65
STROKE, CROSS_SECTION = 8.0e-3, 3.14e-4
"""m, m^2. Of a spool that no sensor sees: only shares of them act."""
DRY, PINS = 0.15, {"triangle": 2, "four_bar": 4}
"""Friction of a pin without grease [-], and how many turn with the boom by about its angle."""
SLOW = 0.15
"""rad/s. There viscous friction of the pins may be as large as the dry one."""
NATURAL = 500.0
"""rad/s. Of a spool on its spring."""
VENTED = 0.1
"""Of the area of an edge: vented spools throttle what they vent."""
BODY = {"masses": 0.2, "urdf": 0.06, "numbers": 0.1}
"""Tolerance of the moments by where they come from."""


RETURN = 0.5
"""Area of the edge from the head side to the tank over that from the supply to the rod side, which data sheets seldom tell: 0.44 to
0.64 in the thesis, and 1 or a little more in valves that are not made for a load. Where they are equal behind a compensator, a
load-holding valve has nothing to lean on and swings. Its tolerance, a factor of 2.5, holds all of these."""
_SENSORS = {"Ts": "s", "q2_quant": "rad", "p_quant": "Pa", "p_noise_psd": "Pa^2/Hz"}


def text(
    answers: Mapping[str, Answer], body: LockedBody, sensors: Mapping[str, float] | None = None, proposed: Collection[str] = ()
) -> str:  # fmt: skip
    """The machine file.

    Args:
        answers: to all questions that are asked.
        body: the moments of what moves.
        sensors: section ``control``, where recordings tell it.
        proposed: keys of the questions for which the proposal was taken: those numbers are assumed.

    Raises:
        MachineError: answers that cannot be true together.
    """
    n = {key: value for key, value in answers.items() if isinstance(value, float)}
    valve, piloted = answers["cylinder_valve"], answers["spool"] == "pilot"
    linked, geometry = linkage(str(answers["linkage"]), n)
    neutral = structure(neutral=answers.get("neutral", NeutralPosition.default)).neutral
    sections = {
        "constants": [Entry("g", 9.81, "m/s^2", "literature", 1e-4)],
        "fluid": _fluid(n),
        "cylinder": _cylinder(n, holds=answers["cylinder_valve"] != "none"),
        "kinematics": geometry,
        "friction": _friction(n, PINS[linked]),
        "hose_burst_valve": _holding(n) if valve == "load_holding" else _burst(n) if valve == "hose_burst" else None,
        "accumulators": _accumulators(n) if answers["accumulators"] == "hose" else None,
        "pilot_valves": _pilot_valves(n) if piloted else None,
        "main_valve_spool": _piloted_spool(n) if piloted else _spool(n),
        "main_valve_orifices": _edges(
            n, compensator=answers["compensator"] == "yes", vented=neutral.vents, piloted=piloted
        ),
    }
    name = json.dumps(quoted(str(answers["name"]), 100), ensure_ascii=False)
    lines = [
        "# Made by ./boom new-machine. Every number may be edited; docs/machine_file.md says what it means.",
        f'meta: {{name: {name}, version: 1, pressure_reference: gauge, angle_q2: "0 = boom horizontal, + = up"}}',
    ]
    types = {"kinematics": linked, "friction": "cylinder", "main_valve_orifices": "four_edges"}
    types["hose_burst_valve"] = "pilot_opened" if valve == "load_holding" else "flow_limiting"
    types["main_valve_spool"] = "pilot_operated" if piloted else "direct"
    for section, entries in sections.items():
        if entries is None:
            lines.append(f"{section}: {{type: none}}")
            continue
        lines.append(f"{section}:")
        lines += [f"  type: {types[section]}"] if section in types else []
        lines += [entry.line(proposed) for entry in entries]
        if section == "main_valve_orifices":
            lines += [f"  neutral: {neutral.name}"] if neutral.vents else []
            lines.append(f"  compensator: {'true' if answers['compensator'] == 'yes' else 'false'}")
            area = _area(n["lift_flow"], 5.0)
            lines.append(
                f"  anti_cavitation: {{enabled: true, A_ac: {in_flow_style(area)}, unit: m^2, p_open: 0.0, prov: assumed}}"
            )
    measured = [Entry(key, value, _SENSORS[key], "recordings", None) for key, value in (sensors or {}).items()]
    lines += ["control:", *(entry.line(proposed) for entry in measured)] if measured else []
    return "\n".join([*lines, *_body(n, str(answers["moments"]), body)]) + "\n"


def _fluid(n: Mapping[str, float]) -> list[Entry]:
    return [
        Entry("rho", DENSITY, "kg/m^3", "literature", 0.04, "mineral oil"),
        Entry("beta", 1.2e9, "Pa", "literature", {"factor": 2.0}, "with hoses and a little air"),
        Entry("C_d", COEFFICIENT, "-", "literature", 0.05),
        Entry("p_t", n["return_pressure"] * BAR, "Pa", "return_pressure", {"abs": 3.0 * BAR}),
        Entry(
            "p_s", n["pump_pressure"] * BAR, "Pa", "pump_pressure", 0.1, "10 % is usual; recorded, it drives the model"
        ),
    ]


def _cylinder(n: Mapping[str, float], *, holds: bool) -> list[Entry]:
    bore, rod = n["piston_diameter"] * MILLI, n["rod_diameter"] * MILLI
    if rod >= bore:
        raise MachineError(
            f"rod_diameter: {n['rod_diameter']:g} mm is not below piston_diameter, {n['piston_diameter']:g} mm"
        )
    piston = math.pi / 4 * bore**2
    hose = math.pi / 4 * (n["hose_bore"] * MILLI) ** 2 * n["hose_length"]
    dead = 0.01 * piston * n["stroke"]
    return [
        Entry("A_a", piston, "m^2", "piston_diameter", 0.01, f"piston {n['piston_diameter']:g} mm"),
        Entry("A_b", piston - math.pi / 4 * rod**2, "m^2", "rod_diameter", 0.01, f"rod {n['rod_diameter']:g} mm"),
        Entry("l_p", n["stroke"], "m", "stroke", {"abs": 0.005}),
        Entry("l_min", n["closed_length"], "m", "closed_length", {"abs": 0.01}),
        Entry(
            "V_0a",
            dead if holds else dead + 1e-5,
            "m^3",
            "assumed",
            {"factor": 5.0},  # 0.05 to 0.2 l are usual whatever the piston is, and half of that in a small one
            "1 % of the piston's displacement",
        ),
        Entry("V_0b", dead + hose, "m^3", "derived", {"factor": 2.0}, "its hose included"),
        Entry("V_h", hose, "m^3", "derived", {"factor": 3.0}, "hose of the head side"),
    ]


def _friction(n: Mapping[str, float], pins: int) -> list[Entry]:
    """Of the seals, and of so many pins that turn with the boom."""
    piston = math.pi / 4 * (n["piston_diameter"] * MILLI) ** 2
    damping, force, radius = 1.5e6 * piston, piston * n["pump_pressure"] * BAR / 2, n["piston_diameter"] * MILLI / 4
    torque = pins * DRY * force * radius
    return [
        *(
            Entry(key, n["seal_friction"], "N", "seal_friction", {"factor": 6.0}, "seals")
            for key in ("F_C_pos", "F_C_neg")
        ),
        *(Entry(key, damping, "N s/m", "assumed", {"factor": 4.0}) for key in ("d_pos", "d_neg")),
        Entry("sigma_p", 2.0e-3, "m/s", "assumed", {"factor": 5.0}),
        *(
            Entry(f"{key}_{way}", 0.0, unit, "assumed", {"abs": most}, note)
            for key, unit, most, note in (
                ("tau_p", "N m", torque, f"{pins} pins without grease"),
                ("k_p", "N m s/rad", torque / SLOW, "as much at 0.15 rad/s"),
            )
            for way in ("pos", "neg")
        ),
    ]


def _holding(n: Mapping[str, float]) -> list[Entry]:
    gain, conductance = LPM / BAR**1.5, LPM / BAR**0.5
    return [
        Entry("p_set", n["set_pressure"] * BAR, "Pa", "set_pressure", 0.15),
        Entry("R", n["pilot_ratio"], "-", "pilot_ratio", {"abs": 0.5}),
        Entry("gain", 0.1 * gain, "m^3/s/Pa^1.5", "assumed", {"factor": 3.0}, "0.1 (l/min)/sqrt(bar) per bar"),
        Entry("G_max", 15 * conductance, "m^3/s/Pa^0.5", "assumed", {"factor": 3.0}, "15 (l/min)/sqrt(bar)"),
        Entry("play", 3 * BAR, "Pa", "assumed", {"factor": 1.5}, "2 to 4 bar"),
        Entry("p_check", 2 * BAR, "Pa", "assumed", {"factor": 1.7}, "1 to 3 bar"),
        Entry("r_check", 0.14 * BAR / LPM, "Pa s/m^3", "assumed", {"factor": 1.5}, "0.1 to 0.2 bar/(l/min)"),
    ]


def _burst(n: Mapping[str, float]) -> list[Entry]:
    """The valve of the thesis, whose limited branches meet at 98 l/min, scaled to another flow."""
    scale = n["limit_flow"] / 98.0
    return [
        Entry("a11", 3.67 * scale, "l/min/bar", "derived", {"factor": 2.0}, "free flow"),
        Entry("a12", 29.2 * scale, "l/min/bar^0.5", "derived", {"factor": 2.0}, "free flow"),
        Entry("a21", 8.24 * scale, "l/min/bar", "derived", {"factor": 2.0}, "before it throttles"),
        Entry("a30", -80.3 * scale, "l/min", "derived", 0.3, "throttled"),
        Entry("a31", 0.84 * scale, "l/min/bar", "derived", {"factor": 2.0}, "throttled"),
    ]


def _accumulators(n: Mapping[str, float]) -> list[Entry]:
    return [
        Entry("V_g0", n["gas_volume"] * LITRE, "m^3", "gas_volume", 0.1),
        *(Entry(f"p_g0_{k}", n[f"precharge_{k}"] * BAR, "Pa", f"precharge_{k}", 0.1) for k in (1, 2)),
        *(Entry(f"d_{k}", n[f"orifice_{k}"] * MILLI, "m", f"orifice_{k}", 0.15) for k in (1, 2)),
        Entry("kappa", 1.4, "-", "literature", 0.1, "nitrogen"),
    ]


def _ordered(n: Mapping[str, float], what: str, unit: str) -> tuple[float, float]:
    """``what`` at which the boom begins to move and at which the valve is fully open."""
    opening, full = n[f"opening_{what}"], n[f"full_{what}"]
    if opening >= full:
        raise MachineError(f"opening_{what}: {opening:g} {unit} is not below full_{what}, {full:g} {unit}")
    return opening, full


def _spool(n: Mapping[str, float]) -> list[Entry]:
    _, full = _ordered(n, "current", "A")
    return [
        Entry("s_max", STROKE, "m", "assumed", 1e-4, "only shares of it act"),
        Entry("K_i", STROKE / full, "m/A", "derived", 0.05, f"full stroke at {full:g} A"),
        Entry("T_s", n["response_time"] * MILLI, "s", "response_time", {"factor": 2.0}),
    ]


def _pilot_valves(n: Mapping[str, float]) -> list[Entry]:
    """h through both pressures and zero without current: h(i) / i is a straight line."""
    (low, high), (opening, full) = _ordered(n, "current", "A"), _ordered(n, "pressure", "bar")
    square = (full / high - opening / max(low, 1e-9)) / (high - low)
    slope = opening / max(low, 1e-9) - square * low
    if square <= 0.0 or slope < -2.0 * math.sqrt(square):  # it would be below -1 bar between
        raise MachineError(
            f"opening_pressure: no pilot valve has {opening:g} bar at {low:g} A and {full:g} bar at {high:g} A: without current "
            "it has none, and it rises ever faster; measure opening_current and opening_pressure again"
        )
    rate, why = 1 / (n["response_time"] * MILLI), f"{opening:g} bar at {low:g} A, {full:g} bar at {high:g} A"
    return [
        Entry("a1_s", -rate, "1/s", "derived", 0.5, f"{n['response_time']:g} ms"),
        Entry("b0_s", rate, "1/s", "derived", None, "at rest the current"),
        Entry("b1_s", 0.0, "-", "assumed", {"abs": 0.03}),
        Entry("h", [square, slope, 0.0], "bar/A^2, bar/A, bar", "derived", 0.1, why),
    ]


def _piloted_spool(n: Mapping[str, float]) -> list[Entry]:
    full = n["full_pressure"] * BAR * CROSS_SECTION
    spring = full / STROKE
    mass = spring / NATURAL**2
    return [
        Entry("A_s", CROSS_SECTION, "m^2", "assumed", 1e-4, "20 mm; only what the pressure does of the stroke acts"),
        Entry("s_max", STROKE, "m", "assumed", 1e-4, "only shares of it act"),
        Entry("k", spring, "N/m", "derived", 0.1, f"full stroke at {n['full_pressure']:g} bar"),
        Entry("m_s", mass, "kg", "assumed", {"factor": 2.0}, "80 Hz"),
        Entry("d_v", math.sqrt(spring * mass), "N s/m", "assumed", {"factor": 2.0}, "damping ratio 0.5"),
        Entry("f_c", 0.06 * full, "N", "assumed", {"factor": 3.0}, "2 to 20 % of the full pressure is usual"),
        Entry("sigma_s", 0.05, "m/s", "assumed", {"factor": 5.0}),
    ]


def _area(flow: float, drop: float) -> float:
    """A [m^2] of an edge, of its flow [l/min] at its drop [bar]: q = C_d A sqrt(2 dp / rho)."""
    return flow * LPM / (COEFFICIENT * math.sqrt(2 * drop * BAR / DENSITY))


def _edges(n: Mapping[str, float], *, compensator: bool, vented: bool, piloted: bool) -> list[Entry]:
    opens = "pressure" if piloted else "current"
    overlap, drop = n[f"opening_{opens}"] / n[f"full_{opens}"], n["flow_drop"]
    lift, lower = (f"{n[key]:g} l/min at {drop:g} bar" for key in ("lift_flow", "lower_flow"))
    areas = {
        "sa": (n["lift_flow"], 1.6, lift),
        "tb": (n["lift_flow"], 2.0, lift),
        "sb": (n["lower_flow"], 1.6, lower),
        "ta": (RETURN * n["lower_flow"], 2.5, f"half of {lower}: it holds the load back"),
    }
    return [
        *(Entry(f"x0_{edge}", overlap, "-", "derived", {"abs": 0.05}, "unequal on most machines") for edge in areas),
        *(
            Entry(f"A_{edge}_max", _area(flow, drop), "m^2", "derived", {"factor": f}, why)
            for edge, (flow, f, why) in areas.items()
        ),
        Entry("n", 1.2, "-", "assumed", {"abs": 0.4}, "areas grow with this power of the opening"),
        Entry("x_n", 0.0, "-", "assumed", {"abs": 0.04}, "neutral off-centre"),
        *(_vent(n, overlap) if vented else []),
        *(
            [
                Entry(
                    "dp_c",
                    drop * BAR,
                    "Pa",
                    "flow_drop",
                    {"factor": 1.5},
                    "margin of the compensator: what the flows hold at",
                )
            ]
            if compensator
            else []
        ),
    ]


def _vent(n: Mapping[str, float], overlap: float) -> list[Entry]:
    area = VENTED * _area(n["lift_flow"], n["flow_drop"])
    return [
        Entry("A_v", area, "m^2", "assumed", {"factor": 4.0}, "of each port to the tank in neutral"),
        Entry("x_v", 0.8 * overlap, "-", "assumed", {"factor": 1.5}, "shut before the edges open"),
    ]


def _body(n: Mapping[str, float], source: str, body: LockedBody) -> list[str]:
    values = {"q3": n["q3"], "q4": n["q4"], "D0": body.D0, "Sx": body.Sx, "Sy": body.Sy, "tip": list(body.tip)}
    shown = ", ".join(f"{key}: {in_flow_style(value)}" for key, value in values.items())
    return [
        "rigid_body:",
        "  configs:",
        f"    as_recorded: {{{shown}, prov: {source}, tol: {BODY[source]}}}",
        "payload: {tol: {abs: 20.0}}",
    ]
