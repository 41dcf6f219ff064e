"""The active control law: its mode and settings, changed in motion without a jump of the currents. No ROS.

Creating a law takes a tenth of a second, and ten times that if it has to be compiled: too long for a moving boom. So all laws are
created at rest, when the machine becomes known, and beside the cycles.
"""

from __future__ import annotations

from dataclasses import dataclass

from boom_controller.controller import MODES, Settings, make_controller
from boom_controller.errors import ControlError
from boom_controller.loop.gradual import GradualSettings
from boom_controller.loop.handover import Handover
from boom_controller.types import Controller, ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose


@dataclass(frozen=True)
class PreparedLaws:
    """What :meth:`LawInUse.prepared` gives: the laws by mode, why there is none of a mode, machine and pose."""

    laws: dict[str, Controller]
    refused: dict[str, str]
    configuration: tuple[Machine, Pose]


class LawInUse:
    """One control law for one machine in one pose.

    Args:
        mode: see ``controller.MODES``.
        settings: of the law.

    Attributes:
        mode, settings: present values; gradual changes are in progress.
        configuration: machine and pose; None before :meth:`use`.
        controller: the law; both laws during a handover.
        preparing: laws for another configuration are being made, or cannot be, in words; no motion begins until it is empty again.
        note: what the law had to say in the last step; usually empty.
    """

    def __init__(self, mode: str, settings: Settings) -> None:
        self.mode, self.settings = mode, settings
        self.configuration: tuple[Machine, Pose] | None = None
        self.controller: Controller | None = None
        self.preparing = self.note = ""
        self._laws: dict[str, Controller] = {}
        self._refused: dict[str, str] = {}
        self._gradual: GradualSettings | None = None

    def prepared(self, machine: Machine, pose: Pose) -> PreparedLaws:
        """Laws for a machine and its pose; a law that the machine has no use for is left out, unless it is the active one.

        Changes nothing here, and so may take its time in another thread.

        Raises:
            ControlError, ModelError: the active law cannot be created for it.
        """
        active, settings = self.mode, self.settings
        laws, refused = {active: make_controller(active, machine, pose, settings)}, {}
        for mode in MODES:
            try:
                laws[mode] = laws.get(mode) or make_controller(mode, machine, pose, settings)
            except ControlError as error:
                refused[mode] = str(error)
        return PreparedLaws(laws, refused, (machine, pose))

    def use(self, prepared: PreparedLaws) -> None:
        """Control with these laws from now on, with the present mode and settings.

        Raises:
            ControlError: the mode has become one that the machine has no use for; the old laws stay.
        """
        if self.mode in prepared.refused:
            raise ControlError(prepared.refused[self.mode])
        self._laws, self._refused, self.configuration = prepared.laws, prepared.refused, prepared.configuration
        self.controller = self._laws[self.mode]
        self.controller.change(self.settings)

    def change_settings(self, settings: Settings, seconds: float) -> None:
        """Change the settings within so many seconds [s]; 0: at once.

        Raises:
            ControlError: another sample time.
        """
        if settings == (self._gradual.new if self._gradual else self.settings):
            return
        if settings.sample_time != self.settings.sample_time:
            raise ControlError("sample_time cannot change while running: stop the controller and start it again")
        self._gradual = GradualSettings(self.settings, settings, round(seconds / settings.sample_time))
        self.glide()

    def glide(self) -> bool:
        """Advance a gradual change of settings by one step. True if they have changed."""
        if self._gradual is None:
            return False
        self.settings = self._gradual.next()
        if self._gradual.finished:
            self._gradual = None
        if self.controller is not None:
            self.controller.change(self.settings)
        return True

    def change_mode(self, mode: str, present: Measurement | None, seconds: float) -> None:
        """Change the law. ``present``: sensor values from which it takes over within ``seconds`` [s]; None: at once.

        Raises:
            ControlError: no such mode, or none for this machine.
        """
        if mode in self._refused:
            raise ControlError(self._refused[mode])
        if mode not in MODES:
            raise ControlError(f"mode {mode}: there is {', '.join(MODES)}")
        if mode == self.mode:
            return
        if self._laws:
            new, old = self._laws[mode], self.controller
            new.change(self.settings)
            if present is not None and old is not None:
                new.reset(present)
                law = old.new if isinstance(old, Handover) else old
                new = Handover(law, new, round(seconds / self.settings.sample_time))
            self.controller = new
        self.mode = mode

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        """One sample time of a configured law."""
        controller = self.controller
        assert controller is not None  # nothing is tracked or held before
        output = controller.step(reference, measurement)
        self.note = output.note
        if isinstance(controller, Handover) and controller.finished:
            self.controller = controller.new
        return output
