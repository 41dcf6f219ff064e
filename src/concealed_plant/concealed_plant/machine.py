"""Reads the machine file for this plant: numbers with their confidence, and crane specimens drawn around them.

Both sides share the file as data, but not the code that reads it. A specimen is the file with every number multiplied by its own
factor. Tolerances are those of the machine notes: confidence high or taken from the thesis +-3 %, medium +-10 %, low +-30 %, none
given +-15 %, pre-charge +-5 %, load +-5 % or +-20 kg. A tolerance is read as two standard deviations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_input.files import InputError
from boom_input.yaml_text import read_yaml
from concealed_plant.quantities import Quantities

Array = NDArray[np.float64]

_BY_CONFIDENCE = {"high": 0.03, "medium": 0.10, "low": 0.30}
_FROM_THESIS, _UNSAID, _PRECHARGE = 0.03, 0.15, 0.05
LOAD_SHARE, LOAD_FLOOR = 0.05, 20.0
DEVIATIONS_IN_TOLERANCE = 2.0

# What is drawn. A number that the file derives from others follows them and has its own factor on top (spring). Those that
# only shift others (density, normalisations, limits) stay as they are.
DRAWN = (
    "fluid.beta", "fluid.C_d", "fluid.p_t",
    "cylinder.A_a", "cylinder.A_b", "cylinder.V_0a", "cylinder.V_0b", "cylinder.V_h",
    "kinematics.L1", "kinematics.foot.0", "kinematics.foot.1", "kinematics.att.0",
    "friction.tau_C_pos", "friction.tau_C_neg", "friction.k_v_pos", "friction.k_v_neg", "friction.sigma",
    "hose_burst_valve.a11", "hose_burst_valve.a12", "hose_burst_valve.a21", "hose_burst_valve.a30", "hose_burst_valve.a31",
    "accumulators.V_g0", "accumulators.p_g0_1", "accumulators.p_g0_2", "accumulators.d_1", "accumulators.d_2",
    "accumulators.kappa",
    "main_valve_spool.k", "main_valve_spool.d_v", "main_valve_spool.f_c",
    "main_valve_orifices.dp_c", "main_valve_orifices.x0", "main_valve_orifices.n", "main_valve_orifices.A_sa_max",
    "main_valve_orifices.A_tb_max", "main_valve_orifices.A_sb_max", "main_valve_orifices.A_ta_law",
    "pilot_valves.a1_s", "pilot_valves.h.0",
    "rigid_body.inertia", "rigid_body.moment",
)  # fmt: skip


class MachineFileError(ValueError):
    """The machine file lacks something that the concealed plant needs."""

    exit_status = 2


@dataclass(frozen=True)
class Posture:
    """Locked joints and the configured load: q_3 [rad], q_4 [m], [kg]."""

    outer_boom_angle: float
    telescope_length: float
    load: float


@dataclass(frozen=True)
class BoomLinkage:
    """s_p(q_2) as an equidistant table: angles [rad], strokes [m], levers ds_p/dq_2 [m/rad]."""

    angles: Array
    strokes: Array
    levers: Array


@dataclass(frozen=True)
class MachineFile:
    """A machine file. ``factors``: dotted key (with ``.0``, ``.1`` for a component) -> factor on its number."""

    document: Mapping[str, Any]
    factors: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def read(path: str | Path) -> MachineFile:
        """Read a file. Raises MachineFileError if it cannot be read as YAML."""
        try:
            document = read_yaml(path)
        except InputError as error:
            raise MachineFileError(str(error)) from None
        if not isinstance(document, dict):
            raise MachineFileError(f"{path}: not a machine file: expected sections such as fluid, cylinder, kinematics")
        return MachineFile(document)

    @property
    def name(self) -> str:
        """Its ``meta.name``."""
        return str(self.document["meta"]["name"])

    def specimen(self, factors: Mapping[str, float]) -> MachineFile:
        """The same machine with these factors on top of its own."""
        merged = dict(self.factors)
        for key, factor in factors.items():
            merged[key] = merged.get(key, 1.0) * factor
        return MachineFile(self.document, merged)

    def entry(self, key: str) -> Mapping[str, Any]:
        """The mapping of a dotted key. Raises MachineFileError if it is missing."""
        node: Any = self.document
        for part in key.split("."):
            if not isinstance(node, Mapping) or part not in node:
                raise MachineFileError(f"machine file: {key} is missing")
            node = node[part]
        return dict(node)

    def number(self, key: str, component: int | None = None) -> float:
        """A number, or one component of a list, with its factor."""
        value = self.entry(key)["value"]
        if component is None:
            return float(value) * self.factors.get(key, 1.0)
        return float(value[component]) * self.factors.get(f"{key}.{component}", 1.0)

    def tolerance(self, key: str, pose: Posture) -> float:
        """Relative tolerance of a key of ``DRAWN``."""
        if key.startswith("rigid_body."):
            near = [c for c in self.entry("rigid_body.configs").values() if abs(c["q3"] - pose.outer_boom_angle) < 0.3]
            return _BY_CONFIDENCE[near[0]["conf"]] if near else _BY_CONFIDENCE["medium"]
        if key.startswith("accumulators.p_g0"):
            return _PRECHARGE
        item = self.entry(re.sub(r"\.\d$", "", key))
        if "tolerance" in item:
            return float(item["tolerance"])
        if "conf" in item:
            return _BY_CONFIDENCE[item["conf"]]
        return _FROM_THESIS if str(item.get("prov", "")).startswith("thesis") else _UNSAID


def load_deviation(load: float) -> float:
    """Standard deviation [kg] of a configured load of so many kg."""
    return max(LOAD_SHARE * load, LOAD_FLOOR) / DEVIATIONS_IN_TOLERANCE


def scattered(machine: MachineFile, pose: Posture, rng: np.random.Generator, deviations: float) -> dict[str, float]:
    """Factors of every drawn key: normal with ``deviations`` of the key's own standard deviations, inside its tolerance."""
    factors = {}
    for key in DRAWN:
        tolerance = machine.tolerance(key, pose)
        step = deviations * rng.standard_normal() / DEVIATIONS_IN_TOLERANCE
        factors[key] = 1.0 + tolerance * float(np.clip(step, -1.0, 1.0))
    return factors


def quantities(machine: MachineFile, pose: Posture) -> Quantities:
    """The numbers of the machine in a pose, without concealed effects."""
    f = machine.number
    inertia, moment, tip = locked_body(pose)
    scale_d, scale_s = machine.factors.get("rigid_body.inertia", 1.0), machine.factors.get("rigid_body.moment", 1.0)
    out_0, out_1 = _meter_out(machine)
    refill = machine.entry("main_valve_orifices.anti_cavitation")
    valve, spool, line = "hose_burst_valve", "main_valve_spool", "accumulators"
    return Quantities(
        gravity=f("constants.g"), inertia=inertia * scale_d, moment_x=moment[0] * scale_s, moment_y=moment[1] * scale_s,
        tip_x=tip[0], tip_y=tip[1], load=pose.load, inertia_scale=scale_d, moment_scale=scale_s,
        density=f("fluid.rho"), bulk=f("fluid.beta"), discharge=f("fluid.C_d"), tank=f("fluid.p_t"),
        area_a=f("cylinder.A_a"), area_b=f("cylinder.A_b"), stroke=f("cylinder.l_p"), dead_a=f("cylinder.V_0a"),
        dead_b=f("cylinder.V_0b"), hose=f("cylinder.V_h"),
        coulomb_up=f("friction.tau_C_pos"), coulomb_down=f("friction.tau_C_neg"), viscous_up=f("friction.k_v_pos"),
        viscous_down=f("friction.k_v_neg"), slip=f("friction.sigma"),
        hbv_11=f(f"{valve}.a11"), hbv_12=f(f"{valve}.a12"), hbv_21=f(f"{valve}.a21"), hbv_30=f(f"{valve}.a30"),
        hbv_31=f(f"{valve}.a31"), hbv_knee=f(f"{valve}.dp_lin"),
        gas=f(f"{line}.V_g0"), precharge_1=f(f"{line}.p_g0_1"), precharge_2=f(f"{line}.p_g0_2"),
        throat_1=f(f"{line}.d_1"), throat_2=f(f"{line}.d_2"), kappa=f(f"{line}.kappa"),
        spool_area=f(f"{spool}.A_s"), spool_stroke=f(f"{spool}.s_max"), spring=f(f"{spool}.k"), spool_mass=f(f"{spool}.m_s"),
        spool_damping=f(f"{spool}.d_v"), spool_coulomb=f(f"{spool}.f_c"), spool_slip=f(f"{spool}.sigma_s"),
        overlap=f("main_valve_orifices.x0"), progression=f("main_valve_orifices.n"), margin=f("main_valve_orifices.dp_c"),
        edge_sa=f("main_valve_orifices.A_sa_max"), edge_tb=f("main_valve_orifices.A_tb_max"),
        edge_sb=f("main_valve_orifices.A_sb_max"), out_0=out_0, out_1=out_1,
        refill=float(refill["A_ac"]) if refill.get("enabled", True) else 0.0, refill_opens=float(refill.get("p_open", 0.0)),
        pole=f("pilot_valves.a1_s"), gain=f("pilot_valves.b0_s") * machine.factors.get("pilot_valves.a1_s", 1.0),
        through=f("pilot_valves.b1_s"), curve_2=f("pilot_valves.h", 0), curve_1=f("pilot_valves.h", 1),
        curve_0=f("pilot_valves.h", 2),
    )  # fmt: skip


def _meter_out(machine: MachineFile) -> tuple[float, float]:
    """c_0, c_1 of the area law "A_sb/(c_0-c_1*u^2)", divided by the factor of that area."""
    law = str(machine.entry("main_valve_orifices.A_ta_law")["value"]).replace(" ", "")
    found = re.fullmatch(r"A_sb/\(([\d.e+-]+)-([\d.e+-]+)\*u\^2\)", law)
    if not found:
        raise MachineFileError(f"machine file: main_valve_orifices.A_ta_law is {law!r}, expected A_sb/(c0-c1*u^2)")
    factor = machine.factors.get("main_valve_orifices.A_ta_law", 1.0)
    return float(found[1]) / factor, float(found[2]) / factor


def linkage(machine: MachineFile, count: int = 6001) -> BoomLinkage:
    """The four-bar linkage: its closed form as the intersection of two circles, tabulated over the whole range of the boom angle.

    The pin-to-pin length at zero stroke follows from the angle at which the stroke begins according to the file.
    """
    low, high = (
        float(machine.entry("kinematics.q2_stroke_min")["value"]),
        float(machine.entry("kinematics.q2_max")["value"]),
    )
    angles = np.linspace(low - 0.02, high + 0.02, count)
    lengths = _pin_to_pin(machine, angles)
    strokes = lengths - float(_pin_to_pin(machine, np.array([low]))[0])
    step = 1e-5
    levers = (_pin_to_pin(machine, angles + step) - _pin_to_pin(machine, angles - step)) / (2 * step)
    return BoomLinkage(angles, strokes, levers)


def _pin_to_pin(machine: MachineFile, angles: Array) -> Array:
    """Distance [m] from the cylinder's foot to the pin where both bars meet, the lower of the circles' two intersections."""
    foot, pivot, att = (
        complex(machine.number(f"kinematics.{k}", 0), machine.number(f"kinematics.{k}", 1))
        for k in ("foot", "pivot", "att")
    )
    long_bar, short_bar = machine.number("kinematics.L1"), machine.number("kinematics.L2")
    eye = np.exp(1j * angles) * att
    apart = np.abs(eye - pivot)
    cosine = (long_bar**2 + apart**2 - short_bar**2) / (2 * long_bar * apart)
    direction = (eye - pivot) / apart * np.exp(-1j * np.arccos(np.clip(cosine, -1.0, 1.0)))
    return np.asarray(np.abs(pivot + long_bar * direction - foot), dtype=np.float64)


def locked_body(pose: Posture) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """D_0 [kg m^2], (S_x, S_y) [kg m] and the tip [m] in the boom's frame, without load: the table of the machine notes."""
    turn = complex(math.cos(pose.outer_boom_angle), math.sin(pose.outer_boom_angle))
    bodies, tip = placed_bodies(turn, pose.telescope_length)
    inertia = sum(mass * abs(at) ** 2 + own for mass, at, own, _ in bodies)
    moment = sum((mass * at for mass, at, _, _ in bodies), 0j)
    return inertia, (moment.real, moment.imag), (tip.real, tip.imag)


def placed_bodies(turn: Any, q4: Any) -> tuple[tuple[tuple[float, Any, float, Any], ...], Any]:
    """Mass [kg], centre [m], own inertia [kg m^2] and long axis of each body, and the tip; complex numbers in the boom's frame.

    turn: exp(i q_3); q4 [m]; numbers, or both over time.
    """

    def arm(x: float, z: Any) -> Any:
        return 3.49288 + turn * (-0.3925 + x - 1j * z)

    tip = arm(0.0, 3.157 + q4)
    foot, eye = complex(1.81268, -0.0485), arm(0.274489, 0.468)
    along, out = (eye - foot) / abs(eye - foot), -1j * turn
    return (
        (407.665, complex(1.61004, 0.039036), 482.518, 1.0), (275.94, arm(0.3015, 1.263), 236.05, out),
        (128.16, arm(0.2947, 1.4913 + q4 / 2), 128.38, out), (95.827, arm(0.251, 1.587 + q4), 88.42, out),
        (47.1186, foot + 0.4944 * along, 7.46, along), (70.814, eye - 0.547 * along, 9.88, along), (345.749, tip, 0.0, out),
    ), tip  # fmt: skip
