"""What is wrong with a recording is found with its times, masked, and nothing else is."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_samples import CONFIGURATION, columns, recording

from boom_input.channels import of_topic
from boom_recording import defects, defects_stamps
from boom_recording.defects import TopicSamples
from boom_recording.loading import load
from boom_recording.recording import Event, Recording
from boom_recording.writing import from_columns, write

_counter = itertools.count()


def after(tmp_path: Path, time: np.ndarray, signals: dict[str, np.ndarray]) -> Recording:
    """The signals written and loaded again."""
    path = tmp_path / f"bag{next(_counter)}"
    write(path, from_columns("x", time, signals, CONFIGURATION))
    return load(path)


def kinds(found: Recording) -> set[tuple[str, str]]:
    return {(event.kind, event.topic) for event in found.events}


def only(found: Recording, kind: str) -> Event:
    (event,) = [event for event in found.events if event.kind == kind]
    return event


def test_a_healthy_recording_has_no_events(tmp_path: Path) -> None:
    for seed in range(3):
        time, signals = columns(20.0, seed)
        found = after(tmp_path, time, signals)
        assert found.events == []
        assert all(signal.valid.all() for signal in found.signals.values())


def test_a_gap_is_more_than_50_ms_and_single_samples_are_one_loss_with_a_count(tmp_path: Path) -> None:
    time, signals = columns()
    for name in ("hose_pressure",):
        signals[name][100:104] = np.nan  # 50 ms from sample to sample: not more
        signals[name][200] = signals[name][300] = np.nan
        signals[name][400:405] = np.nan  # 60 ms
    found = after(tmp_path, time, signals)
    assert kinds(found) == {("loss", "/boom/hose_pressure"), ("gap", "/boom/hose_pressure")}
    assert only(found, "loss").count == 4 + 2
    gap = only(found, "gap")
    assert (gap.start_s, gap.end_s, gap.count) == (pytest.approx(3.99), pytest.approx(4.05), 5)


def test_a_logger_of_20_hz_whose_stamps_jitter_has_gaps_only_where_samples_are_missing(tmp_path: Path) -> None:
    time, signals = columns(12.0)
    time = time + 0.005 * np.random.default_rng(2).uniform(size=len(time))
    keep = np.arange(0, len(time), 5)
    keep = keep[(keep < 600) | (keep > 640)]
    found = after(tmp_path, time[keep], {name: values[keep] for name, values in signals.items()})
    gaps = [event for event in found.events if event.kind == "gap"]
    assert {event.topic for event in gaps} == {signal.topic for signal in found.signals.values()}
    assert all(event.start_s == pytest.approx(5.95, abs=0.02) for event in gaps)


def test_a_topic_that_starts_late_or_ends_early_has_a_gap_there(tmp_path: Path) -> None:
    time, signals = columns()
    signals["rod_pressure"][:100] = np.nan
    signals["hose_pressure"][500:] = np.nan
    found = after(tmp_path, time, signals)
    spans = {event.topic: (event.start_s, event.end_s) for event in found.events}
    assert spans["/boom/rod_pressure"] == (0.0, pytest.approx(1.0))
    assert spans["/boom/hose_pressure"] == (pytest.approx(4.99), pytest.approx(5.99))


def test_jitter_of_the_sender_is_no_loss() -> None:
    random = np.random.default_rng(1)
    steps = np.full(2000, 10e6)
    late = random.choice(np.arange(1, 1999), 200, replace=False)
    stamps = np.cumsum(steps)
    stamps[late] += 7e6
    assert defects._missing(np.diff(np.sort(stamps)), 10e6).sum() == 0


def test_values_that_are_no_numbers_or_outside_the_range_are_masked(tmp_path: Path) -> None:
    time, signals = columns()
    signals["angle"][100:103] = np.nan
    signals["extend_current"][200] = np.inf
    signals["rod_pressure"][300:310] = 700e5
    signals["rate"][400] = -9.0
    found = after(tmp_path, time, signals)
    assert kinds(found) == {
        ("nan", "/joint_states"), ("nan", "/boom/solenoid_currents"), ("out_of_range", "/boom/rod_pressure"),
        ("out_of_range", "/joint_states"),
    }  # fmt: skip
    assert np.flatnonzero(~found.signals["rod_pressure"].valid).tolist() == list(range(300, 310))
    assert np.flatnonzero(~found.signals["angle"].valid).tolist() == [100, 101, 102]
    assert np.flatnonzero(~found.signals["rate"].valid).tolist() == [400]
    assert np.flatnonzero(~found.signals["extend_current"].valid).tolist() == [200]


@pytest.mark.parametrize("name", ["rate", "hose_pressure", "rod_pressure", "extend_current"])
def test_a_noisy_sensor_that_repeats_is_stuck_also_at_rest(tmp_path: Path, name: str) -> None:
    time, signals = columns(12.0)
    at = slice(500, 620) if name == "extend_current" else slice(100, 220)
    signals[name][at] = signals[name][at.start]
    found = after(tmp_path, time, signals)
    (event,) = found.events
    assert event.kind == "stuck" and name in event.detail
    assert (event.start_s, event.end_s) == (
        pytest.approx(at.start / 100, abs=0.05),
        pytest.approx(at.stop / 100, abs=0.05),
    )
    assert not found.signals[name].valid[at].any()
    assert found.signals[name].valid[: at.start - 5].all() and found.signals[name].valid[at.stop + 5 :].all()


def test_a_pressure_that_is_coarser_than_its_noise_may_rest_and_creep(tmp_path: Path) -> None:
    time, signals = columns(12.0)
    rng = np.random.default_rng(1)
    signals["angle"][:] = signals["angle"][0]
    signals["rate"] = 1.5e-3 * rng.standard_normal(len(time))
    for name, level in (("hose_pressure", 1.011e7), ("rod_pressure", 4.0e6)):
        drift = np.where(time < 6.0, 9.0e4 * np.sin(0.4 * time), 0.0)  # now between two steps, now at the edge of one
        signals[name] = np.round((level + drift + 1.7e4 * rng.standard_normal(len(time))) / 2.0e5) * 2.0e5
    found = after(tmp_path, time, signals)
    assert found.events == [] and found.signals["hose_pressure"].valid.all()


def test_a_coarse_pressure_that_rings_when_the_boom_stops_may_stay_as_it_is_while_it_moves_and_while_it_rests(
    tmp_path: Path,
) -> None:
    time, signals = columns(40.0)
    rng = np.random.default_rng(2)
    back_and_forth = np.clip(np.abs(np.mod(time, 8.0) - 4.0) - 1.0, 0.0, 2.0)  # moves for 2 s, rests for 2 s
    signals["angle"] = 0.2 + 0.1 * back_and_forth
    signals["rate"] = np.gradient(signals["angle"], time) + 1.5e-3 * rng.standard_normal(len(time))
    since = np.mod(time - 1.0, 2.0)
    ringing = 9.0e5 * np.exp(-since / 0.3) * np.sin(2.0 * np.pi * 3.0 * since)
    for name, level in (("hose_pressure", 7.01e6), ("rod_pressure", 2.13e6)):
        signals[name] = np.round((level + ringing + 1.5e4 * rng.standard_normal(len(time))) / 1.0e5) * 1.0e5
    assert after(tmp_path, time, signals).events == []


@pytest.mark.parametrize(("name", "level"), [("rod_pressure", -1.01e5), ("hose_pressure", 4.2e7), ("angle", -1.6)])
def test_a_signal_that_drops_to_one_value_and_back_is_left_out_there_and_told_once(
    tmp_path: Path, name: str, level: float
) -> None:
    """A loose plug for 60 to 900 ms at a time was unmodelled physics of the main valve, 0.98."""
    time, signals = columns(12.0)
    at = np.zeros(len(time), dtype=bool)
    for start, length in ((300, 40), (500, 3), (700, 1), (811, 9)):
        at[start : start + length] = True
    signals[name][at] = level
    found = after(tmp_path, time, signals)
    assert np.array_equal(found.signals[name].valid, ~at)
    (said,) = {event.detail for event in found.events}
    assert [event.count for event in found.events] == [40, 3, 1, 9] and "and back 4 times, 53 samples in all" in said
    assert found.events[1].start_s == pytest.approx(5.0) and found.events[1].end_s == pytest.approx(5.02)


def test_a_pump_that_is_switched_and_a_hose_that_is_empty_for_long_are_believed(tmp_path: Path) -> None:
    time, signals = columns(12.0)
    noise = np.random.default_rng(0).normal(0.0, 1e4, len(time))
    signals["hose_pressure"] = np.where(time % 4.0 < 1.5, 0.0, 8e6 + noise)
    signals["supply_pressure"] = np.where(time % 3.0 < 0.9, 0.0, 2e7 + noise)
    assert not [event for event in after(tmp_path, time, signals).events if "jumps" in event.detail]


def test_a_pressure_that_falls_to_the_end_of_its_sensor_on_its_way_is_believed(tmp_path: Path) -> None:
    time, signals = columns(12.0)
    swing = 4e6 * np.sin(2 * np.pi * 0.3 * time) + np.random.default_rng(0).normal(0.0, 1e4, len(time))
    signals["rod_pressure"] = np.maximum(swing, 0.0)
    assert not [event for event in after(tmp_path, time, signals).events if "jumps" in event.detail]


def test_a_coarse_pressure_that_repeats_while_the_boom_goes_far_is_stuck(tmp_path: Path) -> None:
    time, signals = columns(12.0)  # lifts by 0.8 rad
    for name in ("hose_pressure", "rod_pressure"):
        signals[name] = np.round((signals[name] + 3.0e5 * signals["angle"] / 0.1) / 2.0e5) * 2.0e5
    signals["rod_pressure"][420:780] = signals["rod_pressure"][420]
    event = only(after(tmp_path, time, signals), "stuck")
    assert event.topic == "/boom/rod_pressure"


def test_an_angle_that_repeats_at_rest_is_believed_and_while_the_rate_moves_it_is_stuck(tmp_path: Path) -> None:
    time, signals = columns(12.0)  # moves from 4 s to 8 s
    signals["angle"][500:650] = signals["angle"][500]
    found = after(tmp_path, time, signals)
    event = only(found, "stuck")
    assert (event.start_s, event.end_s) == (pytest.approx(5.0, abs=0.02), pytest.approx(6.49, abs=0.02))
    assert found.signals["angle"].valid[:499].all() and found.signals["rate"].valid.all()


def test_an_imu_that_hangs_has_angle_and_rate_masked(tmp_path: Path) -> None:
    time, signals = columns(12.0)
    for name in ("angle", "rate"):
        signals[name][500:650] = signals[name][500]
    found = after(tmp_path, time, signals)
    assert {event.kind for event in found.events} == {"stuck"}
    assert not found.signals["angle"].valid[505:645].any() and not found.signals["rate"].valid[505:645].any()


def test_sensors_without_noise_may_rest(tmp_path: Path) -> None:
    time, signals = columns(12.0)
    moving = (time > 4) & (time < 8)
    swing = np.where(moving, 1 - np.cos(2 * np.pi * (time - 4)), 0)
    quiet = {
        "angle": 0.3 + 0.05 * np.cumsum(swing) * 0.01,
        "rate": 0.05 * swing,
        "hose_pressure": 1e7 + 1e5 * swing,
        "rod_pressure": 4e6 - 1e5 * swing,
        "retract_current": np.zeros(len(time)),
        "extend_current": np.where(moving, 0.4, 0.0),
    }
    assert after(tmp_path, time, quiet).events == []
    assert set(quiet) == set(signals)


# ---- stamps: arrays in, masks out ----


def topic(stamps_s: np.ndarray, log_s: np.ndarray) -> TopicSamples:
    n = len(stamps_s)
    to_ns = lambda seconds: np.rint((np.asarray(seconds) + 1000) * 1e9).astype(np.int64)  # noqa: E731
    name = "/boom/hose_pressure"
    values, valid = {"hose_pressure": np.zeros(n)}, {"hose_pressure": np.ones(n, bool)}
    return TopicSamples(name, of_topic(name), to_ns(stamps_s), to_ns(log_s), values, np.ones(n, bool), valid)


GRID = np.arange(2000) * 0.01


@pytest.mark.parametrize("jump", [5.0, -5.0, 0.2, -0.07])
def test_stamps_that_jump_for_a_while_are_masked_there(jump: float) -> None:
    stamps = GRID.copy()
    stamps[800:1100] += jump
    samples = topic(stamps, GRID + 0.002)
    (event,) = defects_stamps.check_stamps(samples)
    assert event.kind == "clock_jump" and event.count == 300
    assert np.flatnonzero(~samples.timed).tolist() == list(range(800, 1100))
    assert (event.start_ns / 1e9 - 1000, event.end_ns / 1e9 - 1000) == (pytest.approx(8.0), pytest.approx(10.99))


def test_after_a_jump_for_good_the_longer_part_is_kept() -> None:
    stamps = GRID.copy()
    stamps[700:] += 3600
    samples = topic(stamps, GRID + 0.002)
    (event,) = defects_stamps.check_stamps(samples)
    assert event.kind == "clock_jump"
    assert np.flatnonzero(~samples.timed).tolist() == list(range(700))


def test_a_gap_and_a_pause_of_the_log_are_no_jump() -> None:
    stamps = np.delete(GRID, slice(800, 1100))
    assert defects_stamps.check_stamps(topic(stamps, stamps + 0.002)) == []
    log = GRID + np.where(GRID > 8, 3.0, 0.0)
    assert defects_stamps.check_stamps(topic(GRID, log)) == []


def test_late_arrival_of_the_first_messages_behind_a_gap_is_no_jump() -> None:
    stamps = np.delete(GRID, slice(800, 1100))
    log = stamps + 0.002
    log[800:805] += 0.2
    samples = topic(stamps, np.maximum.accumulate(log))
    assert defects_stamps.check_stamps(samples) == []
    assert samples.timed.all()


def test_log_times_that_run_at_another_speed_are_not_compared() -> None:
    assert defects_stamps.check_stamps(topic(GRID, GRID / 20)) == []


def test_repeated_stamps_are_stale_and_the_first_of_them_stays() -> None:
    stamps = GRID.copy()
    stamps[500:520] = stamps[500]
    samples = topic(stamps, GRID + 0.002)
    (event,) = defects_stamps.check_stamps(samples)
    assert event.kind == "stale" and event.count == 19
    assert np.flatnonzero(~samples.timed).tolist() == list(range(501, 520))


def test_messages_that_arrive_long_after_their_stamp_are_stale() -> None:
    log = GRID + 0.002
    log[600:640] = np.maximum(log[600:640] + 0.9, log[639] + 0.9)
    samples = topic(GRID, log)
    (event,) = defects_stamps.check_stamps(samples)
    assert event.kind == "stale"
    assert set(np.flatnonzero(~samples.timed)) >= set(range(600, 640))


def test_stamps_that_go_back_are_a_clock_jump_even_without_a_log_to_compare_with() -> None:
    stamps = GRID.copy()
    stamps[900:905] -= 1.0
    stamps[1500] += 50
    samples = topic(stamps, GRID / 20)
    found = defects_stamps.check_stamps(samples)
    assert {event.kind for event in found} == {"clock_jump"}
    assert np.flatnonzero(~samples.timed).tolist() == [*range(900, 905), 1500]


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.integers(-20, 60), min_size=1, max_size=80),
    st.lists(st.integers(-5, 60), min_size=80, max_size=80),
)
def test_whatever_the_stamps_those_that_are_kept_increase_strictly(steps: list[int], logs: list[int]) -> None:
    stamps = np.cumsum(steps) / 1000
    samples = topic(stamps, np.cumsum(logs[: len(steps)]) / 1000)
    defects_stamps.check_stamps(samples)
    assert (np.diff(samples.stamps_ns[samples.timed]) > 0).all()
    assert samples.timed.any()


@given(st.lists(st.integers(0, 30), min_size=1, max_size=9))
def test_the_fewest_samples_are_masked(stamps: list[int]) -> None:
    keep = defects_stamps._longest_increasing(np.array(stamps))
    best = max(
        len(chosen)
        for size in range(1, len(stamps) + 1)
        for chosen in itertools.combinations(stamps, size)
        if all(a < b for a, b in itertools.pairwise(chosen))
    )
    assert keep.sum() == best


# ---- the common grid ----


def test_the_grid_takes_the_nearest_valid_sample_and_never_interpolates() -> None:
    made = recording()
    signal = made.signals["hose_pressure"]
    signal.valid[100:200] = False
    table = made.on_grid(0.01)
    column = table.columns["hose_pressure"]
    assert len(table.time) == len(column) == 600
    assert np.isnan(column[100:200]).all()
    assert np.array_equal(column[~np.isnan(column)], signal.values[signal.valid])


def test_a_coarser_grid_and_one_that_is_impossible() -> None:
    made = recording()
    assert len(made.on_grid(0.1).time) == 60
    with pytest.raises(ValueError, match="positive"):
        made.on_grid(0.0)


# ---- the recordings that the project did not make ----


def _recordings() -> list[Path]:
    here = Path(__file__).resolve()
    roots = [parent / "bags" for parent in here.parents] + [
        parent.parent / "shared" / "recordings" for parent in here.parents
    ]
    bags: dict[str, Path] = {}
    for root in roots:
        for metadata in sorted(root.glob("**/metadata.yaml")) if root.is_dir() else []:
            bags.setdefault(metadata.parent.name, metadata.parent)
    return list(bags.values())


_MACHINE = [path for path in _recordings() if not path.name.startswith(("retract_", "extend_"))]
_DAMAGED = {"gap_and_losses": (21.3, 24.1, 0.02), "gap_in_motion": (24.2, 25.4, 0.005)}


@pytest.mark.parametrize("path", [path for path in _MACHINE if path.name not in _DAMAGED], ids=lambda path: path.name)
def test_the_recordings_of_the_machine_raise_no_false_alarm(path: Path) -> None:
    found = load(path)
    assert found.events == [] and found.warnings == []
    assert all(signal.valid.all() for signal in found.signals.values())


@pytest.mark.parametrize("name", _DAMAGED)
def test_the_damaged_recordings_list_their_gaps_and_losses(name: str) -> None:
    start, end, share = _DAMAGED[name]
    found = load(next(path for path in _MACHINE if path.name == name))
    for topic_name in ("/joint_states", "/boom/hose_pressure", "/boom/rod_pressure", "/boom/solenoid_currents"):
        (gap_event,), (loss_event,) = (
            [e for e in found.events if e.topic == topic_name and e.kind == kind] for kind in ("gap", "loss")
        )
        assert gap_event.start_s == pytest.approx(start, abs=0.05) and gap_event.end_s == pytest.approx(end, abs=0.05)
        assert loss_event.count == pytest.approx(share * 5800, rel=0.4)
    assert len(found.events) == 8
