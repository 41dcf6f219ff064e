"""Pages of the documentation: links lead somewhere, every page leads to the glossary, table cells are phrases."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = ROOT / "docs" / "glossary.md"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES += [*sorted(ROOT.glob("[!.]*/README.md")), *sorted((ROOT / "src").glob("*/README.md"))]
LONGEST_CELL = 400

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
    cells = [cell.strip() for row in rows for cell in re.split(r"(?<!\\)\|", row)]
    return [f"{len(cell)}: {cell[:60]}" for cell in cells if len(cell) > LONGEST_CELL]


@pages
def test_every_relative_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert broken(page) == []


@pages
def test_no_table_cell_is_longer_than_a_phrase(page: Path) -> None:
    assert long_cells(page) == []


@pages
def test_every_page_leads_to_the_glossary(page: Path) -> None:
    if page != GLOSSARY:
        assert f"]({Path(os.path.relpath(GLOSSARY, page.parent)).as_posix()}" in page.read_text(encoding="utf-8")


def test_a_broken_link_a_broken_anchor_and_a_long_cell_are_seen(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# A title\n[a](nowhere.md) [b](#a-title) [c](#another) [d](page.md)\n| x | {'y' * 401} |\n")
    assert broken(page) == ["nowhere.md", "#another"]
    assert [cell[:3] for cell in long_cells(page)] == ["401"]
