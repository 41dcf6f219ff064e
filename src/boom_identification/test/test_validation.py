"""Free runs against recordings: which agree, which do not, and what happens at gaps, out of range, without data."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
from diagnosis_samples import FOLDED, constant, joystick, simulated, tz17, validated

from boom_estimation import free_run
from boom_estimation.currents import HeldCurrents, held_currents
from boom_estimation.free_run import metrics, plant_for
from boom_estimation.initial_state import InitialState, initial_state, means_at_rest
from boom_estimation.runs import free_stretches
from boom_identification.validation import from_bag, noise_limits, validate
from boom_model.errors import SimulationError
from boom_recording.loading import load
from boom_recording.writing import from_columns
from boom_report.validation.verdict import verdict

FAST = Path(__file__).parents[3] / "bags" / "healthy" / "folded_fast"

HEALTHY = ("extended", "extended_log", "folded_fast", "folded_slow")
EXPLAINED = ("hose_burst_valve_lag_a", "hose_burst_valve_lag_b", "payload_change_a", "payload_change_b")
UNEXPLAINED = ("crane_2_a", "crane_3_a", "crane_4_a")


@pytest.mark.parametrize("name", HEALTHY)
def test_healthy_recordings_agree_with_the_full_model_within_noise(name):
    errors = validated(f"healthy/{name}").full.metrics
    assert errors["angle_mae_rad"] <= 1.0e-3
    assert errors["hose_pressure_rmse_pa"] <= 0.35e5
    assert errors["rod_pressure_rmse_pa"] <= 0.35e5
    assert validated(f"healthy/{name}").mismatches == []


@pytest.mark.parametrize("name", HEALTHY)
def test_the_reduced_model_follows_the_full_one_as_in_table_5_2(name):
    assert validated(f"healthy/{name}").reduced_vs_full_angle_mae_rad <= 25e-3


@pytest.mark.parametrize("name", EXPLAINED)
def test_recordings_that_hide_something_differ(name):
    bag = validated(f"explained/{name}")
    assert "rod_pressure_rmse_pa" in bag.mismatches
    assert bag.full.metrics["rod_pressure_rmse_pa"] > 2 * bag.limits["rod_pressure_rmse_pa"]


def test_a_rate_that_is_the_derivative_of_the_angle_is_compared_and_not_judged():
    recording = validated("healthy/extended").recording
    angle, rate = recording.signals["angle"], recording.signals["rate"]
    noisy = angle.values + 2e-4 * np.random.default_rng(3).standard_normal(len(angle.values))
    derived = np.convolve(np.gradient(noisy, 0.01), np.ones(3) / 3, "same")
    signals = {
        "angle": dataclasses.replace(angle, values=noisy),
        "rate": dataclasses.replace(rate, values=derived, stamps_ns=angle.stamps_ns),
    }
    bag = validate(dataclasses.replace(recording, signals=recording.signals | signals), tz17())
    assert bag.full.metrics["rate_rmse_rad_s"] > noise_limits(tz17())["rate_rmse_rad_s"]
    assert bag.limits["rate_rmse_rad_s"] is None
    assert bag.mismatches == []


def test_a_channel_of_which_there_is_hardly_anything_is_not_judged_by_it():
    """One sample of the hose pressure had agreed "within sensor noise"."""
    recording = validated("healthy/extended").recording
    hose = recording.signals["hose_pressure"]
    valid = np.arange(len(hose.values)) == 5
    signals = recording.signals | {"hose_pressure": dataclasses.replace(hose, valid=valid)}
    bag = validate(dataclasses.replace(recording, signals=signals), tz17())
    assert bag.scarce("hose_pressure") == pytest.approx(0.01) and bag.scarce("rod_pressure") is None
    assert bag.mismatches == [] and verdict(bag).short.endswith("without hose pressure (of which there are 0.01 s)")


@pytest.mark.parametrize("name", UNEXPLAINED)
def test_unexplained_recordings_differ_and_do_not_crash(name):
    assert validated(f"unexplained/{name}").mismatches


@pytest.mark.parametrize(("name", "start", "end"), [("gap_and_losses", 21.29, 24.10), ("gap_in_motion", 24.19, 25.40)])
def test_damaged_recordings_list_the_gap_of_every_topic_and_the_losses(name, start, end):
    events = validated(f"damaged/{name}").document()["events"]
    gaps = [e for e in events if e["kind"] == "gap"]
    topics = {"/joint_states", "/boom/hose_pressure", "/boom/rod_pressure", "/boom/solenoid_currents"}
    assert {e["topic"] for e in gaps} == topics == {e["topic"] for e in events if e["kind"] == "loss"}
    assert all(e["start_s"] == pytest.approx(start, abs=0.02) for e in gaps)
    assert all(e["end_s"] == pytest.approx(end, abs=0.02) for e in gaps)


@pytest.mark.parametrize(("name", "start", "end"), [("gap_and_losses", 21.30, 24.09), ("gap_in_motion", 24.20, 25.39)])
def test_a_run_ends_at_a_gap_in_the_currents_and_starts_again_behind_it(name, start, end):
    bag = validated(f"damaged/{name}")
    time = bag.recording.signals["angle"].time
    for prediction in (bag.full, bag.reduced):
        assert len(prediction.runs) == 2
        inside = (time > start) & (time < end)
        assert not np.isfinite(prediction.values["angle"][inside]).any()
        # one sample may come after the last current that is known, or before the first
        outside = ((time > 0.02) & (time < start - 0.02)) | (time > end + 0.02)
        assert np.isfinite(prediction.values["angle"][outside]).all()


def test_behind_a_gap_in_motion_the_state_is_estimated_well_enough_for_noise_level():
    bag = validated("damaged/gap_in_motion")
    assert "in motion" in bag.full.runs[1]
    assert bag.mismatches == []


def test_a_run_ends_where_the_oil_evaporates_and_starts_again_behind_it():
    """crane_4_a was made by a program that lets oil bear tension: no model with voids gets through 6.5 s as it does."""
    contact = {"ground_contact": {"c": 4.0e5, "q_0": 0.22, "d": 2.0e4}}
    bag = validate(load(FAST.parents[1] / "unexplained" / "crane_4_a"), tz17().with_effects(contact))
    first, second = bag.full.runs
    assert first.startswith("0.00 s to 6.53 s: at rest") and second.startswith("7.60 s to 59.99 s: in motion")
    assert bag.mismatches == []
    assert (
        len(free_stretches(bag.recording, held_currents(bag.recording), tz17(), True)) == 1
    )  # such a hose is not the head side


def test_behind_a_gap_at_rest_the_state_is_that_of_a_resting_boom():
    assert "at rest from 24.10 s" in validated("damaged/gap_and_losses").full.runs[1]


def test_a_recording_made_by_the_model_is_reproduced_by_it():
    recording = simulated(8.0, joystick(np.arange(800) * 0.01))
    errors = validate(recording, tz17()).full.metrics
    assert np.ptp(recording.signals["angle"].values) > 0.05
    assert errors["angle_mae_rad"] < 1e-6
    assert errors["rate_rmse_rad_s"] < 1e-5
    assert max(errors["hose_pressure_rmse_pa"], errors["rod_pressure_rmse_pa"]) < 1e3


def test_errors_are_what_the_definitions_say():
    time = np.arange(4) * 0.01
    columns = {"angle": [0.0, 0.0, 0.0, 0.0], "rate": [1.0] * 4, "hose_pressure": [1e5] * 4, "rod_pressure": [2e5] * 4}
    recording = from_columns("tiny", time, {k: np.array(v) for k, v in columns.items()}, FOLDED)
    predicted = {
        "angle": np.array([0.001, -0.003, 0.0, np.nan]),  # not predicted at the last sample
        "rate": np.array([1.0, 1.0, 1.0, 1.2]),
        "hose_pressure": np.array([1.3e5, 0.6e5, 1e5, 1e5]),
        "rod_pressure": np.full(4, np.nan),
    }
    found = metrics(recording, predicted)
    assert found["angle_mae_rad"] == pytest.approx(0.004 / 3)
    assert found["angle_rmse_rad"] == pytest.approx(math.sqrt(1e-5 / 3))
    assert found["rate_rmse_rad_s"] == pytest.approx(0.1)
    assert found["hose_pressure_rmse_pa"] == pytest.approx(0.25e5)
    assert found["rod_pressure_rmse_pa"] is None


def test_a_masked_sample_counts_nowhere():
    recording = constant(0.03, angle=0.5)
    signal = recording.signals["angle"]
    spoilt = dataclasses.replace(signal, values=np.array([0.5, 99.0, 0.5]), valid=np.array([True, False, True]))
    recording.signals["angle"] = spoilt
    values = {name: np.zeros(3) for name in ("rate", "hose_pressure", "rod_pressure")} | {"angle": np.full(3, 0.6)}
    assert metrics(recording, values)["angle_mae_rad"] == pytest.approx(0.1)


def test_limits_are_one_milliradian_and_twice_the_noise_of_chapter_6_4():
    pressure = 2 * math.hypot(math.sqrt(3e6 / 0.01), 1e4 / math.sqrt(12))
    expected = {
        "angle_mae_rad": 1e-3, "angle_rmse_rad": None, "rate_rmse_rad_s": 3e-3,
        "hose_pressure_rmse_pa": pytest.approx(pressure), "rod_pressure_rmse_pa": pytest.approx(pressure),
    }  # fmt: skip
    assert noise_limits(tz17()).document() == expected
    assert pressure == pytest.approx(0.351e5, abs=50)


def test_a_coarse_angle_sensor_widens_the_limit_of_the_angle():
    coarse = tz17().with_resolution(1.745e-3, 0.0)
    assert noise_limits(coarse)["angle_mae_rad"] == pytest.approx(2 * 1.745e-3 / math.sqrt(12))


def test_a_run_goes_on_where_oil_evaporates_and_says_from_when():
    """Lifted for a moment and let go without a load: the boom goes on, and the head side opens up."""
    recording = constant(6.0, angle=0.6, hose_pressure=2.7e6, rod_pressure=1e6)
    assert validate(recording, tz17()).full.evaporated == ""
    signal = recording.signals["extend_current"]
    lifting = np.where((signal.time > 2.0) & (signal.time < 2.4), 0.55, 0.0)
    recording.signals["extend_current"] = dataclasses.replace(signal, values=lifting)
    bag = validate(recording, tz17())
    said = r"at 2\.\d s first the model's head pressure falls to -0\.\d+ bar, where oil evaporates"
    assert re.fullmatch(said, bag.full.evaporated)
    assert bag.full.stopped == "" and np.isfinite(bag.full.values["angle"]).all()
    assert bag.document()["full"]["evaporated"] == bag.full.evaporated


@pytest.mark.parametrize("offset", [-0.97e5, -1.02e5, -1.6e5])
def test_a_transducer_that_reads_vacuum_at_rest_costs_the_free_run_nothing(offset):
    """Oil at rest leaves no void: the run begins with as little pressure as oil may have."""
    recording = load(FAST)
    signal = recording.signals["rod_pressure"]
    rest = float(np.mean(signal.values[signal.valid][:50]))
    recording.signals["rod_pressure"] = dataclasses.replace(signal, values=signal.values - rest + offset)
    bag = validate(recording, tz17())
    assert bag.full.stopped == "" and bag.full.metrics["angle_rmse_rad"] < 2e-3


def test_a_run_that_leaves_its_range_is_told_with_time_and_state_and_compared_up_to_there():
    recording = constant(15.0, angle=0.4, hose_pressure=6e6, rod_pressure=1e6)
    signal = recording.signals["extend_current"]
    lifting = np.where(signal.time > 2.0, 0.55, 0.0)
    recording.signals["extend_current"] = dataclasses.replace(signal, values=lifting)
    bag = validate(recording, tz17())
    assert "angle (q_2) left its range" in bag.full.stopped
    assert "stopped" in bag.mismatches
    known = np.isfinite(bag.full.values["angle"])
    assert known[0] and not known[-1]
    assert bag.document()["full"]["stopped"] == bag.full.stopped


def test_a_run_whose_last_step_reaches_out_of_range_behind_the_last_sample_is_cut_a_little_earlier():
    class Overshooting:
        """Steps of 10 ms: out of range at 0.50 s, which a run to a sample at 0.495 s meets as well."""

        def run(self, time, currents, reached, state, *, start, tolerance):
            if np.ceil(reached[-1] * 100 - 1e-9) >= 50:
                raise SimulationError("out of range at 0.500 s", 0.5, "angle")
            return reached

    held = HeldCurrents(np.array([0.0]), np.zeros((1, 2)))
    begin = InitialState(0.0, np.zeros(11), "given")
    reached, reason = free_run._run(Overshooting(), held, np.arange(200) * 0.0025, begin)
    assert reason == "out of range at 0.500 s"
    assert 0.47 < reached[-1] <= 0.49


def test_a_recording_outside_the_machines_range_is_no_crash():
    bag = validate(constant(angle=-1.2), tz17())
    assert bag.full.stopped
    assert bag.full.metrics["angle_mae_rad"] is None


def test_a_sensor_that_was_not_recorded_is_not_compared_and_the_others_are():
    recording = simulated(8.0, joystick(np.arange(800) * 0.01))
    for missing in (("rod_pressure",), ("hose_pressure",), ("rate",), ("rate", "rod_pressure", "hose_pressure")):
        never = {
            n: dataclasses.replace(s, valid=np.zeros(len(s.time), bool))
            for n, s in recording.signals.items()
            if n in missing
        }
        bag = validate(dataclasses.replace(recording, signals=recording.signals | never), tz17())
        for name in ("angle_mae", "rate_rmse", "hose_pressure_rmse", "rod_pressure_rmse"):
            key = next(k for k in bag.full.metrics.values if k.startswith(name))
            assert (bag.full.metrics[key] is None) == key.startswith(missing)
        assert bag.full.metrics["angle_mae_rad"] < (1e-3 if len(missing) == 1 else 0.02)
        assert bag.document()["agrees"]


@pytest.mark.parametrize("name", ["angle", "retract_current"])
def test_a_channel_without_a_valid_sample_gives_no_number_and_no_crash(name):
    recording = constant(angle=0.4, hose_pressure=6e6)
    signal = recording.signals[name]
    recording.signals[name] = dataclasses.replace(signal, valid=np.zeros(len(signal.time), bool))
    bag = validate(recording, tz17())
    assert set(bag.full.metrics.document().values()) == {None}
    assert bag.reduced_vs_full_angle_mae_rad is None
    assert not bag.document()["agrees"]


def test_a_simulated_bag_stands_for_the_full_model():
    recording = simulated(8.0, joystick(np.arange(800) * 0.01))
    other = dataclasses.replace(recording, name="other", signals=dict(recording.signals))
    angle = other.signals["angle"]
    other.signals["angle"] = dataclasses.replace(angle, values=angle.values + 0.002)
    bag = validate(recording, tz17(), simulated=other)
    assert bag.full.metrics["angle_mae_rad"] == pytest.approx(0.002)
    assert bag.full.runs == ("simulated by other processes: other",)
    assert bag.mismatches == ["angle_mae_rad"]


def test_a_simulated_bag_predicts_nothing_inside_its_own_gaps():
    recording = simulated(8.0, joystick(np.arange(800) * 0.01))
    other = dataclasses.replace(recording, signals=dict(recording.signals))
    angle = other.signals["angle"]
    other.signals["angle"] = dataclasses.replace(angle, valid=(angle.time < 3.0) | (angle.time > 4.0))
    values = from_bag(recording, other).values["angle"]
    assert not np.isfinite(values[(angle.time >= 3.0) & (angle.time <= 4.0)]).any()
    assert np.isfinite(values[(angle.time < 3.0) | (angle.time > 4.0)]).all()


def test_the_load_of_the_configuration_is_carried_and_an_unknown_one_counts_as_none():
    recording = constant()
    for mass, carried in ((250.0, 250.0), (math.nan, 0.0)):
        configuration = dataclasses.replace(FOLDED, load_mass=mass)
        loaded = dataclasses.replace(recording, stored_configuration=configuration)
        assert plant_for(loaded, tz17(), "full").pose.load == carried


def test_currents_act_from_their_stamp_to_the_next_one():
    held = HeldCurrents(np.array([0.0, 0.01, 0.02]), np.array([[0.1, 0.0], [0.2, 0.0], [0.0, 0.3]]))
    assert held.at(-1.0) == (0.1, 0.0)
    assert held.at(0.0199) == (0.2, 0.0)
    assert held.at(0.02) == (0.0, 0.3)
    assert held.first_above(0.25, 0.0) == 0.02
    assert held.first_above(0.25, 0.03) == math.inf


def test_currents_further_apart_than_50_ms_are_two_stretches():
    time = np.array([0.0, 0.01, 0.02, 0.06, 0.12, 0.13])
    held = HeldCurrents(time, np.zeros((6, 2)))
    assert held.stretches(0.15) == [(0.0, 0.06), (0.12, pytest.approx(0.15))]
    assert held.stretches(9.0)[1] == (0.12, pytest.approx(0.18))
    assert HeldCurrents(np.empty(0), np.empty((0, 2))).stretches(1.0) == []


def resting_with(rate_of):
    recording = constant(angle=0.4, hose_pressure=6e6, rod_pressure=1e6)
    rate = recording.signals["rate"]
    shown = dataclasses.replace(rate, values=rate_of(rate.time))
    return means_at_rest(dataclasses.replace(recording, signals={**recording.signals, "rate": shown}), 0.0, 0.95)


def test_a_boom_that_swings_about_a_place_does_not_rest_and_one_of_a_noisy_gyro_does():
    rng = np.random.default_rng(1)
    noise = np.convolve(rng.standard_normal(300), 0.8 ** np.arange(20), mode="same")
    assert resting_with(lambda time: 0.0 * time) is not None
    assert resting_with(lambda time: 8e-3 / noise.std() * noise[: len(time)]) is not None
    assert resting_with(lambda time: 0.075 * np.cos(2 * np.pi * 2.0 * time)) is None


def test_the_initial_state_of_a_resting_boom_is_the_mean_of_what_was_measured():
    recording = constant(angle=0.4, hose_pressure=6e6, rod_pressure=1e6)
    plant = plant_for(recording, tz17(), "full")
    held = held_currents(recording)
    begin = initial_state(recording, plant, held, 0.0, 2.0)
    state = dict(zip(plant.state_names, begin.state, strict=True))
    assert state["angle"] == pytest.approx(0.4)
    assert state["head_pressure"] == state["hose_pressure"] == pytest.approx(6e6)
    assert state["rod_pressure"] == pytest.approx(1e6)
    assert begin.how == "at rest from 0.00 s to 0.95 s"
