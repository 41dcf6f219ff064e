"""Control laws for a new configuration are made beside the cycles, which go on meanwhile with zero currents. No ROS.

A law is compiled for its machine, pose and load: a second each where none was kept from before, several on a busy computer. Made
between two cycles, they would leave the crane without commands and without a word for that long.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread
from typing import Generic, TypeVar

Made = TypeVar("Made")


class Preparation(Generic[Made]):
    """Calls ``make`` once.

    Args:
        make: makes the laws; touches nothing that a cycle uses.
        aside: in a thread of its own; else at once, as in simulated time, which does not go on meanwhile.
    """

    def __init__(self, make: Callable[[], Made], *, aside: bool) -> None:
        self._make = make
        self._made: list[Made] = []
        self._error: Exception | None = None
        self._thread = Thread(
            target=self._run, name="preparation", daemon=True
        )  # the end of the process waits for no compiler
        self._thread.start()
        if not aside:
            self._thread.join()

    def _run(self) -> None:
        try:
            self._made.append(self._make())
        except Exception as error:  # raised where the result is asked for
            self._error = error

    @property
    def finished(self) -> bool:
        """Whether there is a result."""
        return not self._thread.is_alive()

    def result(self) -> Made:
        """What was made, once it is finished. Raises what ``make`` raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._made[0]
