"""From a heard configuration to laws in use: the cycles go on meanwhile, nothing moves, and it is said why."""

from __future__ import annotations

import math
from collections.abc import Iterator
from threading import Event
from typing import Any

import pytest

from boom_controller.controller import Settings, make_controller
from boom_controller.errors import ControlError
from boom_controller.loop import law_in_use
from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.cycle import Cycle
from boom_controller.loop.rehearsal import Rehearsal
from boom_controller.node.configuring import Configuring
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_interfaces.msg import MachineConfiguration

PATIENCE = 60.0
TOLD = (Settings(), SupervisionSettings())


def configuration(load: float = 0.0, *, machine: str = "tz17") -> MachineConfiguration:
    return MachineConfiguration(machine=machine, outer_boom_angle=0.28, telescope_length=2.2, load_mass=load)


class Maker:
    """In place of the maker of laws: waits until it is let go on."""

    def __init__(self) -> None:
        self.go, self.begun = Event(), Event()
        self.failure: Exception | None = None

    def make(self, mode: str, machine: Any, pose: Any, settings: Settings) -> Any:
        self.begun.set()
        assert self.go.wait(PATIENCE)
        if self.failure is not None:
            raise self.failure
        return make_controller("simple", machine, pose, settings)


class Log:
    def info(self, text: str) -> None: ...

    def warning(self, text: str) -> None: ...


class Rig:
    """Loop, rehearsal and their configuration, as the node has them."""

    def __init__(self, *, aside: bool = True) -> None:
        self.loop, self.rehearsal = ControlLoop("simple", *TOLD), Rehearsal("simple", *TOLD)
        self.refused: list[str] = []
        self.configuring = Configuring("", aside, Log(), lambda *words: self.refused.append(" ".join(words)))
        self.now = 5.0

    def hear(self, message: MachineConfiguration) -> bool:
        new = self.configuring.hear(message)
        self.configuring.advance((self.loop, self.rehearsal))
        return new

    def cycle(self) -> Cycle:
        """One cycle with all sensors and a reference where the boom is."""
        self.now += 0.01
        self.loop.joint(0.3, 0.0, self.now, self.now)
        self.loop.hose_pressure(8e6, self.now, self.now)
        self.loop.rod_pressure(1e6, self.now, self.now)
        self.loop.stream(0.3, self.now)
        if self.configuring.due:
            self.configuring.advance((self.loop, self.rehearsal))
        return self.loop.cycle(self.now)

    def prepared(self) -> None:
        """Waits for what is being prepared."""
        preparation = self.configuring._preparation
        assert preparation is not None
        preparation._thread.join(PATIENCE)
        assert preparation.finished


@pytest.fixture
def maker(monkeypatch: pytest.MonkeyPatch) -> Iterator[Maker]:
    made = Maker()
    monkeypatch.setattr(law_in_use, "make_controller", made.make)
    yield made
    made.go.set()  # no thread stays behind


def test_while_laws_are_made_cycles_go_on_with_zero_currents_and_say_what_is_waited_for(maker: Maker) -> None:
    rig = Rig()
    rig.hear(configuration())
    assert maker.begun.wait(PATIENCE)
    for _ in range(3):
        cycle = rig.cycle()
        assert (cycle.state, cycle.retract, cycle.extend, cycle.status) == ("idle", 0.0, 0.0, "warning")
        assert cycle.reason == "not ready: preparing the control laws for tz17, q3 = 0.28 rad, q4 = 2.2 m, load 0 kg"
    maker.go.set()
    rig.prepared()
    rig.cycle()  # takes them; the angle counts from its next sample on
    assert rig.cycle().state == "track"
    assert rig.rehearsal.law.configuration == rig.loop.configuration


def test_no_motion_begins_with_the_laws_of_before_while_others_are_made(maker: Maker) -> None:
    rig = Rig()
    maker.go.set()
    rig.hear(configuration())
    rig.prepared()
    rig.configuring.advance((rig.loop, rig.rehearsal))
    maker.go.clear()
    maker.begun.clear()
    rig.hear(configuration(load=300.0))
    assert maker.begun.wait(PATIENCE)
    cycle = rig.cycle()
    assert cycle.state == "idle" and "load 300 kg" in cycle.reason
    maker.go.set()
    rig.prepared()
    rig.cycle()
    assert rig.loop.configuration is not None and rig.loop.configuration[1].load == 300.0


def test_of_several_configurations_the_last_counts(maker: Maker) -> None:
    rig = Rig()
    rig.hear(configuration())
    assert maker.begun.wait(PATIENCE)
    assert rig.hear(configuration(load=300.0))
    maker.go.set()
    rig.prepared()
    rig.cycle()  # what was made for the first one is dropped
    assert rig.loop.configuration is None
    rig.prepared()
    rig.cycle()
    assert rig.loop.configuration is not None and rig.loop.configuration[1].load == 300.0


@pytest.mark.parametrize("failure", [ControlError("no such valve"), None])
def test_what_cannot_be_used_is_refused_with_its_reason_and_nothing_moves_until_the_next(
    maker: Maker, failure: Exception | None
) -> None:
    rig = Rig(aside=False)
    maker.go.set()
    rig.hear(configuration())
    before = rig.loop.configuration
    maker.failure = failure
    rig.hear(configuration(load=300.0, machine="tz17" if failure else "/dev/zero"))
    assert len(rig.refused) == 1
    assert rig.refused[0].startswith("/boom/machine_configuration cannot be used")
    assert before is not None and rig.loop.configuration == before
    assert rig.loop.law.preparing.startswith("the last /boom/machine_configuration cannot be used: ")
    maker.failure = None
    rig.hear(configuration())
    assert rig.loop.law.preparing == ""


def test_the_same_configuration_said_again_changes_nothing_even_if_it_does_not_know_the_load(maker: Maker) -> None:
    rig = Rig()
    assert rig.hear(configuration(load=math.nan))
    assert not rig.hear(configuration(load=math.nan))
    assert not rig.hear(configuration(load=0.0))  # what is not known is taken as none


def test_in_simulated_time_laws_are_made_at_once() -> None:
    rig = Rig(aside=False)
    rig.hear(configuration())
    assert rig.loop.configuration is not None


def test_settings_that_change_meanwhile_are_those_of_the_new_laws(maker: Maker) -> None:
    rig = Rig()
    rig.hear(configuration())
    assert maker.begun.wait(PATIENCE)
    changed = Settings(largest_current=0.4)
    rig.loop.change(settings=changed)
    given: list[Settings] = []
    maker.go.set()
    rig.prepared()
    preparation = rig.configuring._preparation
    assert preparation is not None
    law: Any = preparation.result()[0].laws["simple"]
    law.change = given.append
    rig.cycle()
    assert given == [changed]
