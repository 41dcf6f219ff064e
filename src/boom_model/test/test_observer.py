"""Passes of the observer side by side: the same as one after the other, whatever the others in the register do."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from boom_model.codegen.compiled import LANES
from boom_model.machine import Machine
from boom_model.observer import Job, Observed, Samples, observe, observe_all, observe_groups, output_jacobian, riccati
from boom_model.plant import Plant

SENSORS = np.array([3.8e-4, 1.5e-3, 2e4, 2e4])  # angle, rate, pressures: what the machine's sensors resolve
Make = Callable[..., Job]


@pytest.fixture(scope="module")
def job(joystick: Any) -> Make:
    """A pass over 6 s of joystick work with some numbers of the machine off by a factor."""
    time, currents = joystick(6.0, 2)
    made: dict[int, tuple[Plant, Samples, Any]] = {}

    def make(plant: Plant, **factors: float) -> Job:
        if id(plant) not in made:
            start = plant.equilibrium(0.45)
            run = plant.run(time, currents, time[1:], start, start=0.0)
            noise = SENSORS * np.random.default_rng(1).standard_normal(run.outputs.shape)
            n = len(time) - 1
            gain = np.zeros((n, len(plant.state_names), 4))
            for j, name in enumerate(("angle", "rate", "hose_pressure", "rod_pressure")):
                gain[:, plant.state_names.index(name), j] = 0.2
            samples = Samples(time, np.ones((n, 4)), run.outputs + noise, time[:-1], currents[:-1])
            made[id(plant)] = plant, samples, gain  # the plant as well, so that no other one gets its id
        _, samples, gain = made[id(plant)]
        p = plant.p.copy()
        for name, factor in factors.items():
            p[plant.parameter_names.index(name.replace("__", "."))] *= factor
        return plant, samples, plant.equilibrium(0.45), gain, p

    return make


def alone(job: Job, tolerance: float = 1e-5) -> Observed:
    plant, samples, x, gain, p = job
    return observe(plant, samples, x, gain, parameters=p, tolerance=tolerance)


def different(job: Make, plant: Plant) -> list[Job]:
    return [
        job(plant), job(plant, fluid__beta=0.8), job(plant, main_valve_spool__k=1.1), job(plant, cylinder__A_b=0.95)
    ]  # fmt: skip


def test_passes_side_by_side_are_those_one_after_the_other(folded: Plant, job: Make) -> None:
    jobs = different(job, folded)
    assert len(jobs) == LANES
    for together, one in zip(observe_all(jobs, tolerance=1e-8), jobs, strict=True):
        exact = alone(one, 1e-8)
        assert together.complete
        assert np.abs(together.innovations - exact.innovations).max(axis=0) / SENSORS == pytest.approx(0.0, abs=1e-4)
        assert together.states.shape == exact.states.shape


def test_passes_side_by_side_have_their_own_samples_and_currents(folded: Plant, job: Make) -> None:
    jobs = different(job, folded)
    for k, (plant, samples, x, gain, p) in enumerate(jobs):
        measured = samples.measured.copy()
        measured[k::LANES, k % measured.shape[1]] = np.nan
        own = replace(
            samples, share=samples.share * (1.0 - 0.1 * k), measured=measured, currents=samples.currents - 2e-3 * k
        )
        jobs[k] = (plant, own, x, gain, p)
    for together, one in zip(observe_all(jobs, tolerance=1e-8), jobs, strict=True):
        exact = alone(one, 1e-8)
        assert together.complete
        assert np.array_equal(np.isnan(together.innovations), np.isnan(one[1].measured))
        apart = np.nanmax(np.abs(together.innovations - exact.innovations), axis=0) / SENSORS
        assert apart == pytest.approx(0.0, abs=1e-4)


def test_the_place_in_the_register_does_not_matter(folded: Plant, job: Make) -> None:
    jobs = different(job, folded)
    forward, backward = observe_groups([jobs, jobs[::-1]])
    for a, b in zip(forward, backward[::-1], strict=True):
        assert np.array_equal(a.innovations, b.innovations)


@pytest.mark.parametrize("place", range(LANES))
def test_a_pass_that_fails_leaves_the_others_as_they_are(folded: Plant, job: Make, place: int) -> None:
    jobs = different(job, folded)
    jobs[place] = job(folded, fluid__beta=float("nan"))
    seen = observe_groups([jobs])[0]
    assert [o.complete for o in seen] == [k != place for k in range(LANES)]
    for k, (o, one) in enumerate(zip(seen, jobs, strict=True)):
        if k != place:
            assert np.array_equal(o.innovations, alone(one).innovations)


@pytest.mark.parametrize("together", [1, LANES])
def test_a_state_that_would_leave_its_range_is_held_and_the_pass_goes_on(
    folded: Plant, job: Make, together: int
) -> None:
    narrow = copy(folded)
    narrow.maximum = folded.maximum.copy()
    rod, highest = folded.state_names.index("rod_pressure"), 2e6
    narrow.maximum[rod] = highest
    _, samples, x, gain, p = job(folded)
    assert alone(job(folded)).states[:, rod].max() > highest
    for seen in observe_groups([[(narrow, samples, x, gain, p)] * together])[0]:
        assert seen.complete and np.isfinite(seen.innovations).all()
        assert seen.states[:, rod].max() == highest


def test_passes_of_several_plants_come_back_in_their_order(folded: Plant, job: Make, tz17: Machine) -> None:
    log = Plant(tz17, tz17.pose(0.28, 2.8))
    jobs = [job(folded), job(log), job(folded, fluid__beta=0.8), job(log, fluid__beta=0.8), job(folded)]
    for o, one in zip(observe_all(jobs), jobs, strict=True):
        assert np.abs(o.innovations - alone(one).innovations).max(axis=0) / SENSORS == pytest.approx(0.0, abs=0.5)


def test_every_effect_of_the_catalogue_is_the_same_side_by_side(tz17: Machine, possible: Any, job: Make) -> None:
    mild = {e.id: {r.name: 0.9 * r.neutral + 0.1 * r.low for r in e.parameters} for e in possible}
    plant = Plant(replace(tz17, effects=mild), tz17.pose(4.59, 0.0))
    one = job(plant)
    exact = alone(one)
    for o in observe_groups([[one] * LANES])[0]:
        assert o.complete
        assert np.abs(o.innovations - exact.innovations).max(axis=0) / SENSORS == pytest.approx(0.0, abs=0.02)


def test_effects_that_do_nothing_in_one_pass_act_in_another_beside_it(tz17: Machine, possible: Any, job: Make) -> None:
    """What no lane needs is not computed; what one needs does not reach the others."""
    stateless = [e for e in possible if not e.stateful(())]
    mild = {e.id: {r.name: 0.9 * r.neutral + 0.1 * r.low for r in e.parameters} for e in stateless}
    nothing = {e.id: {r.name: r.neutral for r in e.parameters} for e in stateless}
    third = {**nothing, **{e.id: mild[e.id] for e in stateless[::3]}}
    acting = [Plant(replace(tz17, effects=e), tz17.pose(4.59, 0.0)).p for e in (mild, nothing, third)]
    plant = Plant(replace(tz17, effects=mild), tz17.pose(4.59, 0.0))
    passes = [(*job(plant)[:4], p) for p in (acting[0], acting[1], acting[2], acting[1])]
    for group in (passes, [passes[1]] * LANES):
        for o, one in zip(observe_groups([group], tolerance=1e-8)[0], group, strict=True):
            by_itself = observe(*one[:4], parameters=one[4], tolerance=1e-8)
            off = np.abs(o.innovations - by_itself.innovations).max(axis=0) / SENSORS
            assert off == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("seed", range(20))
def test_covariances_of_innovations_can_be_decomposed_wherever_the_state_grows_by_orders(
    folded: Plant, seed: int
) -> None:
    """In a void a transition grows by 1e9: rounding costs the covariance its positivity, and gains are wanted all the same."""
    rng, nx = np.random.default_rng(seed), len(folded.state_names)
    transition = np.tile(0.9 * np.eye(nx), (60, 1, 1))
    transition[20:24] += 10.0 ** rng.uniform(3.0, 9.0) * np.outer(rng.standard_normal(nx), rng.standard_normal(nx))
    output = output_jacobian(folded, folded.equilibrium(0.4))
    scale = np.abs(output).max(axis=1)
    variance = np.tile((1e-3 * scale) ** 2, (60, 1))
    process = np.tile(1e-6 * np.eye(nx), (60, 1, 1))
    valid = np.ones(variance.shape, dtype=bool)
    gain, innovation = riccati(folded, transition, process, output, valid, variance, np.eye(nx))
    assert np.isfinite(gain).all()
    np.linalg.cholesky(innovation)
