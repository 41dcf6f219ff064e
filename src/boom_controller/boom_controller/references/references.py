"""The one reference of the control law, without jumps, whatever its source.

Sources: a stream of wanted angles through the trajectory generator (6.27), a planned trajectory, and rest. When the source
changes, the difference between the old and the new one (angle, rate, acceleration) fades as a quintic within ``blend`` seconds, so
that angle, rate and, up to ``deceleration``, acceleration are continuous. It comes to rest by a bounded ramp, see
:func:`boom_controller.references.polynomial.to_rest`.

What the boom cannot follow is slowed: a trajectory along itself (``governor``), a stream by limiting its rate.

In real time stream and cycles have separate clocks: between two cycles there may be none or two wanted angles, which would double
or skip a step. So the wanted angle is interpolated at one and a half sample times before the sensors' sample, between the two that
came around that time.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Literal

from boom_controller.references.governor import MARGIN, Governor
from boom_controller.references.joint_trajectory import JointTrajectory
from boom_controller.references.polynomial import Polynomial, quintic, to_rest
from boom_controller.references.trajectory_generator import TrajectoryGenerator
from boom_controller.types import Reference

Kind = Literal["rest", "stream", "trajectory"]
_SHORTEST_RAMP = 0.2
_MOST_STEPS = 10
_REMEMBERED = 4
_BEHIND_STREAM = 0.01
"""rad. Less is left behind by every stream."""
_BEHIND = 1.5  # sample times: the newest wanted angle is up to one old, and comes early or late


class References:
    """The reference over time. All times in seconds of one clock, angles in rad.

    Args:
        generator: the trajectory generator; it steps every `sample_time` [s].
        sample_time: [s].
        deceleration: deceleration of the ramp to rest [rad/s^2].
        fastest: rate [rad/s] to which a stream of wanted angles is limited.
        blend: time in which a change of source fades [s].

    Attributes:
        present: the reference now.
        kind: its source.
        governor: knows what the boom can follow.
    """

    def __init__(
        self, generator: TrajectoryGenerator, sample_time: float, deceleration: float, fastest: float, blend: float
    ) -> None:
        self._generator = generator
        self.governor = Governor(sample_time)
        self._sample_time = sample_time
        self.deceleration, self.fastest, self.blend = deceleration, fastest, blend
        self.reset(0.0, 0.0)

    def reset(self, angle: float, now: float) -> None:
        """Rest at the angle from `now` on, whatever the previous reference."""
        self.kind: Kind = "rest"
        self.present = Reference(angle)
        self._now = self._begin = now
        self._piece = Polynomial(angle)
        self._length = 0.0
        self._fading: Polynomial | None = None
        self._faded_from, self._fades_for = now, self.blend
        self._trajectory: JointTrajectory | None = None
        self.governor.reset()
        self._wanted = angle
        self._heard: deque[tuple[float, float]] = deque(maxlen=_REMEMBERED)
        self._limited = angle

    @property
    def resting(self) -> bool:
        """True once the reference stands still."""
        return self.kind == "rest" and self._fading is None and self._now >= self._begin + self._length

    @property
    def wanted(self) -> float:
        """The last angle [rad] received from a stream."""
        return self._wanted

    def rest(self) -> None:
        """Come to rest by the ramp, from any motion."""
        before = self.onward
        self.kind = "rest"
        self._fading = None
        self._begin = self._now
        self._length = max(1.5 * abs(before.rate) / self.deceleration, _SHORTEST_RAMP)
        self._piece = to_rest(before, self._length)

    def stream(self, wanted: float, came: float | None = None) -> None:
        """Follow wanted angles [rad] through the generator from now on; call again with every new one.

        ``came``: when, by the clock of ``sampled`` in :meth:`advance` [s]; None if each cycle has its own.
        """
        self._wanted = wanted
        if self.kind != "stream":
            self.kind = "stream"
            self._heard.clear()
            self._limited = self.present.angle
            self._fade(self._generator.reset(self.present.angle))
        if came is not None:
            self._heard.append((came, wanted))

    def start(self, trajectory: JointTrajectory, begin: float) -> None:
        """Follow a trajectory whose start is at the time `begin` [s]; one that has already started is joined in progress."""
        self._trajectory = trajectory
        self.kind = "trajectory"
        self._begin = begin
        self.governor.start(trajectory.at, self._now - begin)
        source = trajectory.exactly(self._now - begin)
        self._fade(self._generator.reset(source.angle) if trajectory.smoothed else source)

    @property
    def onward(self) -> Reference:
        """What another source goes on from: the present reference, with no more acceleration than a ramp to rest has.

        What a short piece asks for at its ends would carry the boom far away in the time of a change.
        """
        return self.present._replace(acceleration=self._bounded(self.present.acceleration), jerk=0.0)

    def _bounded(self, acceleration: float) -> float:
        return min(max(acceleration, -self.deceleration), self.deceleration)

    @property
    def changing(self) -> bool:
        """Whether something of the source before is left."""
        return self._fading is not None

    @property
    def elapsed(self) -> float:
        """Time of the trajectory since its start [s], which passes slowly where it is slowed; negative before it."""
        return self.governor.time

    def advance(self, now: float, sampled: float = math.inf) -> Reference:
        """The reference at the time `now` [s]; ``sampled``: when the sensors' sample was taken, by the clock of :meth:`stream`."""
        before, self._now = self._now, max(now, self._now)
        if self.kind == "rest":
            passed = self._now - self._begin
            reached = self._piece.at(min(passed, self._length))
            source = reached if passed < self._length else Reference(reached.angle)
        elif self.kind == "stream":
            source = self._stepped(
                self._wanted_at(sampled - _BEHIND * self._sample_time), self._now - before, limited=True
            )
        else:
            assert self._trajectory is not None  # set together with the kind
            source = self.governor.advance(self._now - before)
            if self._trajectory.smoothed:
                self._limited = source.angle
                source = self._stepped(source.angle, self._now - before, limited=False)
        self.present = self._faded(source)
        return self.present

    def change(self, pole: float) -> None:
        """Change the pole of the generator [1/s], without a jump."""
        self._generator.change(pole)

    def _wanted_at(self, time: float) -> float:
        later: tuple[float, float] | None = None
        for came, wanted in reversed(self._heard):
            if came <= time:
                if later is None:
                    return wanted
                return wanted + (time - came) / (later[0] - came) * (later[1] - wanted)
            later = came, wanted
        return self._wanted if later is None else later[1]

    def _stepped(self, wanted: float, passed: float, *, limited: bool) -> Reference:
        # one step a sample time, also where cycles were missed
        late = passed > 1.5 * self._sample_time
        g = self.governor
        up, down = (min(self.fastest, MARGIN * limit) * self._sample_time for limit in (g.up, g.down))
        for _ in range(min(round(passed / self._sample_time), _MOST_STEPS) if late else 1):
            if limited:
                self._limited += min(max(wanted - self._limited, -down), up)
            else:
                self._limited = wanted
            result = self._generator.step(self._limited)
        return result

    @property
    def slowed(self) -> str:
        """A sentence for the operator where the boom cannot follow what it was given; empty where it can."""
        g = self.governor
        if self.kind == "trajectory" and g.slowed:
            return f"the path is slowed to {min(g.share, g.coming):.0%} of its speed: the boom cannot move faster ({g.limits})"
        behind = abs(self._wanted - self._limited)
        if self.kind == "stream" and behind > _BEHIND_STREAM and min(g.up, g.down) < self.fastest:
            return f"the reference is {behind:.2f} rad ahead: the boom cannot move faster ({g.limits})"
        return ""

    def _fade(self, new: Reference) -> None:
        old = self.onward
        ahead = (old.angle - new.angle, old.rate - new.rate, old.acceleration - self._bounded(new.acceleration))
        self._faded_from, self._fades_for = self._now, self.blend
        self._fading = quintic(ahead, (0.0, 0.0, 0.0), self.blend) if any(ahead) else None

    def _faded(self, source: Reference) -> Reference:
        if self._fading is None:
            return source
        passed = self._now - self._faded_from
        if passed >= self._fades_for:
            self._fading = None
            return source
        off = self._fading.at(passed)
        return Reference(
            source.angle + off.angle,
            source.rate + off.rate,
            source.acceleration + off.acceleration,
            source.jerk + off.jerk,
        )
