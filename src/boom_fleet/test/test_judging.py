"""From the posteriors after each recording to the recordings that are raised."""

import numpy as np
import pytest

from boom_fleet.evidence import Change, ChangeHistory
from boom_fleet.judging import UNDATED, Kept, confirmed, dated, judge
from boom_fleet.numbers import QuantityColumn, TrackedQuantity

LEAK, WEAR = (Change(name, "step", 1, (0.0, 1.0), 0.5, (0.4, 0.6), 1.0, ()) for name in ("piston_leakage", "friction"))


def seen(*changes):
    return ChangeHistory(changes, 0.5, 0.0)


def names(histories):
    return [[c.quantity for c in h.changes] for h in histories]


def test_a_change_is_known_when_a_second_recording_shows_it():
    assert names(confirmed([seen(), seen(LEAK), seen(LEAK), seen(LEAK, WEAR), seen(LEAK, WEAR)])) == [
        [], [], ["piston_leakage"], ["piston_leakage"], ["piston_leakage", "friction"]
    ]  # fmt: skip


def test_one_odd_recording_is_no_change_and_a_better_name_is_taken():
    assert names(confirmed([seen(), seen(LEAK), seen(), seen()])) == [[], [], [], []]
    assert names(confirmed([seen(), seen(WEAR), seen(LEAK)])) == [[], [], ["piston_leakage"]]


def test_where_two_recordings_begin_at_once_their_clock_tells_nothing_and_a_month_is_taken_to_lie_between():
    assert dated([0.0, 100.0, 100.0, 101.0, 200.0]) == pytest.approx(
        [0.0, 100.0, 100.0 + UNDATED, 100.0 + 2 * UNDATED, 199.0 + 2 * UNDATED]
    )


@pytest.mark.parametrize("apart", [0.0, 1e-6, 86400.0 * 30])
def test_a_change_is_raised_whether_the_recorder_has_a_clock_or_not(apart):
    """One number; four recordings of it as the file has it, then four far from that. Changes are told in the clock's times."""
    name = "effects.spring_rate.r"
    column = QuantityColumn(((name, 1.0),), -40.0, 40.0, 1.0)
    quantity = TrackedQuantity("spring_rate", "", "main_valve", "-", 0.01, 1.0, (column,))
    kept = [
        Kept(str(k), apart * k, (name,), np.array([[400.0]]), np.array([400.0 * (20.0 if k >= 4 else 0.0)]))
        for k in range(8)
    ]
    (judgement,) = judge({"m": kept}, {"m": (quantity,)}, 0.05).values()
    assert judgement.raised in (("5",), ("6",))
    change = judgement.changes[0]
    assert change.size == pytest.approx(20.0, rel=0.1)
    assert change.since == pytest.approx((apart * 3, apart * 4), abs=1e-5) and change.since[0] < change.since[1]
