"""Which configuration the watch believes, where several are told."""

from __future__ import annotations

import math

from boom_monitor.configuration import STEADY_S, ToldConfiguration

EMPTY, LOADED = ("tz17", 0.28, 2.2, 0.0), ("tz17", 0.28, 2.2, 100.0)


def test_one_that_replaces_another_after_a_while_is_used_at_once() -> None:
    made = ToldConfiguration()
    assert made.hear(EMPTY, 10.0)
    assert not made.hear(EMPTY, 10.1)
    assert made.hear(LOADED, 10.0 + STEADY_S)
    assert made.look(10.0 + STEADY_S) == ""


def test_two_that_alternate_contradict_each_other_until_one_has_remained() -> None:
    made = ToldConfiguration()
    made.hear(EMPTY, 10.0)
    told = set()
    for k in range(100):
        assert not made.hear((LOADED, EMPTY)[k % 2], 11.0 + 0.02 * k)
        told.add(made.look(11.0 + 0.02 * k))
    (line,) = told
    assert "load 0 kg" in line and "load 100 kg" in line
    assert made.look(12.98 + STEADY_S) == ""
    assert made.told == EMPTY


def test_a_pose_that_is_no_number_told_again_and_again_is_one() -> None:
    made = ToldConfiguration()
    assert made.hear(("tz17", math.nan, math.nan, 0.0), 10.0)
    assert not made.hear(("tz17", math.nan, math.nan, 0.0), 10.5)
    assert made.look(10.5) == ""
