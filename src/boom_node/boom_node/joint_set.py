"""Values of all joints of a robot description, from the one that is measured and those that are configured. No ROS.

Every value is ``constant + gain * angle`` of the measured joint:

- measured joint: gain 1;
- configured joint: its constant; any other joint: the value nearest to zero within its limits;
- mimic joint: multiplier * leader + offset;
- hanging joint (the gripper's hinge): the value at which its link is plumb, within its limits. With the joints of its chain
  that turn about the horizontal y axis, plumb means ``sum(pitch of the frames) + sum(+-angles) = 0``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from boom_node.urdf import UrdfError, UrdfJoint, chain_to, read_urdf

_UPRIGHT = 1e-9


@dataclass(frozen=True)
class _Value:
    constant: float
    gain: float = 0.0
    low: float = -math.inf
    high: float = math.inf

    def at(self, angle: float) -> float:
        return min(max(self.constant + self.gain * angle, self.low), self.high)

    def rate(self, angle: float, rate: float) -> float:
        return self.gain * rate if self.low < self.constant + self.gain * angle < self.high else 0.0


class JointSet:
    """All joints that ``/joint_states`` carries.

    Args:
        urdf: the robot description; empty: the measured and the configured joints are all there are.
        measured: name of the measured joint.
        configured: values [rad or m] of locked joints by name.
        hanging: joint whose link hangs plumb; one that the URDF does not have is ignored.

    Attributes:
        names: the measured joint first, then the others in the order of the URDF.
        moving: places in ``names`` of those whose value depends on the measured one.
        note: why the joints of the URDF are left out; empty if they are not.

    Raises:
        UrdfError: the text is no URDF.
    """

    def __init__(self, urdf: str, measured: str, configured: Mapping[str, float], hanging: str = "") -> None:
        joints = read_urdf(urdf)[1] if urdf.strip() else []
        values = {measured: _Value(0.0, 1.0)} | {name: _Value(value) for name, value in configured.items()}
        self.note = ""
        if any(joint.name == measured for joint in joints):
            self._complete(values, joints, hanging)
        elif urdf.strip():
            self.note = f"the robot description has no joint '{measured}': its other joints are not published"
        self.names = tuple(values)
        self._values = tuple(values.values())
        self.moving = tuple(k for k, value in enumerate(self._values) if value.gain)

    def positions(self, angle: float) -> list[float]:
        """Values [rad or m], in the order of `names`, at this angle [rad] of the measured joint."""
        return [value.at(angle) for value in self._values]

    def velocities(self, angle: float, rate: float) -> list[float]:
        """Their derivatives [rad/s or m/s] at this angle [rad] and rate [rad/s] of the measured joint."""
        return [value.rate(angle, rate) for value in self._values]

    def moved(self, angle: float, rate: float) -> list[float]:
        """Values, then derivatives, of the joints of `moving` alone, at this angle [rad] and rate [rad/s]."""
        each = [self._values[k] for k in self.moving]
        return [value.at(angle) for value in each] + [value.rate(angle, rate) for value in each]

    @staticmethod
    def _complete(values: dict[str, _Value], joints: Sequence[UrdfJoint], hanging: str) -> None:
        """Add the joints of the URDF that have no value yet."""
        for joint in joints:
            if joint.moves and joint.mimic is None and joint.name != hanging:
                low, high = joint.limits
                values.setdefault(joint.name, _Value(min(max(0.0, low), high)))
        for joint in joints:
            if joint.mimic is not None:
                leader, multiplier, offset = joint.mimic
                if leader not in values:
                    raise UrdfError(
                        f"the robot description's joint '{joint.name}' mimics '{leader}', which has no value"
                    )
                of = values[leader]
                values.setdefault(joint.name, _Value(multiplier * of.constant + offset, multiplier * of.gain))
        for joint in joints:
            if joint.name == hanging:
                values.setdefault(hanging, _plumb(joint, joints, values))


def _plumb(hinge: UrdfJoint, joints: Sequence[UrdfJoint], values: Mapping[str, _Value]) -> _Value:
    """The hinge's value at which its link is plumb; that nearest to zero where the chain does not lie in one plane."""
    low, high = hinge.limits
    constant = gain = 0.0
    for joint in chain_to(joints, hinge.child):
        roll, pitch, yaw = joint.rpy
        about_y = max(abs(joint.axis[0]), abs(joint.axis[2])) < _UPRIGHT
        turns = joint.kind in ("revolute", "continuous")
        level_turn = turns and abs(constant) + abs(gain) < _UPRIGHT and abs(joint.axis[2]) > 1.0 - _UPRIGHT
        if max(abs(roll), abs(yaw)) > _UPRIGHT or not (about_y or level_turn or not turns):
            return _Value(min(max(0.0, low), high))
        constant -= pitch
        if turns and about_y and joint is not hinge:
            sign = -math.copysign(1.0, joint.axis[1])
            constant += sign * values[joint.name].constant
            gain += sign * values[joint.name].gain
    sign = math.copysign(1.0, hinge.axis[1])
    return _Value(sign * constant, sign * gain, low, high)
