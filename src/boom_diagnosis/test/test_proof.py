"""What free runs over data not used say of a term that was learnt."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_diagnosis import noisy, tz17

from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.case import Case, case_of
from boom_diagnosis.hypotheses import problem_at
from boom_diagnosis.learning import Learned
from boom_diagnosis.proof import proof_of, spans_of
from boom_model.learned import PLACES, VARIABLES, LearnedTerm

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
    proof = proof_of(rubbing, "unknown_physics", viscous(rubbing, MORE), spans_of(rubbing))
    assert proof.learned is not None
    assert proof.fit.held_out["explained"][0] < 0.2 * proof.fit.held_out["parameters_only"][0]
    assert proof.notes == ()


def test_a_term_that_makes_them_worse_is_not_kept_whatever_it_gained_and_the_answer_says_so(rubbing: Case) -> None:
    proof = proof_of(rubbing, "unknown_physics", viscous(rubbing, 3.0 * MORE), spans_of(rubbing))
    assert proof.learned is None
    assert proof.fit.held_out["explained"] == proof.fit.held_out["parameters_only"]
    assert proof.notes[0].startswith(
        "a term learnt for torque is not kept: free runs over data not used are no better: angle"
    )
