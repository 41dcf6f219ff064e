"""What is said of a fleet as a whole."""

from boom_report.fleet.words import sums

ROW = {"machine": "north", "recording": "a", "duration_s": 600.0, "screened_s": 240.0, "screen_processor_s": 14.0}


def test_what_was_screened_of_long_recordings_is_said():
    said = sums([ROW, {**ROW, "recording": "b"}])
    assert "2 recordings, 0.33 h (checked whole, screened 0.13 h of 0.33: " in said


def test_nothing_is_said_of_recordings_that_are_screened_whole_or_not_at_all():
    assert "checked whole" not in sums([{**ROW, "screened_s": 598.0}])
    assert "checked whole" not in sums([{**ROW, "screened_s": None}])
