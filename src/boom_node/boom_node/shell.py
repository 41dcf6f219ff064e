"""Runs one rclpy node as a process: start, spin, signals, clean end. Every node of ours is run by `run`.

Problems of rclpy 7.1.6 that this module solves (each held by a test):

- ``EventsExecutor.spin()`` and ``spin_once()`` without a time-out busy-loop and never call back: here ``spin_once``
  gets a time-out.
- SIGTERM between ``rclpy.init`` and the creation of the node ends in a traceback: here Python's own handlers are active from
  before ``init`` until after the last destructor, and rclpy installs none.
- an executor that is shut down inside a callback hangs: here `finish` only sets a flag, which the loop reads.
- once in many thousand ends the middleware did not let go of a process that had done all it had to: it ends after ``LETTING_GO_S``.
- an exception in a callback leaves the executor and ends the process: here the node's guard handles it, and whatever still leaves
  the executor.
"""

import contextlib
import faulthandler
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from types import FrameType
from typing import TYPE_CHECKING, Any

from boom_input.ending import ending_signals
from boom_input.shown import quoted
from boom_node import (
    early,  # (first: signals and environment, before rclpy is imported)
    parameters,
)
from boom_node.errors import HelpError, StartError

if TYPE_CHECKING:
    from boom_node.node import LifecycleNode, Node

EXECUTOR_VARIABLE = "BOOM_EXECUTOR"  # "events" (default) or "single"
SPIN_TIMEOUT_S = 0.2  # how long a signal may wait for the executor to return to Python

LETTING_GO_S = 10.0
"""s until a process ends that the middleware does not let go of (status 1, and where each thread stands)."""
CLOCK_PATIENCE_S = 3.0  # s until a node that wants /clock says that nobody publishes it


class _Interrupted(BaseException):
    """Raised during the construction of the node when a signal requests the end."""


class _State:
    """What the signal handlers and `finish` pass to the loop. One node per process, hence one state."""

    def __init__(self) -> None:
        self.stop = False
        self.signal = 0
        self.interruptible = False
        self.exit_status = 0
        self.message = ""

    def on_signal(self, number: int, _frame: FrameType | None) -> None:
        self.stop, self.signal = True, number
        if self.interruptible:
            self.interruptible = False
            raise _Interrupted


_state = _State()


def finish(exit_status: int = 0, message: str = "") -> None:
    """Request the end of the process from a callback or another thread of the node.

    The executor returns first, then the node
    is closed. `message`: one line for stderr, printed last.
    """
    _state.exit_status = exit_status
    _state.message = message
    _state.stop = True


def fail(message: str, exit_status: int = 2) -> int:
    """Print one line on stderr, as `StartError` wants it. Returns the exit status."""
    print(quoted(f"boom: {message}", 1000), file=sys.stderr, flush=True)
    return exit_status


def _show(text: str) -> None:
    try:
        print(text, flush=True)
    except BrokenPipeError:  # its reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextlib.contextmanager
def _signals_handled() -> Iterator[None]:
    previous = {number: signal.signal(number, _state.on_signal) for number in ending_signals()}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def make_executor(kind: str | None = None) -> Any:
    """An EventsExecutor; a SingleThreadedExecutor where `kind` or ``BOOM_EXECUTOR`` says "single".

    Raises StartError for any other value.
    """
    kind = kind or os.environ.get(EXECUTOR_VARIABLE, "events")
    if kind not in ("events", "single"):
        raise StartError(f"{EXECUTOR_VARIABLE} is '{kind}': set it to 'events' or 'single'")
    if kind == "events":
        try:
            from rclpy.experimental.events_executor import EventsExecutor

            return EventsExecutor()
        except ImportError:
            pass  # older rclpy: the other executor does the same, with more work per message
    from rclpy.executors import SingleThreadedExecutor

    return SingleThreadedExecutor()


def run(
    make_node: Callable[[], "Node | LifecycleNode"], *, argv: Sequence[str] | None = None, executor: str | None = None
) -> int:
    """Run the node that `make_node` builds until a signal, `finish` or an error ends it. Returns the exit status.

    `argv`: as ``sys.argv`` (the default). A node may have a method ``close()``: it is called once, before it is destroyed, with
    publishers still working. One that has an end may have ``unfinished()``: where a signal ends it before, it says how far it came,
    and the status is 128 and the signal's number. With ``--help`` it prints the module's text and the parameters. 0: ended by
    SIGINT, SIGTERM, SIGHUP or `finish` (before there is a node: see `early.ended_first`); 2: StartError, printed as one line; any
    other exception while the node is built is a programming error and is raised with its traceback. Once the node runs, its guard
    handles them (`boom_node.node`).
    """
    arguments = list(sys.argv if argv is None else argv)
    parameters.process_arguments = arguments[1:]
    _state.__init__()  # type: ignore[misc]  # a process runs one node, a test several after each other
    with _signals_handled():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        if _state.stop:
            return early.ended_first(_state.signal)
        try:
            parameters.read_files(arguments)  # before rclpy does, whose message is two lines without a file name
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        except StartError as error:
            return fail(str(error))
        except Exception as error:
            return fail(f"the ROS arguments cannot be read: {error}; see '--ros-args' in the ROS 2 documentation")
        try:
            return _run_initialised(make_node, executor)
        except StartError as error:
            return fail(str(error))
        except HelpError as wanted:
            _show(f"{(sys.modules[make_node.__module__].__doc__ or '').strip()}\n\n{wanted}")
            return 0
        finally:
            rclpy.try_shutdown()
            faulthandler.cancel_dump_traceback_later()


def _run_initialised(make_node: Callable[[], "Node | LifecycleNode"], kind: str | None) -> int:
    from boom_node.node import Guarded

    node: Node | LifecycleNode | None = None
    executor = None
    try:
        node = _made(make_node)
        if node is None:
            return early.ended_first(_state.signal)
        if not isinstance(node, Guarded):
            raise TypeError(f"{type(node).__name__} has to derive from boom_node.node.Node or LifecycleNode")
        executor = make_executor(kind)
        executor.add_node(node)
        _spin(executor, node)
        unfinished = getattr(node, "unfinished", str)() if _state.signal else ""
        if unfinished:
            return fail(unfinished, 128 + _state.signal)
        return fail(_state.message, _state.exit_status) if _state.message else _state.exit_status
    finally:
        _state.stop = True
        if node is not None:
            _close(node, executor)


def _made(make_node: Callable[[], "Node | LifecycleNode"]) -> "Node | LifecycleNode | None":
    """The node, or None where a signal asked for the end before it was there."""
    try:
        _state.interruptible = True
        return None if _state.stop else make_node()
    except _Interrupted:
        return None
    finally:
        _state.interruptible = False


def _spin(executor: Any, node: "Node | LifecycleNode") -> None:
    """Until a signal or `finish` asks for the end; a StartError ends it too, any other exception is the guard's."""
    clock_due = time.monotonic() + CLOCK_PATIENCE_S
    while not _state.stop:
        try:
            executor.spin_once(timeout_sec=SPIN_TIMEOUT_S)
            if clock_due <= time.monotonic():
                clock_due = float("inf")
                _look_for_clock(node)
        except StartError:
            raise
        except Exception as error:
            node.guard.caught("the executor", error)


def _look_for_clock(node: "Node | LifecycleNode") -> None:
    """Say once that a node waits for a clock that nobody publishes: its own stands at 0, and every stamp seems to be ahead."""
    if node.get_parameter("use_sim_time").value and not node.count_publishers("/clock"):
        node.get_logger().error(
            "use_sim_time is set, and nothing publishes /clock: start what does, or leave use_sim_time out"
        )


def _close(node: "Node | LifecycleNode", executor: Any) -> None:
    """The node's own end first, with publishers still working."""
    try:
        close = getattr(node, "close", None)
        if close is not None:
            close()
    finally:
        with contextlib.suppress(AttributeError, OSError, RuntimeError, ValueError):  # nowhere to write to
            faulthandler.dump_traceback_later(LETTING_GO_S, exit=True, file=sys.__stderr__)
        if executor is not None:
            executor.remove_node(node)
            executor.shutdown()
        node.destroy_node()
