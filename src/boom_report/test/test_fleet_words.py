"""What is said of a fleet as a whole."""

from datetime import datetime, timedelta

from boom_report.fleet.report import _glance
from boom_report.fleet.words import change_sentence, machines, sums

ROW = {"machine": "north", "recording": "a", "duration_s": 600.0, "screened_s": 240.0, "screen_processor_s": 14.0}


def test_what_was_screened_of_long_recordings_is_said():
    said = sums([ROW, {**ROW, "recording": "b"}])
    assert "2 recordings, 0.33 h (checked whole, screened 0.13 h of 0.33: " in said


def test_nothing_is_said_of_recordings_that_are_screened_whole_or_not_at_all():
    assert "checked whole" not in sums([{**ROW, "screened_s": 598.0}])
    assert "checked whole" not in sums([{**ROW, "screened_s": None}])


def change(**given: object) -> dict[str, object]:
    begin, end = datetime(2026, 1, 1), datetime(2026, 2, 1)
    return {
        "quantity": "return_line_pressure", "shape": "step", "since_earliest": begin, "since_latest": end, "unit": "Pa s^2/m^6",
        "change": 3.6e11, "change_low": 3.24e11, "change_high": 3.96e11, "probability": 0.95, "alternatives": [],
    } | given  # fmt: skip


def test_a_change_is_told_in_the_unit_in_which_people_think_of_it_with_its_interval():
    assert change_sentence(change()).endswith(
        "between 2026-01-01 and 2026-02-01: +10 bar at 100 l/min (+9 to +11, 90 %), probability 95 %"
    )


def test_a_machine_of_which_only_what_matters_to_nobody_has_changed_is_likely_unchanged():
    """Its table said so, and beside it that the probability of that was below 0.001."""
    judged = {**ROW, "log_odds_changed": 40.0, "unchanged": 0.97, "changes": [], "levels": []}
    other = {**judged, "machine": "south", "unchanged": 0.5}
    assert [(m.name, m.status, m.unchanged) for m in machines([judged, other])] == [
        ("south", "unchanged", 0.5), ("north", "unchanged", 0.97),
    ]  # fmt: skip


def test_a_machine_whose_file_does_not_describe_its_first_recording_is_not_judged():
    """Of such a one every later fault was taken for how restless it is: unchanged, P above 0.99."""
    rows = [
        {**ROW, "recording": name, "log_odds_changed": -30.0, "unchanged": 1.0, "changes": [], "levels": [],
         "nats_rate_extending": 0.1, "nats_hose_pressure_extending": nats}
        for name, nats in (("a", 40.0), ("b", 270.0))
    ]  # fmt: skip
    (machine,) = machines(rows)
    assert (machine.status, machine.unchanged) == ("not judged", None)
    assert machine.sentences[0].startswith(
        "its file does not describe it (hose pressure extending: errors from sample to sample 9 times the sensor's noise)"
    )
    later = [{**rows[0], "nats_hose_pressure_extending": 0.2}, rows[1]]
    assert machines(later)[0].status == "unchanged"


def test_recordings_whose_clock_tells_nothing_are_drawn_side_by_side_in_their_order():
    begun = datetime(2026, 1, 1)

    def drawn(apart: float) -> tuple[list[object], str]:
        rows = [
            {**ROW, "recording": name, "time": begun + k * timedelta(seconds=apart), "unchanged": 0.9}
            for k, name in enumerate("abc")
        ]
        figure = _glance(machines(rows))
        unchanged = next(trace for trace in figure["data"] if trace["name"] == "unchanged")
        return unchanged["x"], figure["layout"]["xaxis"]["title"]["text"]

    assert drawn(0.0) == ([1, 2, 3], "number of the machine's recording")
    assert drawn(86_400.0) == (["2026-01-01 00:00", "2026-01-02 00:00", "2026-01-03 00:00"], "date of the recording")
