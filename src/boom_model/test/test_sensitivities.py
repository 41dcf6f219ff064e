"""Derivatives of an observer's innovations by sensitivities: those of differences with small steps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from boom_model.machine import Machine
from boom_model.observer import Job, Samples, observe
from boom_model.plant import Plant
from boom_model.sensitivities import Directions, sensitivities, sensitivities_of

SENSORS = np.array([3.8e-4, 1.5e-3, 2e4, 2e4])
NUMBERS = (
    "fluid.beta", "main_valve_spool.k", "main_valve_orifices.x0", "cylinder.A_a", "friction.tau_C_pos", "pose.Sx",
    "accumulators.p_g0_1", "effects.pressure_bias.hose_gain", "effects.piston_leakage.c",
)  # fmt: skip
FINE = 1e-9


@pytest.fixture(scope="module")
def job(joystick: Any, tz17: Machine) -> Job:
    """3 s of joystick work, noise included, some samples missing, of a machine that leaks a little."""
    active = {"pressure_bias": {"hose_gain": 1.02}, "piston_leakage": {"c": 1e-13}}
    plant = Plant(tz17.with_effects(active), tz17.pose(0.28, 2.2))
    time, currents = joystick(3.0, 2)
    start = plant.equilibrium(0.45)
    run = plant.run(time, currents, time[1:], start, start=0.0)
    measured = run.outputs + SENSORS * np.random.default_rng(1).standard_normal(run.outputs.shape)
    measured[::7, 1] = np.nan
    n = len(time) - 1
    gain = np.zeros((n, len(plant.state_names), 4))
    for j, name in enumerate(("angle", "rate", "hose_pressure", "rod_pressure")):
        gain[:, plant.state_names.index(name), j] = 0.2
    samples = Samples(time, np.full((n, 4), 0.7), measured, time[:-1], currents[:-1])
    return plant, samples, start, gain, plant.p.copy()


def central(job: Job, moved: Any, step: float) -> Any:
    """(n, NY) derivative by a difference to both sides; ``moved``: (job, by how much) -> job."""
    there, back = (observe_exactly(moved(job, side * step)) for side in (1.0, -1.0))
    return np.nan_to_num(there - back) / (2.0 * step)


def observe_exactly(job: Job) -> Any:
    plant, samples, x, gain, p = job
    return observe(plant, samples, x, gain, parameters=p, tolerance=FINE).innovations


def share_of_error(found: Any, expected: Any) -> float:
    return float(np.linalg.norm((found - expected) / SENSORS) / np.linalg.norm(expected / SENSORS))


def test_of_the_numbers_and_the_initial_state_they_are_those_of_small_differences(job: Job) -> None:
    plant, _, _, _, p = job
    numbers = np.zeros((len(p), len(NUMBERS)))
    for k, name in enumerate(NUMBERS):
        i = plant.parameter_names.index(name)
        numbers[i, k] = p[i]
    states = np.diag(plant.scale)[:, [0, 2, 3]]  # not the rate: friction has a kink where the boom stands
    along = Directions(
        np.hstack((numbers, np.zeros((len(p), 3)))), np.hstack((np.zeros((len(states), len(NUMBERS))), states))
    )
    observed, found = sensitivities(job, along, tolerance=1e-7)
    assert observed.complete and found.shape == (299, 4, len(NUMBERS) + 3)

    def moved(k: int) -> Any:
        return lambda j, by: (j[0], j[1], j[2] + by * along.state[:, k], j[3], j[4] + by * along.numbers[:, k])

    for k, name in enumerate((*NUMBERS, "angle", "head pressure", "rod pressure")):
        assert share_of_error(found[..., k], central(job, moved(k), 1e-4)) < 0.02, name


def test_of_the_inputs_and_of_when_samples_were_taken_they_are_those_of_small_differences(job: Job) -> None:
    plant, samples, x, gain, p = job
    rng = np.random.default_rng(5)
    inputs = 0.01 * rng.standard_normal(samples.currents.shape)
    share = np.zeros_like(samples.share)
    share[:, 2] = 1.0
    along = Directions(
        np.zeros((len(p), 2)), np.zeros((len(x), 2)), moved=0, inputs=inputs, timed=(-1, -1, 1, -1), share=share,
        measured=np.zeros_like(share),
    )  # fmt: skip
    _, found = sensitivities(job, along, tolerance=1e-7)

    def driven(j: Job, by: float) -> Job:
        return plant, replace(samples, currents=samples.currents + by * inputs), x, gain, p

    def later(j: Job, by: float) -> Job:
        return plant, replace(samples, share=samples.share + by * share), x, gain, p

    assert share_of_error(found[..., 0], central(job, driven, 1e-3)) < 0.03
    assert share_of_error(found[..., 1], central(job, later, 1e-3)) < 0.02


def test_what_was_not_measured_has_none_and_several_passes_are_those_one_by_one(job: Job) -> None:
    x, p = job[2], job[4]
    numbers = np.zeros((len(p), 2))
    numbers[job[0].parameter_names.index("fluid.beta"), 0] = 1e8
    along = Directions(numbers, np.zeros((len(x), 2)))
    observed, found = sensitivities(job, along)
    assert (found[::7, 1] == 0.0).all() and (found[..., 1] == 0.0).all() and np.abs(found[..., 0]).max() > 0.0
    assert np.array_equal(observed.innovations, observe(*job[:4], parameters=p).innovations, equal_nan=True)
    for again, derivatives in sensitivities_of([(job, along), (job, along)]):
        assert np.array_equal(derivatives, found) and again.complete


def test_of_an_effect_that_does_nothing_yet_they_are_those_of_a_small_one(job: Job) -> None:
    """Code for what does nothing is left out, but not where its derivative is asked for."""
    plant, samples, start, gain, p = job
    k = plant.parameter_names.index("effects.piston_leakage.c")
    still = p.copy()
    still[k] = 0.0
    numbers = np.zeros((len(p), 1))
    numbers[k] = 1e-13
    _, found = sensitivities((plant, samples, start, gain, still), Directions(numbers, np.zeros((len(start), 1))))
    small = still.copy()
    small[k] = 1e-15
    expected = [observe_exactly((plant, samples, start, gain, numbers_)) for numbers_ in (small, still)]
    assert share_of_error(found[:, :, 0], np.nan_to_num(expected[0] - expected[1]) * 100.0) < 0.02
