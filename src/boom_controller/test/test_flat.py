"""Laws as one function: nested states go in and out as they are, and settings count from the next step on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from boom_controller.blocks.flat import FlatLaw, leaves, nested
from boom_controller.controller import Settings
from boom_controller.types import Measurement, Reference

STILL = Measurement(7.0, 0.25, 0.0, 8e6, 1e6, 0.004)


class Inner(NamedTuple):
    sum: Any = 0.0
    last: Any = 0.0


class Outer(NamedTuple):
    count: Any = 0.0
    inner: Inner = Inner()


def build(x: Outer, r: Reference, m: Measurement, s: Any) -> tuple[Outer, list[Any]]:
    error = r.angle - m.angle
    after = Outer(x.count + 1, Inner(x.inner.sum + s.sample_time * error, error))
    return after, [s.preview * error + s.gain * x.inner.sum, x.inner.last, m.age]


def test_nested_states_survive_being_flat() -> None:
    shape = Outer(1.0, Inner(2.0, 3.0))
    assert leaves(shape) == [1.0, 2.0, 3.0]
    assert nested(shape, iter([4.0, 5.0, 6.0])) == Outer(4.0, Inner(5.0, 6.0))


def test_a_step_gives_outputs_of_the_states_before_and_moves_them_on() -> None:
    law = FlatLaw("test", Outer(), build, Settings, Settings(), {"gain": 2.0})
    assert list(law.step(Reference(0.75), STILL)) == [0.035 * 0.5, 0.0, 0.004]
    assert list(law.step(Reference(0.25), STILL)) == [2.0 * 0.005, 0.5, 0.004]
    assert law.states == Outer(2.0, Inner(0.005, 0.0))
    law.start(Outer(inner=Inner(1.0)))
    assert law.step(Reference(0.25), STILL)[0] == 2.0


def test_settings_and_what_is_derived_from_them_count_from_the_next_step_on() -> None:
    law = FlatLaw("test", Outer(), build, Settings, Settings(), {"gain": 2.0})
    law.step(Reference(0.75), STILL)
    law.change(replace(Settings(), preview=0.1), {"gain": 0.0})
    assert law.step(Reference(0.75), STILL)[0] == 0.1 * 0.5
    assert law.states.count == 2.0
