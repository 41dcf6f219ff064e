"""What earns an effect its place, on a case whose fits and free runs are given."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_samples import tz17
from rounds_cases import SAMPLES, point, weighed

from boom_diagnosis import earning, proof
from boom_diagnosis.case import Case
from boom_diagnosis.document import Estimate
from boom_diagnosis.fitting import Point
from boom_diagnosis.hypotheses import Round
from boom_diagnosis.nuisances import tolerances


@pytest.fixture
def free_runs(monkeypatch: pytest.MonkeyPatch) -> dict[float, float]:
    """Loss of a fit -> factor by which its free runs err more."""
    factors: dict[float, float] = {}
    monkeypatch.setattr(earning, "settle", lambda case, k, problem, at, *rest: at)
    monkeypatch.setattr(earning, "worsening", lambda case, before, after: factors[after.loss])
    return factors


def test_an_effect_that_free_runs_disprove_gives_way_to_the_next(case: Any, free_runs: dict[float, float]) -> None:
    first, second = weighed("flow_force", 100.0, 90.0, 1000.0), weighed("spring_rate", 95.0, 90.0, 1000.0)
    case.weighed[0] = [first, second]
    free_runs |= {first.fitted.point.loss: 2.3, second.fitted.point.loss: 0.6}
    assert earning.take(case)
    assert (case.taken, case.disproved, case.weighed[0]) == ([second], [first], [second])


def test_what_is_gained_on_data_held_out_is_asked_for_there_per_innovation_too(
    case: Any, free_runs: dict[float, float]
) -> None:
    """Two models of one machine differ by so much in each recording, and an effect takes it up in both."""
    slight = weighed("flow_force", 40.0, 40.0, 100.0)
    free_runs[slight.fitted.point.loss] = 0.9
    case.weighed[0] = [slight]
    assert earning.take(case)
    case.taken, case.trained = [], case.trained[:1]
    case.proving = [SimpleNamespace(counted=np.ones((SAMPLES // 4, 4), dtype=bool))]
    case.weighed[0] = [slight]
    assert not earning.take(case)


@pytest.mark.parametrize(("other", "factor", "first"), [(900.0, 0.5, False), (900.0, 1.05, True), (500.0, 0.5, True)])
def test_worse_free_runs_are_borne_with_only_where_no_other_effect_explains_most_without(
    case: Any, free_runs: dict[float, float], other: float, factor: float, first: bool
) -> None:
    worse, rival = (
        weighed("presliding_friction", 700.0, 250.0, 1000.0),
        weighed("payload_change", other / 2, other / 2, 1000.0),
    )
    case.weighed[0] = [worse, rival]
    free_runs |= {worse.fitted.point.loss: 2.3, rival.fitted.point.loss: factor}
    assert earning.take(case)
    assert case.taken == [worse if first else rival]


@pytest.mark.parametrize(("gain", "taken"), [(-20.0, True), (-100.0, False)])
def test_an_effect_that_costs_on_the_data_fitted_what_it_gains_elsewhere_is_not_taken(
    case: Any, free_runs: dict[float, float], gain: float, taken: bool
) -> None:
    """Chance alone makes 27 nats of 10000 samples."""
    found = weighed("presliding_friction", gain, 900.0, 1000.0)
    case.weighed[0], free_runs[found.fitted.point.loss] = [found], 0.5
    assert earning.take(case) is taken
    assert case.disproved == ([] if taken else [found])


def test_a_large_first_effect_may_leave_free_runs_a_little_worse_and_a_small_one_not(
    case: Any, free_runs: dict[float, float]
) -> None:
    small, large = weighed("payload", 100.0, 90.0, 1000.0), weighed("payload", 300.0, 200.0, 1000.0)
    free_runs |= {small.fitted.point.loss: 1.2, large.fitted.point.loss: 1.2}
    case.weighed[0] = [small]
    assert not earning.take(case)
    case.weighed[0] = [large]
    assert earning.take(case)


@pytest.mark.parametrize(("rest", "taken"), [(800.0, True), (3000.0, False), (400.0, False)])
def test_a_second_effect_must_gain_a_share_of_the_first_or_explain_most_of_a_clear_rest(
    case: Any, free_runs: dict[float, float], rest: float, taken: bool
) -> None:
    """2 % of 50000 nats are 1000; 600 nats are most of 800, not of 3000, and 400 on 10000 samples are no clear rest."""
    case.taken = [weighed("return_line_pressure", 30000.0, 20000.0, 51000.0)]
    second = weighed("position_dependent_friction", 300.0, 300.0 if rest > 500.0 else 50.0, rest)
    case.weighed = [case.taken, [second]]
    case.rounds.append(SimpleNamespace(base=point(rest), problem=None))
    case.trained.append(point(rest))
    free_runs[second.fitted.point.loss] = 0.5
    assert earning.take(case) is taken


@pytest.mark.parametrize(("gain", "factor"), [(100.0, earning.WORSE), (400.0, 1.5), (700.0, 3.0)])
def test_the_more_a_first_effect_explains_the_worse_it_may_leave_free_runs(
    case: Any, gain: float, factor: float
) -> None:
    assert earning._bearable(case, weighed("payload", gain / 2, gain / 2, 1000.0)) == factor


def test_an_effect_whose_size_cannot_be_told_from_none_may_not_leave_free_runs_worse(
    monkeypatch: pytest.MonkeyPatch, case: Any
) -> None:
    def said(low: float) -> None:
        mass = Estimate(4.0, "kg", (low, 8.5))
        monkeypatch.setattr(earning, "estimates", lambda *given: {"effects.payload.mass": mass})

    best = weighed("payload", 350.0, 350.0, 1000.0)
    said(-0.5)
    assert earning._bearable(case, best) == earning.LATER
    said(0.5)
    assert earning._bearable(case, best) > earning.WORSE


@pytest.mark.parametrize(("gain", "rest", "factor"), [(700.0, 1000.0, 1.0), (900.0, 1000.0, 1.5), (450.0, 480.0, 1.0)])
def test_a_further_effect_may_leave_free_runs_worse_where_it_explains_nearly_all_of_a_clear_rest(
    case: Any, gain: float, rest: float, factor: float
) -> None:
    """500 nats on 10000 samples are a clear rest."""
    case.rounds = [SimpleNamespace(base=point(rest), problem=None)]
    case.taken = [weighed("pilot_lag", 300.0, 300.0, 2000.0)]
    assert earning._bearable(case, weighed("payload", gain / 2, gain / 2, rest)) == factor


def test_of_recordings_held_out_the_gain_on_those_fitted_is_compared_with_what_they_begin_with(case: Any) -> None:
    best = weighed("payload", 200.0, 700.0, 1000.0)
    assert earning._bearable(case, best) > earning.WORSE
    case.proving = [object()]
    assert earning._bearable(case, best) == earning.WORSE


@pytest.mark.parametrize(
    ("before", "after", "factor", "worst"),
    [
        ((0.1, 0.1, 0.1, 0.1), (0.2, 0.2, 0.05, 0.1), 2.0 ** (1 / 4), 2.0),
        ((0.1, 0.1, 0.1, np.nan), (0.05, 0.12, 0.01, np.nan), 0.06 ** (1 / 3), 1.2),
        ((0.1, 0.1, 0.1, 0.1), (np.nan,) * 4, proof.ENDED, proof.ENDED),
        ((np.nan,) * 4, (0.3,) * 4, 1 / proof.ENDED, 1 / proof.ENDED),
        ((np.nan,) * 4, (np.nan,) * 4, 1.0, 1.0),
    ],
)
def test_a_free_run_that_ends_early_counts_as_worse(
    monkeypatch: pytest.MonkeyPatch, case: Any, before: Any, after: Any, factor: float, worst: float
) -> None:
    errors = iter([before, after] * 2)
    monkeypatch.setattr(proof, "in_parallel", lambda function, items: [function(item) for item in items])
    case.machine = case.pose = None
    case.others, case.seed = {}, 0
    monkeypatch.setattr(Case, "numbers", lambda self, z, effects: {})
    monkeypatch.setattr(Case, "everywhere", lambda self, at: at.z)
    monkeypatch.setattr(proof, "found_machine", lambda *given: None)
    monkeypatch.setattr(proof, "placed", lambda *given: None)
    monkeypatch.setattr(proof, "free_run", lambda *given: None)
    monkeypatch.setattr(proof, "errors", lambda *given: next(errors))
    monkeypatch.setattr(proof, "noise_floor", lambda *given: (1e-6,) * 4)
    monkeypatch.setattr(proof, "spans_of", lambda case: SimpleNamespace(judged=[SimpleNamespace(recording=None)]))
    assert proof.worsening(case, point(0.0), point(0.0)) == pytest.approx(factor)
    assert proof.worst_channel(case, point(0.0), point(0.0)) == pytest.approx(worst)


@pytest.mark.parametrize(
    ("nominal", "moved", "factor", "kept"),
    [(9000.0, 100.0, 1.6, "moved"), (9000.0, 1000.0, 1.6, "nominal"), (9000.0, 1000.0, 1.0, "moved"),
     (-100.0, -200.0, 1.6, "nominal")],
)  # fmt: skip
def test_moved_tolerances_that_worsen_free_runs_stay_where_nominal_ones_leave_fifty_times_as_much(
    monkeypatch: pytest.MonkeyPatch, case: Any, nominal: float, moved: float, factor: float, kept: str
) -> None:
    """``nominal``, ``moved``: nats that are left; 500 are a clear rest."""
    points = {"nominal": point(nominal), "moved": point(moved)}
    problem: Any = SimpleNamespace(fit_nominal=lambda effects, names: points["nominal"])
    case.proving = [object()]
    monkeypatch.setattr(earning, "worsening", lambda *given: factor)
    assert earning.settle(case, 0, problem, points["moved"], np.zeros((SAMPLES, 1)), ()) is points[kept]
    assert case.spared == ({0: points["nominal"]} if kept == "nominal" else {})


@pytest.fixture
def moving(monkeypatch: pytest.MonkeyPatch, case: Any) -> Any:
    """The case in a recording of 30 s that moves from 1.5 s on; whatever is fitted gains 800 nats."""
    rate = np.where(np.arange(3000) > 150, 0.1, 0.0)
    case.bags = [SimpleNamespace(time=np.arange(3000) * 0.01, moving=lambda: rate > 0.02)]
    case.pose = SimpleNamespace(load=0.0)
    monkeypatch.setattr(
        earning, "_split", lambda case, hypotheses, names: [(500.0, 500.0)] + [(100.0, 100.0)] * (len(names) - 1)
    )
    return case


@pytest.mark.parametrize(("onset", "kept"), [(0.5, ["payload"]), (20.0, ["payload_change", "payload"])])
def test_a_load_that_comes_before_the_boom_has_moved_was_there_all_along(
    moving: Any, onset: float, kept: list[str]
) -> None:
    change, load = (
        weighed("payload_change", 300.0, 300.0, 1000.0).fitted,
        weighed("payload", 290.0, 300.0, 1000.0).fitted,
    )
    change.point.effects.update({"effects.payload_change.mass": 50.0, "effects.payload_change.t_g": onset})
    load.point.effects["effects.payload.mass"] = 5.0
    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (change, load), {}, Any)
    assert [w.fitted.effect for w in earning.weigh(moving, found)] == kept


@pytest.mark.parametrize(("onset", "kept"), [(0.5, ["payload"]), (20.0, ["payload_change"])])
def test_a_load_that_was_there_all_along_is_fitted_where_only_one_that_comes_so_early_was(
    moving: Any, onset: float, kept: list[str]
) -> None:
    change = weighed("payload_change", 300.0, 300.0, 1000.0).fitted
    change.point.effects.update({"effects.payload_change.mass": 50.0, "effects.payload_change.t_g": onset})

    class Fits:
        def points(self, wanted: Any) -> list[Point]:
            return [replace(point(500.0), z=z, effects=dict(e)) for z, e in wanted]

        def fit(self, at: Point, columns: np.ndarray, names: Any) -> tuple[Point, np.ndarray]:
            assert [c.name for c in names] == list(at.effects) == ["effects.payload.mass"]
            return replace(point(410.0), effects={"effects.payload.mass": 4.8}), np.zeros((SAMPLES, 2))

    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (change,), {}, Fits())  # type: ignore[arg-type]
    assert [w.fitted.effect for w in earning.weigh(moving, found)] == kept


@pytest.mark.parametrize(
    ("effect", "value", "kept"),
    [("hose_burst_valve_setting.r", 1.01, False), ("hose_burst_valve_setting.r", 0.97, True),
     ("pilot_lag.r", 0.99, False), ("pilot_lag.line", 0.003, False), ("pilot_lag.line", 0.006, True),
     ("rate_scale.a", 1.01, True), ("payload.mass", 3.0, True),
     ("pressure_delay.T", 0.005, False), ("pressure_delay.T", 0.012, True)],
)  # fmt: skip
def test_a_factor_of_a_number_that_is_next_to_nothing_beside_its_tolerance_is_no_effect(
    monkeypatch: pytest.MonkeyPatch, case: Any, effect: str, value: float, kept: bool
) -> None:
    """Coefficients of the hose burst valve and of the pilot stage are known to 3 %: half of that is asked for beyond it."""
    case.nuisances, case.pose = tolerances(tz17(), tz17().pose(0.3, 1.3, 300.0)), SimpleNamespace(load=0.0)
    fitted = weighed(effect.split(".")[0], 50.0, 50.0, 1000.0).fitted
    fitted.point.effects[f"effects.{effect}"] = value
    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (fitted,), {}, Any)
    monkeypatch.setattr(earning, "_split", lambda case, hypotheses, names: [(500.0, 500.0), (450.0, 450.0)])
    assert [w.fitted for w in earning.weigh(case, found)] == ([fitted] if kept else [])


@pytest.mark.parametrize(("play", "noise"), [(1.9, True), (2.1, False)])
def test_a_play_that_swallows_no_more_than_the_noise_of_the_currents_is_none(
    case: Any, play: float, noise: bool
) -> None:
    """Of the TZ17's spool at half of its stroke 0.85 mA make 4e-4 of it: 2.6 per A, held for 10 ms behind a lag of 0.15 s."""
    case.machine, case.pose = tz17(), tz17().pose(0.28, 2.2)
    sigma = earning.spool_noise(case.machine, case.pose)
    assert sigma == pytest.approx(4e-4, rel=0.05)
    found = weighed("valve_hysteresis", 100.0, 90.0, 1000.0).fitted
    found.point.effects["effects.valve_hysteresis.h"] = play * sigma
    assert earning._filters_noise(case, found) is noise


@pytest.mark.parametrize(
    ("number", "size", "ordinary"),
    [("valve_hysteresis.h", 0.0024, True), ("valve_hysteresis.h", 0.0026, False),
     ("pressure_delay.T", 0.0074, True), ("pressure_delay.T", 0.0076, False),
     ("payload_change.mass", -4.9, True), ("payload_change.mass", 5.1, False)],
)  # fmt: skip
def test_what_every_sound_machine_has_of_an_effect_is_none_whatever_it_gains(
    monkeypatch: pytest.MonkeyPatch, moving: Any, number: str, size: float, ordinary: bool
) -> None:
    moving.machine, moving.pose = tz17(), tz17().pose(0.28, 2.2, 300.0)
    fitted = weighed(number.split(".")[0], 50.0, 50.0, 1000.0).fitted
    beside = {"effects.valve_hysteresis.travel": 0.0, "effects.payload_change.t_g": 20.0}
    fitted.point.effects |= {**beside, f"effects.{number}": size}
    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (fitted,), {}, Any)
    monkeypatch.setattr(earning, "_split", lambda case, hypotheses, names: [(500.0, 500.0), (450.0, 450.0)])
    assert [w.fitted for w in earning.weigh(moving, found)] == ([] if ordinary else [fitted])


@pytest.mark.parametrize(
    ("interval", "rest", "kept"), [((-2.0, 8.0), 400.0, False), ((1.0, 5.0), 400.0, True), ((-2.0, 8.0), 600.0, True)]
)
def test_an_effect_that_may_do_nothing_is_given_up_where_parameters_leave_no_clear_rest(
    monkeypatch: pytest.MonkeyPatch, case: Any, interval: tuple[float, float], rest: float, kept: bool
) -> None:
    """A twentieth of a nat per innovation, here 500 nats, is a clear rest."""
    case.rounds[0].base, case.temperature = point(rest), 3.0
    found = weighed("payload", 50.0, 50.0, rest)
    case.taken, case.weighed, case.trained, case.final = [found], [[found]], [point(rest), point(rest)], found.fitted
    numbers = {"effects.payload.mass": Estimate(3.0, "kg", interval)}
    monkeypatch.setattr(earning, "estimates", lambda fitted, temperature, over: numbers)
    assert earning.given_up(case) is not kept
    assert (case.taken, case.disproved, len(case.trained)) == (([found], [], 2) if kept else ([], [found], 1))


@pytest.mark.parametrize(("free_runs", "kept"), [(0.62, True), (0.89, False)])
def test_a_second_effect_that_may_do_nothing_stays_only_where_free_runs_are_clearly_better_with_it(
    monkeypatch: pytest.MonkeyPatch, case: Any, free_runs: float, kept: bool
) -> None:
    """A load of 2.4 kg that comes and goes beside a boom that bends was a third finding."""
    first, second = weighed("boom_flexibility", 900.0, 900.0, 900.0), weighed("payload", 50.0, 50.0, 600.0)
    case.rounds, case.temperature = [SimpleNamespace(base=point(rest)) for rest in (2000.0, 900.0)], 3.0
    case.taken, case.weighed, case.final = [first, second], [[first], [second]], second.fitted
    case.trained = [point(2000.0), point(900.0), point(600.0)]
    monkeypatch.setattr(earning, "told", lambda effect, numbers, _size: False)
    monkeypatch.setattr(earning, "worsening", lambda case, before, after: free_runs)
    assert earning.given_up(case) is not kept
    assert case.taken == ([first, second] if kept else [first])


def test_an_effect_is_weighed_against_the_likeliest_of_all_sets_of_numbers_that_its_fit_leads_to(
    monkeypatch: pytest.MonkeyPatch, case: Any
) -> None:
    """One fits the data used a nat worse than the base and the data held out 300 nats better: the effect gains 10 there."""
    case.machine, case.pose, case.proving = tz17(), tz17().pose(0.28, 2.2, 300.0), [None]
    fitted = weighed("return_line_pressure", 50.0, 50.0, 1000.0).fitted
    fitted.point.effects |= {"effects.return_line_pressure.k": 1e11, "effects.return_line_pressure.n": 2.0}
    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (fitted,), {}, Any)
    monkeypatch.setattr(earning, "_valleys", lambda found: [(point(1001.0), found.jacobian)])
    losses = [(500.0, 400.0), (501.0, 100.0), (450.0, 90.0)]
    monkeypatch.setattr(earning, "_held_out", lambda case, found, hypotheses, names: losses)
    (told,) = earning.weigh(case, found)
    assert (told.gain, told.held_out_gain) == (51.0, 10.0)


@pytest.mark.parametrize(("effect", "likelihood", "follows"), [
    ("presliding_friction", 900.0, True), ("presliding_friction", 1100.0, False), ("payload", 900.0, False),
])  # fmt: skip
def test_bristles_that_are_no_likelier_than_a_disturbance_of_the_torque_follow_it(
    case: Any, monkeypatch: pytest.MonkeyPatch, effect: str, likelihood: float, follows: bool
) -> None:
    given = SimpleNamespace(likelihood_at=lambda z, effects: likelihood)
    monkeypatch.setattr(Case, "problem", lambda *_: given)
    asked = list[str]()
    monkeypatch.setattr(
        earning, "disturbed", lambda base, at, among: asked.extend(link.key for link in among) or 1000.0
    )
    found: Any = SimpleNamespace(base=point(1000.0), problem=SimpleNamespace(predictor=SimpleNamespace(looseness=1.0)))
    assert earning._follows(case, found, weighed(effect, 500.0, 300.0, 1000.0).fitted) is follows
    assert asked == (["torque"] if effect == "presliding_friction" else [])
