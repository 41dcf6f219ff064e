"""An effect whose numbers trade off against one another is tried from every start of the catalogue."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_diagnosis import noisy, tz17

from boom_diagnosis import restarts
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.case import Case
from boom_diagnosis.coordinates import coordinates
from boom_diagnosis.nuisances import tolerances
from boom_model.catalogue import EFFECTS

SPOT = "effects.position_dependent_friction."


def a_case(machine: Any, effect: str, values: dict[str, float]) -> Case:
    """A case of a recording of ``machine`` in which an effect was taken with these numbers."""
    bag = prepare(noisy(machine, 12.0, 4), tz17())
    assert bag is not None
    nuisances = tolerances(tz17(), tz17().pose(0.28, 2.2, 0.0))[:2]
    point = SimpleNamespace(z=np.zeros(len(nuisances)), effects=values)
    taken: Any = SimpleNamespace(fitted=SimpleNamespace(effect=effect, point=point))
    made = Case(tz17(), tz17().pose(0.28, 2.2, 0.0), [bag], [], [bag.counted], [bag.counted], [], nuisances, 0)
    made.taken = [taken]
    return made


def test_a_tight_spot_that_a_search_saw_elsewhere_is_found_where_it_is() -> None:
    true = {"b": 2.5, "q_c": 0.5, "width": 0.12}
    wrong = {f"{SPOT}b": 0.3, f"{SPOT}q_c": 0.9, f"{SPOT}width": 0.06}
    crane = tz17().with_effects({"position_dependent_friction": true})

    case = a_case(crane, "position_dependent_friction", wrong)
    found = restarts.other_valley(case, case.taken[0].fitted)

    assert found is not None
    problem, point, jacobian = found
    assert point.effects[f"{SPOT}q_c"] == pytest.approx(0.5, abs=0.05)
    assert point.effects[f"{SPOT}b"] == pytest.approx(2.5, rel=0.3)
    assert jacobian.shape == (len(point.w), len(point.z) + len(true))
    assert point.loss == pytest.approx(problem.points([(point.z, point.effects)])[0].loss, rel=1e-3)


GAS = "effects.accumulator_precharge."


@pytest.mark.parametrize("worse", [1.0, 1.1])
def test_the_last_fit_goes_to_the_likelier_of_two_valleys_of_the_gas_where_free_runs_are_no_worse(
    monkeypatch: pytest.MonkeyPatch, worse: float
) -> None:
    crane = tz17().with_effects({"accumulator_precharge": {"r": 0.6, "r_2": 1.0 / 0.6}})  # the first alone
    case = a_case(crane, "accumulator_precharge", {f"{GAS}r": 1.02, f"{GAS}r_2": 0.8})
    names = coordinates(EFFECTS["accumulator_precharge"], case.size)
    problem = case.problem(case.taken[0].fitted.point.z, case.taken[0].fitted.point.effects, 1.0)
    here = problem.points([(np.zeros(2), case.taken[0].fitted.point.effects)])[0]
    columns = np.concatenate([problem.nuisance_jacobian(here), problem.effect_jacobian(here, names)], axis=1)
    monkeypatch.setattr(restarts, "settle", lambda case, k, problem, point, jacobian, names: point)
    monkeypatch.setattr(restarts, "worsening", lambda case, before, after: worse)
    case.trained = [here, here]

    last = problem, here, columns
    found = restarts.in_deepest_valley(case, last, names)

    if worse > 1.0:
        assert found is last and case.trained[1] is here
        return
    _, point, jacobian = found
    assert point.effects[f"{GAS}r"] == pytest.approx(0.6, abs=0.05)
    assert point.effects[f"{GAS}r"] * point.effects[f"{GAS}r_2"] == pytest.approx(1.0, abs=0.08)
    assert case.trained[1] is point and jacobian.shape == columns.shape


@pytest.mark.parametrize("effect", ["command_delay", "payload_change"])
def test_an_effect_of_one_start_or_with_a_time_is_left_where_it_is(effect: str) -> None:
    values = {f"effects.{effect}.{row.name}": row.neutral for row in EFFECTS[effect].parameters}
    assert restarts.other_valley(SimpleNamespace(), SimpleNamespace(effect=effect, point=values)) is None
