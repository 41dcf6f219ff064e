"""Terms learnt from data: they do in the equations what their text says, and a wrong one is one line."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from boom_model.errors import MachineError
from boom_model.learned import PLACES, VARIABLES, check_learned, evaluate
from boom_model.machine import Machine
from boom_model.machine_file import load_machine, machine_from
from boom_model.plant import Plant

ENTRY: dict[str, Any] = {
    "equation": "torque",
    "basis": ["rate"],
    "coefficients": [-2.0],
    "unit": "10000 N m",
    "validity": {"rate": [-0.3, 0.3]},
}


def with_term(**changed: Any) -> Machine:
    document = {**load_machine("tz17").document, "learned": [{**ENTRY, **changed}]}
    return machine_from(document)


def derivative(machine: Machine, state: dict[str, float]) -> dict[str, float]:
    """State name -> rate of change at rest at q2 = 0.3 rad, with what ``state`` changes."""
    pose = load_machine("tz17").tabulated[0]
    plant = Plant(machine, pose)
    x = plant.rest_state(0.3, 9e6, 2e6)
    for name, value in state.items():
        x[plant.state_names.index(name)] = value
    f, _ = plant.derivative(x, (0.0, 0.0))
    return dict(zip(plant.state_names, f, strict=True))


def change(state: dict[str, float], **changed: Any) -> dict[str, float]:
    """What the term changes in every rate."""
    before, after = derivative(load_machine("tz17"), state), derivative(with_term(**changed), state)
    return {name: after[name] - before[name] for name in before}


@pytest.mark.parametrize(
    ("product", "rate", "value"),
    [
        ("rate", 0.15, 0.5),
        ("rate^2", -0.15, 0.25),
        ("sign(rate)", -0.2, -1.0),
        ("abs(rate)", -0.15, 0.48),
        ("plus(rate, 0.2)", 0.15, 0.3),
        ("minus(rate, 0.2)", -0.15, 0.7),
        ("bump(rate, 0.5, 0.1)", 0.15, 1.0),
        ("above(rate, 0.495)", 0.15, 0.8808),
        ("rate*below(rate, 0.6)", 0.15, 0.5),
        ("rate*sign(rate)", -0.15, 0.5),
        ("rate", 0.9, 1.0),  # held at the end of the range that it was learnt in
    ],
)
def test_a_torque_is_its_coefficient_times_its_product_over_the_inertia(
    product: str, rate: float, value: float
) -> None:
    changed = change({"rate": rate}, basis=[product])
    inertia = load_machine("tz17").tabulated[0].values()["pose.D0"]
    assert changed["rate"] * inertia == pytest.approx(-2.0 * 1e4 * value, rel=2e-2)
    scaled = {"rate": np.array([min(rate, 0.3) / VARIABLES["rate"].scale])}
    assert evaluate(product, scaled, lambda _v, _t, v: v) == pytest.approx(np.array([value]), rel=2e-2)
    assert {name for name, size in changed.items() if size != 0.0} == {"rate"}


@pytest.mark.parametrize(
    ("equation", "moved"),
    [
        ("head_flow", "head_pressure"),
        ("hose_flow", "hose_pressure"),
        ("rod_flow", "rod_pressure"),
        ("spool", "spool_velocity"),
    ],
)
def test_a_term_acts_in_its_own_equation_alone(equation: str, moved: str) -> None:
    place = PLACES[equation]
    changed = change({"rate": 0.15}, equation=equation, unit=f"{place.scale:g} {place.unit}", coefficients=[1e-3])
    assert changed[moved] > 0.0
    assert {name for name, size in changed.items() if size != 0.0} == {moved}


def test_a_memory_lags_by_its_time() -> None:
    changed = derivative(with_term(basis=["lag(rate, 0.5)"]), {"rate": 0.15})
    assert changed["memory_rate_0.5"] == pytest.approx(0.5 / 0.5)


def test_a_term_of_zero_changes_nothing_in_a_run() -> None:
    pose = load_machine("tz17").tabulated[0]
    t = np.linspace(0.0, 2.0, 201)
    currents = np.column_stack([np.zeros(201), np.where(t > 0.5, 0.45, 0.0)])
    runs = []
    for machine in (load_machine("tz17"), with_term(coefficients=[0.0])):
        plant = Plant(machine, pose)
        runs.append(plant.run(t, currents, t, plant.rest_state(0.3, 9e6, 2e6), tolerance=1e-6).outputs)
    np.testing.assert_allclose(runs[0], runs[1], rtol=1e-4, atol=1e-6)


def test_what_is_read_is_written_again() -> None:
    (entry,) = check_learned([ENTRY])
    assert entry.document() == ENTRY


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"equation": "torqe"}, "learned[0].equation: 'torqe' is not one of torque"),
        ({"basis": ["speed"]}, "no variable speed"),
        ({"basis": ["sing(rate)"]}, "no function sing"),
        ({"basis": ["rate +"]}, "is neither a variable nor a function of one"),
        ({"basis": ["lag(angle, 0.1)"]}, "angle is not zero at rest"),
        ({"basis": ["plus(rate)"]}, "plus takes 1 numbers"),
        ({"coefficients": [1.0, 2.0]}, "expected 1 numbers"),
        ({"coefficients": [float("nan")]}, "nan is not a finite number"),
        ({"unit": "N m"}, "expected 10000 N m"),
        ({"validity": {}}, "validity.rate: expected [low, high]"),
        ({"validity": {"rate": [0.3, -0.3]}}, "validity.rate: expected [low, high]"),
        ({"validty": {}}, "learned[0].validty: no such key"),
    ],
)
def test_a_wrong_term_is_one_line_that_names_it(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(MachineError, match=re.escape(message)) as caught:
        with_term(**changed)
    assert "\n" not in str(caught.value)
