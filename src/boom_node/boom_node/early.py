"""Settings that must be made before any heavy import; the module of a node imports this first.

A node spends its first half second importing. Without a handler a Ctrl-C in that time ends in a traceback, and message
classes read ``ROS_PYTHON_CHECK_FIELDS`` when they are imported, so both are arranged here, by importing this module:

    from boom_node import early  # noqa: F401  (first line of a node's module)

`boom_node.shell.run` takes the signals over from here.
"""

import os
import signal
import sys
from types import FrameType

from boom_input.ending import ending_signals

_NOT_BEGUN = {"replay": "nothing was replayed", "recorder": "nothing was recorded"}
"""What nodes with something to do say that were ended before they began."""


def ended_first(number: int) -> int:
    """The exit status of a node that a signal ended before it began; one with something to do says that it was not done."""
    spec = getattr(sys.modules.get("__main__"), "__spec__", None)
    program = os.path.basename(sys.argv[0]) if spec is None else str(spec.name).rpartition(".")[2]
    said = _NOT_BEGUN.get(program.removesuffix("_node"))
    if said is None:
        return 0
    os.write(2, f"boom: stopped before it began: {said}\n".encode())
    return 128 + number


def _end_at_once(number: int, _frame: FrameType | None) -> None:
    # Nothing has been opened yet: no destructors, no traceback.
    os._exit(ended_first(number))


def settle() -> None:
    """Set the environment of a node unless the user has, and end on a signal until `run` takes over."""
    os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for number in ending_signals():
        signal.signal(number, _end_at_once)
    signal.pthread_sigmask(
        signal.SIG_UNBLOCK, ending_signals()
    )  # a command that becomes a node holds a Ctrl-C back until here


def is_node_program() -> bool:
    """True if this process was started as a node (``python -m package.some_node``, or the installed program).

    A test or a command that merely imports a node's module keeps its own signal handlers.
    """
    spec = getattr(sys.modules.get("__main__"), "__spec__", None)
    if spec is not None:
        return str(spec.name).endswith("_node")
    # `ros2 run` and launch start <prefix>/lib/<package>/<program>.
    return "--ros-args" in sys.argv or os.path.basename(os.path.dirname(os.path.abspath(sys.argv[0]))).startswith(
        "boom_"
    )


if is_node_program():
    settle()
