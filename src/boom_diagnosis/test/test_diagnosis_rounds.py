"""How the rounds of a search follow one another, on a case whose fits and free runs are given."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rounds_cases import SAMPLES, point, weighed

from boom_diagnosis import answer, earning, hypotheses, run, search, second_search
from boom_diagnosis import rounds as searching
from boom_diagnosis.case import Case
from boom_diagnosis.coordinates import all_coordinates
from boom_diagnosis.fitting import WHITE, Point
from boom_diagnosis.hypotheses import FOLLOWED, GLANCED, Nominal, Round
from boom_diagnosis.search import Fitted
from boom_diagnosis.sizes import THESIS
from boom_diagnosis.weighing import Weighed
from boom_model.catalogue import CATALOGUE


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
    made = Case(None, None, [], [], [], [], [], (), 0, floor=WHITE, rounds=[found] * 2)  # type: ignore[arg-type]

    def look(of: Any, progress: Any, tight: bool) -> bool:
        seen.append(tight)
        of.taken, of.temperature = [first], float(len(seen))
        return len(seen) == 1

    for name, answer_ in {"_look": look, "_satisfied": lambda of: True, "_strained": lambda of: False}.items():
        monkeypatch.setattr(searching, name, answer_)
    monkeypatch.setattr(searching, "_fitted_better", lambda of, found: None)
    monkeypatch.setattr(searching, "with_number_that_explains_all", lambda of: None)
    monkeypatch.setattr(Case, "rest", lambda self, at: left)
    searching.rounds(made, lambda text, share: None)
    assert seen == looks
    assert made.temperature == 2.0  # of the second look: a tight one that finds nothing leaves nothing behind


@pytest.mark.parametrize(("left", "kept"), [(0.2, True), (3.0, False)])
def test_a_later_rounds_better_fit_of_what_was_taken_is_kept(
    monkeypatch: pytest.MonkeyPatch, case: Any, left: float, kept: bool
) -> None:
    """``left``: nats per innovation by the round that finds nothing further; 2 by the fit that the effect was taken with."""
    one, better = weighed("payload", 600.0, 390.0, 1000.0), point(50.0)
    case.taken, case.weighed, case.trained = [one], [[one]], [point(1000.0), point(900.0)]
    case.spared, case.final, case.plain = {}, None, None
    monkeypatch.setattr(Case, "rest", lambda self, at: left if at is better else 2.0)
    monkeypatch.setattr(searching, "settle", lambda of, k, problem, at, *given: at)
    made = Case(None, None, [], [], [], [], [], (), 0, rounds=case.rounds, taken=[one], trained=case.trained)  # type: ignore[arg-type]
    made.weighed = [[one]]
    nothing: Any = None
    searching._fitted_better(made, Round(("payload",), better, np.ones((SAMPLES, 1)), (), {}, nothing))
    assert (made.taken[0].fitted.point is better) is kept
    assert made.weighed[0][0] is made.taken[0]
    assert (made.trained[-1] is better) is kept


@pytest.mark.parametrize(("left", "taken", "found"), [(0.3, True, True), (0.3, False, False), (0.01, True, False)])
def test_what_explains_most_is_tried_from_every_start_where_nothing_was_taken_and_much_is_left(
    monkeypatch: pytest.MonkeyPatch, left: float, taken: bool, found: bool
) -> None:
    """Of three that did not earn their place the one that gains most; ``taken``: whether it does from another start."""
    cushion, others = weighed("end_cushioning", 1230.0, -659.0, 1000.0), [weighed("payload", 33.0, -30.0, 1000.0)]
    made = Case(None, None, [], [], [], [], [], (), 0, weighed=[others], disproved=[cushion])  # type: ignore[arg-type]
    tried = []

    def anew(of: Case, alone: Any) -> bool:
        tried.extend(alone.effects)
        of.disproved = []
        return taken

    monkeypatch.setattr(searching, "other_valley", lambda of, first: (None, point(10.0), np.zeros((SAMPLES, 1))))
    monkeypatch.setattr(searching, "taken_anew", anew)
    monkeypatch.setattr(Case, "last", None)
    monkeypatch.setattr(Case, "rest", lambda self, at: left)
    assert searching._restarted(made) is found
    assert tried == (["end_cushioning"] if left > 0.1 else [])
    assert bool(made.disproved) is not found


@pytest.mark.parametrize("before", [["payload_change"], ["payload_change", "stribeck_friction"]])
@pytest.mark.parametrize(("alone", "gives_way"), [(10.0, True), (900.0, False)])
def test_effects_that_gain_nothing_beside_the_last_give_their_place_to_it(
    monkeypatch: pytest.MonkeyPatch, case: Any, alone: float, gives_way: bool, before: list[str]
) -> None:
    """``alone``: nats that the last effect leaves without those before; with all, none are left."""
    taken = [weighed(effect, 100.0, 100.0, 1000.0) for effect in before] + [
        weighed("pressure_bias", 400.0, 400.0, 800.0)
    ]
    bias = {f"effects.pressure_bias.{name}": value for name, value in
            (("hose", 1e6), ("rod", 0.0), ("hose_gain", 1.0), ("rod_gain", 1.0))}  # fmt: skip
    every = {**{c.name: 5.0 for c in all_coordinates(before)}, **bias}
    taken[-1].fitted.point.effects.update(every)

    class Fits:
        def points(self, wanted: Any) -> list[Point]:
            return [replace(point(0.0 if len(e) == len(every) else 1200.0), z=z, effects=dict(e)) for z, e in wanted]

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
    made.size = THESIS
    monkeypatch.setattr(Case, "problem", lambda *given: Fits())
    monkeypatch.setattr(searching, "_judge", judged)
    searching._without_those_before(made)
    assert [w.fitted.effect for w in made.taken] == [*([] if gives_way else before), "pressure_bias"]


@pytest.mark.parametrize(
    ("before", "left", "second", "likelier", "names"),
    [
        (["presliding_friction"], 3.0, "pump_flow_limit", True, ["payload", "pump_flow_limit"]),
        (["presliding_friction"], 3.0, "pump_flow_limit", False, ["presliding_friction"]),
        (["presliding_friction"], 3.0, "", True, ["presliding_friction"]),
        (["presliding_friction"], 0.5, "pump_flow_limit", True, ["presliding_friction"]),
        (["pressure_bias", "pump_flow_limit"], 0.0, "pump_flow_limit", True, ["payload", "pump_flow_limit"]),
        (["payload", "pump_flow_limit"], 3.0, "spring_rate", True, ["payload", "pump_flow_limit"]),
    ],
)
def test_an_effect_that_does_not_earn_its_place_alone_does_with_a_second_one_if_both_are_likelier_than_what_was_found(
    monkeypatch: pytest.MonkeyPatch, before: list[str], left: float, second: str, likelier: bool, names: list[str]
) -> None:
    """``left``: nats per innovation by what was found before; ``second``: what is found beside the load, if anything."""
    made = Case(None, None, [], [], [], [], [], (), 0, trained=[point(1000.0)])  # type: ignore[arg-type]
    made.taken = [weighed(effect, 100.0, 100.0, 1000.0) for effect in before]

    def anew(of: Case, alone: Any) -> bool:
        of.taken.clear()
        of.weighed = [[weighed(alone, 10.0, -5.0, 1000.0)]]
        return False

    def further(of: Case, progress: Any, begun: bool) -> None:
        assert begun
        if second:
            of.taken.append(weighed(second, 500.0, 400.0, 990.0))

    def settled(of: Case, *given: Any) -> Point:
        return point(990.0)

    monkeypatch.setattr(second_search, "_first_effects", lambda of: [("payload", {})])
    monkeypatch.setattr(second_search, "_from_nominal", lambda of, effect, values: effect)
    monkeypatch.setattr(second_search, "taken_anew", anew)
    monkeypatch.setattr(second_search, "settle", settled)
    monkeypatch.setattr(second_search, "rounds", further)
    monkeypatch.setattr(second_search, "worsening", lambda *given: 0.5)
    monkeypatch.setattr(second_search, "_fitted_on", lambda of: None)
    monkeypatch.setattr(second_search, "_likelier", lambda *given: likelier)
    monkeypatch.setattr(second_search, "_serves_better", lambda *given: likelier)
    monkeypatch.setattr(Case, "last", None)
    monkeypatch.setattr(Case, "rest", lambda self, at: left)
    made.rounds = [SimpleNamespace(problem=None)]  # type: ignore[list-item]
    second_search.begun_elsewhere(made, lambda text, share: None)
    assert list(made.named) == names
    if names == ["payload", "pump_flow_limit"] and before != names:  # weighed by what both explain
        assert (made.taken[0].gain, made.taken[0].held_out_gain) == (510.0, 395.0)
        assert made.weighed[0] == [made.taken[0]]


@pytest.mark.parametrize(
    ("left", "expected"),
    [
        ({"payload": 300.0, "pressure_bias": 290.0, "spring_rate": 600.0}, ["payload", "pressure_bias"]),
        ({"payload": 600.0, "pressure_bias": 700.0}, []),
        (
            {"payload": 10.0, "spring_rate": 20.0, "flow_force": 30.0, "rate_scale": 40.0},
            ["payload", "spring_rate", "flow_force"],
        ),
    ],
)
def test_a_search_is_begun_once_more_with_what_explains_most_of_what_the_nominal_machine_leaves(
    left: dict[str, float], expected: list[str]
) -> None:
    """``left``: nats of 1000 with an effect and nominal tolerances; a number costs log n / 2, and a bias has four."""

    class Fits:
        def points(self, wanted: Any) -> list[Point]:
            return [replace(point(900.0), effects=dict(e)) for _, e in wanted]

        def fit_nominal(self, effects: Any, names: Any) -> Point:
            return replace(point(left[names[0].name.split(".")[1]]), effects=effects)

    candidate = SimpleNamespace(values={})
    made: Any = SimpleNamespace(
        floor=WHITE, size=THESIS,
        nominal=SimpleNamespace(problem=Fits(), at=point(1000.0), seen={effect: [candidate] for effect in left}),
    )  # fmt: skip
    assert [effect for effect, _ in second_search._first_effects(made)] == expected


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

    monkeypatch.setattr(searching, "_by_themselves", lambda of, effects: None)
    monkeypatch.setattr(searching, "taken_anew", anew)
    monkeypatch.setattr(searching, "_look", look)
    monkeypatch.setattr(Case, "last", None)
    monkeypatch.setattr(Case, "rest", rest)
    searching._without_stand_in(made, lambda text, share: None)
    assert [w.fitted.effect for w in made.taken] == names


@pytest.mark.parametrize("lost", [False, True], ids=["found again", "not found again"])
@pytest.mark.parametrize(
    ("without", "names"),
    [
        ({"payload": 400.0, "pressure_bias payload": 400.0, "entrained_air payload": 103.0}, ["entrained_air", "payload"]),
        ({"payload": 400.0, "pressure_bias payload": 103.0, "entrained_air payload": 400.0}, ["pressure_bias", "payload"]),
        ({"payload": 103.0, "pressure_bias payload": 103.0, "entrained_air payload": 103.0}, ["payload"]),
        ({"payload": 400.0, "pressure_bias payload": 400.0, "entrained_air payload": 400.0},
         ["pressure_bias", "entrained_air", "payload"]),
    ],
)  # fmt: skip
def test_of_three_effects_those_go_that_gain_nothing_beside_the_others(
    monkeypatch: pytest.MonkeyPatch, case: Any, without: dict[str, float], names: list[str], lost: bool
) -> None:
    """``without``: loss [nats] of what is kept where that is all; 100 with all three."""
    made = Case(None, None, [], [], [], [], [], (), 0)  # type: ignore[arg-type]
    made.taken = [weighed(effect, 100.0, 100.0, 1000.0) for effect in ("pressure_bias", "entrained_air", "payload")]

    def by_themselves(of: Case, effects: list[str]) -> Any:
        problem = SimpleNamespace(points=lambda wanted: [point(100.0)])
        return searching.Alone(tuple(effects), problem, point(without[" ".join(effects)]), np.zeros((SAMPLES, 1)))  # type: ignore[arg-type]

    def in_turn(of: Case, alone: Any) -> bool:
        kept = [w for w in of.taken if w.fitted.effect in alone.effects]
        of.taken[:] = kept[:1] if lost else kept
        return not lost

    monkeypatch.setattr(searching, "_by_themselves", by_themselves)
    monkeypatch.setattr(searching, "_taken_in_turn", in_turn)
    monkeypatch.setattr(searching, "chance", lambda of: 12.0)
    searching._without_those_before(made)
    three = ["pressure_bias", "entrained_air", "payload"]
    assert [w.fitted.effect for w in made.taken] == (three if lost else names)


@pytest.mark.parametrize(
    ("losses", "at_least", "level", "followed"),
    [
        ([800.0], 0.0, -np.inf, 1), ([800.0], 500.0, -np.inf, 0), ([800.0], 500.0, 810.0, 1), ([800.0], 500.0, 790.0, 0),
        ([800.0, 850.0], 0.0, -np.inf, 1), ([850.0, 800.0], 0.0, -np.inf, 1),  # the likeliest start first
    ],
)  # fmt: skip
def test_a_start_is_followed_if_it_gains_enough_or_stands_where_the_best_stood_then(
    monkeypatch: pytest.MonkeyPatch, losses: list[float], at_least: float, level: float, followed: int
) -> None:
    """``losses``: of each start after a glance, from 1000; enough is 500 gained."""
    further_steps = []

    class Fits:
        size = THESIS

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


@pytest.mark.parametrize("explained", [False, True])
@pytest.mark.parametrize(("prior", "doubted"), [(2.6, False), (2.7, True)])
def test_tolerances_are_doubted_where_they_cost_more_than_those_that_are_told_may_beside_an_effect_or_not(
    case: Any, prior: float, doubted: bool, explained: bool
) -> None:
    """``prior``: nats, 1/2 z'z, of one number that is well told: 0.5 + 3 sqrt(0.5) at most."""
    bent = replace(point(50.0), z=np.array([np.sqrt(2.0 * prior)]))
    told = np.full((SAMPLES, 1), 100.0)
    case.rounds = [SimpleNamespace(jacobian=told)]
    case.spared, case.final = {int(explained): bent}, None
    one = weighed("payload", 700.0, 250.0, 1000.0)
    case.taken = [replace(one, fitted=replace(one.fitted, jacobian=told))] if explained else []
    assert searching._strained(case) is doubted


def test_what_free_runs_leave_so_little_of_that_it_may_do_nothing_is_no_finding(
    monkeypatch: pytest.MonkeyPatch, case: Any
) -> None:
    """The one-step fit told it from nothing; so it was a finding of 0.49 beside parameters only of 0.51."""
    found, done, told = weighed("payload", 50.0, 50.0, 400.0), list[str](), [True]
    case.rounds[0].base, case.temperature = point(400.0), 3.0
    case.taken, case.weighed, case.trained = [found], [[found]], [point(400.0), point(400.0)]

    def to_free_runs(of: Any) -> None:
        done.append(f"free runs with {', '.join(of.named) or 'tolerances'}")
        told[0] = False

    monkeypatch.setattr(run, "_last_fit", lambda of: found.fitted)
    monkeypatch.setattr(run, "fit_to_free_runs", to_free_runs)
    monkeypatch.setattr(earning, "told", lambda effect, numbers, _size: told[0])
    run._finish(case)
    assert done == ["free runs with payload", "free runs with tolerances"]
    assert (case.taken, case.final, case.disproved) == ([], None, [found])


@pytest.mark.parametrize(
    ("effect", "numbers", "doubted"),
    [("payload", {"mass": 385.0}, False),
     ("swinging_load", {"mass": 116.0, "length": 9.0, "zeta": 0.1, "told": 0.0}, True),
     ("swinging_load", {"mass": 116.0, "length": 2.0, "zeta": 0.1, "told": 0.0}, False)],
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

    monkeypatch.setattr(searching, "_look", look)
    monkeypatch.setattr(searching, "_look_again", again)
    monkeypatch.setattr(searching, "_strained", lambda of: False)
    monkeypatch.setattr(Case, "rest", lambda self, at: 0.0)
    case.final = None
    searching.rounds(case, lambda text, share: None)
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
    made = Case(
        nothing, nothing, [], [], [], [], [], (), 0, rounds=rounds, taken=[loose], disproved=[worse], trained=[point(1000.0)]
    )  # fmt: skip
    made.nominal = nothing

    def judged(of: Case, found: Round) -> bool:
        of.weighed = [[little]]
        return False

    monkeypatch.setattr(searching, "afresh", lambda found, *given: found)
    monkeypatch.setattr(searching, "_judge", judged)
    monkeypatch.setattr(Case, "last", None)
    monkeypatch.setattr(Case, "rest", lambda self, at: 0.2)
    assert not searching._look_again(made, lambda text, share: None)
    assert (made.taken, answer._near(made)) == ([], [worse, loose, little])
    made.taken = [little]
    assert answer._near(made) == [little, worse, loose]


def test_an_effect_that_the_linear_look_ranks_low_is_found_by_a_few_steps_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of twelve effects the eleventh leaves least after two steps; only the best three are fitted to the end."""
    order = [effect.id for effect in CATALOGUE[: GLANCED + 2]]
    left = {effect: 900.0 - 10.0 * k for k, effect in enumerate(order)} | {order[10]: 20.0}
    nominal: Any = Nominal.__new__(Nominal)
    nominal.__dict__ |= {
        "_fitted": {}, "_glanced": {}, "seen": dict.fromkeys(order), "tolerances": point(1000.0), "at": point(5000.0),
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


@pytest.mark.parametrize(("apart", "steps"), [(False, 1), (True, 2)])
def test_a_load_has_a_second_step_only_where_one_does_not_do(
    monkeypatch: pytest.MonkeyPatch, apart: bool, steps: int
) -> None:
    """104 and -40 kg from one stroke on, each from 1 to 5000 kg, were 65 kg: the fit with one step had not got so far."""
    own = "effects.payload_change."
    first = {own + "mass": 90.0, own + "t_g": -1.0, own + "s_g": 0.4, own + "mass_2": 0.0, own + "s_2": 10.0}
    second = {own + "mass_2": -40.0, own + "s_2": 0.8 if apart else 0.4}

    def fit(start: Any, *_: Any, **__: Any) -> Any:
        both = start.effects[own + "mass_2"] != 0.0
        moved = start.effects | ({own + "mass": 104.0} if both else {})
        return replace(start, loss=100.0 if both else 900.0 if apart else 130.0, effects=moved), np.zeros((1, 1))

    monkeypatch.setattr(search, "Scanner", lambda *_: SimpleNamespace(next_step=lambda *_: second))
    problem: Any = SimpleNamespace(points=lambda of: [replace(point(0.0), effects=of[0][1])], fit=fit)
    begun = replace(point(0.0), loss=2000.0, effects=first)
    effects = search._placed(problem, begun, np.zeros((1, 1)), ())[0].effects
    assert effects[own + "mass"] == (104.0 if apart else 64.0)
    assert len(search.steps_in(effects)) == steps
