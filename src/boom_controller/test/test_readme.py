"""The README names every parameter with its default, and every reason to stop with what is done."""

from __future__ import annotations

import re
from pathlib import Path

from boom_controller.node.node_parameters import PARAMETERS
from boom_controller.supervision.reasons import REASONS
from boom_controller.supervision.state_machine import State

TEXT = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def rows() -> dict[str, list[str]]:
    return {
        match[1]: [cell.strip() for cell in line.strip("|").split("|")]
        for line in TEXT.splitlines()
        if (match := re.match(r"\| `(\w+)`", line))
    }


def test_every_parameter_stands_in_the_readme_with_its_default() -> None:
    found = rows()
    for spec in PARAMETERS:
        name, default, text = found[spec.name]
        shown = {"true": True, "false": False, "(empty)": ""}.get(default.split()[0], default.split()[0])
        assert type(spec.default)(shown) == spec.default, spec.name
        assert text.startswith(spec.description), spec.name
        assert ("(r)" in name) == spec.read_only, spec.name
        if spec.unit:
            assert default.endswith(spec.unit), spec.name


def test_every_reason_stands_in_the_readme_with_its_reaction_and_remedy() -> None:
    found = rows()
    for reason in REASONS.values():
        _, cause, reaction, remedy = found[reason.id]
        assert (cause, remedy) == (reason.cause, reason.remedy)
        assert reaction == f"by the {reason.reaction}"


def test_every_state_stands_in_the_readme() -> None:
    assert all(f"`{state.value}`" in TEXT for state in State)
