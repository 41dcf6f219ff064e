"""Reference governor: a path that the boom cannot follow is slowed along itself, and not left.

The path q(s) has its own time s, which passes at the share sigma of the clock's:

    s' = sigma,   q' = q_s sigma,   q'' = q_ss sigma^2 + q_s sigma',   q''' = q_sss sigma^3 + 3 q_ss sigma sigma' + q_s sigma''

The control law says how fast valve, pump and currents can move the boom now, both ways. The fastest piece of the path within
``HORIZON`` gives the share that is possible; the trajectory generator's filter turns its steps into sigma with its derivatives,
and settles within the horizon, so that the path is slow when the fast piece begins.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import inf

from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_controller.types import ControlOutput, Reference

HORIZON = 0.6
"""s of the path that is looked at ahead."""
POLE = -16.0
"""1/s, of the filter: it has come within 1 % after 0.6 s."""
MARGIN = 0.9
"""Of the possible speed: the rest is for the feedback, and for what changes on the way."""
LEAST = 0.05
"""Share of the planned speed that remains at least: what stands still altogether is for the supervision."""
SLOWED = 0.99
"""Share below which the path counts as slowed."""
_COARSE = 30

Path = Callable[[float], Reference]
"""Reference at a path time [s]."""


class Governor:
    """Slows one path after the other, each from its own ``start`` on.

    Attributes:
        time: path time [s]. share: sigma; coming: what it goes to; least: the smallest sigma since ``start``.
        up, down: rates [rad/s] that are possible now, both positive.
    """

    def __init__(self, sample_time: float) -> None:
        self._filter = TrajectoryGenerator(POLE, sample_time)
        self._sample_time = sample_time
        self.reset()

    def reset(self) -> None:
        """Nothing is known of the boom, and no path is followed."""
        self.up = self.down = inf
        self.time, self.share, self.coming, self.least = 0.0, 1.0, 1.0, 1.0

    def start(self, path: Path, time: float) -> None:
        """Follow the path from its time [s] on, at its own speed."""
        self._path, self.time = path, time
        self.share = self.coming = self.least = 1.0
        self._filter.reset(1.0)
        self._ahead: tuple[deque[tuple[float, float]], ...] = (deque(), deque())
        for k in range(_COARSE):
            self._look(time + HORIZON * k / _COARSE)

    def allow(self, output: ControlOutput) -> None:
        """What the control law said last; nothing is limited where it does not know."""
        up, down = output.fastest_lift, output.fastest_lower
        self.up = max(up, 0.0) if up == up else inf
        self.down = max(down, 0.0) if down == down else inf

    @property
    def slowed(self) -> bool:
        """Whether the path is followed more slowly than planned."""
        return self.share < SLOWED

    @property
    def slowed_once(self) -> bool:
        """Whether it was since ``start``."""
        return self.least < SLOWED

    @property
    def limits(self) -> str:
        """What is possible now, for the operator."""
        return f"at most {self.up:.2f} rad/s up, {self.down:.2f} rad/s down by valve and pump"

    def advance(self, passed: float) -> Reference:
        """The reference ``passed`` [s] later."""
        self.coming = self._possible()
        sigma = self._filter.step(self.coming)
        self.time += passed * 0.5 * (self.share + sigma.angle)
        self.share = share = sigma.angle
        self.least = min(self.least, share)
        self._look(self.time + HORIZON)
        q = self._path(self.time)
        return Reference(
            q.angle,
            q.rate * share,
            q.acceleration * share**2 + q.rate * sigma.rate,
            q.jerk * share**3 + 3.0 * q.acceleration * share * sigma.rate + q.rate * sigma.acceleration,
        )

    def _look(self, time: float) -> None:
        rate = self._path(time).rate
        for fastest, here in zip(self._ahead, (rate, -rate), strict=True):
            while fastest and fastest[-1][1] <= here:
                fastest.pop()
            fastest.append((time, here))
            while fastest[0][0] < self.time:
                fastest.popleft()

    def _possible(self) -> float:
        share = 1.0
        for fastest, limit in zip(self._ahead, (self.up, self.down), strict=True):
            wanted = fastest[0][1]
            if wanted * share > MARGIN * limit:
                share = max(MARGIN * limit / wanted, LEAST)
        return share


def sampled(references: Sequence[Reference], sample_time: float) -> Path:
    """The path of references one ``sample_time`` [s] apart, at rest before the first and after the last."""
    last = len(references) - 1

    def at(time: float) -> Reference:
        k = int(time / sample_time + 0.5)
        if 0 <= k < last:
            return references[k].ahead(time - k * sample_time)
        return Reference(references[min(max(k, 0), last)].angle)

    return at
