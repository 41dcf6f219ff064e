"""Which equation is accused, at which numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_samples import joystick, simulated, tz17

from boom_diagnosis import locating
from boom_diagnosis.bag_samples import prepare
from boom_diagnosis.case import case_of
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
        return {link.key: float(link.key == broken) for link in locating.places(MACHINE)}, []

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
        return {link.key: 0.2 for link in locating.places(MACHINE)}, float(-100.0 if z.any() else 0.0)

    monkeypatch.setattr(locating, "problem_at", lambda *_: SimpleNamespace())
    monkeypatch.setattr(locating, "_statistical", statistical)
    monkeypatch.setattr(
        locating,
        "_chain",
        lambda _base, z, values, _healthy: ({link.key: 0.0 for link in locating.places(MACHINE)}, [z]),
    )
    found = {"effects.rate_scale.a": 1.1}
    assert locating.locate(MACHINE, [], [], [], FITTED, found, [])[2][0] is FITTED
    assert asked == [found]
    assert not np.any(locating.locate(MACHINE, [], [], [], FITTED, {}, [])[2][0])


@pytest.mark.parametrize(
    ("effect", "place"),
    [
        ({"piston_leakage": {"c": 2e-11}}, "piston"),
        ({"stribeck_friction": {"tau_s": 6000.0, "w_s": 0.02}}, "torque"),
        ({"return_line_pressure": {"k": 3e12}}, "rod_flow"),
    ],
)
def test_what_is_missing_is_located_where_it_acts(effect: dict[str, dict[str, float]], place: str) -> None:
    """A leak past the piston adds to one side what it takes from the other: neither flow alone is wrong."""
    time = np.arange(2000) * 0.01
    machine = tz17()
    bag, healthy = (
        prepare(simulated(20.0, joystick(time), machine=m), machine) for m in (machine.with_effects(effect), machine)
    )
    case = case_of(machine, [bag], [], 0)
    at = np.zeros(len(case.nuisances))
    rows, _, inputs = locating.locate(machine, case.bags, case.select, case.nuisances, at, {}, [healthy])
    assert max(rows, key=lambda row: row.statistical).key == place
    assert {row.key for row in rows} == set(inputs[0])
    stateful = {"effects.hose_burst_valve_lag.tau": 0.05}
    assert locating.locate(machine, case.bags, case.select, case.nuisances, at, stateful, [healthy], doubted=False)[2]


def test_equations_are_called_after_what_the_machine_has() -> None:
    loader, thesis = (
        {link.key: link.title for link in locating.links(load_machine(name))} for name in ("loader_crane", "tz17")
    )
    assert loader["head_flow"] == "flow through the load-holding valve into the cylinder"
    assert loader["hose_flow"] == "flow into the hose"
    assert thesis["head_flow"] == "flow through the hose burst valve into the cylinder"
    assert thesis["hose_flow"] == "flow into hose and accumulators"


def test_a_valve_that_an_effect_puts_between_hose_and_head_side_makes_two_equations_of_one() -> None:
    bare = load_machine("triangle_direct")
    assert not bare.separates and "hose_flow" not in [link.key for link in locating.links(bare)]
    with_valve = bare.with_effects({"load_holding_valve": {"p_set": 1.2e7}})
    assert with_valve.separates
    found = {link.key: link.subsystems for link in locating.links(with_valve)}
    assert "hose_burst_valve" in found["head_flow"] and "hose_flow" in found
