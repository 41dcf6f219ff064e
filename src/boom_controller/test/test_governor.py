"""The reference governor: a path that the boom cannot follow is slowed along itself."""

from __future__ import annotations

import pytest

from boom_controller.references.governor import HORIZON, LEAST, MARGIN, Governor
from boom_controller.references.polynomial import quintic
from boom_controller.types import ControlOutput, Reference

T = 0.01
LENGTH = 4.0
MOVE = quintic((0.2, 0.0, 0.0), (0.9, 0.0, 0.0), LENGTH)
FASTEST = 0.7 / LENGTH * 1.875


def path(time: float) -> Reference:
    """0.7 rad up within 4 s, from 1 s on."""
    passed = time - 1.0
    return MOVE.at(passed) if 0.0 <= passed <= LENGTH else Reference(0.2 if passed < 0.0 else 0.9)


def followed(up: float, down: float = 1.0, seconds: float = 14.0) -> list[Reference]:
    """The governed path with these possible rates [rad/s]."""
    governor = Governor(T)
    governor.start(path, -T)
    references = []
    for _ in range(round(seconds / T)):
        references.append(governor.advance(T))
        governor.allow(ControlOutput(0.0, 0.0, fastest_lift=up, fastest_lower=down))
    return references


def test_a_path_that_can_be_followed_keeps_its_times() -> None:
    for k, reference in enumerate(followed(FASTEST / MARGIN * 1.01, seconds=6.0)):
        assert reference == pytest.approx(path(k * T), abs=1e-9)


def test_a_path_that_is_too_fast_stays_within_the_margin_and_reaches_its_end() -> None:
    references = followed(0.5 * FASTEST)
    assert max(r.rate for r in references) <= 0.5 * FASTEST * (MARGIN + 0.03)
    assert references[-1] == pytest.approx((0.9, 0.0, 0.0, 0.0), abs=1e-6)


def test_the_slowed_rate_and_acceleration_are_the_derivatives_of_the_slowed_angle() -> None:
    references = followed(0.4 * FASTEST)
    for before, here, after in zip(references, references[1:], references[2:], strict=False):
        assert (after.angle - before.angle) / (2 * T) == pytest.approx(here.rate, abs=2e-4)
        assert (after.rate - before.rate) / (2 * T) == pytest.approx(here.acceleration, abs=6e-3)


def test_the_way_back_is_limited_by_the_other_direction_alone() -> None:
    assert followed(FASTEST * 2.0, 0.01, 6.0)[-1].angle == pytest.approx(0.9)


def test_a_law_that_does_not_know_its_limits_slows_nothing() -> None:
    assert followed(float("nan"), float("nan"), 6.0)[-1].angle == pytest.approx(0.9)


def test_a_boom_that_cannot_lift_at_all_is_still_asked_to_move_a_little() -> None:
    governor = Governor(T)
    governor.start(path, 1.0 + 0.5 * LENGTH - HORIZON)
    for _ in range(200):
        reference = governor.advance(T)
        governor.allow(ControlOutput(0.0, 0.0, fastest_lift=0.0, fastest_lower=0.0))
    assert reference.rate == pytest.approx(LEAST * path(governor.time).rate, rel=0.1)
    assert governor.slowed
