"""Decides which currents go to the ECU, and says why they are zero. Pure: times are those of a steady clock.

Currents pass only while the bridge is active, motion is enabled, no emergency stop is set, bus and all sensors are present, and the
last command is finite and no older than 50 ms. Whatever stops an enabled motion also disables it: it must be enabled again. Only
rising currents are limited in rate, so closing the valve never waits.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class GatedCommand:
    """The output: currents [A], whether the ECU may use them, and the reason if not (empty = they are used)."""

    retract: float
    extend: float
    enable: bool
    reason: str


class CommandGate:
    """State of the commands.

    Args:
        largest: largest current that passes [A]
        rise_rate: largest rise of a current [A/s]
        timeout: age from which a command is no longer used [s]
        revoke_after: silence after which motion is disabled [s]; counted only once commands have come
        standstill: time between two outputs that means the bridge itself stood still [s]
    """

    def __init__(
        self,
        largest: float = 0.7,
        rise_rate: float = 20.0,
        timeout: float = 0.05,
        revoke_after: float = 1.0,
        standstill: float = 0.1,
    ) -> None:
        self.largest = largest
        self.rise_rate = rise_rate
        self.timeout = timeout
        self.revoke_after = revoke_after
        self.standstill = standstill
        self.refused = 0
        self.clamped = 0
        self.revoked = ""
        self._enabled = False
        self._stop = False
        self._problem = "not active"
        self._command = (0.0, 0.0)
        self._refusal = ""
        self._received: float | None = None
        self._first_since_enable = False
        self._sent = (0.0, 0.0)
        self._sent_at: float | None = None

    @property
    def enabled(self) -> bool:
        """Whether motion is enabled (not: whether something moves)."""
        return self._enabled

    def enable(self, wanted: bool) -> tuple[bool, str]:
        """Enable or disable motion; returns success and a line for the user."""
        if not wanted:
            self._enabled, self.revoked = False, ""
            return True, "motion disabled: zero current"
        if self._stop:
            return False, "emergency stop is set: clear it on /boom/emergency_stop first"
        if self._problem:
            return False, f"motion stays disabled: {self._problem}"
        self._enabled, self.revoked = True, ""
        self._first_since_enable = False
        return True, "motion enabled"

    def revoke(self, reason: str) -> None:
        """Disable motion; the reason is shown until motion is enabled again."""
        if self._enabled:
            self._enabled, self.revoked = False, reason

    def emergency_stop(self, wanted: bool) -> None:
        """Set the state of /boom/emergency_stop: true stops, false allows enabling again but does not enable."""
        self._stop = wanted
        if wanted:
            self.revoke("emergency stop")

    def problem(self, reason: str) -> None:
        """Set why the machine cannot move at the moment (lifecycle, bus, sensors, ECU); empty = it can."""
        self._problem = reason
        if reason:
            self.revoke(reason)

    def command(self, retract: float, extend: float, age: float, now: float) -> bool:
        """Accept a command; False if it is refused.

        Args:
            retract: current [A]
            extend: current [A]
            age: age by its stamp [s]; 0 without a stamp
            now: steady time [s]
        """
        if not (math.isfinite(retract) and math.isfinite(extend)):
            self._refusal = "the command is not a finite number"
        elif not -self.timeout <= age <= self.timeout:
            self._refusal = f"the command's stamp is {1e3 * age:.0f} ms old, more than {1e3 * self.timeout:.0f} ms"
        else:
            self._refusal = ""
        if self._refusal:
            self.refused += 1
            return False
        limited = (min(max(retract, 0.0), self.largest), min(max(extend, 0.0), self.largest))
        # Noise of a replayed measurement around zero is no reason to complain.
        self.clamped += abs(limited[0] - retract) > 0.01 or abs(limited[1] - extend) > 0.01
        self._command = limited
        self._received = now - max(age, 0.0)
        self._first_since_enable = self._first_since_enable or self._enabled
        return True

    def output(self, now: float) -> GatedCommand:
        """What to send at `now` [s]."""
        elapsed = 0.0 if self._sent_at is None else now - self._sent_at
        self._sent_at = now
        if elapsed > self.standstill:
            self.revoke(f"the bridge itself stood still for {1e3 * elapsed:.0f} ms")
        silence = math.inf if self._received is None else now - self._received
        if self._first_since_enable and silence > self.revoke_after:
            self.revoke(f"no current command for {self.revoke_after:g} s")
        reason = self._reason(silence)
        if reason:
            self._sent = (0.0, 0.0)
            return GatedCommand(0.0, 0.0, False, reason)
        most = self.rise_rate * elapsed
        retract = min(self._command[0], self._sent[0] + most)
        extend = min(self._command[1], self._sent[1] + most)
        self._sent = (retract, extend)
        return GatedCommand(retract, extend, True, "")

    def _reason(self, silence: float) -> str:
        if self._stop:
            return "emergency stop"
        if not self._enabled:
            if self.revoked:
                return f"motion was disabled: {self.revoked}; enable again"
            return self._problem or "motion is not enabled: call ~/enable"
        if self._refusal:
            return self._refusal
        if silence > self.timeout:
            return (
                "no current command" if silence == math.inf else f"no current command for {1e3 * self.timeout:.0f} ms"
            )
        return ""
