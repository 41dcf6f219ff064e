"""From /boom/machine_configuration to the control laws in use: heard, prepared beside the cycles, used at rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from boom_controller.errors import ControlError
from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.law_in_use import PreparedLaws
from boom_controller.loop.preparation import Preparation
from boom_controller.loop.rehearsal import Rehearsal
from boom_interfaces.msg import MachineConfiguration
from boom_model.derived import valve_currents
from boom_model.errors import ModelError
from boom_model.machine_file import load_machine, shipped_machine
from boom_node.foreign import foreign

Loops = Sequence[ControlLoop | Rehearsal]


class Configuring:
    """The configuration of one controller.

    Args:
        given: machine file of the parameter, name or path; empty: the machine that the configuration names, never a path.
        aside: prepare beside the cycles; else at once.
        log: the node's logger.
        refuse: told of a configuration that cannot be used: topic, what is wrong, the details.

    Attributes:
        told: the newest message; None before it.
        foreign: that the laws are for another machine than the crane says it is, in words; usually empty.
    """

    def __init__(self, given: str, aside: bool, log: Any, refuse: Callable[[str, str, str], Any]) -> None:
        self._given, self._aside, self._log, self._refuse = given, aside, log, refuse
        self.told: MachineConfiguration | None = None
        self.foreign = ""
        self._waits = False
        self._preparation: Preparation[list[PreparedLaws]] | None = None

    def hear(self, message: MachineConfiguration) -> bool:
        """Note what the crane says of itself. False: nothing new, as from a publisher that joined anew."""
        if self.told is not None and _said(self.told) == _said(message):
            return False
        self.told, self._waits = message, True
        return True

    def again(self) -> None:
        """There are new loops: what was heard is to be prepared for them."""
        self._preparation, self._waits = None, self.told is not None

    @property
    def due(self) -> bool:
        """Whether :meth:`advance` has something to do at rest."""
        return self._preparation.finished if self._preparation else self._waits

    def advance(self, loops: Loops) -> bool:
        """At rest: begin to prepare what was heard last, or use what is prepared. True: it is in use from now on."""
        used = self._use(loops)
        if self._waits and self._preparation is None:
            self._begin(loops)
            used = self._use(loops) or used
        return used

    def _use(self, loops: Loops) -> bool:
        preparation = self._preparation
        if preparation is None or not preparation.finished:
            return False
        self._preparation = None
        _announce("", loops)
        if self._waits:  # for something that has changed since
            return False
        try:
            for each, laws in zip(loops, preparation.result(), strict=True):
                each.use(laws)
        except (ControlError, ModelError) as error:
            self._refused(error, loops)
            return False
        return True

    def _begin(self, loops: Loops) -> None:
        message, self._waits = self.told, False
        assert message is not None  # otherwise nothing waits
        try:
            machine = load_machine(self._given) if self._given else shipped_machine(message.machine)
            self.foreign = foreign(message.machine, machine.name, "the laws are for")
            if self.foreign:
                self._log.warning(f"{self.foreign}: is it the right file?")
            opened, largest = valve_currents(machine)[1], loops[0].law.settings.largest_current
            if opened > largest:
                self._log.warning(
                    f"the valve of {machine.name} is open at {opened:.2f} A, and largest_current is {largest:g} A: set it higher "
                    "for full speed"
                )
            _, *numbers = _said(message)
            pose = machine.pose(*numbers)
        except (ControlError, ModelError) as error:
            self._refused(error, loops)
            return
        doing = f"preparing the control laws for {machine.name}"
        self._log.info(f"{doing}; takes some seconds the first time")
        _announce(
            f"{doing}, q3 = {pose.outer_boom_angle:g} rad, q4 = {pose.telescope_length:g} m, load {pose.load:g} kg",
            loops,
        )
        self._preparation = Preparation(lambda: [each.law.prepared(machine, pose) for each in loops], aside=self._aside)

    def _refused(self, error: Exception, loops: Loops) -> None:
        """What the crane says of itself now cannot be used, and what it said before is not true any more: nothing moves."""
        self._refuse("/boom/machine_configuration", "cannot be used", str(error))
        _announce(f"the last /boom/machine_configuration cannot be used: {error}", loops)


def _announce(text: str, loops: Loops) -> None:
    for each in loops:
        each.law.preparing = text


def _said(message: MachineConfiguration) -> tuple[str, float, float, float]:
    """Machine, q3 [rad], q4 [m], load [kg]: 0 where it is not known."""
    load = message.load_mass if message.load_mass == message.load_mass else 0.0
    return message.machine, message.outer_boom_angle, message.telescope_length, load
