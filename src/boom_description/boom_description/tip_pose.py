"""Pose of the boom tip from a URDF and joint values: what a crane perception stack computes. No ROS.

A stack of its own would be written the same way: it needs the URDF text, the joint values by name and nothing else of
this project. Kinematics is pinocchio's; the URDF is read here first: of the 18 broken ones of `test_tip_pose.py` pinocchio's
reader (4.1) accepts 3, names the fault of 1 in what it raises, and refuses joints that mimic a continuous one.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_node.urdf import UrdfError, UrdfJoint, chain_to, read_urdf

Vector = NDArray[np.float64]


MOST_JOINTS = 1000
STANDARD_GRAVITY = 9.81
"""m/s^2, as pinocchio has it."""


@dataclass(frozen=True)
class TipPose:
    """A frame relative to another: position (3,) [m] and unit quaternion (x, y, z, w)."""

    position: Vector
    quaternion: Vector


@dataclass(frozen=True)
class CarriedMoments:
    """What a joint carries: inertia about it [kg m^2], first moments outward and upward [kg m], and the tip there [m]."""

    D0: float
    Sx: float
    Sy: float
    tip: tuple[float, float]


@dataclass(frozen=True)
class LinkPose:
    """A link relative to its parent."""

    parent: str
    child: str
    pose: TipPose


def _leaders(joints: Iterable[UrdfJoint], by_name: Mapping[str, UrdfJoint]) -> tuple[str, ...]:
    """Names of those that have values of their own, or lead those that follow."""
    names = dict.fromkeys(joint.mimic[0] if joint.mimic else joint.name for joint in joints if joint.moves)
    for name in names:
        if name not in by_name:
            raise UrdfError(f"the robot description has a joint that mimics '{name}', which is not in it")
    return tuple(names)


class TipKinematics:
    """Forward kinematics from the root of a URDF to one of its links.

    Attributes:
        root_frame: the URDF's root link; poses are given in it.
        tip_frame: the link whose pose is wanted.
        joint_names: the joints between the two with values of their own, from the root outward.
        limits: their lower and upper limits [rad or m]; infinite for continuous joints.
        all_limits: the same for all joints of the URDF with values of their own.

    Raises:
        UrdfError: no URDF, not one tree, or the tip is not in it.
    """

    def __init__(self, urdf: str, tip_frame: str = "boom_tip") -> None:
        links, joints = read_urdf(urdf)
        by_child = {joint.child: joint for joint in joints}
        roots = [link for link in links if link not in by_child]
        if len(roots) != 1:
            raise UrdfError(f"the robot description is not one tree: its roots are {', '.join(roots) or 'missing'}")
        if tip_frame not in links:
            raise UrdfError(f"the robot description has no link '{tip_frame}'; it has: {', '.join(links)}")
        self.root_frame = roots[0]
        self.tip_frame = tip_frame
        self._mimics = {joint.name: joint.mimic for joint in joints if joint.mimic is not None}
        chain = chain_to(joints, tip_frame)
        by_name = {joint.name: joint for joint in joints}
        self.all_limits = {name: by_name[name].limits for name in _leaders(joints, by_name)}
        self.joint_names = _leaders(chain, by_name)
        self.limits = {name: by_name[name].limits for name in self.joint_names}
        self._pinocchio: Any = importlib.import_module("pinocchio")  # here because it takes a second to import
        try:
            self._model: Any = self._pinocchio.buildModelFromXML(urdf)
        except Exception as error:  # pinocchio's parsers raise whatever they find
            raise UrdfError(f"the robot description is refused by pinocchio: {' '.join(str(error).split())}") from None
        self._data: Any = self._model.createData()
        self._frame = self._model.getFrameId(tip_frame)
        joints_of_model = zip(self._model.names, self._model.joints, strict=True)
        self._places = [(name, joint.idx_v) for name, joint in joints_of_model if joint.nv == 1]
        frame = self._model.getFrameId
        edges = [(joint, (joint.parent, joint.child, frame(joint.parent), frame(joint.child))) for joint in joints]
        self._moving = [edge for joint, edge in edges if joint.moves]
        self._fixed = [edge for joint, edge in edges if not joint.moves]

    def pose(self, joints: Mapping[str, float]) -> TipPose:
        """Pose of the tip in `root_frame` for joint values [rad or m] by name.

        Raises KeyError for a joint of `joint_names` that has no value and ValueError for one that is not finite. Others
        are ignored.
        """
        self._check(joints)
        self._place(joints)
        return self._seen(self._data.oMf[self._frame])

    def carried(self, name: str, joints: Mapping[str, float], sign: float = 1.0) -> CarriedMoments:
        """What a joint of `joint_names` carries, all others locked at `joints` [rad or m] by name.

        D_0 is the joint's own entry of the joint-space inertia; its generalised gravity, g (S_x cos q - S_y sin q), is read at
        `joints` and a quarter turn above. The joint is level at its value in `joints`; sign: -1 if its value grows downwards.

        Raises:
            UrdfError: it does not turn about a horizontal axis.
        """
        self._check(joints)
        pin, model, data = self._pinocchio, self._model, self._data
        place = dict(self._places)[name]
        level, quarter = self._position(joints), np.zeros(model.nv)
        quarter[place] = sign * math.pi / 2
        weights = [
            sign * float(pin.computeGeneralizedGravity(model, data, q)[place]) / STANDARD_GRAVITY
            for q in (level, pin.integrate(model, level, quarter))
        ]
        inertia = float(pin.crba(model, data, level)[place, place])
        pin.computeJointJacobians(model, data, level)
        pin.updateFramePlacements(model, data)
        number = model.getJointId(name)
        axis = sign * pin.getJointJacobian(model, data, number, pin.LOCAL_WORLD_ALIGNED)[3:, place]
        if not 0.99 < float(np.hypot(axis[0], axis[1])) < 1.01:
            raise UrdfError(f"joint {name} does not turn about a horizontal axis: it is not the boom's")
        offset = data.oMf[self._frame].translation - data.oMi[number].translation
        outward = np.cross((0.0, 0.0, 1.0), axis)
        return CarriedMoments(inertia, weights[0], -weights[1], (float(offset @ outward), float(offset[2])))

    def _check(self, joints: Mapping[str, float]) -> None:
        """Raises KeyError and ValueError as :meth:`pose`."""
        for name in self.joint_names:
            if not math.isfinite(joints[name]):
                raise ValueError(f"joint {name} is {joints[name]}")

    def frames(self, joints: Mapping[str, float]) -> list[LinkPose]:
        """Links that move, relative to their parents, for values [rad or m] of all joints of `all_limits` by name."""
        self._place(joints)
        return self._relative(self._moving)

    def fixed_frames(self) -> list[LinkPose]:
        """Links that are fixed to their parents."""
        self._place({})
        return self._relative(self._fixed)

    def _relative(self, edges: list[tuple[str, str, int, int]]) -> list[LinkPose]:
        places = self._data.oMf
        return [LinkPose(parent, child, self._seen(places[at].actInv(places[to]))) for parent, child, at, to in edges]

    def _place(self, joints: Mapping[str, float]) -> None:
        """Forward kinematics of all frames."""
        self._pinocchio.framesForwardKinematics(self._model, self._data, self._position(joints))

    def _position(self, joints: Mapping[str, float]) -> Vector:
        """Position vector of the model; joints without a value stand at zero."""
        step: Vector = np.zeros(self._model.nv)
        for name, place in self._places:
            step[place] = self._value(name, joints)
        # from the neutral position on: pinocchio holds a continuous joint as cosine and sine
        return np.asarray(self._pinocchio.integrate(self._model, self._pinocchio.neutral(self._model), step))

    def _seen(self, placement: Any) -> TipPose:
        found: Vector = self._pinocchio.SE3ToXYZQUAT(placement)
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

    def values(self, limits: Mapping[str, tuple[float, float]], now: float) -> JointSources:
        """A value [rad or m] for every joint with such limits at the time `now` [s]."""
        values, sources = {}, {}
        for name, (low, high) in limits.items():
            measured = self._measured.get(name)
            if measured is not None and now - measured[1] <= self.timeout:
                values[name], sources[name] = measured[0], "measured"
            elif name in self._configured:
                values[name] = self._configured[name]
                sources[name] = f"{values[name]:g} from /boom/machine_configuration"
            else:
                values[name] = min(max(0.0, low), high)
                sources[name] = f"{values[name]:g}, because nobody publishes it"
        return JointSources(values, sources)
