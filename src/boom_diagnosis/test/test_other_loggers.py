"""The diagnosis on recordings whose logger or sensors are not those of the machine file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_diagnosis import lagging, noisy, tz17

from boom_checks.sampling import independent
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.hypotheses import problem_at
from boom_diagnosis.nuisances import clock, tolerances
from boom_diagnosis.prediction import beyond, mean_squares
from boom_diagnosis.run import diagnose
from boom_diagnosis.search import Scanner
from boom_estimation.currents import held_inputs
from boom_estimation.sensor_noise import with_measured_noise
from boom_recording.loading import load
from boom_recording.measurement import without_repeats
from boom_recording.recording import Recording, Signal, part

BAGS = Path(__file__).resolve().parents[3] / "bags"
POSE = (0.28, 2.2)


def every_other(signal: Signal, first: int) -> Signal:
    kept = slice(first, None, 2)
    return replace(
        signal,
        stamps_ns=signal.stamps_ns[kept],
        time=signal.time[kept],
        values=signal.values[kept],
        valid=signal.valid[kept],
    )


def in_turn(recording: Recording) -> Recording:
    """Angle and rate in one sample, pressures and currents in the next: no interval has them all."""
    signals = {n: every_other(s, int(n not in ("angle", "rate"))) for n, s in recording.signals.items()}
    return replace(recording, signals=signals)


def without(recording: Recording, channel: str) -> Recording:
    dead = replace(recording.signals[channel], valid=np.zeros_like(recording.signals[channel].valid))
    return replace(recording, signals={**recording.signals, channel: dead})


def test_an_effect_is_found_in_channels_that_are_sampled_in_turn() -> None:
    found = diagnose([in_turn(noisy(tz17().with_effects({"pilot_lag": {"r": 2.0}}), 24.0, 1))], tz17()).document
    assert (found.verdict, found.findings[0].effect) == ("identified", "pilot_lag")
    assert found.findings[0].parameters["r"].value == pytest.approx(2.0, rel=0.1)


def test_intervals_end_with_the_samples_that_belong_together_whichever_channel_is_missing() -> None:
    """Of angle, rate and hose pressure at 6, 7 and 1 ms the pause before the angle is the longest: intervals end at 1 ms."""
    made = noisy(tz17(), 3.0, 1)
    late = {"angle": 6e-3, "rate": 7e-3, "hose_pressure": 1e-3}
    signals = {n: replace(s, time=s.time + late.get(n, 0.0)) for n, s in made.signals.items()}
    bag = prepare(without(replace(made, signals=signals), "rod_pressure"), tz17(), aligned=True)
    assert bag is not None and bag.grid[0] == pytest.approx(-9e-3, abs=1e-6)


def test_an_effect_is_found_without_gyro_and_what_only_that_shows_is_said_to_be_untold() -> None:
    made = noisy(tz17().with_effects({"pilot_lag": {"r": 2.0}}), 24.0, 1)
    result = diagnose([without(made, "rate")], tz17())
    found = result.document
    assert (found.verdict, found.findings[0].effect) == ("identified", "pilot_lag")
    assert found.findings[0].parameters["r"].value == pytest.approx(2.0, rel=0.1)
    assert np.isnan(found.fit.noise_floor[1])
    assert "the rate was not measured: what only it shows cannot be told, rate scale among it" in " ".join(result.notes)


def test_a_rate_that_was_computed_from_the_angle_is_no_measurement_of_its_own() -> None:
    made = noisy(tz17(), 24.0, 3)
    angle, rate = made.signals["angle"].values, made.signals["rate"]
    assert independent(made) is made, "a gyro"
    window = np.ones(11) / 11
    smooth = np.convolve(np.gradient(angle, 0.01), window, mode="same")
    derived = replace(made, signals={**made.signals, "rate": replace(rate, values=smooth)})
    assert not independent(derived).signals["rate"].valid.any()
    assert independent(derived).signals["angle"] is derived.signals["angle"]


def test_a_load_that_comes_is_seen_first_without_a_rod_pressure() -> None:
    made = load(BAGS / "explained" / "payload_change_a")
    bag = prepare(without(made, "rod_pressure"), tz17())
    assert bag is not None
    nuisances = tolerances(tz17(), tz17().pose(*POSE, 0.0))
    problem = problem_at(tz17(), [bag], [bag.counted], nuisances, np.zeros(len(nuisances)), {}, 4.0)
    (nominal,) = problem.points([(np.zeros(len(nuisances)), {})])
    first = Scanner(problem, nominal, problem.nuisance_jacobian(nominal)).scan(
        ["payload_change", "presliding_friction", "spring_rate"]
    )[0]
    assert first.effect == "payload_change"
    assert first.values["effects.payload_change.t_g"] == pytest.approx(27.4, abs=0.15)


def test_between_samples_of_a_sparse_log_currents_lie_on_lines_and_may_have_changed_anywhere() -> None:
    made = noisy(tz17(), 8.0, 3)
    sparse = replace(made, signals={n: every_other(s, 0) for n, s in made.signals.items()})
    dense, thin = (held_inputs(r, tz17()) for r in (made, sparse))
    assert (dense.sampled, dense.late) == (None, 0.0)
    assert thin.late == pytest.approx(0.01, abs=1e-6)
    assert thin.sampled is not None and thin.time[:4] == pytest.approx([0.0, 0.01, 0.02, 0.03], abs=1e-9)
    shown, known = thin.values[thin.sampled], dense.values[::2][: thin.sampled.sum()]
    assert shown == pytest.approx(known, abs=1e-12)
    assert thin.values[1::2] == pytest.approx(0.5 * (shown[1:] + shown[:-1]), abs=1e-6)
    drawn = thin.drawn(np.random.default_rng(1))
    assert drawn[thin.sampled] == pytest.approx(shown, abs=1e-12)
    early = np.isclose(drawn[1::2], shown[1:]).all(axis=1)
    assert (early | np.isclose(drawn[1::2], shown[:-1]).all(axis=1)).all(), "one of the two"
    assert 0.3 < early[np.abs(np.diff(shown, axis=0)).max(axis=1) > 0.01].mean() < 0.7
    slower = held_inputs(sparse, tz17().with_sensors({"Ts": 0.02}))
    assert slower.time[:3] == pytest.approx([0.0, 0.02, 0.04], abs=1e-9)


@pytest.mark.parametrize("delay", [0.004, 0.013, 0.025, 0.04])
def test_late_pressures_of_a_sparse_log_go_back_each_to_its_own_interval(delay: float) -> None:
    made = noisy(tz17(), 8.0, 3)
    signals = {n: every_other(s, int(n == "rod_pressure")) for n, s in made.signals.items()}
    bag = prepare(replace(made, signals=signals), tz17())
    assert bag is not None
    shifts = bag.pressure_shift(delay)
    late = bag.samples(pressure_delay=delay).measured
    for j, (shift, known) in enumerate(zip(shifts, bag.counted.T, strict=True)):
        back = np.roll(np.isfinite(late[:, j]), shift)
        assert back[known][10:].mean() > 0.95, (j, shift)


@pytest.mark.parametrize(("name", "told"), [("extended", 0.01), ("folded_fast", 0.01), ("extended", 0.05)])
def test_a_healthy_recording_of_20_hz_has_no_physics_left_out(name: str, told: float) -> None:
    """Of a controller of 100 Hz, also where the file gives its own sample time for the controller's."""
    psd = tz17().sensors.get("p_noise_psd", 0.0)
    machine = tz17().with_sensors({"Ts": told, **({"p_noise_psd": psd * told / 0.01} if psd else {})})
    made = load(BAGS / "healthy" / name)
    kept = slice(None, None, 5)
    sparse = {
        n: replace(s, stamps_ns=s.stamps_ns[kept], time=s.time[kept], values=s.values[kept], valid=s.valid[kept])
        for n, s in made.signals.items()
    }
    looks = list[str]()
    result = diagnose(
        [replace(made, signals=made.signals | sparse)], machine, progress=lambda text, share: looks.append(text)
    )
    assert result.document.verdict in ("no_mismatch", "parameters_only")
    assert ("commands every" in " ".join(result.notes)) == (told > 0.01)
    assert looks.count("weighing effects") <= 1  # what is the log's is found before any effect is tried on it


def test_a_sample_that_a_bus_repeats_counts_once() -> None:
    made = noisy(tz17(), 8.0, 3)
    hose = made.signals["hose_pressure"]
    values = np.repeat(hose.values[::2], 2)[: len(hose.values)]
    fresh = without_repeats(replace(made, signals={**made.signals, "hose_pressure": replace(hose, values=values)}))
    assert fresh.signals["hose_pressure"].valid[::2].mean() > 0.9
    assert not fresh.signals["hose_pressure"].valid[1::2].any()
    assert fresh.signals["rod_pressure"].valid.all()
    assert without_repeats(made) is made


def test_a_gyro_that_is_noisier_than_the_file_says_is_no_physics() -> None:
    louder = noisy(tz17().with_sensors({"rate_noise": 2.1e-3}), 24.0, 2)
    told = with_measured_noise(tz17(), [louder]).sensor_noise()
    assert told.rate_sigma == pytest.approx(2.1e-3, rel=0.1)
    assert told.pressure_sigma == pytest.approx(tz17().sensor_noise().pressure_sigma, rel=0.1)
    assert diagnose([louder], tz17()).document.verdict in ("no_mismatch", "parameters_only")


def test_a_channel_that_is_not_measured_in_an_interval_tells_nothing_there() -> None:
    parts = np.array([[2.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    counted = parts != 0.0
    assert mean_squares([parts], [counted]) == pytest.approx([4.0, 9.0])
    assert mean_squares([parts], [np.zeros_like(counted)]) == pytest.approx([1.0, 1.0])
    assert beyond(parts, counted, np.ones(2)) == pytest.approx([1.5, 4.0, 0.0])


def shown_later(recording: Recording, late: float) -> Recording:
    """With currents that the log shows ``late`` [s] after they changed."""
    signals = dict(recording.signals)
    for name in ("retract_current", "extend_current"):
        known = signals[name]
        signals[name] = replace(known, stamps_ns=known.stamps_ns + round(1e9 * late), time=known.time + late)
    return replace(recording, signals=signals)


def test_a_log_that_shows_currents_late_by_less_than_a_sample_is_no_fault_of_the_machine() -> None:
    result = diagnose([shown_later(noisy(tz17(), 24.0, 1), 0.006)], tz17())
    assert (result.document.verdict, result.document.findings) == ("parameters_only", ())
    assert result.tolerances_used["clock of the logged currents"].value == pytest.approx(-0.006, abs=1e-3)
    assert result.explained.effects["command_delay"]["T"] == pytest.approx(-0.006, abs=1e-3)


def test_a_machine_whose_angle_is_the_latest_channel_has_no_dead_time() -> None:
    result = diagnose([shown_later(noisy(tz17(), 24.0, 1), -0.006)], tz17())  # as if all sensors were 6 ms late
    assert (result.document.verdict, result.document.findings) == ("parameters_only", ())
    assert result.tolerances_used["clock of the logged currents"].value == pytest.approx(0.006, abs=1e-3)


def test_the_clock_of_a_log_is_known_to_a_sample_and_what_an_angle_may_be_late_unless_the_machine_file_tells_a_dead_time() -> (
    None
):
    made = noisy(tz17(), 8.0, 3)
    sparse = replace(made, signals={n: every_other(s, 0) for n, s in made.signals.items()})
    dense, thin = (held_inputs(r, tz17()) for r in (made, sparse))
    (known,), (between,) = (clock(tz17(), [held]) for held in (dense, thin))
    assert [known.value(0.0, z) for z in known.limits] == pytest.approx([-0.01, 0.0075], abs=1e-6)
    assert [between.value(0.0, z) for z in between.limits] == pytest.approx([-0.01, 0.0175], abs=1e-6)
    assert clock(tz17().with_effects({"command_delay": {"T": 0.02}}), [dense]) == ()


def racing(recording: Recording, seed: int) -> Recording:
    """The currents as a log that races its controller shows them: of every second sample the command before."""
    rng = np.random.default_rng(seed)
    row = np.arange(len(recording.signals["retract_current"].values))
    row = np.maximum(row - (rng.uniform(size=len(row)) < 0.5), 0)
    shown = {n: replace(s, values=s.values[row]) for n, s in recording.signals.items() if n.endswith("current")}
    return replace(recording, signals={**recording.signals, **shown})


def test_a_log_that_races_its_controller_is_told_as_that_beside_what_is_missing() -> None:
    made = noisy(tz17().with_effects({"pilot_lag": {"r": 2.0}}), 24.0, 1)
    raced = racing(racing(racing(made, 2), 5), 7)  # two races are within what latencies leave
    result = diagnose([raced], tz17())
    assert [f.effect for f in result.document.findings if f.confidence >= 0.5] == ["pilot_lag"]
    assert any("stray from their stamps" in note for note in result.notes)
    assert not any("stray from their stamps" in note for note in lagging().notes)


def test_a_healthy_machine_whose_log_races_its_controller_lacks_no_physics() -> None:
    assert diagnose([racing(noisy(tz17(), 24.0, 1), 2)], tz17()).document.verdict in ("no_mismatch", "parameters_only")


def test_gains_of_late_pressures_serve_a_machine_whose_pressures_are_not_late_where_samples_are_rare() -> None:
    made = noisy(tz17(), 24.0, 1)
    rare = replace(made, signals={n: every_other(s, 0) for n, s in made.signals.items()})
    bag = prepare(independent(rare), tz17())
    assert bag is not None
    known = tolerances(tz17(), tz17().pose(*POSE))
    late = {"effects.pressure_delay.T": 1.7e-3}
    losses = []
    for tuned in ({}, late):
        problem = problem_at(tz17(), [bag], [bag.counted], known, np.zeros(len(known)), tuned, 1.0)
        losses.append(problem.points([(np.zeros(len(known)), {})])[0].loss)
    assert losses[1] == pytest.approx(losses[0], rel=0.05)


def test_the_first_eight_seconds_of_a_healthy_recording_whose_angle_rests_in_the_end_name_nothing() -> None:
    found = diagnose([part(load(BAGS / "healthy" / "folded_slow"), 0.0, 8.1)], tz17()).document
    assert found.verdict in ("no_mismatch", "parameters_only")
