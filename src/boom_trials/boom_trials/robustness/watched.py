"""A control law under the supervision as shipped, and with a clock: what the controller's node puts around it."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_controller.supervision.watch import MotionWatch
from boom_controller.types import Controller, ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose


class Watched:
    """A law whose motion is watched with the default limits: the first that is left is its reason to stop.

    Args:
        law: that commands.
        machine, pose: whose stroke limits the angle, and whose weight the pressures carry.

    Attributes:
        mode: of the law. seconds: [s] that each step of the law took.
    """

    def __init__(self, law: Controller, machine: Machine, pose: Pose, *, supervised: bool) -> None:
        self.mode = law.mode
        self.seconds: list[float] = []
        self._law = law
        self._watch = MotionWatch.of(SupervisionSettings(), machine, pose) if supervised else None

    def reset(self, measurement: Measurement) -> None:
        """As the law."""
        self._law.reset(measurement)
        self.seconds.clear()

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        """The law's step, then its limits."""
        begin = perf_counter()
        output = self._law.step(reference, measurement)
        self.seconds.append(perf_counter() - begin)
        found = self._watch and self._watch.motion(measurement, reference, output, measurement.time)
        return output._replace(reason=f"{found.reason}: {found.text}", cause=found.reason) if found else output

    def change(self, settings: Any) -> None:
        """As the law."""
        self._law.change(settings)
