"""What the node sends and says of a cycle; messages are made once and filled again."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from std_msgs.msg import Float64

from boom_controller.loop.cycle import Cycle
from boom_controller.node import messages
from boom_interfaces.msg import ControllerState, ReferenceState, SolenoidCurrents
from boom_node import qos
from boom_node.stamps import set_ns

_NUMBER = re.compile(r"[-+.\d]+")


class Outputs:
    """Publishers of command, state, reference and estimated load.

    Args:
        publish_on: as ``create_publisher`` of the node.
        now_ns: stamp of a command [ns].
        lockstep: nobody may miss a message.
    """

    def __init__(self, publish_on: Callable[[Any, str, Any], Any], now_ns: Callable[[], int], lockstep: bool) -> None:
        self._now_ns = now_ns
        state = qos.EVERY_SAMPLE if lockstep else qos.BY_TOPIC["/boom/controller_state"]
        reference = qos.EVERY_SAMPLE if lockstep else qos.SENSOR_DATA
        self.commands = publish_on(SolenoidCurrents, "/boom/current_command", qos.BY_TOPIC["/boom/current_command"])
        self._states = publish_on(ControllerState, "/boom/controller_state", state)
        self._references = publish_on(ReferenceState, "/boom/reference_state", reference)
        self._loads = publish_on(Float64, "/boom/estimated_load", qos.SENSOR_DATA)
        self._command, self._load = SolenoidCurrents(), Float64()
        self._state, self._reference = ControllerState(), ReferenceState()

    def command(self, retract: float, extend: float) -> None:
        """Both currents [A]."""
        set_ns(self._command.header.stamp, self._now_ns())
        self._command.retract, self._command.extend = retract, extend
        self.commands.publish(self._command)

    def cycle(self, cycle: Cycle, stamp_ns: int) -> None:
        """All that a cycle tells beside its command."""
        self._states.publish(messages.fill_state(self._state, cycle, stamp_ns))
        self._references.publish(messages.fill_reference(self._reference, cycle, stamp_ns))
        if cycle.load == cycle.load:
            self._load.data = cycle.load
            self._loads.publish(self._load)


class Log:
    """State and reason in the log, when they are news.

    Args:
        logger: of the node.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._said = ("", "")

    def tell(self, cycle: Cycle) -> bool:
        """Whether it was news: another state, or another reason than the same with another age or angle in it."""
        before, self._said = self._said, (cycle.state.value, cycle.reason)
        if before == self._said:
            return False
        if before[0] == self._said[0] and _NUMBER.sub("", before[1]) == _NUMBER.sub("", cycle.reason):
            return False
        text = cycle.state.value + (f": {cycle.reason}" if cycle.reason else "")
        if cycle.status == "stopped":  # a place in the code has one severity: rclpy refuses another
            self._logger.error(text)
        elif cycle.status == "warning":
            self._logger.warning(text)
        else:
            self._logger.info(text)
        return True
