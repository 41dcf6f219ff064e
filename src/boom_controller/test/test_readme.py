"""The README names every parameter and every reason to stop with what is done."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from boom_controller import parameter_tables
from boom_controller.node.node_parameters import PARAMETERS
from boom_controller.supervision.reasons import REASONS
from boom_controller.supervision.state_machine import MotionState

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "src/boom_controller" / "README.md").read_text(encoding="utf-8")


def rows() -> dict[str, list[str]]:
    return {
        match[1]: [cell.strip() for cell in line.strip("|").split("|")]
        for line in TEXT.splitlines()
        if (match := re.match(r"\| `(\w+)`", line))
    }


@pytest.mark.parametrize("document", ["src/boom_controller/README.md", "docs/control.md"])
def test_the_tables_of_parameters_and_laws_are_those_of_the_code(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    assert "(made by python -m boom_controller.parameter_tables)" in text
    assert parameter_tables.updated(text) == text, f"run: ./boom python -m boom_controller.parameter_tables {document}"


def test_every_parameter_stands_in_the_readme() -> None:
    assert {spec.name for spec in PARAMETERS} <= rows().keys()


def test_every_reason_stands_in_the_readme_with_its_reaction_and_remedy() -> None:
    found = rows()
    for reason in REASONS.values():
        _, cause, reaction, remedy = found[reason.id]
        assert (cause, remedy) == (reason.cause, reason.remedy)
        assert reaction == f"by the {reason.reaction}"


def test_every_state_stands_in_the_readme() -> None:
    assert all(f"`{state.value}`" in TEXT for state in MotionState)
