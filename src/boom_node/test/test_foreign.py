"""What a node says where its machine file may be another crane's."""

import pytest

from boom_node.foreign import foreign


@pytest.mark.parametrize(
    ("named", "said"),
    [("tz17", ""), ("other\n<b>", "the configuration names other <b>, the laws are for tz17"),
     ("", "the configuration names no machine, the laws are for tz17")],
)  # fmt: skip
def test_a_file_of_another_machine_is_told_on_one_line(named: str, said: str) -> None:
    assert foreign(named, "tz17", "the laws are for") == said
