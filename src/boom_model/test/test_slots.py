"""Components and their slots: who is chosen, who is refused, and that nobody else knows their names."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.slots import (
    Accumulators,
    HoseBurstValve,
    Linkage,
    PilotStage,
    PortValves,
    Spool,
    Supply,
    component,
    register,
    registered,
)
from boom_model.structure import SLOTS, structure

SOURCE = Path(__file__).resolve().parents[2]


def test_a_name_can_be_taken_once() -> None:
    twin = replace(component(Linkage, "triangle"))
    with pytest.raises(ValueError, match=r"kinematics\.type: two components are called triangle"):
        register(twin)
    assert twin not in registered(Linkage)


def test_a_spool_must_have_a_stroke() -> None:
    with pytest.raises(ValueError, match=r"main_valve_spool\.type: short does not specify main_valve_spool\.s_max"):
        register(replace(component(Spool, "direct"), name="short", specifications=()))


@pytest.mark.parametrize(
    ("slot", "name", "message"),
    [
        (Linkage, "five_bar", r"kinematics\.type: 'five_bar' is not one of four_bar, triangle"),
        (Linkage, ["triangle"], r"\['triangle'\] is not one of"),
        (Supply, 1, r"main_valve_orifices\.compensator: 1 is not true or false"),
        (Supply, "true", r"'true' is not true or false"),
        (PortValves, None, r"main_valve_orifices\.anti_cavitation\.enabled: say true or false"),
    ],
)
def test_what_is_no_name_of_a_component_is_refused(slot: Any, name: Any, message: str) -> None:
    with pytest.raises(MachineError, match=message):
        component(slot, name)


def test_the_default_of_a_slot_stands_first() -> None:
    assert [registered(slot)[0].name for slot in SLOTS if slot.default is not None] == [
        slot.default for slot in SLOTS if slot.default is not None
    ]


def test_a_structure_is_the_same_in_another_process(tz17: Machine) -> None:
    again = pickle.loads(pickle.dumps(tz17.structure))
    assert again == tz17.structure
    assert hash(again) == hash(tz17.structure)
    assert again != structure(supply=False)


def test_a_pilot_stage_and_a_spool_that_needs_one_go_together() -> None:
    with pytest.raises(
        MachineError,
        match=r"pilot_valves\.type: none goes with main_valve_spool\.type: direct or second_order, and only",
    ):
        structure(pilot_valves="none").check()
    structure().with_component(component(PilotStage, "none")).check()


def test_an_absent_component_is_neutral(p: Any, effects: Any) -> None:
    e = effects()
    gas, valve, port = component(Accumulators, "none"), component(HoseBurstValve, "none"), component(PortValves, False)
    assert (gas.flow(None, 1e7), gas.compliances(1e7, 1e9, p, e), gas.cells(p, e)) == (0.0, (), ())  # type: ignore[arg-type]
    assert (valve.pressure_drop(1e-3, p, e), valve.separates, port.flow(-1e5, p)) == (0.0, False, 0.0)


def test_no_file_but_the_component_and_its_slot_knows_a_name() -> None:
    names = "|".join(str(c.name) for slot in SLOTS for c in registered(slot) if c.specifications and c.name is not True)
    own = SOURCE / "boom_model" / "boom_model"
    allowed = [*(own / "components").glob("*.py"), own / "slots.py"]
    checked = [path for path in SOURCE.glob("boom_*/boom_*/**/*.py") if path not in allowed]
    if not (own / "slots.py").exists():
        pytest.skip("the package is installed without its source tree")
    found = [path.name for path in checked if re.search(rf"[=!]= ?[\"'](?:{names})[\"']", path.read_text("utf-8"))]
    assert len(checked) > 100
    assert found == []
