"""Transition from one control law to another without a jump of the currents.

    u = (1 - w) u_old + w u_new,  w = 3 x^2 - 2 x^3,  x = 0 in the first half of the time, then rising to 1

The new law starts at rest from the present measurement, and its first currents are large while it opens a valve that it assumes
closed. It therefore runs at first without effect beside the old one. Both run until the new one has taken over. Source: bumpless
transfer by fading.
"""

from __future__ import annotations

from boom_controller.controller import Settings
from boom_controller.types import Controller, ControlOutput, Measurement, Reference


class Handover:
    """Two control laws, the second taking over from the first.

    Args:
        old, new: the laws; `new` has been reset.
        steps: duration in sample times.
    """

    def __init__(self, old: Controller, new: Controller, steps: int) -> None:
        self._old, self.new = old, new
        self._steps, self._done = max(steps, 1), 0
        self.mode = new.mode

    @property
    def finished(self) -> bool:
        """True once only the new law acts."""
        return self._done >= self._steps

    def reset(self, measurement: Measurement) -> None:
        """Start with the new law alone."""
        self._done = self._steps
        self.new.reset(measurement)

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        """One sample time; inner quantities are those of the new law."""
        output = self.new.step(reference, measurement)
        if self.finished:
            return output
        old = self._old.step(reference, measurement)
        self._done += 1
        x = max(0.0, 2.0 * self._done / self._steps - 1.0)
        w = x * x * (3.0 - 2.0 * x)
        return output._replace(
            retract=(1.0 - w) * old.retract + w * output.retract, extend=(1.0 - w) * old.extend + w * output.extend
        )

    def change(self, settings: Settings) -> None:
        """Other settings for both. Raises ControlError if this needs a new controller."""
        self.new.change(settings)
        self._old.change(settings)
