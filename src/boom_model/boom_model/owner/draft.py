"""The machine file that follows from the answers: numbers in SI, each with source, note and a proposed tolerance.

A current commands the spool directly; the valve has four edges; the cylinder is pinned to column and boom (triangle). Tolerances
are what was found on cranes that exist: known lengths and areas are sure, flows of edges are off by 1.6, the oil's stiffness by 2,
volumes of hoses by 3, friction by 6; the overlaps of the four edges are unequal.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from boom_input.shown import quoted
from boom_model.errors import MachineError
from boom_model.owner.questions import BY_KEY, Answer
from boom_model.rigid_body import LockedBody
from boom_model.slots import NeutralPosition
from boom_model.structure import structure

BAR, LPM, MILLI = 1e5, 1 / 60_000, 1e-3
DENSITY, COEFFICIENT = 870.0, 0.65
STROKE = 8.0e-3
"""m. Of a spool that no sensor sees: only shares of it act."""
VENTED = 0.1
"""Of the area of an edge: vented spools throttle what they vent."""
BODY = {"masses": 0.2, "urdf": 0.06, "numbers": 0.1}
"""Tolerance of the moments by where they come from."""


@dataclass(frozen=True)
class Entry:
    """One number of the file; ``source``: a word of the file, or the key of the question whose answer it is."""

    key: str
    value: Any
    unit: str
    source: str
    tol: Any
    note: str = ""

    def line(self, proposed: Collection[str]) -> str:
        """As YAML; ``proposed``: questions that were not answered."""
        source = ("answered", "assumed")[self.source in proposed] if self.source in BY_KEY else self.source
        note = f', note: "{self.note}"' if self.note else ""
        tol = f", tol: {_flow(self.tol)}" if self.tol is not None else ""
        unit = f'"{self.unit}"' if self.unit == "-" else self.unit
        return f"  {self.key}: {{value: {_flow(self.value)}, unit: {unit}, prov: {source}{tol}{note}}}"


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
    neutral = structure(neutral=answers.get("neutral", NeutralPosition.default)).neutral
    sections = {
        "constants": [Entry("g", 9.81, "m/s^2", "literature", 1e-4)],
        "fluid": _fluid(n),
        "cylinder": _cylinder(n, holds=answers["cylinder_valve"] == "load_holding"),
        "kinematics": _kinematics(n),
        "friction": _friction(n),
        "hose_burst_valve": _holding(n) if answers["cylinder_valve"] == "load_holding" else None,
        "accumulators": None,
        "pilot_valves": None,
        "main_valve_spool": _spool(n),
        "main_valve_orifices": _edges(n, compensator=answers["compensator"] == "yes", vented=neutral.vents),
    }
    name = json.dumps(quoted(str(answers["name"]), 100), ensure_ascii=False)
    lines = [
        "# Made by ./boom new-machine. Every number may be edited; docs/machine_file.md says what it means.",
        f'meta: {{name: {name}, version: 1, pressure_reference: gauge, angle_q2: "0 = boom horizontal, + = up"}}',
    ]
    types = {"kinematics": "triangle", "friction": "cylinder", "hose_burst_valve": "pilot_opened"}
    types |= {"main_valve_spool": "direct", "main_valve_orifices": "four_edges"}
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
                f"  anti_cavitation: {{enabled: true, A_ac: {_flow(area)}, unit: m^2, p_open: 0.0, prov: assumed}}"
            )
    measured = [Entry(key, value, _SENSORS[key], "recordings", None) for key, value in (sensors or {}).items()]
    lines += ["control:", *(entry.line(proposed) for entry in measured)] if measured else []
    return "\n".join([*lines, *_body(n, str(answers["moments"]), body)]) + "\n"


def _flow(value: Any) -> str:
    """A value in YAML's flow style; numbers with a point, which YAML 1.1 wants."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(entry) for entry in value) + "]"
    if isinstance(value, float):
        shown = f"{value:.6g}"
        mantissa, e, exponent = shown.partition("e")
        return mantissa + ("" if "." in mantissa else ".0") + e + exponent
    return str(value)


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
            {"factor": 3.0},
            "1 % of the piston's displacement",
        ),
        Entry("V_0b", dead + hose, "m^3", "derived", {"factor": 2.0}, "its hose included"),
        Entry("V_h", hose, "m^3", "derived", {"factor": 3.0}, "hose of the head side"),
    ]


def _kinematics(n: Mapping[str, float]) -> list[Entry]:
    """a^2 + b^2 - 2 a b cos(q_2 + phi_0) = (l_min + s_p)^2, with the cylinder retracted at the lowest angle."""
    a, b, closed, low = n["foot_distance"], n["eye_distance"], n["closed_length"], math.radians(n["lowest_angle"])

    if n["stroke"] >= closed:
        raise MachineError(
            f"stroke: {n['stroke']:g} m is not possible in a cylinder that is {closed:g} m long retracted, pin to pin "
            "(closed_length): measure both again"
        )

    def between(length: float) -> float:
        """Angle between a and b [rad]; NaN: no such triangle."""
        cosine = (a * a + b * b - length * length) / (2 * a * b)
        return math.acos(cosine) if abs(cosine) <= 1.0 else math.nan

    begin, end = between(closed), between(min(closed + n["stroke"], 0.999 * (a + b)))
    if not (math.isfinite(begin) and math.isfinite(end) and end > begin):
        raise MachineError(
            f"closed_length: with pins {a:g} m and {b:g} m from the boom joint, the cylinder is {abs(a - b):.3f} .. {a + b:.3f} m "
            f"long, not {closed:g} m: measure the three lengths again"
        )
    return [
        Entry("a", a, "m", "foot_distance", {"abs": 0.01}),
        Entry("b", b, "m", "eye_distance", {"abs": 0.01}),
        Entry("phi0", begin - low, "rad", "derived", {"abs": 0.035}, "from the lowest angle, 2 deg"),
        Entry("q2_stroke_min", low, "rad", "lowest_angle", None, "cylinder retracted"),
        Entry("q2_max", low + 0.999 * (end - begin), "rad", "derived", None, "cylinder extended"),
    ]


def _friction(n: Mapping[str, float]) -> list[Entry]:
    damping = 1.5e6 * math.pi / 4 * (n["piston_diameter"] * MILLI) ** 2
    return [
        *(
            Entry(key, n["seal_friction"], "N", "seal_friction", {"factor": 6.0}, "seals")
            for key in ("F_C_pos", "F_C_neg")
        ),
        *(Entry(key, damping, "N s/m", "assumed", {"factor": 4.0}) for key in ("d_pos", "d_neg")),
        Entry("sigma_p", 2.0e-3, "m/s", "assumed", {"factor": 5.0}),
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


def _spool(n: Mapping[str, float]) -> list[Entry]:
    if n["opening_current"] >= n["full_current"]:
        raise MachineError(
            f"opening_current: {n['opening_current']:g} A is not below full_current, {n['full_current']:g} A"
        )
    return [
        Entry("s_max", STROKE, "m", "assumed", 1e-4, "only shares of it act"),
        Entry("K_i", STROKE / n["full_current"], "m/A", "derived", 0.05, f"full stroke at {n['full_current']:g} A"),
        Entry("T_s", n["response_time"] * MILLI, "s", "response_time", {"factor": 2.0}),
    ]


def _area(flow: float, drop: float) -> float:
    """A [m^2] of an edge, of its flow [l/min] at its drop [bar]: q = C_d A sqrt(2 dp / rho)."""
    return flow * LPM / (COEFFICIENT * math.sqrt(2 * drop * BAR / DENSITY))


def _edges(n: Mapping[str, float], *, compensator: bool, vented: bool) -> list[Entry]:
    overlap, drop = n["opening_current"] / n["full_current"], n["flow_drop"]
    areas = {
        "sa": (n["lift_flow"], 1.6),
        "tb": (n["lift_flow"], 2.0),
        "sb": (n["lower_flow"], 1.6),
        "ta": (n["lower_flow"], 2.0),
    }
    return [
        *(Entry(f"x0_{edge}", overlap, "-", "derived", {"abs": 0.05}, "unequal on most machines") for edge in areas),
        *(
            Entry(
                f"A_{edge}_max", _area(flow, drop), "m^2", "derived", {"factor": f}, f"{flow:g} l/min at {drop:g} bar"
            )
            for edge, (flow, f) in areas.items()
        ),
        Entry("n", 1.2, "-", "assumed", {"abs": 0.4}, "areas grow with this power of the opening"),
        *(
            Entry(f"dn_{edge}", 0.0, "-", "assumed", {"abs": 0.3}, "notches of its own")
            for edge in areas
            if edge != "sa"
        ),
        *(
            Entry(f"b_{edge}", 0.0, "-", "assumed", {"abs": 0.15}, "half open, no power of the opening")
            for edge in areas
        ),
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
    shown = ", ".join(f"{key}: {_flow(value)}" for key, value in values.items())
    return [
        "rigid_body:",
        "  configs:",
        f"    as_recorded: {{{shown}, prov: {source}, tol: {BODY[source]}}}",
        "payload: {tol: {abs: 20.0}}",
    ]
