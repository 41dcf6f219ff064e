"""Writes ``urdf/epsilon_tz17.urdf`` from the machine file, so that both hold the same numbers.

    python -m boom_description.make_urdf [--machine FILE] [--output FILE]

Frames as in REP 103: x forward, y left, z up. ``base_link`` is the root, on the ground under the slewing axis. A joint
angle is positive where it lifts. ``telescope_joint`` is the total extension q4, as in
boom_interfaces/MachineConfiguration; both stages hang on the outer boom, and the first follows by half (mimic). ``boom_tip`` lies
in the tip hinge, x outward along the arm.

The arm cylinder closes a loop, which a tree of links cannot represent. Its barrels are set on the inner boom and its rods on
the outer boom so that the first moment about the boom joint is that of the machine file at `LUMPED_AT` and within 0.5 %
of it in every other pose; the inertia is within 2 %. The load at the tip is a point mass in the hinge, as in the model.
Shapes are sketches, and the collision shapes are the same boxes: planning keeps the sketched crane clear, not the real one.
"""

from __future__ import annotations

import argparse
import math
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_input.files import InputError
from boom_input.whole import write_whole
from boom_input.yaml_text import parse_yaml, read_yaml
from boom_model.errors import MachineError
from boom_model.rigid_body import entry, frame_axes, group, hanging_mass, link_data, place_bodies, scalar, vector

Vector = NDArray[np.float64]

ROBOT_NAME = "epsilon_tz17"
LEAST_MASS = 1e-3
"""kg"""
BODIES = ("inner_boom", "outer_boom", "telescope_1", "telescope_2")
ROOT_FRAME = "base_link"
TIP_FRAME = "boom_tip"
LUMPED_AT = (
    math.pi / 2
)  # q3 [rad] at which the arm cylinder's parts are shared out: arm in line, between folded and extended

NOTICE = (
    " Made by boom_description.make_urdf from the machine file: change that, not this file. "
    "Numbers come from public descriptions of an Epsilon crane of the same institute "
    "(Geryyy/crane_model, Geryyy/crane_planning); "
    "that it is the crane of the thesis is inferred from equal reach, fold angle and gripper, not stated anywhere. "
    "The shapes are sketches, for collision as for the eye. The format asks for effort and velocity of every joint: "
    "only those of inner_boom_joint follow from the "
    "machine (head side at 250 bar; full current), the others are assumed. "
)

# joint: (effort [N m or N], velocity [rad/s or m/s]); see NOTICE.
EFFORT_AND_VELOCITY = {
    "slewing_joint": (4.0e4, 0.5),
    "inner_boom_joint": (1.74e5, 0.33),
    "outer_boom_joint": (1.0e5, 0.4),
    "telescope_joint": (3.0e4, 0.6),
    "telescope_stage_joint": (3.0e4, 0.3),
    "gripper_hinge_joint": (1.0e3, 2.0),
}
# Column frame of the machine file (x forward, y up, z to the right) to REP 103.
COLUMN_TO_URDF: Vector = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# Plane frame of a body (first axis, second axis, across) to REP 103: the boom's second axis is up, the arm's runs down
# the arm.
BOOM_TO_URDF = COLUMN_TO_URDF
ARM_TO_URDF: Vector = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Inertial:
    """Mass [kg], centre (3,) [m] and inertia about it (3, 3) [kg m^2] in a link's frame."""

    mass: float
    center: Vector
    inertia: Vector

    def with_point(self, mass: float, position: Vector, own_inertia: float = 0.0) -> Inertial:
        """This body and another of `mass` at `position`, whose inertia about any axis is `own_inertia`."""
        total = self.mass + mass
        if not total >= LEAST_MASS:
            return self
        center = (self.mass * self.center + mass * position) / total
        inertia = self.inertia + _steiner(self.mass, self.center - center) + _steiner(mass, position - center)
        return Inertial(total, center, inertia + own_inertia * np.eye(3))


def load_machine(path: Path | None = None) -> Mapping[str, Any]:
    """The machine file as a mapping; without a path the tz17 of boom_model. Raises MachineError if it is unreadable."""
    try:
        if path is None:
            shipped = resources.files("boom_model") / "machines" / "tz17.yaml"
            document = parse_yaml(shipped.read_text(encoding="utf-8"), "tz17")
        else:
            document = read_yaml(path)
    except InputError as error:
        raise MachineError(f"machine file {error}") from None
    if not isinstance(document, Mapping) or "rigid_body" not in document:
        raise MachineError(f"machine file {path} has no section rigid_body: the URDF is made from it")
    return document


def make_urdf(machine: Mapping[str, Any]) -> str:
    """The URDF of the machine as text. Raises MachineError that names a missing or impossible key."""
    body = machine["rigid_body"]
    planar = entry(body, "rigid_body", "planar")
    limits = _limits(body)
    elbow = _plane_vector(planar, "elbow")
    arm = _plane_vector(planar, "arm_origin")
    joint_x, joint_height = vector(entry(planar, "rigid_body.planar", "boom_joint"), "rigid_body.planar.boom_joint", 2)
    tip = entry(planar, "rigid_body.planar", "tip")
    out = vector(entry(tip, "rigid_body.planar.tip", "origin"), "rigid_body.planar.tip.origin", 2)
    telescope = np.array([arm[0] + out[0], 0.0, arm[2] - out[1]])  # both stages and the tip, at q4 = 0, from the elbow
    inertials = _inertials(body)
    for name, inertial in inertials.items():
        if not inertial.mass >= LEAST_MASS:
            raise MachineError(f"rigid_body.links.{name}.m: the URDF needs a mass of at least {LEAST_MASS:g} kg")

    robot = ET.Element("robot", name=ROBOT_NAME)
    robot.append(ET.Comment(NOTICE))
    for name, color in (("orange", "0.85 0.40 0.10 1"), ("grey", "0.45 0.45 0.48 1"), ("steel", "0.70 0.72 0.75 1")):
        ET.SubElement(ET.SubElement(robot, "material", name=name), "color", rgba=color)

    _link(robot, ROOT_FRAME, None, [("grey", [0.9, 0.9, 0.5], [0.0, 0.0, 0.25])])
    _joint(robot, "slewing_joint", "revolute", ROOT_FRAME, "column", [0, 0, 0], [0, 0, 1], limits)
    _link(
        robot,
        "column",
        inertials["slewing_column"],
        [("orange", [0.45, 0.4, joint_height - 0.5], [0.0, 0.0, 0.25 + joint_height / 2])],
    )
    _joint(
        robot, "inner_boom_joint", "revolute", "column", "inner_boom", [joint_x, 0, joint_height], [0, -1, 0], limits
    )
    boom_shape = ("orange", [elbow[0], 0.24, 0.30], [elbow[0] / 2, 0.0, elbow[2] / 2])
    _link(robot, "inner_boom", inertials["inner_boom"], [boom_shape])
    _joint(robot, "outer_boom_joint", "revolute", "inner_boom", "outer_boom", elbow, [0, -1, 0], limits)
    _link(robot, "outer_boom", inertials["outer_boom"], [_tube("orange", 0.30, 2.9, inertials["outer_boom"], -1.35)])
    mimic = ("telescope_joint", 0.5)
    _joint(
        robot, "telescope_stage_joint", "prismatic", "outer_boom", "telescope_1", telescope, [0, 0, -1], limits, mimic
    )
    _link(
        robot,
        "telescope_1",
        inertials["telescope_1"],
        [_tube("steel", 0.24, 2.9, inertials["telescope_1"], out[1] - 1.5)],
    )
    _joint(robot, "telescope_joint", "prismatic", "outer_boom", "telescope_2", telescope, [0, 0, -1], limits)
    tip_plate = (
        "steel",
        [2 * inertials["telescope_2"].center[0], 0.14, 0.14],
        [inertials["telescope_2"].center[0] / 2, 0.0, 0.0],
    )
    stage = _tube("steel", 0.19, 3.0, inertials["telescope_2"], 1.5)
    _link(robot, "telescope_2", inertials["telescope_2"], [stage, tip_plate])
    _joint(
        robot, f"{TIP_FRAME}_joint", "fixed", "telescope_2", TIP_FRAME, [0, 0, 0], None, limits, rpy=[0, math.pi / 2, 0]
    )
    _link(robot, TIP_FRAME, None, [])
    _joint(robot, "gripper_hinge_joint", "revolute", TIP_FRAME, "gripper", [0, 0, 0], [0, -1, 0], limits)
    gripper = [("grey", [0.16, 0.16, 0.72], [0.0, 0.0, -0.36]), ("grey", [0.5, 0.9, 0.6], [0.0, 0.0, -1.02])]
    _link(robot, "gripper", inertials["gripper"], gripper)

    ET.indent(robot, space="  ")
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def shipped_urdf() -> str:
    """Text of the URDF that this package ships."""
    return (resources.files("boom_description") / "urdf" / f"{ROBOT_NAME}.urdf").read_text(encoding="utf-8")


def main(argv: Sequence[str] | None = None) -> int:
    """Write the URDF. Returns the exit status: 0, or 2 with one line on stderr."""
    parser = argparse.ArgumentParser(
        prog="python -m boom_description.make_urdf", description="Make the crane's URDF from a machine file."
    )
    parser.add_argument("--machine", type=Path, metavar="FILE", help="machine file (default: the tz17 of boom_model)")
    default = Path(__file__).parent / "urdf" / f"{ROBOT_NAME}.urdf"
    parser.add_argument(
        "--output", type=Path, metavar="FILE", default=default, help="file to write (default: the one in this package)"
    )
    arguments = parser.parse_args(argv)
    try:
        write_whole(arguments.output, make_urdf(load_machine(arguments.machine)))
    except (MachineError, OSError) as error:
        print(f"make_urdf: {error}", file=sys.stderr)
        return 2
    print(f"wrote {arguments.output}")
    return 0


def _inertials(body: Mapping[str, Any]) -> dict[str, Inertial]:
    """Inertials of all links in their URDF frames: the bodies of the machine file, rotated, and the distributed masses."""
    planar, links = entry(body, "rigid_body", "planar"), entry(body, "rigid_body", "links")
    mass, center, inertia = link_data(links, "slewing_column")
    joint = vector(entry(planar, "rigid_body.planar", "boom_joint"), "rigid_body.planar.boom_joint", 2)
    foot = np.array([joint[0], 0.0, joint[1]])
    inertials = {"slewing_column": _turned(mass, center, inertia, COLUMN_TO_URDF, foot)}
    bodies = group(planar, "rigid_body.planar", "bodies")
    for name in BODIES:
        entry(bodies, "rigid_body.planar.bodies", name)
    for name, item in bodies.items():
        key = f"rigid_body.planar.bodies.{name}"
        origin = vector(entry(item, key, "origin"), f"{key}.origin", 2)
        if entry(item, key, "carrier") == "boom":
            turn, at = BOOM_TO_URDF, np.array([origin[0], 0.0, origin[1]])
        elif scalar(entry(item, key, "q4_share"), f"{key}.q4_share") > 0.0:
            turn, at = ARM_TO_URDF, np.zeros(3)  # a stage: its link's origin is where the machine file has it
        else:
            arm = _plane_vector(planar, "arm_origin")
            turn, at = ARM_TO_URDF, np.array([arm[0] + origin[0], 0.0, arm[2] - origin[1]])
        inertials[name] = _turned(*link_data(links, name), turn @ frame_axes(item, key), at)
    _share_out_arm_cylinder(body, inertials)
    # The source's tensor of the gripper is not physical (10 > 5 + 4.56 kg m^2): its mean stands on every axis.
    moments = sum(float(np.trace(link_data(links, name)[2])) for name in ("tip_link", "rotator", "gripper_frame"))
    inertials["gripper"] = Inertial(hanging_mass(body), np.zeros(3), moments / 3 * np.eye(3))
    return inertials


def _share_out_arm_cylinder(body: Mapping[str, Any], inertials: dict[str, Inertial]) -> None:
    """Add barrels to the inner boom and rods to the outer boom; see the module's docstring."""
    planar = entry(body, "rigid_body", "planar")
    if "arm_cylinder" not in planar:
        return
    cylinder = entry(planar, "rigid_body.planar", "arm_cylinder")
    placed = {part.name: part for part in place_bodies(body, LUMPED_AT, 0.0)}
    barrels, rods = placed["arm_cylinder_barrels"], placed["arm_cylinder_rods"]
    eye = vector(entry(cylinder, "rigid_body.planar.arm_cylinder", "eye"), "rigid_body.planar.arm_cylinder.eye", 2)
    arm = _plane_vector(planar, "arm_origin")
    # Rods sit at the eye on the arm; what is missing to their true first moment is made up by moving the barrels.
    eye_on_arm = np.array([arm[0] + eye[0], 0.0, arm[2] - eye[1]])
    elbow = _plane_vector(planar, "elbow")
    cos, sin = math.cos(LUMPED_AT), math.sin(LUMPED_AT)
    eye_on_boom = np.array(
        [elbow[0] + cos * eye_on_arm[0] - sin * eye_on_arm[2], elbow[2] + sin * eye_on_arm[0] + cos * eye_on_arm[2]]
    )
    if not barrels.mass >= LEAST_MASS:
        raise MachineError(
            f"rigid_body.planar.arm_cylinder.barrels.m: the URDF needs a mass of at least {LEAST_MASS:g} kg"
        )
    lumped = barrels.center + rods.mass * (rods.center - eye_on_boom) / barrels.mass
    on_boom = np.array([lumped[0], 0.0, lumped[1]])
    inertials["inner_boom"] = inertials["inner_boom"].with_point(barrels.mass, on_boom, barrels.inertia)
    inertials["outer_boom"] = inertials["outer_boom"].with_point(rods.mass, eye_on_arm, rods.inertia)


def _limits(body: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Lower and upper limit of each moving joint [rad or m]."""
    table = entry(body, "rigid_body", "joint_limits")

    def pair(name: str, factor: float = 1.0) -> tuple[float, float]:
        low, high = factor * vector(entry(table, "rigid_body.joint_limits", name), f"rigid_body.joint_limits.{name}", 2)
        return float(low), float(high)

    return {
        "slewing_joint": pair("q1"),
        "inner_boom_joint": pair("q2"),
        "outer_boom_joint": pair("q3"),
        "telescope_joint": pair("q4_per_stage", 2.0),
        "telescope_stage_joint": pair("q4_per_stage"),
        "gripper_hinge_joint": pair("q6"),
    }


def _plane_vector(planar: Mapping[str, Any], name: str) -> Vector:
    """A point (x, y up) of the boom's plane as (x, 0, z)."""
    point = vector(entry(planar, "rigid_body.planar", name), f"rigid_body.planar.{name}", 2)
    return np.array([point[0], 0.0, point[1]])


def _turned(mass: float, center: Vector, inertia: Vector, turn: Vector, origin: Vector) -> Inertial:
    return Inertial(mass, origin + turn @ center, turn @ inertia @ turn.T)


def _steiner(mass: float, offset: Vector) -> Vector:
    tensor: Vector = mass * (float(offset @ offset) * np.eye(3) - np.outer(offset, offset))
    return tensor


def _tube(
    color: str, width: float, length: float, inertial: Inertial, middle: float
) -> tuple[str, list[float], list[float]]:
    """A box along the arm, centred across where the body's mass is."""
    return color, [width, width, length], [float(inertial.center[0]), 0.0, middle]


def _link(
    robot: ET.Element,
    name: str,
    inertial: Inertial | None,
    boxes: Sequence[tuple[str, Sequence[float], Sequence[float]]],
) -> None:
    link = ET.SubElement(robot, "link", name=name)
    if inertial is not None:
        element = ET.SubElement(link, "inertial")
        ET.SubElement(element, "origin", xyz=_numbers(inertial.center))
        ET.SubElement(element, "mass", value=_number(inertial.mass))
        tensor = inertial.inertia
        names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
        ET.SubElement(element, "inertia", {key: _number(float(tensor[index])) for key, index in names.items()})
    for color, size, center in boxes:
        visual = ET.SubElement(link, "visual")
        ET.SubElement(visual, "origin", xyz=_numbers(center))
        ET.SubElement(ET.SubElement(visual, "geometry"), "box", size=_numbers(size))
        ET.SubElement(visual, "material", name=color)
        collision = ET.SubElement(link, "collision")
        ET.SubElement(collision, "origin", xyz=_numbers(center))
        ET.SubElement(ET.SubElement(collision, "geometry"), "box", size=_numbers(size))


def _joint(
    robot: ET.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    origin: Sequence[float] | Vector,
    axis: Sequence[float] | None,
    limits: Mapping[str, tuple[float, float]],
    mimic: tuple[str, float] | None = None,
    rpy: Sequence[float] | None = None,
) -> None:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    attributes = {"xyz": _numbers(origin)} | ({"rpy": _numbers(rpy)} if rpy is not None else {})
    ET.SubElement(joint, "origin", attributes)
    if axis is None:
        return
    ET.SubElement(joint, "axis", xyz=_numbers(axis))
    (low, high), (effort, velocity) = limits[name], EFFORT_AND_VELOCITY[name]
    bounds = {"lower": low, "upper": high, "effort": effort, "velocity": velocity}
    ET.SubElement(joint, "limit", {key: _number(value) for key, value in bounds.items()})
    if mimic is not None:
        ET.SubElement(joint, "mimic", joint=mimic[0], multiplier=_number(mimic[1]))


def _number(value: float) -> str:
    return f"{round(float(value), 9) + 0.0:.10g}"  # + 0.0: no minus zero


def _numbers(values: Sequence[float] | Vector) -> str:
    return " ".join(_number(value) for value in values)


if __name__ == "__main__":
    sys.exit(main())
