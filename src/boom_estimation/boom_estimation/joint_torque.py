"""The torque that the motion of the other joints asks of the boom, over a recording: for all that compares forces without a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_model import joint_motion as other_joints
from boom_model import joint_torque as model
from boom_model.machine import Machine, Pose
from boom_recording.joint_motion import JointMotion, joint_motion
from boom_recording.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointTorque:
    """dM (``boom_model.joint_torque``) over the motion of a recording; zero without motion."""

    motion: JointMotion | None
    machine: Machine
    pose: Pose

    def at(self, time: Array, angle: Array, rate: Array, acceleration: Array) -> Array:
        """dM (n,) [N m] at times [s] with q_2 [rad], q_2' and q_2'' (n,); NaN where one of them is."""
        if self.motion is None or len(time) == 0:
            return np.zeros(len(time))
        pose = self.pose.outer_boom_angle, self.pose.telescope_length
        inputs = other_joints.inputs(self.machine.document, pose, *self.motion.at(time))
        return model.joint_torque(self.machine, self.pose, inputs, np.column_stack((angle, rate, acceleration)))


def joint_torque(recording: Recording, machine: Machine, pose: Pose) -> JointTorque:
    """That of a recording; where its joints move and the machine file does not tell the bodies, they count as locked."""
    motion = joint_motion(recording) if other_joints.known(machine.document) else None
    return JointTorque(motion, machine, pose)
