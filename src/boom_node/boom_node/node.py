"""Base classes of our nodes: nothing that comes in over ROS ends them. `boom_node.shell.run` accepts no others.

Every callback (subscription, timer, service, action, transition) goes through the node's `Guard`. A message is checked before it
becomes an object: one that is too large or damaged is refused within microseconds.

    class Example(Node):
        def stop_safely(self, reason): ...  # if the node can move something: bring it to rest, whatever the state of everything
        else
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import rclpy.lifecycle
import rclpy.node
from rclpy.serialization import deserialize_message

from boom_node.errors import StartError
from boom_node.guard import Guard

LARGEST_BYTES = 65_536
"""Largest message that a subscription accepts, unless its type is listed below."""
LARGEST_BY_TYPE: Mapping[str, int] = {"JointTrajectory": 80_000, "String": 1_000_000}
"""1000 points; a robot description."""


class Guarded:
    """Common part of both kinds of nodes; stands before rclpy's class in the list of bases."""

    @property
    def guard(self) -> Guard:
        """The node's guard, created on first use, because rclpy's constructors already create services."""
        made = getattr(self, "_guard", None)
        if made is None:
            made = self._guard = Guard(self._guard_tells, lambda reason: self.stop_safely(reason))
        return made

    def stop_safely(self, reason: str) -> None:
        """Bring to rest whatever this node moves, after a callback has raised. Most nodes move nothing."""

    def _guard_tells(self, error: bool, text: str) -> None:
        # Two calls: rclpy refuses one place in the code that logs at two levels.
        if error:
            self.get_logger().error(text)
        else:
            self.get_logger().warning(text)

    def guarded(self, where: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, guarded, for a thread or a callback without arguments."""

        def call() -> None:
            try:
                function()
            except StartError:
                raise
            except Exception as error:
                self.guard.caught(where, error)

        return call

    # ------------------------------------------------------------------------------------------- what rclpy calls back

    def create_subscription(self, msg_type: Any, topic: str, callback: Any, *args: Any, **options: Any) -> Any:
        """As in rclpy; the callback receives only messages that are small enough and readable."""
        raw = options.pop("raw", False)
        largest = LARGEST_BY_TYPE.get(msg_type.__name__, LARGEST_BYTES)

        def receive(data: bytes) -> None:
            try:
                if raw:
                    callback(data)
                    return
                if len(data) > largest:
                    self.guard.refuse(topic, f"larger than {largest // 1000} kB", f"{len(data) // 1000} kB")
                    return
                try:
                    message = deserialize_message(data, msg_type)
                except Exception as error:
                    self.guard.refuse(topic, "damaged", " ".join(str(error).split())[:200])
                    return
                callback(message)
            except StartError:
                raise
            except Exception as error:
                self.guard.caught(topic, error)

        return super().create_subscription(msg_type, topic, receive, *args, raw=True, **options)  # type: ignore[misc]

    def create_timer(self, timer_period_sec: float, callback: Any, *args: Any, **options: Any) -> Any:
        """As in rclpy."""
        name = f"timer {getattr(callback, '__name__', '')}"
        return super().create_timer(timer_period_sec, self.guarded(name, callback), *args, **options)  # type: ignore[misc]

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, *args: Any, **options: Any) -> Any:
        """As in rclpy; a request whose callback raises is answered as failed."""
        served = partial(self._guard_serves, srv_name, callback)
        return super().create_service(srv_type, srv_name, served, *args, **options)  # type: ignore[misc]

    def _guard_serves(self, name: str, callback: Any, request: Any, response: Any) -> Any:
        try:
            return callback(request, response)
        except StartError:
            raise
        except Exception as error:
            if _within_rclpy(callback, error):
                self.guard.refuse(f"service {name}", "impossible request", " ".join(str(error).split())[:200])
                return response
            self.guard.caught(f"service {name}", error)
            if hasattr(response, "message"):
                response.message = self.guard.internal
            return response

    def add_waitable(self, waitable: Any) -> None:
        """As in rclpy; callbacks of an action server are guarded too."""
        if hasattr(waitable, "register_execute_callback"):
            self._guard_covers_action(waitable)
        super().add_waitable(waitable)  # type: ignore[misc]

    def _guard_covers_action(self, server: Any) -> None:
        from rclpy.action import CancelResponse, GoalResponse

        def answering(callback: Any, otherwise: Any) -> Any:
            def answer(argument: Any) -> Any:
                try:
                    return callback(argument)
                except Exception as error:
                    self.guard.caught("action", error)
                    return otherwise

            return answer

        execute = server._execute_callback

        async def executing(handle: Any) -> Any:
            try:
                return await execute(handle)
            except Exception as error:
                self.guard.caught("action", error)
                if handle.is_active:
                    handle.abort()
                result = server.action_type.Result()
                if hasattr(result, "error_string"):
                    result.error_string = self.guard.internal
                return result

        server.register_execute_callback(executing)
        server.register_goal_callback(answering(server._goal_callback, GoalResponse.REJECT))
        server.register_cancel_callback(answering(server._cancel_callback, CancelResponse.REJECT))


def _within_rclpy(callback: Any, error: Exception) -> bool:
    """Whether a service of rclpy raised it, as its parameter services do for an unknown type; then no code of ours ran."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    ours = any(Path(frame.filename).parent.name.startswith("boom_") for frame in frames)
    return str(getattr(callback, "__module__", "")).startswith("rclpy") and not ours


class Node(Guarded, rclpy.node.Node):
    """rclpy's node, guarded."""


class LifecycleNode(Guarded, rclpy.lifecycle.LifecycleNode):
    """rclpy's lifecycle node, guarded; a transition that the present state does not have is refused and raises nothing."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._callbacks = {state: self._telling(callback) for state, callback in self._callbacks.items()}
        for service in self.services:
            if not isinstance(service.callback, partial):  # made past create_service
                callback = (
                    self._changing(service.callback) if service is self._service_change_state else service.callback
                )
                service.callback = partial(self._guard_serves, service.srv_name, callback)

    def _telling(self, callback: Any) -> Any:
        def transition(state: Any) -> Any:
            try:
                return callback(state)
            except Exception as error:  # rclpy would say nothing
                self.guard.caught(f"transition {callback.__name__}", error)
                raise

        return transition

    def _changing(self, change: Any) -> Any:
        def changing(request: Any, response: Any) -> Any:
            wanted = request.transition
            # rclpy goes by the label where there is one
            possible = {entry[1] if wanted.label else entry[0] for entry in self._state_machine.available_transitions}
            if (wanted.label or wanted.id) not in possible:
                self.get_logger().warning(f"no transition {wanted.label or wanted.id!r} from here")
                response.success = False
                return response
            return change(request, response)

        return changing
