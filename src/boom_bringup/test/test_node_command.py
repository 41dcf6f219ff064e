import argparse
import sys

import pytest

from boom_bringup.cli import UsageError
from boom_bringup.commands import record, replay
from boom_bringup.node_command import node_command


class BecameNode(BaseException):
    """Stands for the end of this process: the real `become_node` never returns."""


def test_options_become_parameters_that_keep_their_type():
    values = {"bag": "2024", "rate": 2.0, "loop": False, "topics": ("/a", "*"), "skip": None}
    command = node_command("pkg.some_node", values)

    assert command[:4] == [sys.executable, "-m", "pkg.some_node", "--ros-args"]
    assert command[4:] == ["-p", 'bag:="2024"', "-p", "rate:=2.0", "-p", "loop:=false", "-p", 'topics:=["/a", "*"]']


@pytest.mark.parametrize(
    "text", ["crane \U0001f3d7", "\U0001f3d7\\", 'a "b"\n\u0085\u2028\x7f', "\\ud83c\\udfd7", "null", "\ufeff"]
)
def test_whatever_text_an_option_holds_ros_reads_the_same(text):
    import rclpy

    rclpy.init(args=node_command("pkg.some_node", {"bag": text, "topics": (text, "b")})[3:])
    try:
        node = rclpy.create_node("reads", automatically_declare_parameters_from_overrides=True)
        assert (node.get_parameter("bag").value, list(node.get_parameter("topics").value)) == (text, [text, "b"])
        node.destroy_node()
    finally:
        rclpy.shutdown()


def test_a_name_that_is_no_utf_8_is_refused_in_one_line():
    with pytest.raises(UsageError, match=r"bad\\udcff: ROS takes names in UTF-8 only"):
        node_command("pkg.some_node", {"bag": "bad\udcff"})


@pytest.mark.parametrize(
    ("command", "words"), [(record, ["out", "--topic", "/a", "--require", "/a"]), (replay, ["bag"])]
)
def test_every_parameter_that_a_command_sets_exists_in_its_node(command, words, monkeypatch):
    from boom_recording import recorder_node, replay_node

    taken = {}

    def become_node(module, parameters):
        taken[module] = set(parameters)
        raise BecameNode

    monkeypatch.setattr(command, "become_node", become_node)
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    with pytest.raises(BecameNode):
        command.run(parser.parse_args(words))

    [(module, parameters)] = taken.items()
    node = {"boom_recording.recorder_node": recorder_node, "boom_recording.replay_node": replay_node}[module]
    assert parameters <= {spec.name for spec in node.PARAMETERS}
