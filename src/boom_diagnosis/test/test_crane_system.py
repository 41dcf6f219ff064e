"""The crane as the estimation takes it: its derivatives are those of the compiled observer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.crane_system import CraneSystem, catalogue_effects, tolerance_numbers
from boom_estimation.linearising import HypothesisProblem
from boom_estimation.numbers import SizePriors
from boom_estimation.posterior import fit
from boom_estimation.recursion import LinearisedPass, difference_columns
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_recording.recording import Recording

BAG = Path(__file__).resolve().parents[3] / "bags" / "healthy" / "extended"
SECONDS = 12.0


@pytest.fixture(scope="module")
def tz17() -> Machine:
    return load_machine("tz17")


@pytest.fixture(scope="module")
def system(tz17: Machine) -> CraneSystem:
    bag = prepare(_beginning(load(BAG)), aligned=True)
    assert bag is not None
    return CraneSystem(tz17, [bag])


@pytest.fixture(scope="module")
def linearised(system: CraneSystem) -> LinearisedPass:
    q = len(system.places)
    sizes = SizePriors(np.full(q, np.nan), np.full(q, np.nan), np.ones(q))
    numbers = tolerance_numbers(system.nuisances)
    problem = HypothesisProblem(system, (), numbers, sizes)
    return fit(problem, np.zeros(len(numbers)), np.full(q, np.log(0.02)), turns=0).linearised[0]


def _beginning(recording: Recording) -> Recording:
    return replace(recording, duration=SECONDS)


def test_every_equation_of_the_tz17_may_have_a_discrepancy(system: CraneSystem) -> None:
    assert system.places == ("head_flow", "hose_flow", "rod_flow", "spool", "torque")


def test_columns_hold_for_an_observer_with_other_gains(system: CraneSystem, linearised: LinearisedPass) -> None:
    """Taken with one gain, they say what numbers change in the innovations of another, within 10 %."""
    model, numbers = system.models(())[0], tolerance_numbers(system.nuisances)
    there = linearised.run(np.full(len(system.places), 0.03), np.zeros(len(numbers)), by=True, gain=True)
    assert there.by is not None and there.gain is not None
    strength = np.linalg.norm(there.by[model.counted], axis=(0, 1))
    inverse = np.linalg.inv(there.factor)
    for j in np.argsort(-strength)[:6]:
        ((base, moved),) = model.beside({}, [{numbers[j].name: 0.05}], there.gain)
        change = (moved.innovations - base.innovations) / 0.05
        passes = (inverse @ change[:, :, None])[:, :, 0][model.counted]
        error = np.linalg.norm(there.by[:, :, j][model.counted] - passes) / np.linalg.norm(passes)
        assert error < 0.1, numbers[j].name


def test_a_late_pressure_is_told_from_the_slope_and_not_from_the_noise_of_shifted_samples(
    system: CraneSystem, linearised: LinearisedPass
) -> None:
    model = system.models(())[0]
    ((base, moved),) = model.beside({}, [{"effects.pressure_delay.T": 1e-3}], linearised.pass_gain)
    assert moved.beside is not None and np.array_equal(moved.innovations, base.innovations)
    change = moved.beside[model.counted]
    assert np.abs(change[:, :2]).max() == 0.0
    assert 0.0 < np.abs(change[:, 2:]).max() < 2e5  # 1 ms of at most 2000 bar/s


def test_what_late_pressures_change_in_the_innovations_is_no_change_of_the_states(
    system: CraneSystem, linearised: LinearisedPass
) -> None:
    model, gain = system.models(())[0], linearised.pass_gain
    pairs = model.beside({}, [{"effects.pressure_delay.T": 1e-3}], gain)
    found = difference_columns(
        model.name, pairs, np.array([1e-3]), gain, linearised.pass_transition, linearised.pass_output
    )
    assert np.abs(found.ends).max() == 0.0
    assert pairs[0][1].beside is not None
    assert found.outputs[:, :, 0] == pytest.approx(-1e3 * pairs[0][1].beside * linearised.along.valid)


def test_each_effect_that_the_machine_can_have_is_searched_with_starts_inside_its_range(tz17: Machine) -> None:
    for effect in catalogue_effects(tz17, 60.0, -4.0):
        assert effect.starts, effect.id
        for start in effect.starts:
            for number in effect.numbers:
                inner = number.inner(start[number.name])
                assert number.low - 1e-9 <= inner <= number.high + 1e-9, (effect.id, number.name)
