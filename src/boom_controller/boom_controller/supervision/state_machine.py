"""The state of the motion, and the course of a stop. No ROS; times are seconds of the supervising clock.

| state | event | next |
|---|---|---|
| idle | a reference is accepted | track |
| track | end, abort or cancel of a trajectory; the stream of references falls silent | hold |
| hold | a reference is accepted | track |
| idle | a requested stop (emergency stop) | stopped |
| hold, track | a reason to stop | stopping |
| stopping | the currents have come to zero | stopped |
| stopped | ~/resume, and no reason persists | idle |

In idle and stopped both currents are zero: the centred spool holds the boom.
"""

from __future__ import annotations

from enum import StrEnum

from boom_controller.supervision.reasons import REASONS, StopCause
from boom_controller.supervision.supervision_settings import SupervisionSettings

FAULT_RAMP = 0.05
"""s. After a failure of the program itself the currents are zero within 100 ms, even if the next cycle fails."""


class MotionState(StrEnum):
    """States of the table above."""

    IDLE = "idle"
    HOLD = "hold"
    TRACK = "track"
    STOPPING = "stopping"
    STOPPED = "stopped"


class Supervision:
    """The state machine.

    Attributes:
        state: of the motion.
        finding: reason for the stop; None otherwise.
    """

    def __init__(self, settings: SupervisionSettings) -> None:
        self.settings = settings
        self.state = MotionState.IDLE
        self.finding: StopCause | None = None
        self._since = 0.0
        self._ramp_from: float | None = None
        self._ramp = settings.current_ramp
        self._rested_since: float | None = None

    @property
    def closed_loop(self) -> bool:
        """True while the control law commands: holding, tracking, or coming to rest by the reference."""
        return self.state in (MotionState.HOLD, MotionState.TRACK) or (
            self.state is MotionState.STOPPING and self._ramp_from is None
        )

    @property
    def moving(self) -> bool:
        """True while currents may flow."""
        return self.state in (MotionState.HOLD, MotionState.TRACK, MotionState.STOPPING)

    def track(self) -> None:
        """Note an accepted reference."""
        self.state = MotionState.TRACK

    def hold(self) -> None:
        """Hold the boom where it is, after the motion has ended."""
        self.state = MotionState.HOLD

    def stop(self, finding: StopCause, now: float) -> bool:
        """Bring the boom to rest for this reason. True if this changes anything.

        A stop by the reference becomes one by the currents if the new reason requires it; the first reason is reported.
        """
        if self.state is MotionState.STOPPED:
            return False
        by_currents = REASONS[finding.reason].reaction == "currents"
        if self.state is not MotionState.STOPPING:
            self._ramp = self.settings.current_ramp
        if finding.reason == "internal_error":
            self._ramp = min(self.settings.current_ramp, FAULT_RAMP)
        if self.state is MotionState.STOPPING:
            if by_currents and self._ramp_from is None:
                self._ramp_from = now
            return False
        was_moving = self.moving
        self.finding, self._since = finding, now
        self._rested_since = None
        self._ramp_from = now if by_currents else None
        self.state = MotionState.STOPPING if was_moving else MotionState.STOPPED
        return True

    def advance(self, now: float, resting: bool) -> float:
        """Advance to the time `now` [s]; `resting`: the reference stands still. Returns the share 0 .. 1 of the currents left."""
        if self.state is not MotionState.STOPPING:
            return 1.0 if self.moving else 0.0
        if self._ramp_from is None:
            self._rested_since = (self._rested_since if self._rested_since is not None else now) if resting else None
            settled = self._rested_since is not None and now - self._rested_since >= self.settings.stop_settling
            if settled or now - self._since >= self.settings.longest_stop:
                self._ramp_from = now
        if self._ramp_from is None:
            return 1.0
        left = 1.0 - (now - self._ramp_from) / self._ramp
        if left <= 0.0:
            self.state = MotionState.STOPPED
            return 0.0
        return left

    def resume(self, standing: StopCause | None, missing: str = "") -> tuple[bool, str]:
        """Handle the command to continue; `standing`: a persisting reason, `missing`: why no motion can begin yet, in words.

        Returns success and a line for the operator.
        """
        if self.state is MotionState.STOPPING:
            return False, "the boom is still coming to rest: call again"
        if self.state is not MotionState.STOPPED:
            return True, f"nothing to resume: {self.state.value}"
        if standing is not None:
            return False, f"still stopped, {standing.text}: {REASONS[standing.reason].remedy}"
        self.state, self.finding = MotionState.IDLE, None
        return True, missing or "ready: waiting for a reference"

    def drop(self) -> None:
        """Go to idle at once, or from stopping to stopped; the caller removes the currents. A persisting stop stays."""
        if self.state is MotionState.STOPPING:
            self.state = MotionState.STOPPED
        elif self.state is not MotionState.STOPPED:
            self.state = MotionState.IDLE
