"""A recording is doubted before any physics: faults of recordings are told as what they are, physics is not told as a fault."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording_faults import FAULTS, changed, late, slipped

from boom_checks import commands
from boom_checks.chain import chain_of_machine
from boom_checks.check import RecordingCheck
from boom_checks.clocks import CHANGING, clock_checks, offset
from boom_checks.clocks import CURRENTS as CLOCK_CURRENTS
from boom_checks.clocks import PRESSURES as CLOCK_PRESSURES
from boom_checks.commands import chatter_checks
from boom_checks.doubts import checks
from boom_checks.even_series import PERIOD, EvenSeries, even_series
from boom_checks.jumps import jump_checks, turn_checks
from boom_checks.mechanics import mechanics
from boom_checks.readings import PRIOR, reading_checks
from boom_checks.relations import changes, contact_gain, force, pressure_range, response
from boom_checks.sampling import sampling_checks
from boom_checks.statics import statics_of
from boom_model.machine_file import load_machine
from boom_recording import writing
from boom_recording.loading import load
from boom_recording.recording import Recording

ROOT = Path(__file__).resolve().parents[3]
BAGS, SHARED = ROOT / "bags", ROOT.parent / "shared" / "recordings" / "strangers"
TZ17 = load_machine("tz17")


def fast() -> Recording:
    return load(BAGS / "healthy" / "folded_fast")


def spoiling(recording: Recording) -> list[RecordingCheck]:
    return [check for check in checks(recording, TZ17) if check.spoils]


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_told_as_what_it_is_and_as_nothing_else(fault: str, tmp_path: Path) -> None:
    kind, topic, make = FAULTS[fault]
    writing.write(tmp_path / "bag", make(fast()))

    found = spoiling(load(tmp_path / "bag"))

    assert [(check.kind, check.topic) for check in found] == [(kind, topic)]
    assert found[0].log_odds > 0.0
    low, high = found[0].measure.interval_90
    assert low <= found[0].measure.value <= high


@pytest.mark.parametrize("bag", [
    "damaged/gap_in_motion", "explained/payload_change_a", "explained/hose_burst_valve_lag_b", "unexplained/crane_4_a",
])  # fmt: skip
def test_physics_and_lost_samples_are_no_fault_of_the_recording(bag: str) -> None:
    assert checks(load(BAGS / bag), TZ17) == []


@pytest.mark.parametrize("limits", [(-1.05, 0.6), (0.5, 1.5)])
def test_a_range_that_is_wrong_in_the_file_is_no_other_zero_of_the_angle(limits: tuple[float, float]) -> None:
    """The recording's angles go from 0.17 to 0.82 rad; the pressures carry the boom at these."""
    assert [check for check in checks(fast(), replace(TZ17, angle_limits=limits)) if check.spoils] == []


def test_two_faults_are_found_one_behind_the_other() -> None:
    both = FAULTS["swapped pressures"][2](FAULTS["command's sign"][2](fast()))
    found, _ = reading_checks(even_series(both), mechanics(TZ17, both))
    assert {check.kind for check in found} == {"sign", "swapped_channels"}


def test_behind_a_valve_that_holds_the_load_the_hose_carries_the_boom_while_it_lifts_and_counts_then_alone() -> None:
    made = fast()
    series, boom = even_series(made), mechanics(TZ17, made)
    lifting = series.smooth("rate") > 0.01
    vented = series.with_columns({"hose_pressure": np.where(lifting, series.columns["hose_pressure"], 2e5)})
    swapped = {"hose_pressure": vented.columns["rod_pressure"], "rod_pressure": vented.columns["hose_pressure"]}
    holding = replace(boom, holds=True)
    assert force(vented, holding) > force(vented.with_columns(swapped), holding) + 3.0
    lost = force(series, boom) - force(vented, boom)
    assert force(series, holding) - force(vented, holding) < 0.2 * lost
    assert reading_checks(vented, holding)[0] == []


def test_the_series_comes_back_with_the_fault_put_right() -> None:
    right, wrong = fast(), FAULTS["bar for Pa"][2](fast())
    _, repaired = reading_checks(even_series(wrong), mechanics(TZ17, wrong))
    expected = even_series(right).columns["hose_pressure"]
    np.testing.assert_allclose(repaired.columns["hose_pressure"], expected, atol=1.0, equal_nan=True)


def test_a_latched_command_is_found_where_it_was_put() -> None:
    made, plain = FAULTS["latched command"][2](fast()), fast()
    moved = np.abs(made.signals["extend_current"].values - plain.signals["extend_current"].values) > 0.1
    moved |= np.abs(made.signals["retract_current"].values - plain.signals["retract_current"].values) > 0.1
    time = made.signals["extend_current"].time

    (found,) = spoiling(made)

    inside = np.zeros(len(time), bool)
    for start, end in found.intervals_s:
        inside |= (time >= start) & (time <= end)
    assert inside[moved].mean() > 0.85
    assert not inside[~moved].any()


def test_what_a_command_brings_is_known_from_the_smallest_on_that_moves_the_boom_elsewhere() -> None:
    """Of a smaller one the law through the larger ones says nothing: held within a dead zone for 12 s it spoilt a recording."""
    series = even_series(load(BAGS / "healthy" / "folded_slow"))
    known, size = commands._moves_elsewhere(series, 20), np.abs(series.command)
    assert not known[size < 0.2].any()
    assert known[size > 0.37].all()
    assert 0.2 < size[known].min() < 0.36
    assert not commands._moves_elsewhere(series.with_columns({"rate": 0.0 * series.columns["rate"]}), 20).any()


def test_a_boom_pressed_against_a_stop_by_supply_pressure_got_its_command() -> None:
    made = FAULTS["latched command"][2](fast())
    largest = max(float(made.signals[name].values.max()) for name in ("hose_pressure", "rod_pressure"))
    command = made.signals["extend_current"].values - made.signals["retract_current"].values
    pressed = {}
    for name, sign in (("hose_pressure", 1.0), ("rod_pressure", -1.0)):
        signal = made.signals[name]
        supplied = np.interp(signal.time, made.signals["extend_current"].time, sign * command) > 0.2
        pressed[name] = np.where(supplied, largest, signal.values)
    blocked = [check for check in spoiling(changed(made, **pressed)) if check.kind == "latched_command"]
    assert blocked == []


@pytest.mark.parametrize("offset", [0.25, -0.15])
def test_the_offset_of_a_clock_is_measured_and_its_interval_holds_it(offset: float) -> None:
    (found,) = spoiling(late(load(BAGS / "healthy" / "extended"), offset, "hose_pressure", "rod_pressure"))
    low, high = found.measure.interval_90
    assert low <= offset <= high
    assert high - low < 0.1


@pytest.mark.parametrize("offset", [0.1, 0.25])
def test_currents_whose_clock_is_late_are_so_by_more_than_the_motion_follows_them(offset: float) -> None:
    """They had been told later by less than they are: pilot stage and spool take 0.16 s of it here."""
    recording = late(load(BAGS / "healthy" / "extended"), offset, "retract_current", "extend_current")
    found = [check for check in checks(recording, TZ17) if check.kind == "clock"]
    assert [check.measure.value for check in found] == ([pytest.approx(offset, abs=0.02)] if offset > 0.2 else [])
    assert all(check.measure.interval_90[0] <= offset <= check.measure.interval_90[1] for check in found)


def test_a_dead_time_that_the_file_knows_is_no_clock() -> None:
    recording = late(load(BAGS / "healthy" / "extended"), -0.3, "retract_current", "extend_current")
    assert "clock" in [check.kind for check in checks(recording, TZ17)]
    told = TZ17.with_effects({"command_delay": {"T": 0.3}})
    assert "clock" not in [check.kind for check in checks(recording, told)]


def test_a_fault_of_a_reading_is_told_once() -> None:
    """Against another crane's file an angle had been 90 degrees too small, and 90 degrees too small again."""
    recording = load(BAGS / "healthy" / "extended")
    far = changed(recording, angle=recording.signals["angle"].values - 2.6)
    found, _ = reading_checks(even_series(far), mechanics(TZ17, far))
    told = [check.sentence.split(" (")[0] for check in found]
    assert any("90 degrees" in sentence for sentence in told) and len(set(told)) == len(told)


def running(recording: Recording, percent: float, *names: str) -> Recording:
    """The same log, the stamps of these signals running fast."""
    signals = dict(recording.signals)
    for name in names:
        signal = signals[name]
        late = 1.0 + 0.01 * percent
        signals[name] = replace(
            signal,
            time=signal.time * late,
            stamps_ns=np.round(signal.stamps_ns[0] + 1e9 * signal.time * late).astype(np.int64),
        )
    return replace(recording, signals=signals)


@pytest.mark.parametrize("percent", [0.4, -0.5, 1.2])
@pytest.mark.parametrize("names", [CLOCK_PRESSURES, CLOCK_CURRENTS])
def test_a_clock_that_runs_away_is_told_with_its_drift(percent: float, names: tuple[str, ...]) -> None:
    found = [
        check
        for check in spoiling(running(load(BAGS / "healthy" / "extended"), percent, *names))
        if check.kind == "clock"
    ]
    assert [check.measure.name for check in found] == ["drift"]
    low, high = found[0].measure.interval_90
    assert low <= percent <= high and high - low < 0.3
    assert f"the stamps run {'fast' if percent > 0 else 'slow'}" in found[0].sentence


def test_pressures_and_currents_that_drift_alike_have_the_clock_of_the_joint_states_run_away() -> None:
    recording = running(load(BAGS / "healthy" / "extended"), 0.8, *CLOCK_PRESSURES, *CLOCK_CURRENTS)
    (found,) = (check for check in spoiling(recording) if check.kind == "clock")
    low, high = found.measure.interval_90
    assert found.topic == "/joint_states"
    assert low <= -0.8 <= high and "the stamps run slow against those of pressures and currents" in found.sentence
    assert chain_of_machine(recording, TZ17).sentence.startswith("the recording first: /joint_states: the stamps")


def test_of_a_long_recording_the_beginning_tells_by_how_much_a_clock_runs_away() -> None:
    """Ten minutes, in the end 3 s late: farther than any offset that is tried."""
    recording = load(BAGS / "healthy" / "extended")
    once = even_series(recording)
    count = 10 * len(once.time)
    shown = np.round(0.995 * np.arange(count)).astype(int) % len(once.time)
    columns = {n: v[shown] if n in CLOCK_CURRENTS else np.tile(v, 10) for n, v in once.columns.items()}
    (found,) = clock_checks(EvenSeries(PERIOD * np.arange(count), columns), mechanics(TZ17, recording))
    assert found.measure.value == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("offset", [-0.6, 0.0, 0.6])
def test_behind_a_valve_that_holds_the_load_a_clock_is_told_by_when_pressures_change(offset: float) -> None:
    recording = late(load(BAGS / "healthy" / "extended"), offset, "hose_pressure", "rod_pressure")
    holding = replace(mechanics(TZ17, recording), holds=True)
    found = clock_checks(even_series(recording), holding)
    assert [check.measure.value for check in found] == ([pytest.approx(offset, abs=0.1)] if offset else [])


@pytest.mark.parametrize("frequency", [1.25, 1.6, 2.4])
def test_a_boom_that_hunts_behind_such_a_valve_has_no_other_clock(frequency: float) -> None:
    recording = load(BAGS / "healthy" / "extended")
    series = even_series(recording)

    def hunting(late: float) -> np.ndarray:
        t = series.time - late
        return np.sin(2.0 * np.pi * frequency * t) * np.exp(-(((t - 25.0) / 4.0) ** 2))

    pressures = {name: 5e6 + 2e6 * hunting(0.05) for name in ("hose_pressure", "rod_pressure")}
    swinging = series.with_columns({"rate": 0.1 * hunting(0.0), **pressures})
    measure, odds = offset(swinging, mechanics(TZ17, recording), tuple(pressures), changes, CHANGING)
    assert odds < -PRIOR / 2
    period = 1.0 / frequency  # in phase, or a quarter of a period from it: nothing else tells which
    assert min(abs(measure.value - 0.05 - k * period / 4.0) for k in range(-3, 4)) < 0.02


def test_a_bending_boom_behind_such_a_valve_rings_a_quarter_of_a_period_behind_the_change_of_its_pressures() -> None:
    """The pressures carry the acceleration: a boom that rang at 1.8 Hz seemed to have a clock that is 0.14 s off."""
    recording = load(BAGS / "healthy" / "extended")
    series = even_series(recording)
    phase = 2.0 * np.pi * 1.8 * series.time
    envelope = np.exp(-((series.time % 8.0) / 3.0)) * (1.0 + 0.1 * np.sin(0.4 * series.time))
    pressures = {name: 5e6 + 2e6 * envelope * np.cos(phase) for name in ("hose_pressure", "rod_pressure")}
    ringing = series.with_columns({"rate": 0.1 * envelope * np.sin(phase), **pressures})
    measure, odds = offset(ringing, mechanics(TZ17, recording), tuple(pressures), changes, CHANGING)
    assert odds < -PRIOR / 2
    assert measure.value == pytest.approx(0.0, abs=0.02)


def test_repeated_samples_are_told_with_the_time_between_new_ones() -> None:
    recording = fast()
    values = recording.signals["rod_pressure"].values
    held = np.repeat(values[::5], 5)[: len(values)]
    (found,) = sampling_checks(changed(recording, rod_pressure=held))
    assert (found.kind, found.topic, found.spoils) == ("repeated", "/boom/rod_pressure", False)
    assert found.measure.value == pytest.approx(0.05, rel=0.2)  # now and then a new value is the same as the last one


def test_a_rate_that_is_the_derivative_of_the_angle_is_told() -> None:
    recording = load(BAGS / "healthy" / "extended")
    rng = np.random.default_rng(3)
    angle = recording.signals["angle"].values + 2e-4 * rng.standard_normal(len(recording.signals["angle"].values))
    rate = np.convolve(np.gradient(angle, 0.01), np.ones(3) / 3, "same")
    (found,) = sampling_checks(changed(recording, angle=angle, rate=rate))
    assert (found.kind, found.spoils) == ("derived_rate", False)
    assert sampling_checks(recording) == []


def test_a_rate_that_a_slow_filter_makes_of_the_angle_makes_no_clock_of_the_pressures_early() -> None:
    recording = load(BAGS / "healthy" / "extended")
    slow = np.convolve(
        np.gradient(recording.signals["angle"].values, 0.01), np.r_[np.zeros(20), np.ones(21) / 21], "same"
    )
    told = [check for check in checks(changed(recording, rate=slow), TZ17) if check.kind != "derived_rate"]
    assert told == []


def turned(recording: Recording, values: np.ndarray) -> Recording:
    angle = recording.signals["angle"]
    return replace(recording, signals={**recording.signals, "angle": replace(angle, values=values)})


def test_an_angle_that_wraps_or_lies_a_turn_off_is_told_as_that_and_as_nothing_else() -> None:
    made = fast()
    angle = made.signals["angle"].values
    for values, told in (
        (np.where(angle < 0.5, angle + 2 * np.pi, angle), "jumps by whole turns"), (angle + 2 * np.pi, "is larger by a whole turn"),
    ):  # fmt: skip
        (check,) = spoiling(turned(made, values))
        assert check.kind == "jump" and told in check.sentence


@pytest.mark.parametrize("wrong", [6.4, -6.0, 50.5, 1e20])
def test_a_single_wrong_sample_of_an_angle_is_no_turn(wrong: float) -> None:
    made = fast()
    values = made.signals["angle"].values.copy()
    values[3000] = wrong
    assert not turn_checks(turned(made, values), TZ17)[0]


@pytest.mark.parametrize("jump", [-0.02, 0.006])
def test_an_angle_that_slips_is_told_with_time_and_size(jump: float) -> None:
    made = slipped(fast(), jump)
    (check,) = jump_checks(made)
    assert check.measure.value == pytest.approx(jump, abs=6e-4)
    assert check.measure.interval_90[0] < jump < check.measure.interval_90[1]
    ((first, last),) = check.intervals_s
    assert first <= 0.6 * made.duration <= last
    assert f"{last:.2f} s" in check.sentence


def test_a_sensor_that_slips_again_and_again_is_told_in_one_sentence() -> None:
    made = fast()
    for share in np.linspace(0.1, 0.9, 9):
        angle = made.signals["angle"]
        made = changed(made, angle=angle.values + 0.02 * (angle.time > share * made.duration))
    (check,) = jump_checks(made)
    assert len(check.intervals_s) == 9 and "and 6 times more (jump 0.02" in check.sentence


def test_a_wrong_sample_a_gap_and_a_boom_that_is_stopped_hard_under_a_slow_gyro_are_no_jump() -> None:
    made = fast()
    angle, rate = made.signals["angle"], made.signals["rate"]
    flash = angle.values + 0.05 * (np.arange(len(angle.values)) == 2000)
    assert jump_checks(changed(made, angle=flash)) == []
    kept = (angle.time < 20.0) | (angle.time > 21.5)
    both = {
        s.name: replace(s, values=s.values[kept], time=s.time[kept], stamps_ns=s.stamps_ns[kept], valid=s.valid[kept])
        for s in (angle, rate)
    }
    assert jump_checks(replace(made, signals={**made.signals, **both})) == []
    stopped = np.interp(angle.time, [0.0, 5.0, 15.0, 60.0], [0.1, 0.1, 3.1, 3.1])
    speed = np.where((angle.time > 5.0) & (angle.time < 15.0), 0.3, 0.0)
    filtered = np.convolve(speed, np.exp(-np.arange(40) / 5.0) / np.sum(np.exp(-np.arange(40) / 5.0)))[: len(speed)]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(stopped))
    assert jump_checks(changed(made, angle=stopped + noise, rate=filtered)) == []


@pytest.mark.parametrize("times", [3, 10, 20])
def test_an_angle_that_a_bus_repeats_has_no_jump(times: int) -> None:
    made = fast()
    values = made.signals["angle"].values
    assert jump_checks(changed(made, angle=values[np.arange(len(values)) // times * times])) == []


@pytest.mark.parametrize(
    ("late", "jitter"), [(0.0, 2e-3), (0.0, 5e-4), (3e-4, 0.0), (5e-4, 0.0), (9.7e-3, 0.0), (4e-3, 1e-3)]
)
def test_a_step_of_an_encoder_whose_angle_was_put_on_other_stamps_is_no_jump(late: float, jitter: float) -> None:
    """Among them are values that lie between two steps, and near one of them."""
    made = fast()
    angle = made.signals["angle"]
    bit = 2.0 * np.pi / 2**14
    counted = np.round((angle.values + 0.02 * np.sin(0.05 * angle.time)) / bit) * bit
    stamps = angle.time + late + jitter * np.random.default_rng(1).random(len(counted))
    later = np.interp(stamps, angle.time, counted)
    still = np.where(np.abs(made.signals["rate"].values) < 0.02, 0.0, made.signals["rate"].values)
    assert jump_checks(changed(made, angle=later, rate=still)) == []


def test_an_angle_without_noise_that_stands_still_has_no_jump() -> None:
    made = fast()
    angle = made.signals["angle"]
    still = 0.4 + 1e-17 * (angle.time > 30.0) + 1e-15 * (angle.time > 40.0)
    assert jump_checks(changed(made, angle=still, rate=np.zeros(len(still)))) == []


def test_a_rate_that_is_made_of_the_angle_tells_no_jump() -> None:
    made = slipped(fast())
    angle = made.signals["angle"]
    assert jump_checks(changed(made, rate=np.gradient(angle.values, angle.time))) == []


def test_chatter_at_rest_is_told_with_its_frequency() -> None:
    recording = fast()
    time = recording.signals["extend_current"].time
    on = (time > 30.0) & (time < 32.0)
    side = (np.arange(len(time)) // 2) % 2 == 0
    extend = np.where(on, np.where(side, 0.2, 0.0), 0.0)
    retract = np.where(on, np.where(side, 0.0, 0.2), 0.0)
    (found,) = chatter_checks(even_series(changed(recording, extend_current=extend, retract_current=retract)))
    assert found.measure.value == pytest.approx(50.0, rel=0.02)
    ((start, end),) = found.intervals_s
    assert (start, end) == (pytest.approx(30.0, abs=0.1), pytest.approx(32.0, abs=0.1))


def test_the_answer_to_a_command_is_recovered() -> None:
    time = np.arange(0.0, 40.0, 0.01)
    command = 0.5 * np.sin(0.7 * time)
    behind = 0.5 * np.sin(0.7 * (time - 0.1))
    speed = 0.4 * np.maximum(behind - 0.1, 0.0) ** 1.0 - 0.2 * np.maximum(-behind - 0.2, 0.0) ** 2.0
    found = response(command, speed)
    assert found.lag == 10
    assert found.lifting == (pytest.approx(0.4, rel=1e-3), pytest.approx(0.1, abs=1e-4), 1.0)
    assert found.lowering == (pytest.approx(0.2, rel=1e-3), pytest.approx(0.2, abs=1e-4), 2.0)


def frozen(recording: Recording, start: float, seconds: float) -> Recording:
    """A log of the command that stands still from ``start`` [s] on."""
    values = {}
    for name in ("retract_current", "extend_current"):
        signal = recording.signals[name]
        inside = (signal.time >= start) & (signal.time < start + seconds)
        values[name] = np.where(inside, signal.values[np.argmax(inside)], signal.values)
    return changed(recording, **values)


def test_a_log_that_stands_still_while_the_boom_stops_and_moves_again_is_a_command_that_was_not_logged() -> None:
    (found,) = spoiling(frozen(fast(), 32.0, 2.0))  # lifts until 32.4 s, lowers from 32.9 s on

    assert found.kind == "latched_command" and "stands still" in found.sentence
    ((start, end),) = found.intervals_s
    assert (start, end) == (pytest.approx(32.0, abs=0.2), pytest.approx(34.0, abs=0.2))


def test_an_operator_who_holds_the_command_while_the_boom_moves_is_believed() -> None:
    recording = fast()
    for name in ("retract_current", "extend_current"):
        recording = changed(recording, **{name: np.round(recording.signals[name].values, 1)})
    assert spoiling(recording) == []


@pytest.mark.parametrize("half", ["a", "b"])
def test_what_is_wrong_with_the_strangers_recordings_is_told_in_both(half: str) -> None:
    if not SHARED.is_dir():
        pytest.skip("no shared/recordings/strangers beside the project")
    machine = load_machine(SHARED / "stranger.yaml")
    told = {}
    for number in range(1, 7):
        found = [check for check in checks(load(SHARED / f"stranger_{number}_{half}"), machine) if check.spoils]
        told[number] = [check.kind for check in found]
    assert told == {1: [], 2: [], 3: [], 4: ["sign"], 5: [], 6: ["latched_command"]}


def test_what_is_smoothed_moves_along_with_a_signal_that_is_moved() -> None:
    series = even_series(fast())
    for steps in (7, -12, np.round(np.linspace(-20.0, 30.0, len(series.time))).astype(np.int64)):
        moved = series.moved(("hose_pressure",), steps)
        again = series.with_columns({"hose_pressure": moved.columns["hose_pressure"]})
        for order, share in ((0, 0.01), (1, 0.1)):
            one, other = (s.smooth("hose_pressure", order)[50:-50] for s in (moved, again))
            assert np.std(one - other) < (1e-9 if np.isscalar(steps) else share) * np.std(other)


@pytest.mark.parametrize("factor", [1e60, 1e300])
@pytest.mark.parametrize("signal", ["extend_current", "hose_pressure", "angle"])
def test_numbers_that_no_unit_makes_are_no_measurement_and_end_in_no_error(signal: str, factor: float) -> None:
    made = fast()
    absurd = replace(made.signals[signal], values=factor * (1.0 + made.signals[signal].values),
                     valid=np.zeros_like(made.signals[signal].valid))  # fmt: skip
    assert checks(replace(made, signals={**made.signals, signal: absurd}), TZ17) is not None


def test_a_boom_held_against_its_stop_at_supply_pressure_has_no_other_fault() -> None:
    """Its rod pressure was "in bar", as its hose pressure carries no load there, or the two were swapped."""
    series, boom = even_series(fast()), mechanics(TZ17, fast())
    held = series.time > 20.0
    columns = {
        name: np.where(held, series.columns[name][2000], series.columns[name]) for name in ("angle", "rod_pressure")
    }
    columns |= {"rate": np.where(held, 0.0, series.columns["rate"])}
    columns |= {"extend_current": np.where(held, 0.5, series.columns["extend_current"])}
    columns |= {"retract_current": np.where(held, 0.0, series.columns["retract_current"])}
    columns |= {"hose_pressure": np.where(held, 2.1e7, series.columns["hose_pressure"])}
    assert reading_checks(series.with_columns(columns), boom)[0] == []
    columns["extend_current"] = np.where(
        series.time > 40.0, 0.0, columns["extend_current"]
    )  # let go, the oil is shut in
    pressed = series.with_columns(columns)
    assert pressed.leaning[2500:-20].all() and not pressed.leaning[:1000].all()
    assert statics_of(pressed, boom).steps == ()


def test_a_boom_that_is_driven_into_something_soft_again_and_again_has_no_other_zero_of_its_angle() -> None:
    """Its pressures were told as swapped, and another one's angle as 90 degrees too large with 1e10 to 1."""
    series, boom = even_series(fast()), mechanics(TZ17, fast())
    angle = series.smooth("angle")
    deep = np.maximum(angle - np.nanquantile(angle, 0.3), 0.0) / boom.lever(angle)
    pushed = series.columns["hose_pressure"] + 3.5e7 * deep / np.nanmax(deep)
    into = series.with_columns({"hose_pressure": pushed})
    assert contact_gain(into, boom) > 20.0
    assert [check.sentence for check in reading_checks(into, boom)[0]] == []


@pytest.mark.parametrize("name", ["hose_pressure", "rod_pressure"])
def test_no_pressure_is_larger_than_what_hydraulics_bear(name: str) -> None:
    series, boom = even_series(fast()), mechanics(TZ17, fast())
    larger = series.with_columns({name: 1e5 * series.columns[name]})
    assert pressure_range(larger, boom) < pressure_range(series, boom) - 100.0


def test_a_boom_that_rests_for_ten_minutes_has_no_unit_of_its_rate_to_be_told() -> None:
    """An encoder that stands still beside a gyro's noise, which the force balance takes for acceleration."""
    time, rng = np.arange(0.0, 600.0, 0.01), np.random.default_rng(0)
    there = {"angle": 0.3, "rate": 0.0, "hose_pressure": 8.0e6, "rod_pressure": 2.0e5}
    noise = {"rate": 1.5e-3, "hose_pressure": 1.5e4, "rod_pressure": 1.5e4}
    columns = {n: v + noise.get(n, 0.0) * rng.standard_normal(len(time)) for n, v in there.items()}
    columns |= {name: np.zeros(len(time)) for name in ("retract_current", "extend_current")}
    resting = writing.from_columns("rest", time, columns, load(BAGS / "healthy" / "extended").configuration)
    assert spoiling(resting) == []
