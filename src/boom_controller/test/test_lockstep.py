"""Which tick of the simulation is answered, and when."""

from __future__ import annotations

import pytest

from boom_controller.node.lockstep import TickGate

TICK = 10_000_000


def arrive(made: TickGate, stamp: int, *names: str) -> None:
    for name in names:
        made.arrived(name, stamp)


def test_a_tick_is_answered_once_as_soon_as_its_samples_are_there() -> None:
    made = TickGate(with_reference=False, delay_ns=0)
    made.begun = True
    made.tick_ns = TICK
    arrive(made, TICK, "joint", "hose")
    assert not made.due()
    arrive(made, TICK, "rod")
    assert made.due()
    assert not made.due()
    made.tick_ns = 2 * TICK
    assert not made.due()
    arrive(made, 2 * TICK, "joint", "hose", "rod")
    assert made.due()


def test_samples_may_be_as_old_as_told_the_reference_may_not() -> None:
    made = TickGate(with_reference=True, delay_ns=TICK)
    made.begun = True
    made.tick_ns = 2 * TICK
    arrive(made, TICK, "joint", "hose", "rod", "reference")
    assert not made.due()
    arrive(made, 2 * TICK, "reference")
    assert made.due()


@pytest.mark.parametrize("with_reference", [False, True])
def test_the_first_command_goes_out_once_before_any_tick(with_reference: bool) -> None:
    made = TickGate(with_reference, delay_ns=0)
    assert made.may_begin() is not with_reference
    arrive(made, 0, "reference")
    assert made.may_begin()
    made.begun = True
    assert not made.may_begin()
    assert not made.due()


def test_a_controller_that_joins_late_answers_the_tick_that_it_hears() -> None:
    made = TickGate(with_reference=False, delay_ns=0)
    made.tick_ns = 5 * TICK
    assert not made.may_begin()
    arrive(made, 5 * TICK, "joint", "hose", "rod")
    assert made.due()
    assert made.begun
