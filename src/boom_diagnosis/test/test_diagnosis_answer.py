"""What is said of a finished search, on a case whose rounds are given."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rounds_cases import SAMPLES, point, weighed

from boom_diagnosis import answer, earning, run
from boom_diagnosis import odds as weighing_of
from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.case import Case
from boom_diagnosis.coordinates import all_coordinates
from boom_diagnosis.document import Fit
from boom_diagnosis.hypotheses import Round
from boom_recording.recording import Event

OFF = Fit({}, {"parameters_only": (0.1,) * 4}, (0.01,) * 4, ("b",))
"""All channels at ten times their floor."""


def test_what_is_damaged_or_left_out_of_a_recording_is_said(case: Any) -> None:
    def bag(name: str, warnings: list[str], cavitating: int, lacking: Sequence[str] = (), strays: float = 0.0) -> Any:
        lost = np.arange(1000) < cavitating
        events = [Event("stuck", "/boom/hose_pressure", 3.0, 5.0, 199, "hose_pressure repeats 1e+07 Pa for 2.00 s")]
        recording = SimpleNamespace(warnings=warnings, events=events if name == "c" else [])
        currents = SimpleNamespace(strays=strays)
        made = SimpleNamespace(
            name=name, cavitating=lost, ended=lost[::-1], recording=recording, lacking=frozenset(lacking), currents=currents
        )  # fmt: skip
        made.left_out, made.stuck = partial(Bag.left_out, made), partial(Bag.stuck, made)
        return made

    case.bags, case.proving = (
        [bag("a", [], 150), bag("b", ["cut.mcap: the file is cut"], 0, ["rate"])],
        [bag("c", ["no index"], 0, strays=5e-3)],
    )
    left_out, straying, evaporating, ended, untold, *damaged = answer.notes_of(
        case.bags, case.proving, {"still": "the boom hardly moves"}
    )
    assert left_out == "still is left out: the boom hardly moves"
    assert straying.startswith("c: samples of the currents stray from their stamps, by 5.0 ms")
    assert evaporating.startswith("a: 1.5 s are left out") and "evaporates" in evaporating
    assert ended.startswith("a: 1.5 s are left out: the boom stands at an end of its range")
    assert untold == "b: the rate was not measured: what only it shows cannot be told, rate scale among it"
    stands = "c: hose_pressure repeats 1e+07 Pa for 2.00 s, from 3.0 s: left out, look at the sensor and at the logger"
    assert damaged == ["b: cut.mcap: the file is cut", stands, "c: no index"]


def test_an_effect_that_no_boom_can_have_is_not_weighed_but_said(monkeypatch: pytest.MonkeyPatch, case: Any) -> None:
    case.pose, case.healthy_squares, case.bags = SimpleNamespace(load=0.0), np.ones(4), []
    case.select = []
    fitted = weighed("payload", 600.0, 300.0, 1000.0).fitted
    fitted = replace(fitted, coordinates=all_coordinates(["payload"]), jacobian=np.ones((SAMPLES, 2)))
    fitted.point.effects["effects.payload.mass"] = -80.0
    found: Any = Round((), point(1000.0), np.zeros((SAMPLES, 1)), (fitted,), {}, Any)
    case.weighed = [earning.weigh(case, found)]
    assert case.weighed == [[]]
    monkeypatch.setattr(answer.regimes, "where", lambda *given: SimpleNamespace(text="", intervals=()))
    evidence: Any = SimpleNamespace(key="torque", subsystems=("load", "friction"), statistical=1.0, chain=0.0)
    tight: Any = SimpleNamespace(explained=[])
    said = answer._unknown_finding(case, weighing_of.odds_of(case, 0.9), [], tight, [evidence], None, OFF).evidence
    assert said.endswith("; the nearest is payload, but as no boom can have it (mass -80 kg).")


@pytest.mark.parametrize(
    ("unknown", "confidence", "like", "verdict"),
    [(0.48, 0.18, "", "unknown_physics"), (0.45, 0.5, "", "ambiguous"), (0.1, 0.9, "", "identified"),
     (0.1, 0.9, "ground_contact", "unknown_physics"), (0.1, 0.5, "ground_contact", "ambiguous")],
)  # fmt: skip
def test_physics_of_no_catalogue_is_the_verdict_where_it_is_likelier_than_what_was_found(
    case: Any, unknown: float, confidence: float, like: str, verdict: str
) -> None:
    found: Any = SimpleNamespace(subsystem="supply", confidence=confidence, like=like)
    tight: Any = SimpleNamespace(excess_before=1.0)
    assert answer._verdict(case, [found], unknown, 1.0, 0.0, tight) == verdict


@pytest.mark.parametrize(
    ("tolerances", "moved", "verdict"),
    [(0.2, 0.0, "ambiguous"), (0.2, 1e6, "ambiguous"), (0.6, 1e6, "parameters_only"), (0.6, 0.0, "no_mismatch")],
)
def test_tolerances_are_the_verdict_only_where_they_are_likelier_than_all_else_together(
    tolerances: float, moved: float, verdict: str
) -> None:
    """A gyro with another gain in one direction was "the physics is right", as likely as four effects, 0.20 each."""
    case: Any = SimpleNamespace(nuisances=[None] * 10)
    assert answer._verdict(case, [], 0.0, tolerances, moved, SimpleNamespace(excess_before=1.0)) == verdict


@pytest.mark.parametrize(("proved", "most"), [(True, 1.0), (False, weighing_of.UNPROVED)])
def test_what_free_runs_are_worse_with_is_not_sure(
    monkeypatch: pytest.MonkeyPatch, case: Any, proved: bool, most: float
) -> None:
    case.weighed = [[weighed("pilot_lag", 3000.0, 3000.0, 2000.0)]]
    case.taken, case.temperature = case.weighed[0], 3.0
    monkeypatch.setattr(weighing_of, "is_told", lambda *given: True)
    odds = weighing_of.odds_of(case, 0.02, proved=proved)
    assert odds.effects[0]["pilot_lag"] == pytest.approx(min(0.98, most))
    assert odds.effects[0]["pilot_lag"] + odds.tolerances + odds.unknown == pytest.approx(1.0, abs=2e-4)


@pytest.mark.parametrize(("begin", "most"), [(30.0, 1.0), (45.0, weighing_of.UNPROVED)])
def test_what_begins_where_all_data_are_held_out_has_nothing_that_proves_it(
    monkeypatch: pytest.MonkeyPatch, case: Any, begin: float, most: float
) -> None:
    """A load of 37 kg in the last 3 s of a recording was sure, 0.98; it stood for the form of another effect."""
    case.weighed = [[weighed("payload_change", 3000.0, 3000.0, 2000.0)]]
    case.taken, case.temperature = case.weighed[0], 3.0
    case.bags = [SimpleNamespace(time=np.arange(60.0))]
    case.training = [np.arange(60.0)[:, None] < [40.0]]
    values = {"effects.payload_change.t_g": begin}
    monkeypatch.setattr(Case, "last", SimpleNamespace(effects=values))
    monkeypatch.setattr(weighing_of, "is_told", lambda *given: True)
    assert weighing_of.odds_of(case, 0.02).effects[0]["payload_change"] == pytest.approx(min(0.98, most))


@pytest.mark.parametrize(
    ("wrong", "far", "unknown", "tolerances"),
    [(True, 1.0, 0.51, 0.0), (False, 1.0, 0.02, 0.49), (True, 0.1, 0.069, 0.441)],
)
def test_what_cannot_be_claimed_of_an_effect_is_unknown_physics_where_something_is_clearly_wrong(
    monkeypatch: pytest.MonkeyPatch, case: Any, wrong: bool, far: float, unknown: float, tolerances: float
) -> None:
    """As far as free runs with tolerances alone are far from what noise leaves."""
    case.weighed = [[weighed("pilot_lag", 3000.0, 3000.0, 2000.0)]]
    case.taken, case.temperature = case.weighed[0], 3.0
    monkeypatch.setattr(weighing_of, "is_told", lambda *given: False)
    monkeypatch.setattr(weighing_of, "clear", lambda *given: wrong)
    odds = weighing_of.odds_of(case, 0.02, far=far)
    assert odds.effects[0]["pilot_lag"] == weighing_of.UNTOLD
    assert (odds.unknown, odds.tolerances) == pytest.approx((unknown, tolerances), abs=2e-3)


@pytest.mark.parametrize(("gain", "unknown"), [(1000.0, 0.02), (3000.0, 0.5), (4000.0, 1.0)])
def test_what_explains_more_as_no_machine_can_have_it_is_unknown_physics_that_looks_like_it(
    monkeypatch: pytest.MonkeyPatch, case: Any, gain: float, unknown: float
) -> None:
    """A droop beyond its range gained 401 nats, an overlap 117, and the overlap was it with 0.97."""
    case.weighed = [[weighed("edge_overlap", 3000.0, 3000.0, 2000.0)]]
    case.taken, case.temperature = case.weighed[0], 3.0
    case.impossible = [replace(case.taken[0].fitted, effect="compensator_droop", gain=gain)]
    monkeypatch.setattr(weighing_of, "is_told", lambda *given: True)
    odds = weighing_of.odds_of(case, 0.02)
    assert odds.unknown == pytest.approx(unknown, abs=0.012)
    assert odds.effects[0]["edge_overlap"] + odds.tolerances + odds.unknown == pytest.approx(1.0, abs=2e-4)


@pytest.mark.parametrize(("net", "likelier"), [(11.0, False), (60.0, True)])
def test_an_effect_that_gains_less_than_is_needed_is_not_likelier_than_parameters_only(
    monkeypatch: pytest.MonkeyPatch, case: Any, net: float, likelier: bool
) -> None:
    """A verdict of parameters only stood beside an effect at 0.98."""
    case.weighed, case.taken, case.temperature = [[weighed("pilot_lag", net, net, 2000.0)]], [], 3.0
    monkeypatch.setattr(weighing_of, "needed", lambda case, w: w.net - net + 30.0)
    odds = weighing_of.odds_of(case, 0.02)
    assert (odds.effects[0]["pilot_lag"] > odds.tolerances) is likelier
    assert odds.effects[0]["pilot_lag"] + odds.tolerances + odds.unknown == pytest.approx(1.0, abs=2e-4)


def test_of_two_effects_that_explain_the_same_the_one_with_fewer_numbers_is_it_however_much_that_is(
    monkeypatch: pytest.MonkeyPatch, case: Any
) -> None:
    """A load that hangs all the time was as likely as one grasped before the recording began: both explained 300 000 nats."""
    costs = {"payload": 5.0, "payload_change": 31.0}
    fewer, more = (replace(weighed(name, 1e5, 2e5, 2000.0), cost=cost) for name, cost in costs.items())
    case.weighed, case.taken, case.temperature = [[fewer, more]], [fewer], 3.0
    case.rounds[0].base = replace(case.rounds[0].base, loss=3e5)
    monkeypatch.setattr(weighing_of, "is_told", lambda *given: True)
    assert weighing_of.odds_of(case, 0.02).effects[0]["payload_change"] < 0.01


@pytest.mark.parametrize("unknown", [0.02, 0.26, 0.49])
def test_what_free_runs_leave_of_unknown_physics_is_not_parameters_only(case: Any, unknown: float) -> None:
    """Gas lost by 40 % was "parameters only" with more than 0.99, unknown physics with 0.26 beside it was left out."""
    case.weighed, case.taken, case.temperature = [[]], [], 3.0
    odds = weighing_of.odds_of(case, unknown)
    assert (odds.unknown, odds.tolerances) == pytest.approx((unknown, 1.0 - unknown))


@pytest.mark.parametrize(
    ("numbers", "inside"),
    [({"mass": 188.0, "s_g": -1.0}, True), ({"mass": 188.0, "s_g": 1.5}, False), ({"mass": 5.0}, False)],
)
def test_a_number_that_does_not_act_is_not_outside_its_plausible_range(numbers: dict[str, float], inside: bool) -> None:
    """A load that comes at a time was "outside its plausible range", as it leaves the ground at no stroke."""
    found = weighed("payload_change", 50.0, 50.0, 400.0)
    names = all_coordinates(["payload_change"])
    neutral = {"mass_2": 0.0, "s_2": 10.0, "s_g": -1.0, "t_g": 20.0, "t_r": 1e4, "tau": 0.01}
    values = {f"effects.payload_change.{k}": v for k, v in {**neutral, **numbers}.items()}
    at = replace(found.fitted.point, effects=values)
    assert weighing_of._inside(replace(found, fitted=replace(found.fitted, point=at, coordinates=names))) is inside


def test_what_is_near_unknown_physics_has_the_probability_of_the_ranking(
    monkeypatch: pytest.MonkeyPatch, case: Any
) -> None:
    """The finding said a third of what is not unknown, whatever the ranking said."""
    near, far, disproved = (
        weighed(effect, gain, gain, 2000.0)
        for effect, gain in (("presliding_friction", 300.0), ("pilot_lag", 200.0), ("payload", 400.0))
    )
    case.weighed, case.disproved, case.healthy_squares, case.bags = [[near, far]], [disproved], np.ones(4), []
    case.select = []
    case.impossible, case.temperature, case.learned = [], 150.0, None
    for part in (answer, weighing_of):
        monkeypatch.setattr(part, "estimates", lambda *given: {})
    monkeypatch.setattr(answer.regimes, "where", lambda *given: SimpleNamespace(text="", intervals=()))
    odds = weighing_of.odds_of(case, 0.876)
    evidence: Any = SimpleNamespace(key="torque", subsystems=("load", "friction"), statistical=1.0, chain=0.0)
    tight: Any = SimpleNamespace(explained=[])
    finding = answer._unknown_finding(case, odds, [], tight, [evidence], None, OFF)
    ranked = {row.effect or row.kind: row.probability for row in weighing_of.ranking(case, odds, [finding])}
    assert {a.effect: a.confidence for a in finding.alternatives} == {
        e: ranked[e] for e in ("payload", "presliding_friction")
    }
    assert ranked["payload"] == 0.0 and finding.confidence == ranked["unknown"] == 0.876
    assert sum(ranked.values()) == pytest.approx(1.0, abs=2e-4)


@pytest.mark.parametrize(
    ("effect", "left", "unproved", "unknown"),
    [("ground_contact", 0.1, [], 0.0), ("ground_contact", 0.6, [], 0.9), ("ground_contact", 0.1, ["angle"], 0.9),
     ("payload", 0.1, [], 0.9)],
)  # fmt: skip
def test_what_is_left_of_something_foreign_that_explains_most_is_its_form(
    effect: str, left: float, unproved: list[str], unknown: float, case: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A boom on soft soil, 4 % to 0.3 % of the angle, was unknown physics of the friction for the rest, and contact second."""
    case.taken, case.trained = [weighed(effect, 50.0, 50.0, 400.0)], ["plain", "found"]
    monkeypatch.setattr(Case, "kept", lambda self, k: self.trained[k])
    monkeypatch.setattr(Case, "rest", lambda self, at: {"plain": 1.0, "found": left}[at])
    monkeypatch.setattr(weighing_of, "is_told", lambda *_: True)
    odds = weighing_of.as_its_form(case, weighing_of.Odds(0.9, ({effect: 0.06},), 0.04), unproved)
    assert odds.unknown == unknown and odds.effects[0][effect] == pytest.approx(0.96 - unknown)


@pytest.mark.parametrize(
    ("gain", "torque", "home"),
    [(0.0, 0.4, ("torque", "load")), (300.0, 0.4, ("rod_flow", "supply")), (300.0, 1.0, ("torque", "load"))],
)
def test_what_no_effect_explains_is_likelier_another_form_of_one_that_explains_part(
    case: Any, gain: float, torque: float, home: tuple[str, str]
) -> None:
    """A pump limited by its torque, of whose errors a limited flow explained two thirds, was unknown at the hose burst valve."""
    equations: list[Any] = [
        SimpleNamespace(key="torque", subsystems=("load", "friction"), statistical=torque, chain=0.0),
        SimpleNamespace(key="rod_flow", subsystems=("cylinder", "supply"), statistical=0.3, chain=0.0),
    ]
    case.rounds[0].fitted = (weighed("pump_flow_limit", gain, 0.0, 1000.0).fitted,)
    assert answer._home(case, equations) == home


@pytest.mark.parametrize(
    ("angle", "rate", "alone"),
    [(0.05, 0.08, True), (0.08, 0.08, False), (0.05, 0.04, False), (float("nan"), 0.08, False)],
)
def test_where_the_rate_alone_is_off_it_is_the_sensor(angle: float, rate: float, alone: bool) -> None:
    """Floors of 0.05, 0.03, 0.01 and 0.01; a pressure at 1.3 times its floor is not off."""
    fit = replace(OFF, held_out={"parameters_only": (angle, rate, 0.013, 0.01)}, noise_floor=(0.05, 0.03, 0.01, 0.01))
    assert answer.rate_alone(fit) is alone


@pytest.mark.parametrize(("left", "kept"), [(0.04, False), (0.02, True)])
def test_a_search_with_other_currents_counts_only_where_it_leaves_less(left: float, kept: bool) -> None:
    """A bending boom that was found to 0.04 nats was a base that gives, to 2.7, after the search had begun anew."""
    before, again = (SimpleNamespace(learned=None, last=None, rest=lambda _, r=r: r) for r in (0.03, left))
    chosen: Any = run._better(before, again)  # type: ignore[arg-type]
    assert (chosen is again) == kept


@pytest.mark.parametrize(
    ("rod", "told", "expected"),
    [
        (0.015, {("a", True), ("a", False)}, False), (0.015, {("a", False)}, True),
        (0.042, {("a", False)}, False), (0.042, set(), True), (0.1, set(), False),
    ],
)  # fmt: skip
def test_what_no_number_tells_goes_where_parameters_alone_run_not_far_from_the_noise(
    monkeypatch: pytest.MonkeyPatch, rod: float, told: set[tuple[str, bool]], expected: bool
) -> None:
    """Pressures that came 10 ms late (6.8 to 13.5; sound: 7.5) stay: without it the rod pressure ran at 4.2 times the noise.

    A leak of 0.1 l/min (-2.2 to 2.4) of a sound crane, whose angle ran at 3.6 times, does not.
    """
    monkeypatch.setattr(answer, "is_told", lambda _, effect, *, sound: (effect, sound) in told)
    case: Any = SimpleNamespace(named=("a", "b"))
    assert answer._nothing_told(case, {"parameters_only": (0.015, 0.015, 0.02, rod)}, (0.01,) * 4) == expected


@pytest.mark.parametrize(("others", "gain"), [((), 1.0), (("payload_change",), 0.5)])
def test_numbers_that_do_the_same_are_the_plainest_unless_a_load_tells_them_apart(
    others: tuple[str, ...], gain: float
) -> None:
    own = {"gain": 0.5, "f": 2.0, "zeta": 0.02, "mu": 0.8, "eta": 0.6, "sag": 0.0}
    at: Any = SimpleNamespace(z=np.zeros(1), effects={f"effects.boom_flexibility.{n}": v for n, v in own.items()})
    problem: Any = SimpleNamespace(points=lambda given: [SimpleNamespace(z=z, effects=v) for z, v in given])
    plain = run._plainest(problem, at, ["boom_flexibility", *others])
    assert plain.effects["effects.boom_flexibility.gain"] == gain
    assert plain.effects["effects.boom_flexibility.mu"] == pytest.approx(0.2 if gain == 1.0 else 0.8)
