"""Sensors that are stuck, and those that are only quiet."""

import numpy as np
import pytest

from boom_input.repeats import Repeats


def shown(values: np.ndarray, repeated: int, *, last: float | None = None) -> Repeats:
    """A channel of 100 Hz that shows ``values`` at rest, and then its last one, or ``last``, again and again."""
    made = Repeats(1e-6)
    again = np.full(repeated, values[-1] if last is None else last)
    for k, value in enumerate(np.concatenate([values, again])):
        made.take(float(value), 0.01 * k, k < len(values))
    return made


NOISE = np.random.default_rng(3).normal(0.004, 0.0015, 400)


def test_a_noisy_gyro_that_repeats_its_value_is_stuck_within_a_fifth_of_a_second() -> None:
    assert shown(NOISE, 5).stuck is None
    stuck = shown(NOISE, 20).stuck
    assert stuck is not None and stuck[0] == pytest.approx(0.2) and stuck[1] == pytest.approx(0.1)


def test_one_of_coarse_steps_may_repeat_its_value_five_times_as_long_as_it_did_at_rest() -> None:
    coarse = np.round(NOISE / 2e-3) * 2e-3
    changes = np.flatnonzero(np.diff(coarse))
    longest = int(np.diff(changes).max())
    assert longest >= 3
    allowed = 5 * longest
    assert shown(coarse, allowed - 2, last=4e-3).stuck is None
    assert shown(coarse, 4 * allowed, last=4e-3).stuck is not None


@pytest.mark.parametrize(
    "values",
    [
        pytest.param(np.full(400, 0.3), id="an encoder that stands"),
        pytest.param(np.round(NOISE / 2e-3)[:30] * 2e-3, id="one of which little has been seen"),
        pytest.param(np.where(np.random.default_rng(1).random(400) < 0.5, 0.3, 0.31), id="flicker between two steps"),
        pytest.param(np.exp(-0.01 * np.arange(400)), id="a boom that settles"),
        pytest.param(NOISE * 1e-5, id="less than any noise"),
    ],
)
def test_what_is_quiet_at_rest_is_never_stuck(values: np.ndarray) -> None:
    assert shown(values, 3000).stuck is None


def test_a_value_of_exactly_nothing_is_where_transducers_end_and_computed_rates_stay() -> None:
    assert shown(NOISE, 3000, last=0.0).stuck is None


def test_what_it_does_in_motion_tells_nothing_of_its_noise() -> None:
    made = Repeats(1e-6)
    for k, value in enumerate([*NOISE, *np.full(100, 0.1)]):
        made.take(float(value), 0.01 * k, at_rest=False)
    assert made.stuck is None


def test_an_encoder_that_stands_is_stuck_where_the_gyro_carries_the_boom_on() -> None:
    made = Repeats(1e-6)
    angles = np.round(0.3 + 1e-3 * np.arange(100), 3)  # 0.1 rad/s
    for k, angle in enumerate([*angles, *np.full(40, angles[-1])]):
        made.take(float(angle), 0.01 * k, at_rest=False, carried=1.5e-3)
        assert (made.stuck is not None) == (k > 99 + 13), k  # 0.02 rad


def test_a_gyro_that_turns_at_rest_carries_nothing() -> None:
    made = Repeats(1e-6)
    for k in range(3000):
        made.take(0.3, 0.01 * k, at_rest=True, carried=1e-4)
    assert made.stuck is None
