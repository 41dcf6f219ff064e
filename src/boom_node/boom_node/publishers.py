"""Who else publishes: two controllers or two cranes on the same topics are not to move anything.

The graph says how many publish on a topic. A process that was killed stays in it for some 6 s, until the middleware misses it.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from boom_input.shown import quoted
from boom_node.parameters import ParameterSpec

LOOK_EVERY_S = 0.05
COMMANDS = ("/boom/current_command",)
PARAMETER = ParameterSpec(
    "shared_topics",
    "",
    "topics of commands and sensors that several may publish on, with commas between",
    read_only=True,
)


class SolePublishers:
    """Looks whether more than one publishes on any of some topics.

    Args:
        node: asks the graph.
        topics: that one alone may publish on, the node itself included.
        shared: of these, the ones that several may publish on all the same, as in the parameter.
    """

    def __init__(self, node: Any, topics: Iterable[str], shared: str = "") -> None:
        self._node = node
        self._topics = [topic for topic in topics if topic not in [name.strip() for name in shared.split(",")]]
        self._looked = -LOOK_EVERY_S
        self.conflict = ""

    def look(self) -> str:
        """What is wrong, in one line, or ""; asks the graph every `LOOK_EVERY_S` at most."""
        now = time.monotonic()
        if now - self._looked >= LOOK_EVERY_S:
            self._looked = now
            crowded = next((topic for topic in self._topics if self._node.count_publishers(topic) > 1), None)
            self.conflict = "" if crowded is None else self._told(crowded)
        return self.conflict

    def _told(self, topic: str) -> str:
        names = [info.node_name for info in self._node.get_publishers_info_by_topic(topic)]
        if len(names) < 2:  # one has gone meanwhile
            return ""
        who = ", ".join(sorted(quoted(name, 60) for name in names[:8]))
        return f"{len(names)} publish {topic} ({who}): end all but one; one that was killed goes within 10 s"
