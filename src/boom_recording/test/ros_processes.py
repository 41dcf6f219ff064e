"""Starts the nodes of this package as processes and talks to them, for the tests."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def environment() -> dict[str, str]:
    """What conftest.py has set: loopback only, a domain apart from whatever else runs on this computer."""
    return dict(os.environ, PYTHONUNBUFFERED="1")


def start(module: str, cwd: Path, **parameters: object) -> "subprocess.Popen[str]":
    """Start ``python -m module`` with ROS parameters."""
    command = [sys.executable, "-m", module, "--ros-args"]
    for name, value in parameters.items():
        text = (
            "[" + ",".join(value) + "]"
            if isinstance(value, list)
            else str(value).lower()
            if isinstance(value, bool)
            else str(value)
        )
        command += ["-p", f"{name}:={text}"]
    return subprocess.Popen(
        command, cwd=cwd, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


class Partner:
    """A node in this process, spun until something is so."""

    def __init__(self, name: str) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def until(self, condition: Callable[[], Any], timeout: float = 20.0) -> None:
        import time

        end = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < end, "what was waited for did not happen"
            self.executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()
