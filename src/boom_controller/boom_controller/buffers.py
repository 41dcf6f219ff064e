"""CasADi functions on plain buffers: what the control laws evaluate in every cycle."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Any


def on_buffers(function: Any, arguments: array[float], results: array[float]) -> Callable[[], None]:
    """Evaluates a CasADi function of one vector on plain buffers: ten times as fast as its ordinary call.

    Args:
        function: of one vector, giving one vector.
        arguments: what every call reads.
        results: what it writes.
    """
    buffer, evaluate = function.buffer()
    buffer.set_arg(0, memoryview(arguments))
    buffer.set_res(0, memoryview(results))

    def call(_owner: Any = (function, buffer)) -> None:  # both have to live as long as they are called
        evaluate()

    return call
