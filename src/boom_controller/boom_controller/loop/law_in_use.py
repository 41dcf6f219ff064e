"""The active control law: its mode and settings, changed in motion without a jump of the currents. No ROS.

Creating a law takes a tenth of a second, and ten times that if it has to be compiled: too long for a moving boom. So all laws are
created at rest, when the machine becomes known.
"""

from __future__ import annotations

from boom_controller.controller import MODES, Settings, make_controller
from boom_controller.errors import ControlError
from boom_controller.loop.gradual import GradualSettings
from boom_controller.loop.handover import Handover
from boom_controller.types import Controller, ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose


class LawInUse:
    """One control law for one machine in one pose.

    Args:
        mode: see ``controller.MODES``.
        settings: of the law.

    Attributes:
        mode, settings: present values; gradual changes are in progress.
        configuration: machine and pose; None before :meth:`configure`.
        controller: the law; both laws during a handover.
        note: what the law had to say in the last step; usually empty.
    """

    def __init__(self, mode: str, settings: Settings) -> None:
        self.mode, self.settings = mode, settings
        self.configuration: tuple[Machine, Pose] | None = None
        self.controller: Controller | None = None
        self.note = ""
        self._laws: dict[str, Controller] = {}
        self._refused: dict[str, str] = {}
        self._gradual: GradualSettings | None = None

    def configure(self, machine: Machine, pose: Pose) -> None:
        """Set the machine and its pose. A law that the machine has no use for is left out, unless it is the active one.

        Raises:
            ControlError, ModelError: the active law cannot be created for it; the old ones stay.
        """
        laws, refused = {self.mode: make_controller(self.mode, machine, pose, self.settings)}, {}
        for mode in MODES:
            try:
                laws[mode] = laws.get(mode) or make_controller(mode, machine, pose, self.settings)
            except ControlError as error:
                refused[mode] = str(error)
        self._laws, self._refused = laws, refused
        self.controller = self._laws[self.mode]
        self.configuration = (machine, pose)

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
