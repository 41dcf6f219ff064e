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


@pytest.mark.parametrize(("best", "named"), [(-500.0, "hose_flow"), (-498.0, "torque"), (-100.0, "torque")])
def test_an_equation_is_accused_at_the_files_numbers_where_an_unknown_input_makes_them_likelier(
    monkeypatch: pytest.MonkeyPatch, best: float, named: str
) -> None:
    """At the fitted numbers it is the torque, where the chain breaks, too; at the file's a flow: -499 nats, priors included."""

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


def test_what_is_left_beside_an_effect_is_located_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the file's own numbers without it the largest mismatch would be what was found already."""
    asked = list[Any]()

    def statistical(_base: Any, z: Any, values: Any) -> tuple[dict[str, float], float]:
        asked.append(values)
        return {link.key: 0.2 for link in locating.links(MACHINE)}, float(-100.0 if z.any() else 0.0)

    monkeypatch.setattr(locating, "problem_at", lambda *_: SimpleNamespace())
    monkeypatch.setattr(locating, "_statistical", statistical)
    monkeypatch.setattr(
        locating,
        "_chain",
        lambda _base, z, values, _healthy: ({link.key: 0.0 for link in locating.links(MACHINE)}, [z]),
    )
    found = {"effects.rate_scale.a": 1.1}
    assert locating.locate(MACHINE, [], [], [], FITTED, found, [])[2][0] is FITTED
    assert asked == [found]
    assert not np.any(locating.locate(MACHINE, [], [], [], FITTED, {}, [])[2][0])
