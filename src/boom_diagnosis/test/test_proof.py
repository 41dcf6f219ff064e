"""What free runs over data not used say of a term that was learnt."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_diagnosis import noisy, tz17

from boom_diagnosis import proof
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.case import Case, case_of
from boom_diagnosis.hypotheses import problem_at
from boom_diagnosis.learning import Learned
from boom_diagnosis.proof import proof_of, spans_of
from boom_model.learned import PLACES, VARIABLES, LearnedTerm
from boom_model.sensors import OUTPUTS

MORE = 1.0e5
"""N m s/rad of viscous friction that the file does not know."""


@pytest.fixture(scope="module")
def rubbing() -> Case:
    """A boom that rubs more than its file says, with the file's numbers as the fit."""
    nominal = tz17()
    names = ("friction.k_v_pos", "friction.k_v_neg")
    made = noisy(nominal.with_values({n: nominal.parameters[n].value[0] + MORE for n in names}), 24.0, 1)
    bag = prepare(made, nominal)
    assert bag is not None
    case = case_of(nominal, [bag], [], 0)
    z = np.zeros(len(case.nuisances))
    problem: Any = problem_at(nominal, case.bags, case.select, case.nuisances, z, {}, 1.0)
    case.rounds = [SimpleNamespace(problem=problem)]  # type: ignore[list-item]
    case.trained = problem.points([(z, {})])
    return case


def viscous(case: Case, added: float) -> Learned:
    """Friction that is ``added`` [N m s/rad] to the file's; the torque moves the boom up."""
    place, rate = PLACES["torque"], VARIABLES["rate"]
    term = LearnedTerm("torque", ("rate",), (-added * rate.scale / place.scale,), {"rate": (-1.0, 1.0)})
    return Learned(term, case.trained[0], 1000.0, 1000.0, SimpleNamespace(reading=""))  # type: ignore[arg-type]


def test_a_term_is_kept_where_free_runs_over_data_not_used_improve(rubbing: Case) -> None:
    proved = proof_of(rubbing, "unknown_physics", viscous(rubbing, MORE), spans_of(rubbing))
    assert proved.learned is not None
    assert proved.fit.held_out["explained"][0] < 0.2 * proved.fit.held_out["parameters_only"][0]
    assert proved.notes == ()


def test_a_term_that_makes_them_worse_is_not_kept_whatever_it_gained_and_the_answer_says_so(rubbing: Case) -> None:
    proved = proof_of(rubbing, "unknown_physics", viscous(rubbing, 3.0 * MORE), spans_of(rubbing))
    assert proved.learned is None
    assert proved.fit.held_out["explained"] == proved.fit.held_out["parameters_only"]
    assert proved.notes[0].startswith(
        "a term learnt for torque is not kept: free runs over data not used are no better: angle"
    )


@pytest.mark.parametrize(
    ("before", "after", "factor"),
    [(0.005, 0.014, 1.0), (0.03, 0.06, 2.0), (0.06, 0.005, 0.25), (0.06, float("nan"), 10.0)],
)
def test_of_two_machines_that_err_as_noise_makes_them_neither_is_worse(
    rubbing: Case, monkeypatch: pytest.MonkeyPatch, before: float, after: float, factor: float
) -> None:
    """With errors of 0.01 by noise, those up to 0.015 are alike."""
    point, other = rubbing.trained[0], replace(rubbing.trained[0])
    monkeypatch.setattr(proof, "machine_at", lambda _, at: before if at is point else after)
    monkeypatch.setattr(proof, "placed", lambda machine, *_: machine)
    monkeypatch.setattr(proof, "free_run", lambda _, machine: machine)
    monkeypatch.setattr(proof, "errors", lambda _, machine: (machine,) * len(OUTPUTS))
    monkeypatch.setattr(proof, "noise_floor", lambda *_: (0.01,) * len(OUTPUTS))
    assert proof.worsening(rubbing, point, other) == pytest.approx(factor)
