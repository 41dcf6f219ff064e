"""Rigid body of the crane with every joint but the boom's locked, (3.3)-(3.4): D_0, (S_x, S_y) and the tip in any pose.

    D_0 = sum_i (m_i |r_i|^2 + I_i)        (S_x, S_y) = sum_i m_i r_i

r_i is the centre of body i in the boom's frame (origin at the boom joint, x along the boom, y up); it follows from the
arm angle q_3 and the telescope's extension q_4. Masses at the tip hinge count as a point mass there; the load is
left out (``equation_of_motion`` adds it, and holds D and g(q_2) themselves). The angle is positive upwards.

The sums are pinocchio's: the bodies become one body on one revolute joint, D_0 is its joint-space inertia (composite
rigid body algorithm) and S_x, S_y are its generalised gravity at two angles under 1 m/s^2.

Symbols: q_3 [rad] (pi/2 = arm in line with the boom, 4.59 = folded), q_4 [m] (total extension of both stages), D_0
[kg m^2], S_x, S_y [kg m], tip [m]. Valid within the machine's joint limits. Not included: the boom cylinder and its
linkage (2 % of g).
Source: sections ``rigid_body.links`` and ``rigid_body.planar`` of the machine file; how they are read: machine notes.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_model.errors import MachineError

Vector = NDArray[np.float64]
Point = tuple[Any, Any]
"""(x, y) [m], numbers or CasADi expressions."""

AXES = ("x", "y", "z")
LARGEST = 1e6
"""Limit of a mass [kg], a length [m], an inertia [kg m^2]: far beyond any crane, and its squares stay finite."""
LIMIT_SLACK = 1e-3
"""rad or m: a pose read from a message may lie this far outside the joint limits by rounding."""


class PoseError(MachineError):
    """A joint angle or extension that the machine cannot have; the message gives the range."""


@dataclass(frozen=True)
class LockedBody:
    """The body that the boom joint carries in one pose, without the load.

    Attributes:
        D0: inertia about the boom joint [kg m^2].
        Sx: first moment along the boom [kg m].
        Sy: first moment across the boom, upwards [kg m].
        tip: the tip hinge (x, y) in the boom's frame [m]; the load hangs there.
        load_mass: the load [kg] of the pose; not in D0, Sx, Sy.
    """

    D0: float
    Sx: float
    Sy: float
    tip: tuple[float, float]
    load_mass: float = 0.0


@dataclass(frozen=True)
class Body:
    """One rigid body in the boom's plane frame; numbers, or CasADi expressions of q_3 and q_4.

    Attributes:
        mass: [kg].
        x, y: its centre [m].
        inertia: about the centre, across the plane [kg m^2].
        angle: its turn against the boom, up to a constant [rad].
        spread: int x^2 dm, int y^2 dm, int x y dm about the centre, along the boom's axes [kg m^2].
    """

    name: str
    mass: float
    x: Any
    y: Any
    inertia: float
    angle: Any = 0.0
    spread: tuple[Any, Any, Any] = (0.0, 0.0, 0.0)

    @property
    def center(self) -> Vector:
        """The centre (2,) [m] where it is a number."""
        return np.array([self.x, self.y])


def locked_inertia(rigid_body: Mapping[str, Any], q3: float, q4: float, load_mass: float = 0.0) -> LockedBody:
    """Inertia, first moments and tip for the arm angle q3 [rad], the extension q4 [m] and the load [kg] at the tip.

    ``rigid_body`` is the section of that name of a machine file, as a plain mapping; its parts ``links`` and ``planar``
    are read, and ``joint_limits`` if present.

    Raises:
        MachineError: a key is missing or has no sensible value; the message names it.
        PoseError: q3, q4 or the load is impossible.
    """
    check_pose(rigid_body, q3, q4)
    if not (math.isfinite(load_mass) and load_mass >= 0.0):
        raise PoseError(f"the load is {load_mass} kg: give a mass of 0 kg or more")
    model = _one_joint_model(place_bodies(rigid_body, q3, q4))
    pinocchio = importlib.import_module("pinocchio")
    data = model.createData()
    inertia = pinocchio.crba(model, data, np.zeros(1))[0, 0]
    level = pinocchio.computeGeneralizedGravity(model, data, np.array([0.0]))[0]
    upright = pinocchio.computeGeneralizedGravity(model, data, np.array([math.pi / 2]))[0]
    tip_x, tip_y = tip_position(rigid_body, q3, q4)
    return LockedBody(
        float(inertia), float(level), -float(upright), (float(tip_x), float(tip_y)), load_mass=float(load_mass)
    )


def tip_position(rigid_body: Mapping[str, Any], q3: float, q4: float) -> Vector:
    """The tip hinge, shape (2,), in the boom's frame [m]. Raises MachineError for a missing key."""
    return np.array(tip_point(rigid_body, q3, q4))


def tip_point(rigid_body: Mapping[str, Any], q3: Any, q4: Any) -> Point:
    """The same for numbers or CasADi symbols."""
    tip = entry(entry(rigid_body, "rigid_body", "planar"), "rigid_body.planar", "tip")
    return _place(rigid_body, "rigid_body.planar.tip", tip, (0.0, 0.0), q3, q4)


def place_bodies(rigid_body: Mapping[str, Any], q3: Any, q4: Any) -> list[Body]:
    """Every body that the boom joint carries, placed for q3 [rad] and q4 [m], numbers or CasADi symbols.

    Raises:
        MachineError: a key is missing or has no sensible value.
    """
    links = entry(rigid_body, "rigid_body", "links")
    planar = entry(rigid_body, "rigid_body", "planar")
    placed = []
    for name, item in group(planar, "rigid_body.planar", "bodies").items():
        key = f"rigid_body.planar.bodies.{name}"
        mass, center, inertia = link_data(links, name)
        turn = frame_axes(item, key)
        first, second, _ = (float(v) for v in turn @ center)
        own = turn @ inertia @ turn.T
        across = float(turn[2] @ inertia @ turn[2])
        x, y = _place(rigid_body, key, item, (first, second), q3, q4)
        thick = 0.5 * float(np.trace(own))
        spread = (thick - float(own[0, 0]), thick - float(own[1, 1]), -float(own[0, 1]))
        if entry(item, key, "carrier") == "arm":
            placed.append(Body(name, mass, x, y, across, q3, _turned((spread[0], spread[1], -spread[2]), q3)))
        else:
            placed.append(Body(name, mass, x, y, across, 0.0, spread))
    placed.append(Body("tip", hanging_mass(rigid_body), *tip_point(rigid_body, q3, q4), 0.0))
    return placed + _arm_cylinders(rigid_body, q3)


def check_pose(rigid_body: Mapping[str, Any], q3: float, q4: float) -> None:
    """Raise PoseError if q3 [rad] or q4 [m] is not a number or outside ``joint_limits``."""
    limits = group(rigid_body, "rigid_body", "joint_limits") if "joint_limits" in rigid_body else {}
    ranges = {}
    if "q3" in limits:
        ranges["outer boom angle q3"] = (q3, vector(limits["q3"], "rigid_body.joint_limits.q3", 2), "rad")
    if "q4_per_stage" in limits:
        stage = vector(limits["q4_per_stage"], "rigid_body.joint_limits.q4_per_stage", 2)
        ranges["telescope length q4"] = (q4, 2.0 * stage, "m")
    if not (math.isfinite(q3) and math.isfinite(q4)):
        raise PoseError(f"the pose q3 = {q3} rad, q4 = {q4} m is not a pair of numbers")
    for name, (value, (low, high), unit) in ranges.items():
        if not low - LIMIT_SLACK <= value <= high + LIMIT_SLACK:
            raise PoseError(f"{name} is {value:g} {unit}: this machine has {low:g} to {high:g} {unit}")


def hanging_mass(rigid_body: Mapping[str, Any]) -> float:
    """Mass [kg] at the tip hinge without the load: rotator, gripper and jaws."""
    tip = entry(entry(rigid_body, "rigid_body", "planar"), "rigid_body.planar", "tip")
    links = entry(rigid_body, "rigid_body", "links")
    return sum(
        scalar(
            entry(entry(links, "rigid_body.links", name), f"rigid_body.links.{name}", "m"), f"rigid_body.links.{name}.m"
        )
        for name in words(tip, "rigid_body.planar.tip", "hangs")
    )


def link_data(links: Mapping[str, Any], name: str) -> tuple[float, Vector, Vector]:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2], all in the link's own frame."""
    key = f"rigid_body.links.{name}"
    link = entry(links, "rigid_body.links", name)
    inertia = vector(entry(link, key, "I"), f"{key}.I", 3)
    if np.any(inertia <= 0.0):
        raise MachineError(f"{key}.I: {link['I']}: moments of inertia must be above 0 kg m^2")
    return scalar(entry(link, key, "m"), f"{key}.m"), vector(entry(link, key, "com"), f"{key}.com", 3), np.diag(inertia)


def frame_axes(item: Mapping[str, Any], key: str) -> Vector:
    """Rotation (3, 3) from a link's own frame to its carrier's plane frame (first axis, second axis, across)."""
    names = words(item, key, "axes")
    rows = []
    for name in names:
        letter = name.removeprefix("-")
        if letter not in AXES:
            raise MachineError(
                f"{key}.axes: {names} given, expected two of x, y, z, with a minus sign where they point the other way"
            )
        rows.append((-1.0 if name.startswith("-") else 1.0) * np.eye(3)[AXES.index(letter)])
    if len(rows) != 2 or abs(rows[0] @ rows[1]) > 0.0:
        raise MachineError(f"{key}.axes: {names} given, expected two different axes")
    return np.array([rows[0], rows[1], np.cross(rows[0], rows[1])])


def entry(mapping: Any, key: str, name: str) -> Any:
    """``mapping[name]``, without its wrapper of unit and provenance. Raises MachineError that names the key."""
    if not isinstance(mapping, Mapping) or name not in mapping:
        raise MachineError(f"{key}.{name}: missing; D and g in any pose need it")
    value = mapping[name]
    return value["value"] if isinstance(value, Mapping) and "value" in value else value


def group(mapping: Any, key: str, name: str) -> Mapping[str, Any]:
    """``mapping[name]`` with keys of its own. Raises MachineError that names the key."""
    value = entry(mapping, key, name)
    if not isinstance(value, Mapping):
        raise MachineError(f"{key}.{name}: expected keys with values below it")
    return value


def words(mapping: Any, key: str, name: str) -> Sequence[str]:
    """``mapping[name]``, a list of texts. Raises MachineError that names the key."""
    value = entry(mapping, key, name)
    if not isinstance(value, list) or not all(isinstance(word, str) for word in value):
        raise MachineError(f"{key}.{name}: {value!r} given, expected a list of names")
    return value


def vector(value: Any, key: str, length: int) -> Vector:
    """`length` finite numbers as an array. Raises MachineError that names the key."""
    numbers = isinstance(value, Sequence) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    if not numbers or len(value) != length or not all(abs(item) <= LARGEST for item in value):
        raise MachineError(f"{key}: {value!r} given, expected {length} numbers")
    return np.array(value, dtype=np.float64)


def scalar(value: Any, key: str) -> float:
    """A finite number of 0 or more. Raises MachineError that names the key."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= LARGEST:
        raise MachineError(f"{key}: {value!r} given, expected a number of 0 .. {LARGEST:g}")
    return float(value)


def _arm_cylinders(rigid_body: Mapping[str, Any], q3: Any) -> list[Body]:
    """Barrels and rods lie on the line from the foot on the boom to the eye on the arm; none where the file has none."""
    key = "rigid_body.planar.arm_cylinder"
    planar = group(rigid_body, "rigid_body", "planar")
    if "arm_cylinder" not in planar:
        return []
    cylinder = group(planar, "rigid_body.planar", "arm_cylinder")
    foot = _pair(entry(cylinder, key, "foot"), f"{key}.foot")
    eye = _arm_point(rigid_body, _pair(entry(cylinder, key, "eye"), f"{key}.eye"), q3)
    along_x, along_y = eye[0] - foot[0], eye[1] - foot[1]
    length = ca.hypot(along_x, along_y)
    if isinstance(length, float) and not length > 0.0:
        raise MachineError(f"{key}: foot and eye lie in one point at q3 = {q3:g} rad")
    x, y = along_x / length, along_y / length
    bodies = []
    for name, start, way in (("barrels", foot, 1.0), ("rods", eye, -1.0)):
        part = entry(cylinder, key, name)
        mass, distance, inertia = (
            scalar(entry(part, f"{key}.{name}", k), f"{key}.{name}.{k}") for k in ("m", "com", "I")
        )
        at = (start[0] + distance * (way * x), start[1] + distance * (way * y))
        spread = (inertia * x * x, inertia * y * y, inertia * x * y)
        bodies.append(Body(f"arm_cylinder_{name}", mass, *at, inertia, ca.atan2(along_y, along_x), spread))
    return bodies


def _place(rigid_body: Mapping[str, Any], key: str, item: Any, point: Point, q3: Any, q4: Any) -> Point:
    """A point of a body, given from the body's origin along its carrier's axes, in the boom's frame."""
    origin = _pair(entry(item, key, "origin"), f"{key}.origin")
    out = scalar(entry(item, key, "q4_share"), f"{key}.q4_share") * q4
    carrier = entry(item, key, "carrier")
    if carrier == "boom":
        return origin[0] + point[0], origin[1] + point[1]
    if carrier == "arm":
        return _arm_point(rigid_body, (origin[0] + point[0], origin[1] + point[1] + out), q3)
    raise MachineError(f"{key}.carrier: {carrier!r} given, expected boom or arm")


def _arm_point(rigid_body: Mapping[str, Any], point: Point, q3: Any) -> Point:
    """Point (x across, z along) of the arm's frame in the boom's frame: elbow + R(q3) (arm_origin + (x, -z))."""
    planar, key = entry(rigid_body, "rigid_body", "planar"), "rigid_body.planar"
    elbow = _pair(entry(planar, key, "elbow"), f"{key}.elbow")
    origin = _pair(entry(planar, key, "arm_origin"), f"{key}.arm_origin")
    x, y = origin[0] + point[0], origin[1] - point[1]
    cos, sin = ca.cos(q3), ca.sin(q3)
    return elbow[0] + (cos * x - sin * y), elbow[1] + (sin * x + cos * y)


def _pair(value: Any, key: str) -> Point:
    x, y = vector(value, key, 2).tolist()
    return x, y


def _turned(spread: tuple[float, float, float], angle: Any) -> tuple[Any, Any, Any]:
    """Second moments along other axes: R(angle) J R(angle)^T."""
    xx, yy, xy = spread
    cos, sin = ca.cos(angle), ca.sin(angle)
    return (
        cos * cos * xx - 2 * cos * sin * xy + sin * sin * yy,
        sin * sin * xx + 2 * cos * sin * xy + cos * cos * yy,
        cos * sin * (xx - yy) + (cos * cos - sin * sin) * xy,
    )


def _one_joint_model(bodies: Sequence[Body]) -> Any:
    """A pinocchio model of one revolute joint about z that carries all bodies, under a gravity of 1 m/s^2 along -y."""
    pinocchio = importlib.import_module("pinocchio")  # here because it takes a second to import
    model = pinocchio.Model()
    model.gravity.linear = np.array([0.0, -1.0, 0.0])
    joint = model.addJoint(0, pinocchio.JointModelRZ(), pinocchio.SE3.Identity(), "boom")
    for body in bodies:
        # Planar: only the inertia across the plane acts; the other two are set equal to keep the tensor physical.
        inertia = pinocchio.Inertia(body.mass, np.zeros(3), body.inertia * np.eye(3))
        center = np.array([body.x, body.y, 0.0])
        model.appendBodyToJoint(joint, inertia, pinocchio.SE3(np.eye(3), center))
    return model
