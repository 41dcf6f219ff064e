"""A JointState as it is received: what of it can be used."""

from __future__ import annotations

from sensor_msgs.msg import JointState

from boom_node.guard import Guard


def named_twice(guard: Guard, topic: str, message: JointState, joint: str) -> bool:
    """Whether the joint stands in a message several times, which is then refused: which of them counts it does not say."""
    twice = list(message.name).count(joint) > 1
    if twice:
        guard.refuse(topic, "the joint stands in one message several times", "give it once")
    return twice


def angle_and_rate(guard: Guard, topic: str, message: JointState, joint: str) -> tuple[float, float] | None:
    """Position and velocity of the joint; None of other joints, and where one of the two is missing, which is told."""
    if joint not in message.name:
        return None
    k = list(message.name).index(joint)
    for what, values in (("position", message.position), ("velocity, a gyro's rate,", message.velocity)):
        if k >= len(values):
            guard.refuse(topic, f"the joint's {what} is missing", "the controller needs both")
            return None
    return message.position[k], message.velocity[k]
