"""What is within the tolerances of machine, sensors and log is no physics left out."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_samples import joystick, simulated, tz17

from boom_diagnosis.absorbed import off_themselves
from boom_diagnosis.bag_samples import at_stamps, prepare
from boom_diagnosis.case import case_of
from boom_diagnosis.coordinates import coordinates, starts
from boom_diagnosis.fitting import Problem
from boom_diagnosis.freerun import Span, errors
from boom_diagnosis.search import Fitted
from boom_estimation.free_run import predict
from boom_model.catalogue import EFFECTS
from boom_recording.recording import Recording, Signal

Z = {"accumulators.p_g0_1": 0.5, "accumulators.p_g0_2": -0.25}


def moved(duration: float = 8.0) -> Recording:
    time = np.arange(round(duration / 0.01)) * 0.01
    return simulated(duration, joystick(time))


@pytest.fixture(scope="module")
def problem() -> Problem:
    bag = prepare(moved())
    assert bag is not None
    case = case_of(tz17(), [bag], [], 0)
    return case.problem(np.zeros(len(case.nuisances)), {}, 1.0)


def fitted(problem: Problem, effect: str, z: dict[str, float] | None = None, **numbers: float) -> Fitted:
    names = coordinates(EFFECTS[effect])
    at = np.array([(z or {}).get(n.name, 0.0) for n in problem.nuisances])
    values = {f"effects.{effect}.{row.name}": numbers.get(row.name, row.neutral) for row in EFFECTS[effect].parameters}
    point = problem.points([(at, values)])[0]
    return Fitted(effect, point, names, np.zeros((len(point.w), len(at) + len(names))), 0.0, (point.loss,))


def index(problem: Problem, name: str) -> int:
    return [n.name for n in problem.nuisances].index(name)


def test_a_factor_of_both_pre_charges_is_that_of_two_numbers(problem: Problem) -> None:
    f = fitted(problem, "accumulator_precharge", Z, r=1.02)
    gained, lost = off_themselves(problem, f)[:2]
    effects = {"effects.accumulator_precharge.r": 1.0, "effects.accumulator_precharge.r_2": 1.0}
    known = problem.points([(f.point.z, f.point.effects), (gained, effects)])
    assert known[1].w == pytest.approx(known[0].w, abs=1e-6)
    for name, z in Z.items():
        k = index(problem, name)
        assert lost[k] < z < gained[k]


def test_one_accumulator_that_lost_its_gas_leaves_the_other_number_where_it_is(problem: Problem) -> None:
    f = fitted(problem, "accumulator_precharge", r=0.5, r_2=2.0)
    first, second = (index(problem, name) for name in Z)
    z = off_themselves(problem, f)[0]
    assert z[second] == 0.0
    assert problem.nuisances[first].value(1.0, z[first]) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("effect", "numbers", "within"),
    [
        ("accumulator_precharge", {"r": 1.03}, True),
        ("accumulator_precharge", {"r": 0.7}, False),
        ("accumulator_precharge", {"r": 0.7, "r_2": 1 / 0.7}, False),
        ("pressure_delay", {"T": 0.003}, True),
        ("pressure_delay", {"T": 0.03}, False),
        ("pressure_bias", {"hose": 5e4, "rod": -8e4}, True),
        ("pressure_bias", {"hose": 5e4, "rod": -3e5}, False),
        ("rate_scale", {"a": 1.005}, True),
        ("rate_scale", {"a": 1.05}, False),
    ],
)
def test_tolerances_predict_what_an_effect_does_as_far_as_they_go(
    problem: Problem, effect: str, numbers: dict[str, float], within: bool
) -> None:
    f = fitted(problem, effect, **numbers)
    low, high = problem.limits
    wanted = off_themselves(problem, f)
    same = min(
        problem.points([(np.clip(z, low, high), {}) for z in wanted]),
        key=lambda p: float(np.abs(p.w - f.point.w).max()),
    )
    nominal = problem.points([(np.zeros(len(low)), {})])[0]
    left, done = (float(np.abs(at.w - f.point.w).max()) for at in (same, nominal))
    assert (left < 0.02 * done) == within


def test_what_no_tolerance_does_has_no_start_there(problem: Problem) -> None:
    assert off_themselves(problem, fitted(problem, "piston_leakage", c=1e-13)) == []


def test_one_of_two_accumulators_is_a_start_of_the_search() -> None:
    found = [tuple(point.values()) for point in starts(EFFECTS["accumulator_precharge"], 60.0)]
    assert (0.7, 1.0) in found and (1.0, 0.7) in found and (0.7, 1.0 / 0.7) in found


def test_a_channel_that_is_late_is_read_at_its_stamps() -> None:
    time = np.arange(0.0, 2.0, 0.01)
    stamps = np.round(1e9 * time).astype(np.int64)
    late = Signal("x", "Pa", "t", stamps, time, np.sin(3.0 * (time - 0.004)), np.ones(len(time), dtype=bool))
    inside = slice(2, -2)
    assert at_stamps(late, 0.004)[inside] == pytest.approx(np.sin(3.0 * time)[inside], abs=1e-4)
    assert at_stamps(late, 0.0) == pytest.approx(late.values)
    assert (
        len(at_stamps(replace(late, valid=np.zeros(len(time), dtype=bool)), 0.004)) == 0
    )  # a sensor that is not there


def clocked(recording: Recording, **late: float) -> Recording:
    """The same log, channels so late [s]."""
    signals = dict(recording.signals)
    for name, by in late.items():
        s = signals[name]
        signals[name] = replace(s, values=np.interp(s.time - by, s.time, s.values))
    return replace(recording, signals=signals)


def test_latencies_of_the_channels_are_told_and_free_runs_are_compared_at_the_stamps() -> None:
    late = {"hose_pressure": 0.004, "rod_pressure": -0.003}
    made = clocked(moved(), **late)
    bag = prepare(made)
    assert bag is not None
    case = case_of(tz17(), [bag], [], 0)
    problem = case.problem(np.zeros(len(case.nuisances)), {}, 1.0)
    start = problem.points([(np.zeros(len(case.nuisances)), {})])[0]
    point, _ = problem.fit(start, problem.nuisance_jacobian(start))
    told = problem.values(point.z, {})
    for name, by in late.items():
        assert told[f"clocks.{name}"] == pytest.approx(by, abs=5e-4)
    run = predict(made, tz17(), "full")
    clocks = (0.0, 0.0, late["hose_pressure"], late["rod_pressure"])
    blind, seeing = (errors(Span(made, 0.0, 8.0, 0.0, c), run) for c in ((), clocks))
    assert seeing[2] < 0.5 * blind[2] and seeing[3] < 0.5 * blind[3]
