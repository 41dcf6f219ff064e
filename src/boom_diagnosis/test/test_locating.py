"""Which equation is accused, at which numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from boom_diagnosis import locating
from boom_model.machine_file import load_machine

MACHINE = load_machine("tz17")
FITTED = np.array([4.0, -3.0])


@pytest.mark.parametrize(("best", "named"), [(-487.0, "hose_flow"), (-486.0, "torque"), (-100.0, "torque")])
def test_an_equation_is_accused_at_the_files_numbers_where_an_unknown_input_makes_them_likelier(
    monkeypatch: pytest.MonkeyPatch, best: float, named: str
) -> None:
    """The fit went 12.5 nats of prior away, and its chain breaks at the torque; at the file's numbers it is a flow: -499 nats."""

    def problem_at(_m: Any, _b: Any, _s: Any, _n: Any, z: Any, _v: Any, _l: float) -> Any:
        def bearing(inputs: dict[str, float]) -> Any:
            fitted, wrong = bool(z.any()), "rate" if z.any() else "hose_pressure"
            raised = ((best if fitted else -499.0) if wrong in inputs else -900.0) if inputs else -1000.0
            return SimpleNamespace(
                predictor=SimpleNamespace(machine=MACHINE, looseness=1.0), likelihood_at=lambda *_: raised,
                bearing_with=lambda _, inputs: bearing(inputs),
            )  # fmt: skip

        return bearing({})

    def chain(_base: Any, z: Any, *_: Any) -> Any:
        broken = "torque" if z.any() else "hose_flow"
        return {link.key: float(link.key == broken) for link in locating.links(MACHINE)}, []

    monkeypatch.setattr(locating, "problem_at", problem_at)
    monkeypatch.setattr(locating, "_chain", chain)
    monkeypatch.setattr(locating, "in_parallel", lambda function, tasks: [function(task) for task in tasks])
    rows, said, _ = locating.locate(MACHINE, [], [], [], FITTED, {}, [])
    assert max(rows, key=lambda row: row.statistical).key == named
    assert max(rows, key=lambda row: row.chain).key == named
    assert said.startswith("Both ways of locating agree on")
