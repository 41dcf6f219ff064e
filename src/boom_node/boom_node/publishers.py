"""Detects a second publisher: two controllers or two cranes on the same topics must not move anything.

The ROS graph lists the publishers of a topic. A killed process stays in it for some 6 s, until the middleware notices.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from boom_input.shown import quoted
from boom_node.parameters import ParameterSpec

LOOK_EVERY_S = 0.05
_UNKNOWN = "_NODE_NAME_UNKNOWN_"  # rcl's word until the middleware has heard the name
COMMANDS = ("/boom/current_command",)
SETTLE_S = 0.3
"""s. Two nodes see the end of a conflict up to a few looks apart, as discovery reaches them."""
PARAMETER = ParameterSpec(
    "shared_topics",
    "",
    "topics of commands, references and sensors that may have several publishers, separated by commas",
    read_only=True,
)


class SolePublishers:
    """Checks whether any of some topics has more than one publisher.

    Args:
        node: queries the graph.
        topics: those that may have one publisher only, the node itself included.
        shared: those of them that may have several, from the parameter.
        settle: s that a conflict is told beyond its end. A commander waits so long: a valve that was closed acts only once it
            has seen the end, too, and zero commands after it.
    """

    def __init__(self, node: Any, topics: Iterable[str], shared: str = "", settle: float = 0.0) -> None:
        self._node = node
        self._topics = [topic for topic in topics if topic not in [name.strip() for name in shared.split(",")]]
        self._looked, self._crowded, self._settle = -LOOK_EVERY_S, -settle, settle
        self.conflict = ""

    def look(self) -> str:
        """The fault in one line, or ""; queries the graph at most every `LOOK_EVERY_S`."""
        now = time.monotonic()
        if now - self._looked >= LOOK_EVERY_S:
            self._looked = now
            crowded = next((topic for topic in self._topics if self._node.count_publishers(topic) > 1), None)
            told = "" if crowded is None else self._told(crowded)
            if told:
                self._crowded = now
            if told or now - self._crowded >= self._settle:
                self.conflict = told
        return self.conflict

    def _told(self, topic: str) -> str:
        names = [info.node_name for info in self._node.get_publishers_info_by_topic(topic)]
        if len(names) < 2:  # one has gone meanwhile
            return ""
        who = ", ".join(sorted("one that just joined" if name == _UNKNOWN else quoted(name, 60) for name in names[:8]))
        return f"{len(names)} publish {topic} ({who}): end all but one; one that was killed goes within 10 s"
