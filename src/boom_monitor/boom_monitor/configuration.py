"""Which configuration counts where ``/boom/machine_configuration`` tells several. No ROS; times are those of a steady clock."""

from __future__ import annotations

import math

from boom_input.shown import quoted

STEADY_S = 2.0
"""s. Nobody changes pose or load of a machine sooner: configurations that do contradict each other."""

Configuration = tuple[str, float, float, float]
"""Machine, outer boom angle [rad], telescope length [m], load [kg]."""


def in_words(told: Configuration) -> str:
    """The configuration, for the operator."""
    return f"{quoted(told[0], 60)}, q3 = {told[1]:g} rad, q4 = {told[2]:g} m, load {told[3]:g} kg"


class ToldConfiguration:
    """The last configuration that was told.

    Attributes:
        told: it; None before the first.
        contradiction: that it contradicts the one before, in one line, the same for as long as this goes on; empty: it does not.
    """

    def __init__(self) -> None:
        self.told: Configuration | None = None
        self.contradiction = ""
        self._changed = -math.inf

    def hear(self, told: Configuration, now: float) -> bool:
        """One that came at the time ``now`` [s]. True if it is to be used instead of the one before."""
        before, self.told = self.told, told
        # as words: a number that is none equals nothing, not even itself
        if before is not None and in_words(before) == in_words(told):
            return False
        sooner, self._changed = now - self._changed < STEADY_S, now
        if sooner and before is not None and not self.contradiction:
            self.contradiction = (
                f"two configurations contradict each other ({in_words(before)}; {in_words(told)}): end all but one "
                "publisher of /boom/machine_configuration"
            )
        return not self.contradiction

    def look(self, now: float) -> str:
        """The contradiction at the time ``now`` [s]; it has ended once one configuration has remained."""
        if now - self._changed >= STEADY_S:
            self.contradiction = ""
        return self.contradiction
