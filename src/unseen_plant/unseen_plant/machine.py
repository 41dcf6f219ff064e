"""Reads machine files for this plant: a crane's numbers in SI, each drawn within the tolerance that the file gives it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from boom_input.files import InputError
from boom_input.yaml_text import read_yaml
from unseen_plant.layout import CraneNumbers

DEVIATIONS = 2.0
"""A tolerance is this many standard deviations."""
DRAWN = (
    "fluid.beta", "fluid.C_d", "fluid.p_t", "fluid.p_s", "cylinder.A_a", "cylinder.A_b", "cylinder.V_0a", "cylinder.V_0b",
    "cylinder.V_h", "kinematics.L1", "kinematics.foot.1", "kinematics.att.0", "kinematics.b", "friction.tau_C_pos",
    "friction.tau_C_neg", "friction.k_v_pos", "friction.k_v_neg", "friction.sigma", "hose_burst_valve.a11", "hose_burst_valve.a12",
    "hose_burst_valve.a21", "hose_burst_valve.a30", "hose_burst_valve.a31", "accumulators.V_g0", "accumulators.p_g0_1",
    "accumulators.p_g0_2", "accumulators.d_1", "accumulators.d_2", "accumulators.kappa", "main_valve_spool.A_s",
    "main_valve_spool.d_v", "main_valve_spool.f_c", "main_valve_spool.K_i", "main_valve_spool.T_s", "main_valve_orifices.dp_c",
    "main_valve_orifices.x0", "main_valve_orifices.A_sa_max", "main_valve_orifices.A_tb_max", "main_valve_orifices.A_sb_max",
    "pilot_valves.a1_s", "pilot_valves.h.0", "rigid_body.inertia", "rigid_body.moment", "load",
)  # fmt: skip
"""Numbers that differ from crane to crane. Where a structure lacks one, it is left out."""
_BY_CONFIDENCE = {"high": 0.03, "medium": 0.10, "low": 0.30}
_UNSAID, _PRECHARGE, _BODY = 0.15, 0.05, 0.03
_BARS = ("foot.0", "foot.1", "pivot.0", "pivot.1", "att.0", "att.1", "L1", "L2")
_LAW = re.compile(r"A_sb/\((?P<base>[\d.eE+-]+)-(?P<bend>[\d.eE+-]+)\*u\^2\)")


class UnreadableMachineError(ValueError):
    """The machine file lacks a number; one line that says which."""

    exit_status = 2


@dataclass(frozen=True)
class LockedPose:
    """Angle of the outer boom q3 [rad], telescope q4 [m], configured load [kg]."""

    q3: float
    q4: float
    load: float = 0.0


@dataclass(frozen=True)
class Owner:
    """What the owner of a crane believes: the machine file's document.

    Attributes:
        document: the parsed file.
        name: of the file.
        factors: by which the numbers of one crane differ from it.
    """

    document: Mapping[str, Any]
    name: str
    factors: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def read(path: str | Path) -> Owner:
        """Raises InputError for a file that cannot be read."""
        document = read_yaml(path)
        if not isinstance(document, dict):
            raise InputError(f"{path}: not a machine file")
        return Owner(document, str(document.get("meta", {}).get("name", Path(path).stem)))

    def entry(self, key: str) -> Any:
        """The entry at a dotted key, None where there is none; a number may be an item of a list."""
        entry: Any = self.document
        for part in key.split("."):
            if isinstance(entry, Mapping) and part in entry:
                entry = entry[part]
            elif isinstance(entry, Mapping) and isinstance(entry.get("value"), list) and part.isdigit():
                entry = {**entry, "value": entry["value"][int(part)]}
            else:
                return None
        return entry

    def number(self, key: str, default: float | None = None) -> float:
        """A number with its factor. Raises UnreadableMachineError where it is missing and has no default."""
        entry = self.entry(key)
        value = entry.get("value") if isinstance(entry, Mapping) else entry
        if value is None or isinstance(value, list):
            if default is None:
                raise UnreadableMachineError(f"{self.name}: {key} is missing")
            return default
        try:
            return float(value) * self.factors.get(key, 1.0)
        except (TypeError, ValueError):
            raise UnreadableMachineError(f"{self.name}: {key}: {value!r} is no number") from None

    def kind(self, section: str, default: str) -> str:
        """The component of a section."""
        entry = self.entry(section)
        return str(entry.get("type", default)) if isinstance(entry, Mapping) else default

    def tolerance(self, key: str, pose: LockedPose) -> float:
        """How far, relatively, a number may be off while the machine is still the same."""
        if key == "load":
            return max(0.05, 20.0 / pose.load) if pose.load else 0.0
        if key.startswith("rigid_body."):
            return _BODY if (pose.q3, pose.q4) == (4.59, 0.0) else _BY_CONFIDENCE["medium"] / 2.0
        if key.startswith("accumulators.p_g0"):
            return _PRECHARGE
        entry = self.entry(key)
        if not isinstance(entry, Mapping):
            return _UNSAID
        stated = entry.get("tol")
        if isinstance(stated, int | float):
            return float(stated)
        if entry.get("prov") == "thesis":
            return _BY_CONFIDENCE["high"]
        return _BY_CONFIDENCE.get(str(entry.get("conf", "")), _UNSAID)

    def has(self, key: str) -> bool:
        """Whether a crane of this structure has the number."""
        return key.startswith("rigid_body.") or key == "load" or self.entry(key) is not None

    def drawn(
        self, rng: np.random.Generator, pose: LockedPose, spread: float, wrong: Mapping[str, float]
    ) -> dict[str, float]:
        """Factors of one crane: normal with ``spread`` standard deviations, never beyond the tolerance; ``wrong`` as told."""
        factors = {}
        for key in DRAWN:
            off = float(np.clip(spread * rng.standard_normal(), -DEVIATIONS, DEVIATIONS))
            off = wrong.get(key, off)
            if self.has(key):
                factors[key] = 1.0 + off * self.tolerance(key, pose) / DEVIATIONS
        return factors


def crane(owner: Owner, pose: LockedPose) -> CraneNumbers:
    """All numbers of a crane in a pose [SI].

    Raises:
        UnreadableMachineError: a number is missing, or no configuration has this pose and the bodies are not told.
    """
    n = owner.number
    bars = owner.kind("kinematics", "four_bar") == "four_bar"
    piloted = owner.kind("main_valve_spool", "pilot_operated") == "pilot_operated"
    burst = owner.kind("hose_burst_valve", "flow_limiting") == "flow_limiting"
    gas = owner.kind("accumulators", "two_diaphragm") == "two_diaphragm"
    compensated = (owner.entry("main_valve_orifices") or {}).get("compensator", True) is True
    refill = (owner.entry("main_valve_orifices.anti_cavitation") or {}).get("enabled", False) is True
    law = _LAW.fullmatch(str((owner.entry("main_valve_orifices.A_ta_law") or {}).get("value", "")))
    if law is None:
        raise UnreadableMachineError(f"{owner.name}: main_valve_orifices.A_ta_law is not A_sb/(a-b*u^2)")
    inertia, (sx, sy), (tx, ty) = body(owner, pose)
    moment = owner.factors.get("rigid_body.moment", 1.0)
    x0 = n("main_valve_orifices.x0")

    def there(present: bool, key: str, otherwise: float = 1.0) -> float:
        return n(key) if present else otherwise

    k, v, b, a, s, p = (
        "kinematics.", "main_valve_orifices.", "hose_burst_valve.", "accumulators.", "main_valve_spool.", "pilot_valves."
    )  # fmt: skip
    return CraneNumbers._make([
        n("constants.g"), n("fluid.rho"), n("fluid.beta"), n("fluid.C_d"), n("fluid.p_t"), n("fluid.p_s", 2.5e7),
        n("cylinder.A_a"), n("cylinder.A_b"), n("cylinder.l_p"), n("cylinder.V_0a"), n("cylinder.V_0b"), n("cylinder.V_h"),
        float(bars), *(there(bars, f"{k}{key}") for key in _BARS),
        *(there(not bars, f"{k}{key}") for key in ("a", "b", "phi0")), n("cylinder.l_min"),
        n(f"{k}q2_stroke_min"), n(f"{k}q2_max"),
        inertia * owner.factors.get("rigid_body.inertia", 1.0), sx * moment, sy * moment, tx, ty,
        pose.load * owner.factors.get("load", 1.0),
        n("friction.tau_C_pos"), n("friction.tau_C_neg"), n("friction.k_v_pos"), n("friction.k_v_neg"), n("friction.sigma"),
        float(burst), *(there(burst, f"{b}{key}") for key in ("a11", "a12", "a21", "a30", "a31")), n(f"{b}dp_lin", 0.02),
        float(gas), *(there(gas, f"{a}{key}") for key in ("V_g0", "p_g0_1", "p_g0_2", "d_1", "d_2", "kappa")),
        float(piloted), there(piloted, f"{s}A_s"), n(f"{s}s_max"),
        *(there(piloted, f"{s}{key}") for key in ("k", "m_s", "d_v", "f_c", "sigma_s")),
        *(there(not piloted, f"{s}{key}") for key in ("K_i", "T_s")),
        *(there(piloted, f"{p}{key}") for key in ("a1_s", "b0_s", "b1_s", "h.0", "h.1", "h.2")),
        float(compensated), there(compensated, f"{v}dp_c"), x0, x0, x0, x0, n(f"{v}n"),
        n(f"{v}A_sa_max"), n(f"{v}A_tb_max"), n(f"{v}A_sb_max"), float(law["base"]), float(law["bend"]),
        n(f"{v}anti_cavitation.A_ac") if refill else 0.0, n(f"{v}anti_cavitation.p_open", 0.0), 1.0, 0.0, 0.0, 0.0,
    ])._replace(feed=_feed(owner, piloted))  # fmt: skip


def _feed(owner: Owner, piloted: bool) -> float:
    """b_0: a pole that is off keeps the gain of the stage at rest, which is one (5.2)."""
    return owner.number("pilot_valves.b0_s") * owner.factors.get("pilot_valves.a1_s", 1.0) if piloted else 1.0


def body(owner: Owner, pose: LockedPose) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """Inertia about the boom joint [kg m^2], first moments [kg m] and tip [m] in the boom's frame, without load."""
    for told in (owner.entry("rigid_body.configs") or {}).values():
        if math.isclose(told["q3"], pose.q3, abs_tol=1e-6) and math.isclose(told["q4"], pose.q4, abs_tol=1e-6):
            return (
                float(told["D0"]),
                (float(told["Sx"]), float(told["Sy"])),
                (float(told["tip"][0]), float(told["tip"][1])),
            )
    plane = owner.entry("rigid_body.planar")
    if plane is None:
        raise UnreadableMachineError(f"{owner.name}: no configuration has q3 = {pose.q3:g} rad, q4 = {pose.q4:g} m")
    turn = complex(math.cos(pose.q3), math.sin(pose.q3))
    elbow, arm = complex(*plane["elbow"]["value"]), complex(*plane["arm_origin"]["value"])

    def placed(carrier: str, x: float, z: float) -> complex:
        return complex(x, z) if carrier == "boom" else elbow + turn * (arm + complex(x, -z))

    parts = []
    for name, at in plane["bodies"].items():
        link = owner.entry(f"rigid_body.links.{name}")
        x, z = (_along(axis, link["com"]) for axis in at["axes"])
        normal = 3 - sum("xyz".index(axis[-1]) for axis in at["axes"])
        where = placed(at["carrier"], at["origin"][0] + x, at["origin"][1] + z + at["q4_share"] * pose.q4)
        parts.append((link["m"], where, link["I"][normal]))
    rod = plane["arm_cylinder"]
    foot, eye = complex(*rod["foot"]["value"]), placed("arm", *rod["eye"]["value"])
    axis = (eye - foot) / abs(eye - foot)
    parts.append((rod["barrels"]["m"], foot + rod["barrels"]["com"] * axis, rod["barrels"]["I"]))
    parts.append((rod["rods"]["m"], eye - rod["rods"]["com"] * axis, rod["rods"]["I"]))
    tip = placed("arm", plane["tip"]["origin"][0], plane["tip"]["origin"][1] + plane["tip"]["q4_share"] * pose.q4)
    parts.append((sum(owner.entry(f"rigid_body.links.{name}")["m"] for name in plane["tip"]["hangs"]), tip, 0.0))
    first = sum(m * where for m, where, _ in parts)
    return sum(m * abs(where) ** 2 + own for m, where, own in parts), (first.real, first.imag), (tip.real, tip.imag)


def _along(axis: str, vector: list[float]) -> float:
    return (-1.0 if axis.startswith("-") else 1.0) * float(vector["xyz".index(axis[-1])])
