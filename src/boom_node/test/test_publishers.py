"""The second publisher of a topic, as it is told."""

from __future__ import annotations

from types import SimpleNamespace

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
