"""Pose of the boom tip from a URDF and joint values: what a crane perception stack computes. No ROS.

A stack of its own would be written the same way: it needs the URDF text, the joint values by name and nothing else of
this project. Kinematics is pinocchio's; the URDF is read here first: of the 18 broken ones of `test_tip_pose.py` pinocchio's
reader (4.1) accepts 3, names the fault of 1 in what it raises, and refuses joints that mimic a continuous one.
"""

from __future__ import annotations

import importlib
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


MOST_JOINTS = 1000


class UrdfError(Exception):
    """The robot description cannot be used; one line that says why."""

    exit_status = 2


@dataclass(frozen=True)
class TipPose:
    """A frame relative to another: position (3,) [m] and unit quaternion (x, y, z, w)."""

    position: Vector
    quaternion: Vector


@dataclass(frozen=True)
class _Joint:
    name: str
    parent: str
    child: str
    limits: tuple[float, float]
    mimic: tuple[str, float, float] | None  # leader, multiplier, offset
    moves: bool


class TipKinematics:
    """Forward kinematics from the root of a URDF to one of its links.

    Attributes:
        root_frame: the URDF's root link; poses are given in it.
        tip_frame: the link whose pose is wanted.
        joint_names: the joints between the two with values of their own, from the root outward.
        limits: their lower and upper limits [rad or m]; infinite for continuous joints.

    Raises:
        UrdfError: no URDF, not one tree, or the tip is not in it.
    """

    def __init__(self, urdf: str, tip_frame: str = "boom_tip") -> None:
        links, joints = _read(urdf)
        by_child = {joint.child: joint for joint in joints}
        roots = [link for link in links if link not in by_child]
        if len(roots) != 1:
            raise UrdfError(f"the robot description is not one tree: its roots are {', '.join(roots) or 'missing'}")
        if tip_frame not in links:
            raise UrdfError(f"the robot description has no link '{tip_frame}'; it has: {', '.join(links)}")
        self.root_frame = roots[0]
        self.tip_frame = tip_frame
        self._mimics = {joint.name: joint.mimic for joint in joints if joint.mimic is not None}
        chain = _chain(by_child, tip_frame)
        by_name = {joint.name: joint for joint in joints}
        leaders = dict.fromkeys(joint.mimic[0] if joint.mimic else joint.name for joint in chain if joint.moves)
        for name in leaders:
            if name not in by_name:
                raise UrdfError(f"the robot description has a joint that mimics '{name}', which is not in it")
        self.joint_names = tuple(leaders)
        self.limits = {name: by_name[name].limits for name in leaders}
        self._pinocchio: Any = importlib.import_module("pinocchio")  # here because it takes a second to import
        try:
            self._model: Any = self._pinocchio.buildModelFromXML(urdf)
        except Exception as error:  # pinocchio's parsers raise whatever they find
            raise UrdfError(f"the robot description is refused by pinocchio: {' '.join(str(error).split())}") from None
        self._data: Any = self._model.createData()
        self._frame = self._model.getFrameId(tip_frame)
        joints_of_model = zip(self._model.names, self._model.joints, strict=True)
        self._places = [(name, joint.idx_v) for name, joint in joints_of_model if joint.nv == 1]

    def pose(self, joints: Mapping[str, float]) -> TipPose:
        """Pose of the tip in `root_frame` for joint values [rad or m] by name.

        Raises KeyError for a joint of `joint_names` that has no value and ValueError for one that is not finite. Others
        are ignored.
        """
        for name in self.joint_names:
            if not math.isfinite(joints[name]):
                raise ValueError(f"joint {name} is {joints[name]}")
        step: Vector = np.zeros(self._model.nv)
        for name, place in self._places:
            step[place] = self._value(name, joints)
        # from the neutral position on: pinocchio holds a continuous joint as cosine and sine
        position = self._pinocchio.integrate(self._model, self._pinocchio.neutral(self._model), step)
        self._pinocchio.framesForwardKinematics(self._model, self._data, position)
        found: Vector = self._pinocchio.SE3ToXYZQUAT(self._data.oMf[self._frame])
        # both signs are the same rotation; the one with w >= 0 is given
        return TipPose(found[:3], -found[3:] if found[6] < 0.0 else found[3:])

    def _value(self, name: str, joints: Mapping[str, float]) -> float:
        leader, multiplier, offset = self._mimics.get(name, (name, 1.0, 0.0))
        return multiplier * joints[leader] + offset if leader in joints else 0.0


@dataclass(frozen=True)
class JointSources:
    """A value for every joint of the chain, and its source for the log."""

    values: Mapping[str, float]
    sources: Mapping[str, str]


class JointTable:
    """Keeps the newest value of every joint and fills in joints that are not measured.

    A measured value counts for `timeout` seconds. After that, or if a joint is not measured at all, the value of the
    machine configuration is used, or else the value nearest to zero within the joint's limits.
    """

    def __init__(self, timeout: float = 2.0) -> None:
        self.timeout = timeout
        self._measured: dict[str, tuple[float, float]] = {}
        self._configured: dict[str, float] = {}

    def measure(self, names: Sequence[str], positions: Sequence[float], now: float) -> tuple[str, ...]:
        """Store measured positions [rad or m] at the time `now` [s]. Returns the names that had a finite value."""
        finite = [(name, float(value)) for name, value in zip(names, positions, strict=False) if math.isfinite(value)]
        if len(self._measured) > MOST_JOINTS:  # names that come and go: those that nobody measures any more
            self._measured = {name: entry for name, entry in self._measured.items() if now - entry[1] <= self.timeout}
        if len(self._measured) <= MOST_JOINTS:
            self._measured.update({name: (value, now) for name, value in finite})
        return tuple(name for name, _ in finite)

    def configure(self, joints: Mapping[str, float]) -> None:
        """Store the pose of locked joints [rad or m]; values that are not finite count as unknown."""
        self._configured = {name: value for name, value in joints.items() if math.isfinite(value)}

    def values(self, kinematics: TipKinematics, now: float) -> JointSources:
        """A value [rad or m] for every joint of the chain at the time `now` [s]."""
        values, sources = {}, {}
        for name in kinematics.joint_names:
            measured = self._measured.get(name)
            if measured is not None and now - measured[1] <= self.timeout:
                values[name], sources[name] = measured[0], "measured"
            elif name in self._configured:
                values[name] = self._configured[name]
                sources[name] = f"{values[name]:g} from /boom/machine_configuration"
            else:
                low, high = kinematics.limits[name]
                values[name] = min(max(0.0, low), high)
                sources[name] = f"{values[name]:g}, because nobody publishes it"
        return JointSources(values, sources)


def _chain(by_child: Mapping[str, _Joint], tip: str) -> list[_Joint]:
    chain: list[_Joint] = []
    link = tip
    while link in by_child:
        if len(chain) > len(by_child):
            raise UrdfError(f"the robot description has a loop of joints at link '{link}'")
        chain.append(by_child[link])
        link = by_child[link].parent
    return chain[::-1]


def _read(urdf: str) -> tuple[list[str], list[_Joint]]:
    """Names of the links, and the joints, of a URDF."""
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


def _read_joint(element: ET.Element) -> _Joint:
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
    return _Joint(name, ends[0], ends[1], limits, mimic, kind != "fixed")


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
