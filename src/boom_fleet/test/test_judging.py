"""From the posteriors after each recording to the recordings that are raised."""

from boom_fleet.evidence import Change, ChangeHistory
from boom_fleet.judging import confirmed

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
