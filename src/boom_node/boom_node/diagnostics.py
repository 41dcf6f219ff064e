"""Publishes a node's health on /diagnostics: once a second and at once when the level or the words change."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any

from boom_node import qos

if TYPE_CHECKING:
    from boom_node.node import Guarded

PERIOD_S = 1.0


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Health:
    """The health of a node: level, one line, and numbers with their unit in the key."""

    level: Level
    message: str
    values: Mapping[str, object] = field(default_factory=dict)


class DiagnosticsPublisher:
    """Calls `health` once a second (wall clock, so also while simulated time stands still) and publishes the result.

    `hardware_id`: name of the machine file or "". A node calls `update` when its health may have changed. The status also
    includes what the node's guard has caught and refused; after an exception in a callback the level stays ERROR.
    """

    def __init__(self, node: "Guarded | Any", health: Callable[[], Health], hardware_id: str = "") -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.clock import Clock
        from rclpy.clock_type import ClockType

        self._node = node
        self._health = health
        self._hardware_id = hardware_id
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", qos.BY_TOPIC["/diagnostics"])
        self._last: tuple[Level, str] | None = None
        self._guard = node.guard
        self._guard.changed = self.update
        self._timer = node.create_timer(PERIOD_S, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def update(self) -> None:
        """Publish now if level or message have changed, by more than a number in it."""
        health = self._asked()
        if _words(health) != self._last:
            self._send(health)

    def publish(self) -> None:
        """Publish now."""
        self._send(self._asked())

    def _asked(self) -> Health:
        try:
            health = self._health()
        except Exception as error:
            self._guard.caught("diagnostics", error)
            health = Health(Level.ERROR, "cannot report its health")
        values = {**health.values, **self._guard.values()}
        if not self._guard.internal:
            return Health(health.level, health.message, values)
        return Health(Level.ERROR, f"{health.message}; internal error: {self._guard.internal}", values)

    def _send(self, health: Health) -> None:
        from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

        self._last = _words(health)
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        status = DiagnosticStatus(
            level=bytes([health.level]),
            name=self._node.get_name(),
            message=health.message,
            hardware_id=self._hardware_id,
        )
        status.values = [KeyValue(key=str(key), value=str(value)) for key, value in health.values.items()]
        array.status = [status]
        self._publisher.publish(array)


def _words(health: Health) -> tuple[Level, str]:
    return health.level, re.sub(r"-?\d[\d.]*(e[+-]?\d+)?", "0", health.message)
