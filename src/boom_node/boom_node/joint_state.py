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
