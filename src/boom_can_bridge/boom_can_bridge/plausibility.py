"""Refuses a value that changed faster than the machine can: a frame with a valid checksum may come from a broken sensor.

One sample is refused; if the next one agrees with it, the step was real and is accepted.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .codec import Codec
from .errors import FrameError


class RateCheck:
    """Rate of change of each field against the `rate_limit` of the mapping; for the live bus and for logs.

    After `SILENCE_S` without a frame the next one is accepted unchecked.
    """

    SILENCE_S = 0.1

    def __init__(self, codec: Codec) -> None:
        self._limits = {
            spec.name: [
                (f.name, f.rate_limit, f.tolerance * 2) for f in spec.fields.values() if f.rate_limit < math.inf
            ]
            for spec in codec.frames.values()
        }
        self._periods = {spec.name: spec.period_s for spec in codec.frames.values()}
        self._accepted: dict[str, tuple[float, Mapping[str, float]]] = {}
        self._refused: dict[str, tuple[float, Mapping[str, float]]] = {}

    def _offender(
        self, frame: str, before: tuple[float, Mapping[str, float]], values: Mapping[str, float], time: float
    ) -> str:
        # Frames that waited arrive close together: never less than a period between two samples.
        elapsed = max(time - before[0], self._periods[frame])
        if elapsed >= self.SILENCE_S:
            return ""
        for name, limit, bit in self._limits[frame]:
            if abs(values[name] - before[1][name]) > limit * elapsed + bit:
                return name
        return ""

    def accept(self, frame: str, values: Mapping[str, float], time: float) -> None:
        """Check the values of a good frame.

        Args:
            frame: name
            values: SI values by field
            time: of the frame [s], on one clock

        Raises:
            FrameError: `range`: a value changed faster than its limit
        """
        before = self._accepted.get(frame)
        if before is not None:
            name = self._offender(frame, before, values, time)
            refused = self._refused.get(frame)
            if name and (refused is None or self._offender(frame, refused, values, time)):
                self._refused[frame] = (time, values)
                raise FrameError("range", f"{frame}: {name} jumped from {before[1][name]:g} to {values[name]:g}")
        self._accepted[frame] = (time, values)
        self._refused.pop(frame, None)

    def accept_many(
        self, frame: str, values: Mapping[str, NDArray[np.float64]], times: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Like `accept` for many frames of one kind: which are accepted (n,). Arguments as there, arrays of length n."""
        good = np.ones(len(times), bool)
        if not len(times) or not self._limits[frame]:
            return good
        elapsed = np.maximum(np.diff(times), self._periods[frame])
        calm = True
        for name, limit, bit in self._limits[frame]:
            steps = np.abs(np.diff(values[name])) > limit * elapsed + bit
            calm = calm and not bool(np.any(steps & (elapsed < self.SILENCE_S)))
        last = len(times) - 1
        first = {name: float(column[0]) for name, column in values.items()}
        before = self._accepted.get(frame)
        if (
            calm
            and frame not in self._refused
            and (before is None or not self._offender(frame, before, first, float(times[0])))
        ):
            self._accepted[frame] = (float(times[last]), {name: float(column[last]) for name, column in values.items()})
            return good
        names = list(values)
        for i, row in enumerate(zip(*(values[name].tolist() for name in names), strict=True)):
            try:
                self.accept(frame, dict(zip(names, row, strict=True)), float(times[i]))
            except FrameError:
                good[i] = False
        return good

    def forget(self) -> None:
        """Accept any next value."""
        self._accepted.clear()
        self._refused.clear()
