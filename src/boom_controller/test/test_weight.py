"""The force balance of a boom that is lifted, at the crane of the thesis."""

from __future__ import annotations

import pytest

from boom_controller.supervision.weight import CarriedWeight
from boom_model.machine_file import load_machine
from boom_model.plant import Plant

CASES = {
    "right": (lambda hose, rod: (hose, rod), False),
    "of a boom that is half as heavy": (lambda hose, rod: (0.5 * hose, rod), False),
    "swapped": (lambda hose, rod: (rod, hose), True),
    "bar for Pa": (lambda hose, rod: (1e-5 * hose, 1e-5 * rod), True),
    "a dead hose transducer": (lambda hose, rod: (0.0, rod), True),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("rate", [0.1, -0.1])
@pytest.mark.parametrize("pose", [(4.5, 0.0), (0.3, 2.0)])
def test_pressures_that_do_not_carry_a_boom_in_lifting_are_found_within_a_quarter_of_a_second(
    case: str, rate: float, pose: tuple[float, float]
) -> None:
    machine = load_machine("tz17")
    plant = Plant(machine, machine.pose(*pose))
    watch = CarriedWeight(machine, plant.pose)
    changed, impossible = CASES[case]
    found = False
    for k in range(25):
        angle = 0.3 + rate * 0.01 * k
        state = dict(zip(plant.state_names, plant.equilibrium(angle), strict=True))
        hose, rod = changed(state["head_pressure"], state["rod_pressure"])
        found = found or watch.lacks(0.01 * k, angle, rate, hose, rod)
    assert found == (impossible and rate > 0.0)
