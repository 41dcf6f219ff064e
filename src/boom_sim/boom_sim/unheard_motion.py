"""Detects motions that no controller follows. Queries the ROS graph and subscribes to nothing."""

from __future__ import annotations

from typing import Any

LOOK_EVERY_S = 0.25
COMMAND = "/boom/current_command"
WANTED = ("/boom/joint_trajectory", "/boom/reference")
GOAL = "/boom_controller/track_trajectory/_action/send_goal"
ACTION = "/boom_controller/track_trajectory"


class UnheardMotion:
    """Checks who publishes motions and who commands currents.

    Args:
        node: queries the graph.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._told = False

    def look(self) -> str:
        """One line for the operator, once, when a motion is first published and no node commands currents; otherwise empty."""
        if self._told or self._node.count_publishers(COMMAND):
            return ""
        given = [topic for topic in WANTED if self._node.count_publishers(topic)]
        if self._node.count_clients(GOAL):
            given.append(ACTION)
        if not given:
            return ""
        self._told = True
        return f"{given[0]} is given and no controller is there to follow it: end this and start ./boom sim --control"
