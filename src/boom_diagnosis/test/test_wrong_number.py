"""A number of the machine file that is wrong, in the command's own search."""

from collections.abc import Sequence
from dataclasses import replace
from math import exp, log
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_diagnosis import noisy, tz17

from boom_diagnosis import answer, wrong_number
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.case import Case, Opened, case_of
from boom_diagnosis.coordinates import coordinates
from boom_diagnosis.must_keep import by_free_runs
from boom_diagnosis.nuisances import Nuisance, bore, known, tolerances
from boom_diagnosis.run import diagnose
from boom_diagnosis.wrong_number import in_words
from boom_estimation.free_run import plant_for
from boom_model.catalogue import EFFECTS
from boom_model.machine import Machine
from boom_model.machine_file import machine_from
from boom_recording.recording import Recording
from boom_report.diagnosis.words import headline

GIVEN = 1.4
"""Factor of the rod side's area in the file: another rod."""


def test_a_rod_that_was_mistyped_is_told_with_its_size_and_no_physics_is_named() -> None:
    machine = tz17()
    area = machine.parameters["cylinder.A_b"].value[0]
    result = diagnose([noisy(machine, 20.0, 1)], machine.with_values({"cylinder.A_b": GIVEN * area}))
    assert (result.document.verdict, result.document.findings) == ("parameters_only", ())
    assert result.wrong == ("cylinder.A_b",)
    estimate = result.tolerances_used["cylinder.A_b"]
    assert estimate.value == pytest.approx(
        area, rel=0.1
    )  # what is not told of the rod side's volume and masses goes with it
    assert result.explained.parameters["cylinder.A_b"].value[0] == estimate.value
    low, high = estimate.interval_90
    assert high - low > 0.04 * area  # no better known than one that was looked up, to 3 %
    assert headline(result).startswith("cylinder.A_b is wrong in the machine file: 9")  # mm^2
    assert any(note.startswith("cylinder.A_b is wrong in the machine file: 0.0") for note in result.notes)
    (plain,) = (row for row in result.document.ranking if row.kind == "parameters")
    assert plain.parameters == {"cylinder.A_b": estimate}


def test_masses_that_are_all_wrong_by_one_factor_are_told_as_that() -> None:
    machine = tz17()
    body = machine.document["rigid_body"]
    heavier = {
        name: {key: 1.6 * value if key in ("D0", "Sx", "Sy") else value for key, value in row.items()}
        for name, row in body["configs"].items()
    }
    doubtful = machine_from({**machine.document, "rigid_body": {**body, "configs": heavier}})
    result = diagnose([noisy(machine, 20.0, 1)], doubtful)
    assert (result.document.verdict, result.document.findings) == ("parameters_only", ())
    assert result.wrong == ("pose.D0", "pose.Sx", "pose.Sy")
    true = plant_for(noisy(machine, 20.0, 1), machine, "full").pose
    assert result.tolerances_used["pose.D0"].value == pytest.approx(true.D0, rel=0.1)
    assert headline(result).startswith("pose.D0, pose.Sx and pose.Sy are wrong in the machine file, all by one factor")


def opened(name: str, rest: float, away: float, within: float = 0.01, strain: float = 0.0) -> Opened:
    number = Nuisance(name, 0.01)
    case = Case(None, None, [], [], [], [], [], (number,), 0, wrong=(name,))  # type: ignore[arg-type]
    return Opened(number, case, rest, away, within, lambda: strain)


def test_of_numbers_that_explain_as_much_the_one_that_is_least_off_is_wrong_and_the_others_are_told() -> None:
    case = Case(None, None, [], [], [], [], [], (), 0)  # type: ignore[arg-type]
    case.opened = [
        opened("kinematics.L2", 0.0, -0.36), opened("kinematics.L1", 0.001, -0.05), opened("cylinder.A_a", 0.5, 0.2),
        opened("fluid.beta", 0.0, 0.03),  # within its tolerance
        opened("main_valve_spool.d_v", 0.0, 0.04, 0.4),  # nothing tells it
    ]  # fmt: skip
    found = wrong_number._wrong(case, 0.012)
    assert found is not None and found.wrong == ("kinematics.L1",)
    assert found.or_wrong == ((("kinematics.L2",), pytest.approx(exp(-0.36))),)
    assert wrong_number._wrong(case, -0.01) is None
    assert in_words(found.wrong, ["kinematics.L2"]) == "kinematics.L1 or kinematics.L2 is wrong in the machine file"


@pytest.mark.parametrize(
    ("beside_it", "beside_the_effect", "wrong"), [(0.0, 40.0, True), (39.9, 40.0, False), (40.0, 90.0, True)]
)
def test_a_number_is_wrong_instead_of_an_effect_that_explains_all_where_it_strains_tolerances_less(
    beside_it: float, beside_the_effect: float, wrong: bool
) -> None:
    """An angle sensor askew by 22 mrad, beside a moment at its end, explained a pin that was 63 mm elsewhere; so does the pin."""
    case = Case(None, None, [], [], [], [], [], (), 0)  # type: ignore[arg-type]
    case.opened = [opened("kinematics.b", 0.0, 0.14, strain=beside_it)]
    found = wrong_number._wrong(case, 0.012, strained=beside_the_effect)
    assert (found is not None) == wrong


@pytest.mark.parametrize(("strained", "far", "wrong"), [(38.6, True, True), (38.6, False, False), (10.0, True, False)])
def test_a_number_is_wrong_where_tolerances_alone_explain_all_strained_and_free_runs_err(
    monkeypatch: pytest.MonkeyPatch, strained: float, far: bool, wrong: bool
) -> None:
    """A load-holding valve of ratio 1.8, 2.9 in the file, was parameters only, it and the set pressure at their ends."""
    monkeypatch.setattr(wrong_number, "_strain", lambda *of: strained)
    monkeypatch.setattr(wrong_number, "far_from_noise", lambda *of: far)
    case = Case(None, None, [], [], [], [], [], (), 0)  # type: ignore[arg-type]
    point: Any = SimpleNamespace(z=np.zeros(0), effects={})
    case.trained, case.rounds = [point], [SimpleNamespace(base=point)]  # type: ignore[list-item]
    monkeypatch.setattr(Case, "rest", lambda *of: -0.016)
    monkeypatch.setattr(Case, "ended", lambda *of: np.ones(1, dtype=bool))
    case.opened = [opened("hose_burst_valve.R", -0.017, -0.47)]
    found = wrong_number.with_wrong_number(case)
    assert (found.wrong if found else None) == (("hose_burst_valve.R",) if wrong else None)


@pytest.mark.parametrize(
    ("stood_at_its_end", "left", "wrong"), [(True, 800.0, True), (True, 890.0, False), (False, 800.0, False)]
)
def test_a_number_is_wrong_instead_of_an_effect_where_it_stood_at_its_end_and_explains_more(
    monkeypatch: pytest.MonkeyPatch, stood_at_its_end: bool, left: float, wrong: bool
) -> None:
    """A rod of 70 mm, 75 in the file, was gains of both transducers, whose free runs erred eight times the noise."""
    monkeypatch.setattr(wrong_number, "_at_ends", lambda of: {"cylinder.A_b"} if stood_at_its_end else set())
    monkeypatch.setattr(wrong_number, "_left", lambda *of: 900.0)
    case = Case(None, None, [], [], [], [], [], (), 0)  # type: ignore[arg-type]
    point: Any = SimpleNamespace(point=None, coordinates=())
    case.rounds, case.taken = [SimpleNamespace(base=None)], [SimpleNamespace(fitted=point)]  # type: ignore[list-item]
    case.opened = [replace(opened("cylinder.A_b", 0.001, 0.07), loss=lambda: left)]
    assert (wrong_number._wrong(case, 0.005, instead=True) is not None) == wrong


def ended(machine: Machine, made: Recording, numbers: Sequence[str]) -> tuple[Case, np.ndarray]:
    """The case of a recording, and tolerances of which these stand at their upper ends."""
    bag = prepare(made, machine)
    assert bag is not None
    case = case_of(machine, [bag], [], 0)
    return case, np.array([n.limits[1] if n.name in numbers else 0.0 for n in case.nuisances])


def strain(case: Case, z: np.ndarray, effects: dict[str, float]) -> float:
    at = case.problem(z, effects, 1.0).points([(z, effects)])[0]
    return wrong_number._strain(case, at, coordinates(EFFECTS["payload"]) if effects else ())


def test_a_tolerance_at_its_end_strains_nothing_beside_an_effect_that_does_the_same() -> None:
    """A load of 220 kg was told as moments of mass that were all wrong by one factor: one of them stood at its end beside it."""
    loaded = noisy(tz17().with_effects({"payload": {"mass": 150.0}}), 6.0, 1)
    assert strain(*ended(tz17(), loaded, ["pose.Sx", "pose.Sy"]), {"effects.payload.mass": 60.0}) < 2.0
    area = tz17().parameters["cylinder.A_a"].value[0]
    smaller = tz17().with_values({"cylinder.A_a": area / 1.06})
    assert strain(*ended(smaller, noisy(tz17(), 6.0, 1), ["cylinder.A_a"]), {}) > 6.0


def test_a_length_that_is_wrong_may_be_outside_its_tolerance() -> None:
    bag = prepare(noisy(tz17(), 3.0, 1), tz17())
    assert bag is not None
    case = case_of(tz17(), [bag], [], 0)
    (length,) = (n for n in case.nuisances if n.name == "kinematics.L1")
    assert length.limits[1] * length.sigma < 0.1
    free = wrong_number._opened(case, length).nuisances[0]
    assert free.limits[0] * free.sigma < -1.0 and free.limits[1] * free.sigma > 1.0


def test_a_length_that_is_known_better_than_sensors_see_is_doubted_all_the_same() -> None:
    document = tz17().document
    row = {**document["kinematics"]["L1"], "tol": {"abs": 2e-4}}
    machine = machine_from({**document, "kinematics": {**document["kinematics"], "L1": row}})
    pose = plant_for(noisy(machine, 3.0, 1), machine, "full").pose
    assert "kinematics.L1" not in {n.name for n in tolerances(machine, pose)}
    assert "kinematics.L1" in {n.name for n in known(machine, pose)}


NOISE = (0.01, 0.02, 0.01, 0.01)


def ran(plain: float, found: float) -> dict[str, list[float]]:
    """Errors of free runs that are so many times those of noise; one channel was not measured."""
    return {stage: [ratio * n for n in NOISE[:3]] + [float("nan")] for stage, ratio in
            (("parameters_only", plain), ("explained", found))}  # fmt: skip


@pytest.mark.parametrize(
    ("plain", "found", "expected"),
    [(6.0, 6.0, (0.5, 0.0)), (3.0, 3.0, (0.25, 0.25)), (27.0, 27.0, (0.9, 0.0)), (27.0, 3.0, (0.5, 0.0)),
     (3.0, 1.5, (0.25, 0.0625))],
)  # fmt: skip
def test_free_runs_near_noise_speak_against_unknown_physics_and_far_ones_for_it(plain, found, expected) -> None:
    assert by_free_runs(0.5, ran(plain, found), NOISE) == pytest.approx(expected)


def test_without_a_free_run_that_ends_unknown_physics_is_what_one_step_says() -> None:
    assert by_free_runs(0.7, {"parameters_only": [float("nan")] * 4}, NOISE) == pytest.approx((0.7, 0.0))


def test_an_effect_that_has_less_than_free_runs_give_to_parameters_alone_is_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(answer, "by_free_runs", lambda unknown, held_out, noise_floor, leaves: (0.05, 0.6))
    monkeypatch.setattr(answer, "as_far_by_chance", lambda z: 1.0)  # as if they had gone nowhere
    lagging = tz17().with_effects({"pilot_lag": {"r": 2.0}})
    result = diagnose([noisy(lagging, 16.0, 1)], tz17())
    assert result.document.findings == ()
    assert "pilot_lag" not in result.explained.effects
    assert [row.effect for row in result.document.ranking if row.effect] == []


def test_another_piston_changes_both_areas_by_one_amount_and_its_rod_side_never_vanishes() -> None:
    pose = plant_for(noisy(tz17(), 3.0, 1), tz17(), "full").pose
    (of_both,) = bore(tolerances(tz17(), pose))
    nominal = {"cylinder.A_a": 0.01, "cylinder.A_b": 0.006}
    moved = dict[str, float]()
    of_both.move(moved, nominal, log(1.2) / of_both.sigma)
    assert moved == pytest.approx({"cylinder.A_a": 0.012, "cylinder.A_b": 0.008})
    less = dict[str, float]()
    of_both.move(less, nominal, log(0.2) / of_both.sigma)
    assert 0.0 < less["cylinder.A_b"] < 0.1 * nominal["cylinder.A_b"]
    assert in_words(of_both.components).startswith(
        "cylinder.A_a and cylinder.A_b are wrong in the machine file, by one amount"
    )


def test_numbers_that_may_be_wrong_together_are_tried_where_one_of_them_is() -> None:
    case = case_of(tz17(), [prepare(noisy(tz17(), 3.0, 1), tz17())], [], 0)
    numbers = [*case.nuisances, *known(tz17(), case.pose)]
    (both,) = bore(numbers)
    named = {n.name: n for n in numbers}
    assert wrong_number._together_with(both, [named["fluid.beta"], named["cylinder.A_b"]])
    assert not wrong_number._together_with(both, [named["fluid.beta"]])
    assert not wrong_number._together_with(named["cylinder.A_b"], [both])


def test_a_second_start_has_the_number_where_a_loose_observer_likes_it_best_and_a_search_begins_from_the_better_one() -> (
    None
):
    machine = tz17()
    area = machine.parameters["cylinder.A_b"].value[0]
    wrong = machine.with_values({"cylinder.A_b": GIVEN * area})
    case = case_of(wrong, [prepare(noisy(machine, 10.0, 1), wrong)], [], 0)
    (number,) = (n for n in (*case.nuisances, *known(wrong, case.pose)) if n.name == "cylinder.A_b")
    opened = wrong_number._opened(case, number)
    start = wrong_number._alone(opened)
    assert start.z[0] * wrong_number.ANYTHING == pytest.approx(-log(GIVEN), abs=0.12)
    assert not start.z[1:].any()
    found = wrong_number._fitted(number, opened, case.floor)
    assert exp(found.away) == pytest.approx(1.0 / GIVEN, rel=0.1)
    assert opened.nominal.tolerances.z[0] * wrong_number.ANYTHING == found.away
