"""Settings that change in motion move gradually to their new values: p = old + (3 w^2 - 2 w^3) (new - old), w from 0 to 1.

A law may be bumpless in its integral states and still respond to a step of a number with a peak: a lead for the pilot stage turns
every step of the neutral pressure into a peak. Small steps avoid it.
"""

from __future__ import annotations

from dataclasses import fields, replace

from boom_controller.controller import Settings


class GradualSettings:
    """The transition from one set of settings to another in so many steps.

    Args:
        old, new: both valid.
        steps: at least 1.
    """

    def __init__(self, old: Settings, new: Settings, steps: int) -> None:
        self._old, self.new = old, new
        self._steps, self._done = max(steps, 1), 0

    @property
    def finished(self) -> bool:
        """True once the new settings are reached."""
        return self._done >= self._steps

    def next(self) -> Settings:
        """The settings one step further."""
        self._done += 1
        if self.finished:
            return self.new
        w = self._done / self._steps
        part = w * w * (3.0 - 2.0 * w)
        changed = {}
        for entry in fields(self._old):
            old, new = getattr(self._old, entry.name), getattr(self.new, entry.name)
            if old != new:
                changed[entry.name] = old + part * (new - old)
        return replace(self._old, **changed)
