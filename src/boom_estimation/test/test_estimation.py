"""Estimation recovers known truths from small simulated recordings, and says what it cannot tell."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_samples import BAGS, FOLDED, PERIOD, constant, tz17

from boom_estimation import (
    EstimationProblem,
    Unknown,
    effect_unknown,
    fit,
    last_part,
    machine_unknown,
    prepare,
    with_effects_present,
)
from boom_estimation.uncertainty import Uncertainty, uncertainty
from boom_identification.held import pairing_told
from boom_identification.refine import refine
from boom_identification.search import search
from boom_model.batch import Job, run_jobs
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.plant import Plant
from boom_recording.loading import load
from boom_recording.recording import Recording
from boom_recording.writing import from_columns

SA, SB, TB = (f"main_valve_orifices.{name}" for name in ("A_sa_max", "A_sb_max", "A_tb_max"))
FRICTION = "friction.tau_C_pos"


def work(duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and currents of lifting and lowering by turns, at changing speeds."""
    time = np.arange(round(duration / PERIOD)) * PERIOD
    phase = (time - 1.0) % 6.0
    level = np.where((time // 6.0) % 2 == 0, 0.47, 0.40)
    currents = np.zeros((len(time), 2))
    currents[:, 1] = np.where((time > 1.0) & (phase < 2.0), level, 0.0)
    currents[:, 0] = np.where((time > 1.0) & (phase > 3.0) & (phase < 4.8), level, 0.0)
    return time, currents


def recorded(machine: Machine, duration: float = 13.0, *, seed: int = 1, name: str = "made") -> Recording:
    """A recording of ``machine`` with the noise of its sensors, its own currents included."""
    time, currents = work(duration)
    plant = Plant(machine, machine.pose(FOLDED.outer_boom_angle, FOLDED.telescope_length, 0.0))
    run = plant.run(time, currents, time, plant.equilibrium(0.4), tolerance=1e-6)
    rng, noise = np.random.default_rng(seed), machine.sensor_noise()
    seen, current = noise.outputs(run.outputs, rng), noise.currents(currents, rng)
    columns = {key: seen[:, i] for i, key in enumerate(("angle", "rate", "hose_pressure", "rod_pressure"))}
    columns |= {"retract_current": current[:, 0], "extend_current": current[:, 1]}
    return from_columns(name, time, columns, FOLDED)


def number(machine: Machine, name: str) -> float:
    return machine.values(machine.pose(FOLDED.outer_boom_angle, FOLDED.telescope_length))[name]


def wrong(**factors: float) -> Machine:
    changed = {key.replace("__", "."): number(tz17(), key.replace("__", ".")) * f for key, f in factors.items()}
    return tz17().with_values(changed)


OFF = {SA.replace(".", "__"): 1.3, SB.replace(".", "__"): 0.75, FRICTION.replace(".", "__"): 1.4, "fluid__beta": 0.7}


def problem(
    machine: Machine, *recordings: Recording, names: tuple[str, ...] = (SA, SB, FRICTION, "fluid.beta")
) -> EstimationProblem:
    unknowns = [machine_unknown(machine, name, widen=3.0, least=0.3) for name in names]
    return EstimationProblem([prepare(r, machine) for r in recordings], unknowns)


def test_numbers_that_are_a_third_wrong_come_back_inside_their_intervals() -> None:
    from_wrong = problem(wrong(**OFF), recorded(tz17()))
    found = fit(from_wrong)
    known = uncertainty(from_wrong, found)
    assert found.level == 1.0
    for u, value, low, high in zip(found.unknowns, found.values, known.low, known.high, strict=True):
        truth = number(tz17(), u.name)
        assert low <= truth <= high, u.name
        assert value == pytest.approx(truth, rel=0.05), u.name
        assert high - low < 0.2 * truth


def test_innovations_of_the_true_model_are_white_and_of_unit_variance() -> None:
    right = problem(tz17(), recorded(tz17()))
    z = np.zeros(4)
    gains = right.gains(z, right.gains(z, right.first_gains()))
    white = gains[0].whiten(right.observed(z, gains)[0].innovations[:, :, None])[:, 1:, 0]
    assert white.std(axis=0) == pytest.approx(np.ones(3), abs=0.08)
    assert np.abs(np.mean(white[1:] * white[:-1], axis=0)).max() < 0.1


def test_sensitivities_are_the_differences_of_predictions() -> None:
    right = problem(tz17(), recorded(tz17(), 6.0), names=(SA,))
    gains = right.gains(np.zeros(1), right.first_gains())
    _, derivative = right.sensitivities(np.zeros(1), gains)
    up, down = (right.observed(np.array([d]), gains)[0].innovations for d in (0.01, -0.01))
    scale = np.abs(derivative[0][:, :, 0]).max(axis=0)
    assert (np.abs((up - down) / 0.02 - derivative[0][:, :, 0]).max(axis=0) < 0.1 * scale).all()


def test_an_effect_is_estimated_like_any_other_number() -> None:
    loaded = tz17().with_effects({"pressure_bias": {"hose": 1.5e5}})
    nominal = with_effects_present(tz17(), {"pressure_bias": {}})
    unknown = effect_unknown("pressure_bias", "hose")
    found = fit(EstimationProblem([prepare(recorded(loaded, 7.0), nominal)], [unknown]))
    assert found.number("effects.pressure_bias.hose") == pytest.approx(1.5e5, rel=0.05)


def test_delays_are_estimated_from_runs_with_shifted_inputs() -> None:
    late = tz17().with_effects({"command_delay": {"T": 0.033}, "pressure_delay": {"T": 0.027}})
    nominal = with_effects_present(tz17(), {"command_delay": {}, "pressure_delay": {}})
    unknowns = [effect_unknown("command_delay", "T"), effect_unknown("pressure_delay", "T")]
    found = fit(EstimationProblem([prepare(recorded(late, 7.0), nominal)], unknowns))
    assert found.values == pytest.approx([0.033, 0.027], abs=1.5e-3)


def test_an_unknown_of_one_recording_leaves_the_others_alone() -> None:
    nominal = with_effects_present(tz17(), {"pressure_bias": {}})
    biased = recorded(tz17().with_effects({"pressure_bias": {"hose": 2e5}}), 5.0, name="biased")
    plain = recorded(tz17(), 5.0, seed=2, name="plain")
    unknowns = [effect_unknown("pressure_bias", "hose", bag=name) for name in ("biased", "plain")]
    found = fit(EstimationProblem([prepare(r, nominal) for r in (biased, plain)], unknowns))
    assert found.values == pytest.approx([2e5, 0.0], abs=1.5e4)


def test_held_out_samples_do_not_touch_the_fit() -> None:
    recording = recorded(tz17(), 10.0)
    spoilt = replace(recording, signals=dict(recording.signals))
    hose = recording.signals["hose_pressure"]
    spoilt.signals["hose_pressure"] = replace(hose, values=np.where(hose.time > 7.6, 2e7, hose.values))
    fits = [
        fit(
            EstimationProblem([prepare(r, tz17(), held_out=last_part(r, 0.25))], [machine_unknown(tz17(), SA)]),
            iterations=3,
        )
        for r in (recording, spoilt)
    ]
    assert fits[0].values == pytest.approx(fits[1].values, rel=1e-9)


def test_two_numbers_of_which_only_the_product_acts_are_told_together_only() -> None:
    pair = [Unknown(name, "", 1.0, 0.3, 0.1, 10.0, True, factor_of=(SA,)) for name in ("one factor", "another factor")]
    twice = EstimationProblem([prepare(recorded(tz17(), 7.0), tz17())], pair)
    known = uncertainty(twice, fit(twice, iterations=3))
    assert known.partners(0) == [1]
    assert known.shrinkage == pytest.approx([0.707, 0.707], abs=0.02)


def test_a_bound_is_not_crossed() -> None:
    held = replace(machine_unknown(wrong(**OFF), SA, widen=3.0), low=1.1 * number(tz17(), SA))
    found = fit(EstimationProblem([prepare(recorded(tz17(), 7.0), wrong(**OFF))], [held]), iterations=8)
    assert found.values[0] == pytest.approx(held.low)


def test_refinement_fits_what_is_excited_and_predicts_what_it_has_not_seen() -> None:
    names = (SA, SB, TB, FRICTION, "fluid.beta")
    found = refine([recorded(tz17(), 16.0)], wrong(**OFF), unknowns=names)
    assert {e.key for e in found.estimates} >= {SA, SB}
    for e in found.estimates:
        assert e.value == pytest.approx(number(tz17(), e.key), rel=0.1)
        assert found.machine.parameters[e.key].value[0] == e.value
    check = found.held_out[0]
    assert check.after["angle"] < 0.2 * check.before["angle"]
    held = {n.parameter: n.why for n in found.not_determined}
    assert all(name in held["main_valve_orifices.A_0"] for name in (SA, SB))
    assert "pilot gain and spring cannot be separated" in held["pilot_valves.h.0"]
    assert "main_valve_spool.k" in held["pilot_valves.h.0"]


def test_where_what_is_wrong_is_not_among_the_unknowns_no_number_is_invented() -> None:
    found = refine([recorded(tz17(), 9.0)], wrong(fluid__beta=0.6), unknowns=(SA, FRICTION), starts=1)
    assert found.estimates == ()
    assert {n.parameter for n in found.not_determined} >= {SA, FRICTION}
    assert any("no values were found" in n.why for n in found.not_determined)


def test_orifices_are_nobody_s_where_the_pre_charges_are_not_told() -> None:
    names = [machine_unknown(tz17(), f"accumulators.{n}", least=0.3) for n in ("p_g0_1", "p_g0_2", "d_1", "d_2")]

    def known(half: float) -> Uncertainty:
        middle = np.array([u.nominal for u in names])
        share = np.array([half, half, 0.01, 0.01])
        return Uncertainty(
            tuple(names),
            np.full(4, 0.1),
            np.eye(4),
            middle * (1 - share),
            middle * (1 + share),
            np.ones(4),
            np.full(4, 0.1),
        )

    assert pairing_told(known(0.01), ())
    assert not pairing_told(known(0.3), ())
    assert not pairing_told(known(0.01), ("accumulators.p_g0_1",))


def test_two_accumulators_that_changed_places_are_found_from_another_start() -> None:
    charges = ("accumulators.p_g0_1", "accumulators.p_g0_2")
    machine = wrong(accumulators__p_g0_1=0.72, accumulators__p_g0_2=1.3)
    unknowns = [machine_unknown(machine, name, widen=3.0, least=0.3) for name in charges]
    recording = recorded(tz17(), 9.0)
    found, _, _ = search(EstimationProblem([prepare(recording, machine)], unknowns), 3, 0, lambda _: None)
    assert found.level <= 1.3
    assert sorted(found.values) == pytest.approx(sorted(number(tz17(), name) for name in charges), rel=0.1)


def test_a_recording_at_standstill_invents_no_number() -> None:
    resting = constant(8.0, angle=0.4, hose_pressure=6e6, rod_pressure=1e6)
    found = refine([resting], tz17(), unknowns=(SA, SB, FRICTION))
    assert found.estimates == ()
    assert found.machine is tz17()
    assert {n.parameter for n in found.not_determined} == {SA, SB, FRICTION}
    assert all("not enough excitation" in n.why for n in found.not_determined)


def test_a_recording_with_a_gap_in_motion_is_used_on_both_sides_of_it() -> None:
    damaged = load(BAGS / "damaged/gap_in_motion")
    experiment = prepare(damaged, wrong(**{SA.replace(".", "__"): 1.3}))
    assert [segment.rest is None for segment in experiment.segments] == [False, True]
    found = fit(
        EstimationProblem([experiment], [machine_unknown(wrong(**{SA.replace(".", "__"): 1.3}), SA, widen=3.0)])
    )
    assert found.values[0] == pytest.approx(number(tz17(), SA), rel=0.01)
    assert found.level < 1.3


def test_an_unknown_that_the_machine_does_not_have_is_named() -> None:
    with pytest.raises(MachineError, match="A_sa_mix: no such parameter; did you mean"):
        machine_unknown(tz17(), "main_valve_orifices.A_sa_mix")


def test_jobs_of_different_starts_and_inputs_are_the_single_runs() -> None:
    plant = Plant(tz17(), tz17().pose(4.59, 0.0))
    time, currents = work(3.0)
    starts = [plant.equilibrium(angle) for angle in (0.3, 0.6)]
    jobs = [Job(plant, plant.p, time, currents * f, time, x, 0.0) for x, f in zip(starts, (1.0, 0.9), strict=True)]
    for job, outputs in zip(jobs, run_jobs(jobs, tolerance=1e-5), strict=True):
        single = plant.run(job.input_time, job.currents, time, job.initial_state, tolerance=1e-5)
        assert np.array_equal(outputs, single.outputs)


def test_linearisation_is_the_derivative() -> None:
    plant = Plant(tz17(), tz17().pose(4.59, 0.0))
    time, currents = work(3.0)
    states = plant.run(time, currents, time, plant.equilibrium(0.4)).states[150:160]
    by_state, by_input = plant.linearise(states, currents[150:160])
    _, jacobian = plant.derivative(states[3], currents[153])
    assert np.array_equal(by_state[3], jacobian)
    up, down = (plant.derivative(states[3], currents[153] + np.array([0.0, d]))[0] for d in (1e-4, -1e-4))
    assert by_input[3][:, 1] == pytest.approx((up - down) / 2e-4, rel=1e-5, abs=1e-9)
