"""/boom/emergency_stop as it is read, with a node by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import QoSDurabilityPolicy, QoSReliabilityPolicy
from std_msgs.msg import Bool

from boom_node import qos
from boom_node.emergency_stop import EmergencyStop


class Graph:
    """A node that knows who publishes, and keeps what it is told to tell."""

    def __init__(self) -> None:
        self.names = ["panel"]
        self.told: list[str] = []
        self.heard: list[tuple[Any, Any]] = []
        self.offered = qos.LATCHED
        self.guard = SimpleNamespace(refuse=lambda topic, reason, text: self.told.append(text))

    def create_subscription(self, kind: Any, topic: str, callback: Any, profile: Any, **_: Any) -> None:
        self.heard.append((profile, lambda wanted: callback(Bool(data=wanted))))
        assert profile.depth >= 100

    def say(self, wanted: bool, durability: Any = QoSDurabilityPolicy.TRANSIENT_LOCAL) -> None:
        """To all subscriptions of a durability."""
        for profile, hear in self.heard:
            if profile.durability == durability:
                hear(wanted)

    def count_publishers(self, topic: str) -> int:
        return len(self.names)

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        return [SimpleNamespace(node_name=name, qos_profile=self.offered) for name in self.names]


@pytest.mark.parametrize(
    ("names", "counted", "standing"),
    [(["panel"], [True, False], False), (["panel", "remote"], [True], True), ([], [True, False], False)],
)
def test_a_false_counts_only_where_it_cannot_be_another_ones(
    names: list[str], counted: list[bool], standing: bool
) -> None:
    graph, heard = Graph(), list[bool]()
    stop = EmergencyStop(graph, heard.append)
    graph.names = names
    graph.say(True)
    graph.say(False)
    assert (heard, stop.standing) == (counted, standing)
    assert len(graph.told) == int(standing) and all("panel, remote" in text for text in graph.told)


def test_once_one_publisher_is_left_its_next_false_counts() -> None:
    graph, heard = Graph(), list[bool]()
    stop = EmergencyStop(graph, heard.append)
    graph.names = ["panel", "remote"]
    for wanted in (True, False):
        graph.say(wanted)
    graph.names = ["panel"]
    graph.say(False)
    assert (heard, stop.standing) == ([True, False], False)


def test_a_stop_is_heard_from_publishers_of_any_qos_and_from_those_that_latch_by_who_comes_later() -> None:
    graph = Graph()
    stop = EmergencyStop(graph, lambda _: None)
    asked = {(profile.durability, profile.reliability) for profile, _ in graph.heard}
    volatile, reliable = QoSDurabilityPolicy.VOLATILE, QoSReliabilityPolicy.RELIABLE
    assert asked == {
        (QoSDurabilityPolicy.TRANSIENT_LOCAL, reliable), (volatile, reliable),
        (volatile, QoSReliabilityPolicy.BEST_EFFORT),
    }  # fmt: skip
    graph.offered = qos.SENSOR_DATA
    for wanted in (True, False):
        graph.say(wanted, volatile)
        assert stop.standing == wanted


def test_an_older_false_that_comes_late_beside_the_latched_one_clears_nothing() -> None:
    graph = Graph()
    stop = EmergencyStop(graph, lambda _: None)
    graph.say(False)
    graph.say(True)
    graph.say(False, QoSDurabilityPolicy.VOLATILE)
    assert stop.standing
    graph.say(True, QoSDurabilityPolicy.VOLATILE)
    graph.say(False)
    assert not stop.standing
