"""docs/theory.md and the code stay in step."""

from __future__ import annotations

from pathlib import Path

import pytest

from boom_model import theory
from boom_model.catalogue import CATALOGUE
from boom_model.errors import ModelError
from boom_model.machine import Machine

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "theory.md"


@pytest.fixture
def text() -> str:
    if not DOCUMENT.exists():
        pytest.skip("no docs/theory.md: the package is installed without its source tree")
    return DOCUMENT.read_text(encoding="utf-8")


def test_tables_are_those_that_the_code_makes(text: str) -> None:
    assert theory.updated(text) == text, "run: python -m boom_model.theory docs/theory.md"


def test_every_parameter_state_and_effect_has_its_row(text: str, tz17: Machine, other_make: Machine) -> None:
    for key in {*tz17.parameters, *other_make.parameters}:
        assert f"| `{key}` |" in text
    for state in theory.all_states():
        assert f"| state `{state.name}` |" in text
    for effect in CATALOGUE:
        assert f"| `{effect.id}` |" in text


def test_check_tells_an_outdated_document_and_leaves_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "theory.md"
    marks = "\n".join(theory._MARK.format(name=n, end=e) for n in theory.TABLES for e in ("begin", "end"))
    path.write_text(marks)
    assert theory.main([str(path), "--check"]) == 1
    assert "is not up to date: run python -m boom_model.theory" in capsys.readouterr().err
    assert path.read_text() == marks
    assert theory.main([str(path)]) == 0
    assert theory.main([str(path), "--check"]) == 0


def test_document_without_markers_or_missing_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "theory.md"
    assert theory.main([str(path)]) == 2
    path.write_text("no tables here")
    assert theory.main([str(path)]) == 2
    assert "markers of table symbols are missing" in capsys.readouterr().err
    with pytest.raises(ModelError):
        theory.updated("")
