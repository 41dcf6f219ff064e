"""Shared by the commands that only start a node: turns options into ROS parameters."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from typing import NoReturn

from boom_bringup.cli import UsageError
from boom_input.shown import quoted

ParameterValue = str | float | int | bool | Sequence[str]


def node_command(module: str, parameters: Mapping[str, ParameterValue | None]) -> list[str]:
    """Make the command line of a node.

    Args:
        module: module with the node's `main()`.
        parameters: values by parameter name; None leaves the node's own default.

    Returns:
        Program and arguments.

    Raises:
        UsageError: a text that is no UTF-8.
        ModuleNotFoundError: the messages are missing, without which no node starts; the command line says how to install them.
    """
    if importlib.util.find_spec("boom_interfaces") is None:
        raise ModuleNotFoundError(name="boom_interfaces")
    command = [sys.executable, "-m", module, "--ros-args"]
    for name, value in parameters.items():
        if value is not None:
            command += ["-p", f"{name}:={_yaml(value)}"]
    return command


def _yaml(value: ParameterValue) -> str:
    """A value as rcl reads it: texts quoted, so that a path of digits stays one, and whatever they hold in ASCII."""
    if isinstance(value, (bool, int, float)):
        return json.dumps(value)
    if not isinstance(value, str):
        return f"[{', '.join(_yaml(each) for each in value)}]"
    if any("\ud800" <= c <= "\udfff" for c in value):  # bytes of a name that are no UTF-8
        raise UsageError(f"{quoted(value)}: ROS takes names in UTF-8 only: rename it, or give another")
    # what JSON writes in one escape is YAML, too, but not its pairs for characters beyond 16 bits
    return '"' + "".join(json.dumps(c)[1:-1] if c < "\U00010000" else f"\\U{ord(c):08X}" for c in value) + '"'


def become_node(module: str, parameters: Mapping[str, ParameterValue | None]) -> NoReturn:
    """Replace this process by the node, so that signals and the exit status are the node's own."""
    command = node_command(module, parameters)
    sys.stdout.flush()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # until boom_node.early handles it
    os.execv(command[0], command)
