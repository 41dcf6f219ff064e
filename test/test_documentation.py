"""Pages of the documentation: links lead somewhere, every page leads to the glossary, table cells are phrases."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import os
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = ROOT / "docs" / "glossary.md"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES += [*sorted(ROOT.glob("[!.]*/README.md")), *sorted((ROOT / "src").glob("*/README.md"))]
LONGEST_CELL = 160
MADE_BY_THE_BLIND_TRIAL = (ROOT / "docs" / "proof.md", ROOT / "docs" / "proof_unseen.md")

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def prose(page: Path) -> str:
    """The text of a page without its code."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(page: Path) -> list[str]:
    """Relative links of a page that lead to no file, or to no heading of it."""
    found = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = Path(os.path.normpath(page.parent / name)) if name else page
        if not path.exists() or (anchor and path.suffix == ".md" and anchor not in anchors(path)):
            found.append(target)
    return found


def long_cells(page: Path) -> list[str]:
    """Beginnings of the table cells that are longer than a phrase may be."""
    rows = [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    cells = [re.sub(r"\]\([^)]*\)", "]", cell.strip()) for row in rows for cell in re.split(r"(?<!\\)\|", row)]
    return [f"{len(cell)}: {cell[:60]}" for cell in cells if len(cell) > LONGEST_CELL]


@pages
def test_every_relative_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert broken(page) == []


@pages
def test_no_table_cell_is_longer_than_a_phrase(page: Path) -> None:
    assert long_cells(page) == [] or page in MADE_BY_THE_BLIND_TRIAL


@pages
def test_every_page_leads_to_the_glossary(page: Path) -> None:
    if page != GLOSSARY:
        assert f"]({Path(os.path.relpath(GLOSSARY, page.parent)).as_posix()}" in page.read_text(encoding="utf-8")


def test_a_broken_link_a_broken_anchor_and_a_long_cell_are_seen(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# A title\n[a](nowhere.md) [b](#a-title) [c](#another) [d](page.md)\n| x | {'y' * 161} |\n")
    assert broken(page) == ["nowhere.md", "#another"]
    assert [cell[:3] for cell in long_cells(page)] == ["161"]


def python_blocks() -> list[tuple[str, str]]:
    found = []
    for page in PAGES:
        for block in re.findall(
            r"^```python[^\n]*\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        ):
            found.append((str(page.relative_to(ROOT)), block))
    return found


@pytest.mark.parametrize(("page", "block"), python_blocks())
def test_every_block_of_python_compiles_and_imports_what_exists(page: str, block: str) -> None:
    for node in ast.walk(ast.parse(block, page)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("boom_"):
            module = importlib.import_module(node.module)
            lacking = [name.name for name in node.names if not hasattr(module, name.name)]
            assert [name for name in lacking if importlib.util.find_spec(f"{node.module}.{name}") is None] == []


def test_what_a_release_needs_names_what_is_there() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == version
    copied = re.findall(r"^COPY --chown=boom (.*) \S+$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    assert [name for line in copied for name in line.split() if not (ROOT / name).exists()] == []
    steps = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())["jobs"]["wheels"]["steps"]
    typed = [word for step in steps for word in step.get("run", "").split()]
    assert {".ci/run", ".ci/wheels"} <= set(typed)
    assert all(os.access(ROOT / word, os.X_OK) for word in typed if word.startswith((".ci/", "./boom")))
