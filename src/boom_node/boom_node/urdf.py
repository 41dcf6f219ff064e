"""Links and joints of a robot description (URDF). No ROS, standard library only."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

Triple = tuple[float, float, float]


class UrdfError(Exception):
    """The robot description cannot be used; one line that says why."""

    exit_status = 2


@dataclass(frozen=True)
class UrdfJoint:
    """One joint.

    Attributes:
        name: its name; ``parent`` and ``child``: the links that it joins.
        kind: revolute, continuous, prismatic or fixed.
        limits: lower and upper [rad or m]; infinite for continuous joints.
        mimic: leader, multiplier and offset [rad or m]; None where it has a value of its own.
        rpy: orientation of its frame in the parent's [rad]; ``axis``: in its own frame.
    """

    name: str
    parent: str
    child: str
    kind: str
    limits: tuple[float, float]
    mimic: tuple[str, float, float] | None
    rpy: Triple
    axis: Triple

    @property
    def moves(self) -> bool:
        """Whether it has a value, its own or a leader's."""
        return self.kind != "fixed"


def read_urdf(urdf: str) -> tuple[list[str], list[UrdfJoint]]:
    """Names of the links, and the joints, of a URDF. Raises UrdfError."""
    if not urdf.strip():
        raise UrdfError("the robot description is empty")
    try:
        robot = ET.fromstring(urdf)
    except (ET.ParseError, ValueError) as error:
        raise UrdfError(f"the robot description is no XML: {error}") from None
    if robot.tag != "robot":
        raise UrdfError(f"the robot description begins with <{robot.tag}>: a URDF begins with <robot>")
    links = [_attribute(link, "name", "a link") for link in robot.findall("link")]
    joints = [_read_joint(joint) for joint in robot.findall("joint")]
    for kind, names in (("link", links), ("joint", [joint.name for joint in joints])):
        twice = _first_repeated(names)
        if twice is not None:
            raise UrdfError(f"the robot description has two {kind}s named '{twice}'")
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise UrdfError(f"the robot description's joint '{joint.name}' names link '{link}', which is not in it")
    return links, joints


def _read_joint(element: ET.Element) -> UrdfJoint:
    name = _attribute(element, "name", "a joint")
    what = f"joint '{name}'"
    kind = _attribute(element, "type", what)
    if kind not in ("revolute", "continuous", "prismatic", "fixed"):
        raise UrdfError(
            f"the robot description's {what} is of type '{kind}': "
            "revolute, continuous, prismatic and fixed are understood"
        )
    limits = (-math.inf, math.inf)
    limit = element.find("limit")
    if kind in ("revolute", "prismatic"):
        if limit is None:
            raise UrdfError(f"the robot description's {what} has no <limit>: a {kind} joint needs one")
        limits = (_number(limit, "lower", what, 0.0), _number(limit, "upper", what, 0.0))
        if not limits[0] <= limits[1]:
            raise UrdfError(
                f"the robot description's {what} has limits {limits[0]:g} to {limits[1]:g}: "
                "the lower is above the upper"
            )
    mimic = None
    leader = element.find("mimic")
    if leader is not None:
        mimic = (
            _attribute(leader, "joint", what),
            _number(leader, "multiplier", what, 1.0),
            _number(leader, "offset", what, 0.0),
        )
    ends = []
    for end in ("parent", "child"):
        child = element.find(end)
        if child is None:
            raise UrdfError(f"the robot description's {what} has no <{end}>")
        ends.append(_attribute(child, "link", what))
    rpy = _triple(element.find("origin"), "rpy", what, (0.0, 0.0, 0.0))
    axis = _triple(element.find("axis"), "xyz", what, (1.0, 0.0, 0.0))
    return UrdfJoint(name, ends[0], ends[1], kind, limits, mimic, rpy, axis)


def chain_to(joints: Iterable[UrdfJoint], link: str) -> list[UrdfJoint]:
    """The joints from the root to a link, from the root outward. Raises UrdfError where they form a loop."""
    by_child: Mapping[str, UrdfJoint] = {joint.child: joint for joint in joints}
    chain: list[UrdfJoint] = []
    while link in by_child:
        if len(chain) > len(by_child):
            raise UrdfError(f"the robot description has a loop of joints at link '{link}'")
        chain.append(by_child[link])
        link = by_child[link].parent
    return chain[::-1]


def _triple(element: ET.Element | None, name: str, what: str, default: Triple) -> Triple:
    text = None if element is None else element.get(name)
    if text is None:
        return default
    try:
        x, y, z = (float(word) for word in text.split())
    except ValueError:
        raise UrdfError(f"the robot description's {what} has {name}='{text}': give three numbers") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise UrdfError(f"the robot description's {what} has {name}='{text}': give three numbers")
    return x, y, z


def _attribute(element: ET.Element, name: str, what: str) -> str:
    value = element.get(name)
    if not value:
        raise UrdfError(f"the robot description has {what} without '{name}'")
    return value


def _number(element: ET.Element, name: str, what: str, default: float) -> float:
    text = element.get(name)
    try:
        value = default if text is None else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UrdfError(f"the robot description's {what} has {name}='{text}': give a number")
    return value


def _first_repeated(names: Iterable[str]) -> str | None:
    known: set[str] = set()
    for name in names:
        if name in known:
            return name
        known.add(name)
    return None
