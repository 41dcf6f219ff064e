"""The watch over whole recordings: silent on healthy and damaged ones, an alarm in the right subsystem on others."""

import dataclasses
import math

import numpy as np
import pytest
import report_cases
from diagnosis_samples import BAGS, simulated, tz17

from boom_model.sensors import OUTPUTS
from boom_monitor.filter import Information
from boom_monitor.model import Suspect, WatchModel
from boom_monitor.status import Alarm, Status, WatchSettings
from boom_monitor.watch import CHANNELS, CURRENTS, Watch, judged
from boom_monitor.words import message, silence, values
from boom_recording.loading import load
from boom_recording.recording import Recording

EVERY = 0.2  # s between two questions


def watched(
    recording: Recording, settings: WatchSettings | None = None, until: float = math.inf, start: float = 0.0
) -> tuple[Watch, list[Status]]:
    """What a watch says over a recording, asked every 0.2 s; its samples come in the order of their stamps."""
    c = recording.configuration
    watch = Watch(tz17(), tz17().pose(c.outer_boom_angle, c.telescope_length, c.load_mass), settings)
    samples = []
    for name in (*OUTPUTS, *CURRENTS):
        signal = recording.signals[name]
        samples += [(t, name, v) for t, v in zip(signal.time[signal.valid], signal.values[signal.valid], strict=True)]
    said, due = [], start + EVERY
    for time, name, value in sorted(sample for sample in samples if sample[0] >= start):
        if time > until:
            break
        watch.add(name, time, value)
        if time >= due:
            due = time + EVERY
            said.append(watch.advance())
    return watch, said


@pytest.mark.parametrize("name", ["extended", "extended_log", "folded_fast", "folded_slow"])
def test_a_healthy_machine_raises_no_alarm(name):
    _, said = watched(load(BAGS / "healthy" / name))
    assert said[-1].alarms == 0
    assert max(s.score for s in said if s.watching) < 1.2
    assert np.mean([s.watching for s in said]) > 0.95


@pytest.mark.parametrize(("name", "start"), [("extended", 19.1), ("folded_fast", 6.7), ("extended_log", 3.6)])
def test_a_watch_that_begins_while_the_boom_is_moved_raises_no_alarm(name, start):
    _, said = watched(load(BAGS / "healthy" / name), until=start + 9.0, start=start)
    assert said[-1].watching
    assert said[-1].alarms == 0


@pytest.mark.parametrize("start", [25.0, 40.9])
def test_a_watch_that_begins_as_the_valve_opens_guesses_again_and_raises_no_alarm(start):
    _, said = watched(load(BAGS / "healthy" / "extended"), until=start + 14.0, start=start)
    assert said[-1].watching
    assert said[-1].alarms == 0


def test_currents_that_come_too_seldom_are_told_and_nothing_is_judged_by_them():
    recording = load(BAGS / "healthy" / "folded_fast")
    for name in CURRENTS:
        signal = recording.signals[name]
        seldom = signal.valid & (np.arange(len(signal.time)) % 5 == 0)
        recording.signals[name] = dataclasses.replace(signal, valid=seldom)
    _, said = watched(recording, until=20.0)
    assert said[-1].alarms == 0 and not any(s.watching for s in said)
    assert message(said[-1]).startswith("waits for samples of the currents at least every 30 ms")


@pytest.mark.parametrize("name", CHANNELS)
def test_a_channel_that_is_silent_for_two_seconds_and_comes_back_raises_no_alarm(name):
    recording = load(BAGS / "healthy" / "extended")
    signal = recording.signals[name]
    away = (signal.time > 20.0) & (signal.time < 22.0)
    recording.signals[name] = dataclasses.replace(signal, valid=signal.valid & ~away)
    _, said = watched(recording, until=34.0, start=14.0)
    assert said[-1].watching and said[-1].alarms == 0


def test_gaps_and_losses_of_the_bus_raise_no_alarm_and_the_watch_goes_on_behind_them():
    _, said = watched(load(BAGS / "damaged" / "gap_in_motion"), until=40.0)
    assert said[-1].alarms == 0
    assert not any(s.watching for s in said if 24.8 < s.time < 25.4)
    assert all(s.watching for s in said if s.time > 28.0)


@pytest.mark.parametrize(
    ("name", "onset", "subsystem"),
    [
        # the poppet's lag shows for the first time when it is first lowered fast
        ("hose_burst_valve_lag_a", 17.0, "hose_burst_valve"),
        ("hose_burst_valve_lag_b", 15.0, "hose_burst_valve"),
        ("payload_change_a", 27.0, "load"),
        ("payload_change_b", 40.6, "load"),
    ],
)
def test_what_a_recording_hides_is_told_within_ten_seconds_with_its_subsystem(name, onset, subsystem):
    _, said = watched(load(BAGS / "explained" / name), until=onset + 6.0)
    alarms = [s.alarm for s in said if s.alarm is not None]
    assert onset < alarms[0].begin < onset + 5.0
    assert subsystem == alarms[-1].subsystem == next(iter(alarms[-1].share))
    assert sum(alarms[-1].share.values()) == pytest.approx(1.0)
    assert alarms[-1].share[subsystem] > 0.9


def test_an_alarm_ends_when_the_machine_is_back_within_its_tolerance():
    _, said = watched(load(BAGS / "explained" / "hose_burst_valve_lag_a"), WatchSettings(hold=3.0), until=32.0)
    alarmed = [s.time for s in said if s.alarm is not None]
    assert alarmed[0] > 17.0
    assert alarmed[-1] < 30.0
    assert said[-1].alarm is None and said[-1].alarms == 1


def test_a_model_that_carries_what_the_machine_has_raises_no_alarm():
    recording = load(BAGS / "explained" / "hose_burst_valve_lag_a")
    c = recording.configuration
    machine = report_cases.with_lag(0.09)
    model = WatchModel(machine, machine.pose(c.outer_boom_angle, c.telescope_length, 0.0))
    assert "hose_burst_valve_lag" not in {s.effect for s in model.suspects}
    assert model.plant.machine.effects["hose_burst_valve_lag"] == {"tau": 0.09}


@pytest.mark.parametrize(("stroke", "seen"), [(-1.0, True), (-0.3, False)])
def test_a_pump_that_delivers_less_is_seen_where_the_valve_asks_for_more(stroke, seen):
    """Half of its range is 35 l/min: 70 l/min are less than a full stroke asks for, and more than 0.3 of it."""
    model = WatchModel(tz17(), tz17().pose(0.3, 1.3, 0.0))
    state = model.plant.rest_state_measured(0.5, 1.0e7, 1.0e6)
    names = list(model.plant.state_names)
    state[names.index("spool_position")] = stroke * tz17().parameters["main_valve_spool.s_max"].value[0]
    pump = len(model.tolerated) + [s.effect for s in model.suspects].index("pump_flow_limit")
    change = model.at(state, (0.0, 0.6)).f_c[names.index("hose_pressure"), pump]
    assert (change < -1e6) == seen  # Pa/s


def without(recording: Recording, name: str, until: float = math.inf) -> Recording:
    """The recording with nothing on a channel before ``until`` [s]."""
    signal = recording.signals[name]
    recording.signals[name] = dataclasses.replace(signal, valid=signal.valid & (signal.time >= until))
    return recording


def test_it_waits_until_every_channel_has_brought_samples():
    watch, said = watched(without(simulated(3.0, np.zeros((300, 2))), "rod_pressure"))
    assert not any(s.watching for s in said)
    assert watch.status.waits_for == "rod_pressure"
    assert message(watch.status) == "waits for samples of rod_pressure"


@pytest.mark.parametrize("name", ["rate", "rod_pressure", "hose_pressure"])
def test_a_machine_without_a_sensor_is_watched_without_it(name):
    watch, said = watched(without(load(BAGS / "healthy" / "extended"), name), until=40.0)
    assert said[-1].watching and said[-1].alarms == 0
    assert message(watch.status) == f"within the tolerance of the model (without {name})"


def test_a_sensor_that_comes_late_is_used_from_then_on():
    _, said = watched(without(load(BAGS / "healthy" / "extended"), "rate", 20.0), until=30.0)
    assert [s.absent for s in said if s.time == pytest.approx(15.0, abs=0.2)] == [("rate",)] * 2
    assert said[-1].watching and said[-1].alarms == 0 and said[-1].absent == ()


def test_what_is_hidden_from_a_machine_without_gyro_is_told():
    _, said = watched(without(load(BAGS / "explained" / "payload_change_a"), "rate"))
    alarms = [s.alarm for s in said if s.alarm is not None]
    assert alarms and alarms[-1].subsystem == "load"


def test_a_pressure_sensor_that_is_off_by_its_accuracy_raises_no_alarm():
    recording = load(BAGS / "healthy" / "extended_log")
    signal = recording.signals["rod_pressure"]
    recording.signals["rod_pressure"] = dataclasses.replace(signal, values=signal.values - 0.9e5)
    _, said = watched(recording, until=60.0)
    assert said[-1].watching and said[-1].alarms == 0


def test_samples_that_are_no_numbers_or_out_of_order_are_left_out():
    recording = simulated(4.0, np.zeros((400, 2)))
    c = recording.configuration
    watch = Watch(tz17(), tz17().pose(c.outer_boom_angle, c.telescope_length, 0.0))
    for k in range(400):
        for name in (*OUTPUTS, *CURRENTS):
            watch.add(name, k * 0.01, recording.signals[name].values[k])
            watch.add(name, k * 0.01 - 0.005, 1e9)
            watch.add(name, k * 0.01 + 0.002, math.nan)
    assert watch.advance().watching
    assert watch.status.score < 1.2


def test_a_sample_that_comes_after_its_time_was_passed_is_left_out_and_not_put_where_it_does_not_belong():
    recording = simulated(6.0, np.zeros((600, 2)))
    c = recording.configuration
    watch, late = Watch(tz17(), tz17().pose(c.outer_boom_angle, c.telescope_length, 0.0)), []
    for k in range(600):
        for name in CHANNELS:
            overtaken = name == "rod_pressure" and k >= 300  # from here on 0.3 s late
            at = k - 30 if overtaken else k
            used = watch.add(name, at * 0.01, recording.signals[name].values[at])
            late.append(used if overtaken else False)
        watch.advance()
    assert not any(late)
    assert watch.status.watching and watch.status.score < 1.2


def gapped(recording: Recording, names: tuple[str, ...], every: float, gap: float) -> Recording:
    """The recording without samples of some channels for ``gap`` [s] every ``every`` [s]."""
    for name in names:
        signal = recording.signals[name]
        recording.signals[name] = dataclasses.replace(signal, valid=signal.valid & (signal.time % every >= gap))
    return recording


@pytest.mark.parametrize("every", [1.0, 6.0])
def test_currents_with_short_gaps_hide_no_fault_and_make_none(every):
    lost = gapped(load(BAGS / "explained" / "hose_burst_valve_lag_b"), CURRENTS, every, 0.07)
    alarms = [s.alarm for s in watched(lost, until=24.0)[1] if s.alarm is not None]
    assert 15.0 < alarms[0].begin < 20.0 and alarms[-1].subsystem == "hose_burst_valve"
    watch, said = watched(gapped(load(BAGS / "healthy" / "extended"), CURRENTS, every, 0.07))
    assert said[-1].alarms == 0
    assert (said[-1].blind > 0.0) == (every == 1.0) and said[-1].blind < 0.4
    assert ("the currents have gaps" in message(watch.status)) == (said[-1].blind > 0.1)


@pytest.mark.parametrize("name", ["rate", "hose_pressure", "rod_pressure"])
def test_a_channel_that_repeats_its_value_is_told_and_named_as_no_physics(name):
    recording = load(BAGS / "healthy" / "extended")
    signal = recording.signals[name]
    held = np.where(signal.time > 20.0, signal.values[np.searchsorted(signal.time, 20.0)], signal.values)
    recording.signals[name] = dataclasses.replace(signal, values=held)
    watch, said = watched(recording, until=40.0)
    assert said[-1].alarm is None and said[-1].stuck == (name,)
    assert all(s.stuck == (name,) or not s.watching for s in said if s.time > 21.0)
    assert message(watch.status).startswith(f"nothing is judged: {name} repeats its value")


@pytest.mark.parametrize("step", [0.0, 2e-4])
def test_an_angle_alone_that_stands_while_the_gyro_turns_is_told_as_stuck_an_encoder_too(step):
    recording = load(BAGS / "healthy" / "extended")
    signal = recording.signals["angle"]
    shown = np.round(signal.values / step) * step if step else signal.values
    held = np.where(signal.time > 20.0, shown[np.searchsorted(signal.time, 20.0)], shown)
    for seen, stuck in ((held, ("angle",)), (shown, ())):
        recording.signals["angle"] = dataclasses.replace(signal, values=seen)
        _, said = watched(recording, until=40.0)
        assert not any(s.alarm for s in said) and said[-1].stuck == stuck


def test_silent_channels_are_named_whatever_else_is_said():
    assert silence([]) == ""
    said = silence(["rod_pressure"])
    assert said.startswith("no samples of rod_pressure:")
    fine = Status(True, 20.0, 1.0, None, 0)
    assert message(fine, said) == said
    alarm = Alarm(17.6, "load", "payload", {"load": 1.0}, 100.0, "kg", "mass")
    assert message(Status(True, 20.0, 1.7, alarm, 1), said).endswith(f"; {said}")


def test_what_is_within_its_tolerance_is_taken_out_of_the_score_and_the_cause_gets_its_size():
    """Two causes with known sensitivities: one tolerated (column 0), one suspect (column 1)."""
    rng = np.random.default_rng(3)
    sensitivity = rng.standard_normal((4000, 2)) * [3.0, 1.0]
    suspect = Suspect("payload", "mass", "load", 975.0, "kg", 0.0, 2.0)

    def info(tolerated: float, size: float) -> Information:
        e = sensitivity @ [tolerated, size] + rng.standard_normal(4000)
        return Information(sensitivity.T @ sensitivity, sensitivity.T @ e, float(e @ e), 4000.0)

    score, gain, _ = judged(info(0.8, 0.0), [suspect])
    assert score == pytest.approx(1.0, abs=0.1) and gain[0] < 12
    score, gain, size = judged(info(0.8, 1.3), [suspect])
    assert score == pytest.approx(1.0 + 1.3**2, rel=0.1) and size[0] == pytest.approx(1.3, abs=0.1)
    assert gain[0] == pytest.approx(4000 * 1.3**2, rel=0.1)
    assert judged(info(0.0, -1.0), [suspect])[2][0] == 0.0  # no load is lighter than nothing


def test_the_message_names_the_subsystem_and_what_else_it_could_be():
    share = {"hose_burst_valve": 0.7, "load": 0.25, "sensors": 0.05}
    alarm = Alarm(17.6, "hose_burst_valve", "hose_burst_valve_lag", share, 0.05, "s", "tau")
    status = Status(True, 20.0, 1.7, alarm, 1)
    assert message(status).startswith("the machine has left the tolerance of its model: hose burst valve, else load;")
    told = values(status)
    assert (
        told["subsystem"] == "hose_burst_valve" and told["tau of about [s]"] == "0.05" and told["since [s]"] == "17.60"
    )
