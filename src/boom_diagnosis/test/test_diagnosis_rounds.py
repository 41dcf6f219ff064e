"""What a round of the diagnosis takes, on a case whose fits and free runs are given."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_samples import tz17

from boom_diagnosis.diagnosis import answer, earning, hypotheses, proof, run, search
from boom_diagnosis.diagnosis.case import Case
from boom_diagnosis.diagnosis.coordinates import all_coordinates
from boom_diagnosis.diagnosis.fitting import WHITE, Point
from boom_diagnosis.diagnosis.hypotheses import FOLLOWED, GLANCED, Nominal, Round
from boom_diagnosis.diagnosis.nuisances import tolerances
from boom_diagnosis.diagnosis.search import Fitted
from boom_diagnosis.diagnosis.weighing import Weighed
from boom_model.effects import CATALOGUE

SAMPLES = 10_000


def point(excess: float) -> Point:
    """A fit that loses so many nats more than white noise."""
    w, used = np.zeros(SAMPLES), np.ones(SAMPLES, dtype=bool)
    return Point(np.zeros(1), {}, w, used, WHITE * SAMPLES + excess, [], [])


def weighed(effect: str, gain: float, held_out_gain: float, base: float) -> Weighed:
    left = point(base - gain - held_out_gain)
    return Weighed(Fitted(effect, left, (), np.zeros((SAMPLES, 1)), gain, ()), gain, held_out_gain, 0.0)


@pytest.fixture
def case() -> Any:
    """A case whose first round begins with 1000 nats too many."""
    made: Any = Case.__new__(Case)
    made.__dict__ |= {
        "select": [np.ones((SAMPLES // 4, 4), dtype=bool)], "floor": WHITE, "proving": [], "taken": [], "disproved": [],
        "spared": {}, "weighed": [[]], "trained": [point(1000.0)],
        "rounds": [SimpleNamespace(base=point(1000.0), problem=None)],
    }  # fmt: skip
    return made


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


@pytest.mark.parametrize(("gain", "rest", "factor"), [(700.0, 1000.0, 1.0), (900.0, 1000.0, 1.5), (450.0, 480.0, 1.0)])
def test_a_further_effect_may_leave_free_runs_worse_where_it_explains_nearly_all_of_a_clear_rest(
    case: Any, gain: float, rest: float, factor: float
) -> None:
    """500 nats on 10000 samples are a clear rest."""
    case.rounds = [SimpleNamespace(base=point(rest), problem=None)]
    case.taken = [weighed("pilot_lag", 300.0, 300.0, 2000.0)]
    assert earning._bearable(case, weighed("payload", gain / 2, gain / 2, rest)) == factor


@pytest.mark.parametrize(
    ("left", "followed", "looks"),
    [(2.0, True, [False, False, True]), (2.0, False, [False, False]), (0.5, True, [False, True])],
)
def test_what_a_loose_observer_follows_beside_an_effect_is_looked_for_with_the_tight_one(
    monkeypatch: pytest.MonkeyPatch, left: float, followed: bool, looks: list[bool]
) -> None:
    """``left``: nats per innovation that the first effect leaves to the tight observer; ``followed``: none to the loose one."""
    first, seen = weighed("payload", 600.0, 390.0, 1000.0), []
    loose: Any = SimpleNamespace(predictor=SimpleNamespace(looseness=15.0))
    found: Any = SimpleNamespace(base=point(100.0 if followed else 900.0), problem=loose)
    made = Case(None, None, [], [], [], [], [], (), 0, floor=WHITE, rounds=[found])  # type: ignore[arg-type]

    def look(of: Any, progress: Any, tight: bool) -> bool:
        seen.append(tight)
        of.taken, of.temperature = [first], float(len(seen))
        return len(seen) == 1

    for name, answer_ in {"_look": look, "_satisfied": lambda of: True, "_strained": lambda of: False}.items():
        monkeypatch.setattr(run, name, answer_)
    monkeypatch.setattr(Case, "rest", lambda self, at: left)
    run._rounds(made, lambda text, share: None)
    assert seen == looks
    assert made.temperature == 2.0  # of the second look: a tight one that finds nothing leaves nothing behind


def test_of_recordings_held_out_the_gain_on_those_fitted_is_compared_with_what_they_begin_with(case: Any) -> None:
    best = weighed("payload", 200.0, 700.0, 1000.0)
    assert earning._bearable(case, best) > earning.WORSE
    case.proving = [object()]
    assert earning._bearable(case, best) == earning.WORSE


@pytest.mark.parametrize(
    ("before", "after", "factor"),
    [
        ((0.1, 0.1, 0.1, 0.1), (0.2, 0.2, 0.05, 0.1), 2.0 ** (1 / 4)),
        ((0.1, 0.1, 0.1, 0.1), (np.nan,) * 4, proof.ENDED),
        ((np.nan,) * 4, (0.3,) * 4, 1 / proof.ENDED),
        ((np.nan,) * 4, (np.nan,) * 4, 1.0),
    ],
)
def test_a_free_run_that_ends_early_counts_as_worse(
    monkeypatch: pytest.MonkeyPatch, case: Any, before: Any, after: Any, factor: float
) -> None:
    errors = iter([before, after])
    monkeypatch.setattr(proof, "in_parallel", lambda function, items: [function(item) for item in items])
    case.machine = case.pose = None
    monkeypatch.setattr(Case, "values", lambda self, z, effects: {})
    monkeypatch.setattr(proof, "found_machine", lambda *given: None)
    monkeypatch.setattr(proof, "placed", lambda *given: None)
    monkeypatch.setattr(proof, "free_run", lambda *given: None)
    monkeypatch.setattr(proof, "errors", lambda *given: next(errors))
    monkeypatch.setattr(proof, "spans_of", lambda case: SimpleNamespace(judged=[SimpleNamespace(recording=None)]))
    assert proof.worsening(case, point(0.0), point(0.0)) == pytest.approx(factor)


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
    change.point.effects.update({"effects.payload_change.mass": 5.0, earning.TIME: onset})
    load.point.effects["effects.payload.mass"] = 5.0
    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (change, load), {}, Any)
    assert [w.fitted.effect for w in earning.weigh(moving, found)] == kept


@pytest.mark.parametrize(("onset", "kept"), [(0.5, ["payload"]), (20.0, ["payload_change"])])
def test_a_load_that_was_there_all_along_is_fitted_where_only_one_that_comes_so_early_was(
    moving: Any, onset: float, kept: list[str]
) -> None:
    change = weighed("payload_change", 300.0, 300.0, 1000.0).fitted
    change.point.effects.update({"effects.payload_change.mass": 5.0, earning.TIME: onset})

    class Fits:
        def points(self, wanted: Any) -> list[Point]:
            return [replace(point(500.0), z=z, effects=dict(e)) for z, e in wanted]

        def fit(self, at: Point, columns: np.ndarray, names: Any) -> tuple[Point, np.ndarray]:
            assert [c.name for c in names] == list(at.effects) == ["effects.payload.mass"]
            return replace(point(410.0), effects={"effects.payload.mass": 4.8}), np.zeros((SAMPLES, 2))

    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (change,), {}, Fits())  # type: ignore[arg-type]
    assert [w.fitted.effect for w in earning.weigh(moving, found)] == kept


@pytest.mark.parametrize("before", [["payload_change"], ["payload_change", "stribeck_friction"]])
@pytest.mark.parametrize(("alone", "gives_way"), [(10.0, True), (900.0, False)])
def test_effects_that_gain_nothing_beside_the_last_give_their_place_to_it(
    monkeypatch: pytest.MonkeyPatch, case: Any, alone: float, gives_way: bool, before: list[str]
) -> None:
    """``alone``: nats that the last effect leaves without those before; with all, none are left."""
    taken = [weighed(effect, 100.0, 100.0, 1000.0) for effect in before] + [
        weighed("pressure_bias", 400.0, 400.0, 800.0)
    ]
    bias = {"effects.pressure_bias.hose": 1e6, "effects.pressure_bias.rod": 0.0}
    taken[-1].fitted.point.effects.update({**bias, "effects.payload_change.mass": 5.0})

    class Fits:
        def points(self, wanted: Any) -> list[Point]:
            return [replace(point(0.0 if len(e) == 3 else 1200.0), z=z, effects=dict(e)) for z, e in wanted]

        def nuisance_jacobian(self, at: Point) -> np.ndarray:
            return np.zeros((SAMPLES, 1))

        def fit(self, at: Point, columns: np.ndarray, names: Any = ()) -> tuple[Point, np.ndarray]:
            return replace(point(alone if names else 1000.0), effects=at.effects), columns

    def judged(of: Any, found: Round) -> bool:
        of.taken.append(Weighed(found.fitted[0], 500.0, 400.0, 0.0))
        return True

    nothing: Any = None
    problem: Any = SimpleNamespace(predictor=SimpleNamespace(looseness=1.0))
    rounds = [Round((), point(1000.0), np.zeros((SAMPLES, 1)), (), {}, problem)] * 3
    made = Case(nothing, nothing, [], [], case.select, [], [], (nothing,), 0, floor=WHITE, rounds=rounds, taken=taken)
    monkeypatch.setattr(Case, "problem", lambda *given: Fits())
    monkeypatch.setattr(run, "_judge", judged)
    run._without_those_before(made)
    assert [w.fitted.effect for w in made.taken] == [*([] if gives_way else before), "pressure_bias"]


@pytest.mark.parametrize(
    ("left", "names"), [(0.2, ["payload", "stribeck_friction"]), (0.4, ["presliding_friction", "payload"])]
)
def test_what_stands_in_for_something_gives_way_if_the_second_and_what_is_beside_it_leave_less(
    monkeypatch: pytest.MonkeyPatch, case: Any, left: float, names: list[str]
) -> None:
    """``left``: nats per innovation with the new pair; 0.3 with the one that begins with a stand-in."""
    made = Case(None, None, [], [], [], [], [], (), 0)  # type: ignore[arg-type]
    made.taken = [weighed(effect, 400.0, 400.0, 1000.0) for effect in ("presliding_friction", "payload")]

    def anew(of: Case, found: Any) -> bool:
        of.taken[:] = [of.taken[1]]
        return True

    def look(of: Case, *given: Any) -> bool:
        of.taken.append(weighed("stribeck_friction", 100.0, 100.0, 1000.0))
        return True

    def rest(of: Case, at: Any) -> float:
        return {"presliding_friction": 0.3}.get(of.taken[0].fitted.effect, left)

    monkeypatch.setattr(run, "_last_alone", lambda of: (None, None))
    monkeypatch.setattr(run, "_taken_anew", anew)
    monkeypatch.setattr(run, "_look", look)
    monkeypatch.setattr(Case, "last", None)
    monkeypatch.setattr(Case, "rest", rest)
    run._without_stand_in(made, lambda text, share: None)
    assert [w.fitted.effect for w in made.taken] == names


@pytest.mark.parametrize(
    ("losses", "at_least", "level", "followed"),
    [
        ([800.0], 0.0, -np.inf, 1), ([800.0], 500.0, -np.inf, 0), ([800.0], 500.0, 810.0, 1), ([800.0], 500.0, 790.0, 0),
        ([800.0, 850.0], 0.0, -np.inf, 1), ([850.0, 800.0], 0.0, -np.inf, 2),
    ],
)  # fmt: skip
def test_a_start_is_followed_if_it_gains_enough_or_stands_where_the_best_stood_then(
    monkeypatch: pytest.MonkeyPatch, losses: list[float], at_least: float, level: float, followed: int
) -> None:
    """``losses``: of each start after a glance, from 1000; enough is 500 gained."""
    further_steps = []

    class Fits:
        def fit(self, at: Point, jacobian: np.ndarray, names: Any, *, iterations: int, further: int = 0) -> Any:
            further_steps.extend([further] if further else [])
            return at, jacobian

    starts = iter(losses)
    monkeypatch.setattr(search, "_start", lambda scanner, candidate: point(next(starts)))
    scanner: Any = SimpleNamespace(problem=Fits(), at=point(1000.0))
    candidates = [search.Candidate("payload", {}, 1.0)] * len(losses)
    level += WHITE * SAMPLES
    found = search.refine(scanner, np.zeros((SAMPLES, 1)), candidates, at_least=at_least, level=level)
    assert len(further_steps) == followed
    assert found.glanced == point(min(losses)).loss


@pytest.mark.parametrize(
    ("prior", "explained", "doubted"),
    [(11.0, False, False), (13.0, False, True), (29.0, True, False), (31.0, True, True)],
)
def test_tolerances_may_go_further_beside_an_effect_that_explains_most(
    monkeypatch: pytest.MonkeyPatch, case: Any, prior: float, explained: bool, doubted: bool
) -> None:
    """``prior``: nats of the tolerances, 1/2 z'z."""
    bent = replace(point(50.0), z=np.array([np.sqrt(2.0 * prior)]))
    case.rounds = [SimpleNamespace(base=point(1000.0), problem=None)]
    case.spared, case.final = {0: bent} if not explained else {1: bent}, None
    case.taken = [weighed("payload", 700.0, 250.0, 1000.0)] if explained else []
    monkeypatch.setattr(Case, "rest", lambda self, at: at.excess(WHITE))
    assert run._strained(case) is doubted


@pytest.mark.parametrize(
    ("effect", "value", "kept"),
    [("hose_burst_valve_setting.r", 1.01, False), ("hose_burst_valve_setting.r", 0.97, True),
     ("pilot_lag.r", 0.99, False), ("rate_scale.a", 1.01, True), ("payload.mass", 3.0, True)],
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


@pytest.mark.parametrize(
    ("effect", "numbers", "doubted"),
    [("payload", {"mass": 385.0}, False),
     ("swinging_load", {"mass": 116.0, "length": 9.0, "zeta": 0.1}, True),
     ("swinging_load", {"mass": 116.0, "length": 2.0, "zeta": 0.1}, False)],
)  # fmt: skip
def test_what_lies_at_the_end_of_its_range_is_looked_at_again(
    monkeypatch: pytest.MonkeyPatch, case: Any, effect: str, numbers: dict[str, float], doubted: bool
) -> None:
    """A load on a rope of 9 m that hardly swings is a load."""
    taken = weighed(effect, 600.0, 390.0, 1000.0)
    taken = replace(taken, fitted=replace(taken.fitted, coordinates=all_coordinates([effect])))
    taken.fitted.point.effects.update({f"effects.{effect}.{name}": value for name, value in numbers.items()})
    looks = []

    def look(of: Any, *given: Any) -> bool:
        of.taken = [taken]
        looks.append("look")
        return True

    def again(of: Any, *given: Any) -> bool:
        looks.append("again")
        return True

    monkeypatch.setattr(run, "_look", look)
    monkeypatch.setattr(run, "_look_again", again)
    monkeypatch.setattr(Case, "rest", lambda self, at: 0.0)
    case.final = None
    run._rounds(case, lambda text, share: None)
    assert looks == (["look", "again"] if doubted else ["look"])


def test_what_only_a_loose_observer_takes_or_free_runs_disproved_comes_near_what_is_unknown(
    monkeypatch: pytest.MonkeyPatch, case: Any
) -> None:
    """The second look takes nothing: the effect of the first that gained most comes first, one that gained nothing last."""
    loose, worse, little = (
        weighed("accumulator_heat_loss", 600.0, 78.0, 1000.0), weighed("compensator_droop", 700.0, 100.0, 1000.0),
        weighed("spring_rate", 10.0, 2.0, 1000.0),
    )  # fmt: skip
    nothing: Any = None
    problem: Any = SimpleNamespace(predictor=SimpleNamespace(looseness=1.0))
    rounds = [Round((), point(1000.0), np.zeros((SAMPLES, 1)), (), {}, problem)]
    made = Case(nothing, nothing, [], [], [], [], [], (), 0, rounds=rounds, taken=[loose], disproved=[worse])
    made.nominal = nothing

    def judged(of: Case, found: Round) -> bool:
        of.weighed = [[little]]
        return False

    monkeypatch.setattr(run, "afresh", lambda found, *given: found)
    monkeypatch.setattr(run, "_judge", judged)
    monkeypatch.setattr(Case, "last", None)
    monkeypatch.setattr(Case, "rest", lambda self, at: 0.2)
    assert not run._look_again(made, lambda text, share: None)
    assert (made.taken, answer._near(made)) == ([], [worse, loose, little])
    made.taken = [little]
    assert answer._near(made) == [little, worse, loose]


def test_what_is_damaged_or_left_out_of_a_recording_is_said(case: Any) -> None:
    def bag(name: str, warnings: list[str], cavitating: int) -> Any:
        lost = np.arange(1000) < cavitating
        return SimpleNamespace(name=name, cavitating=lost, recording=SimpleNamespace(warnings=warnings))

    case.bags, case.proving = (
        [bag("a", [], 150), bag("b", ["cut.mcap: the file is cut"], 0)],
        [bag("c", ["no index"], 0)],
    )
    left_out, evaporating, *damaged = answer._notes(case, ["still"])
    assert left_out.startswith("still is left out")
    assert evaporating.startswith("a: 1.5 s are left out") and "evaporates" in evaporating
    assert damaged == ["b: cut.mcap: the file is cut", "c: no index"]


def test_an_effect_that_the_linear_look_ranks_low_is_found_by_a_few_steps_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of twelve effects the eleventh leaves least after two steps; only the best three are fitted to the end."""
    order = [effect.id for effect in CATALOGUE[: GLANCED + 2]]
    left = {effect: 900.0 - 10.0 * k for k, effect in enumerate(order)} | {order[10]: 20.0}
    nominal: Any = Nominal.__new__(Nominal)
    nominal.__dict__ |= {
        "_fitted": {}, "seen": dict.fromkeys(order), "tolerances": point(1000.0), "at": point(5000.0),
    }  # fmt: skip
    glanced, fitted = [], []

    def refined(effect: str, at_least: float, level: float = -np.inf) -> Fitted:
        (glanced if at_least == np.inf else fitted).append(effect)
        at = point(left[effect])
        return Fitted(effect, at, (), np.zeros((SAMPLES, 1)), 0.0, (), at.loss)

    monkeypatch.setattr(nominal, "_refined", refined)
    nominal.fitted(order[:3])
    nominal.glance(GLANCED)
    assert sorted(glanced) == sorted(order[3:GLANCED])
    assert set(fitted) == {*order[:3], order[10], order[11], order[9]}
    assert len(fitted) == 3 + FOLLOWED
    assert nominal.best[0].effect == order[10]


def test_an_effect_that_no_boom_can_have_is_not_weighed_but_said(monkeypatch: pytest.MonkeyPatch, case: Any) -> None:
    case.pose, case.healthy_squares, case.bags = SimpleNamespace(load=0.0), np.ones(4), []
    fitted = weighed("payload", 600.0, 300.0, 1000.0).fitted
    fitted = replace(fitted, coordinates=all_coordinates(["payload"]), jacobian=np.ones((SAMPLES, 2)))
    fitted.point.effects["effects.payload.mass"] = -80.0
    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (fitted,), {}, Any)
    case.weighed = [earning.weigh(case, found)]
    assert case.weighed == [[]]
    monkeypatch.setattr(answer.regimes, "where", lambda *given: SimpleNamespace(text="", intervals=()))
    evidence: Any = SimpleNamespace(key="torque", statistical=10.0, chain=0.0)
    tight: Any = SimpleNamespace(explained=[])
    said = answer._unknown_finding(case, 0.9, [], tight, [evidence], None).evidence
    assert said.endswith("; the nearest is payload, but as no boom can have it (mass -80 kg).")


@pytest.mark.parametrize(
    ("unknown", "confidence", "verdict"),
    [(0.48, 0.18, "unknown_physics"), (0.45, 0.5, "ambiguous"), (0.1, 0.9, "identified")],
)
def test_physics_of_no_catalogue_is_the_verdict_where_it_is_likelier_than_what_was_found(
    case: Any, unknown: float, confidence: float, verdict: str
) -> None:
    found: Any = SimpleNamespace(subsystem="supply", confidence=confidence)
    tight: Any = SimpleNamespace(excess_before=1.0)
    assert answer._verdict(case, [found], unknown, 0.0, tight) == verdict


@pytest.mark.parametrize(
    ("found", "of", "base", "gain", "kept"),
    [(26000.0, 28000.0, 900.0, 880.0, "after"), (26000.0, 28000.0, 900.0, 100.0, "before"),
     (26000.0, 28000.0, -200.0, 30.0, "before"), (9000.0, 28000.0, 900.0, 100.0, "after"),
     (300.0, 300.0, 300.0, 10.0, "after")],
)  # fmt: skip
def test_gains_that_follow_a_machine_without_the_effect_as_well_do_not_weigh_it(
    found: float, of: float, base: float, gain: float, kept: str
) -> None:
    """``found`` of so many nats: what the effect explains with the gains that it was found with; 1000 are a clear misfit."""
    rounds = {}
    for name, left, gained in (("before", of, found), ("after", base, gain)):
        fitted = weighed("presliding_friction", gained, 0.0, left).fitted
        nothing: Any = None
        rounds[name] = Round((), point(left), np.zeros((SAMPLES, 1)), (fitted,), {}, nothing)
    assert hypotheses._telling(rounds["before"], rounds["after"]) is rounds[kept]
