"""/boom/emergency_stop as its readers take it: no ``true`` is lost, and none is cleared by somebody else.

A message does not say who sent it. Where several nodes publish, a ``false`` may be another one's than the ``true`` that stands, and
does not count: that it does nothing is told, and once one publisher is left, its next ``false`` counts.

A stop counts whatever QoS it is published with. One that latches is heard by each subscription, in its own time: what is heard
beside the latched one may be older, so that no ``false`` of it counts while a publisher latches.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_msgs.msg import Bool

from boom_input.shown import quoted
from boom_node import qos

TOPIC = "/boom/emergency_stop"


class EmergencyStop:
    """Subscribes for a node.

    Args:
        node: subscribes, tells what does not count, and queries the graph.
        changed: called with every state that counts: True stops, False allows to move again but starts nothing.

    Attributes:
        standing: whether it is stopped.
    """

    def __init__(self, node: Any, changed: Callable[[bool], None]) -> None:
        self.standing = False
        self._node, self._changed = node, changed
        for profile, take in ((qos.requested(TOPIC), self._take), *((p, self._take_unlatched) for p in qos.UNLATCHED)):
            node.create_subscription(Bool, TOPIC, take, profile, event_callbacks=qos.QUIETLY)

    def _take_unlatched(self, message: Bool) -> None:
        publishers = self._node.get_publishers_info_by_topic(TOPIC)
        if message.data or not any(qos.latches(info.qos_profile) for info in publishers):
            self._take(message)

    def _take(self, message: Bool) -> None:
        wanted = bool(message.data)
        if self.standing and not wanted and self._node.count_publishers(TOPIC) > 1:
            names = sorted(info.node_name for info in self._node.get_publishers_info_by_topic(TOPIC))
            if len(names) > 1:
                who = ", ".join(quoted(name, 60) for name in names[:8])
                self._node.guard.refuse(
                    TOPIC, "false from one of several",
                    f"{len(names)} nodes publish it ({who}), and true may still be another one's: end all but one, which then "
                    "publishes false again",
                )  # fmt: skip
                return
        self.standing = wanted
        self._changed(wanted)
