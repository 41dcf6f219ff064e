"""The second publisher of a topic, as it is told."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from boom_node import publishers
from boom_node.publishers import SolePublishers


def told(*names: str, shared: str = "") -> str:
    node = SimpleNamespace(
        count_publishers=lambda _: len(names),
        get_publishers_info_by_topic=lambda _: [SimpleNamespace(node_name=name) for name in names],
    )
    return SolePublishers(node, ["/joint_states"], shared).look()


def test_two_publishers_are_told_by_name_and_one_or_shared_ones_are_not() -> None:
    assert told("crane", "other").startswith("2 publish /joint_states (crane, other): end all but one")
    assert told("crane") == told("crane", "other", shared="/joint_states") == ""


def test_a_node_whose_name_is_not_heard_yet_is_told_in_plain_words() -> None:
    assert "(crane, one that just joined)" in told("_NODE_NAME_UNKNOWN_", "crane")


def test_who_commands_a_valve_is_told_of_a_conflict_a_little_longer_than_the_valve(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A goal that came within 10 ms of the end was tracked by a controller whose simulation still waited for a zero."""
    names, now = ["controller", "other"], [100.0]
    node = SimpleNamespace(
        count_publishers=lambda _: len(names),
        get_publishers_info_by_topic=lambda _: [SimpleNamespace(node_name=name) for name in names],
    )
    monkeypatch.setattr(publishers.time, "monotonic", lambda: now[0])
    valve, commander = (SolePublishers(node, ["/boom/current_command"], settle=s) for s in (0.0, 0.3))
    assert valve.look() and commander.look()
    names.pop()
    now[0] += 0.1
    assert not valve.look() and commander.look()
    now[0] += 0.25
    assert not commander.look()
