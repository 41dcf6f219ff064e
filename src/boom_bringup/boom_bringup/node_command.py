"""Shared by the commands that only start a node: turns options into ROS parameters."""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Mapping, Sequence
from typing import NoReturn

ParameterValue = str | float | int | bool | Sequence[str]


def node_command(module: str, parameters: Mapping[str, ParameterValue | None]) -> list[str]:
    """Make the command line of a node.

    Args:
        module: module with the node's `main()`.
        parameters: values by parameter name; None leaves the node's own default.

    Returns:
        Program and arguments.

    Raises:
        ModuleNotFoundError: the messages are missing, without which no node starts; the command line says how to install them.
    """
    if importlib.util.find_spec("boom_interfaces") is None:
        raise ModuleNotFoundError(name="boom_interfaces")
    command = [sys.executable, "-m", module, "--ros-args"]
    for name, value in parameters.items():
        if value is not None:
            # JSON is YAML: quoted, so that a path of digits stays a string.
            command += ["-p", f"{name}:={json.dumps(list(value) if isinstance(value, tuple) else value)}"]
    return command


def become_node(module: str, parameters: Mapping[str, ParameterValue | None]) -> NoReturn:
    """Replace this process by the node, so that signals and the exit status are the node's own."""
    command = node_command(module, parameters)
    sys.stdout.flush()
    os.execv(command[0], command)
