"""What README and docs tell people to type exists: commands, options, modules, benchmarks."""

from __future__ import annotations

import importlib
import importlib.util
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from boom_bringup import cli

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted(ROOT.glob("*/README.md")),
]
PAGES += sorted((ROOT / "docs" / "history").glob("*.md")) + sorted((ROOT / "src").glob("*/README.md"))


def _code(page: Path) -> Iterator[str]:
    """Lines of code blocks and what stands between backticks."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^```[a-z]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    indented = re.findall(r"^    (\S.*)$", text, re.MULTILINE)
    yield from (line.strip() for block in blocks for line in block.splitlines())
    yield from indented
    yield from re.findall(r"`([^`\n]+)`", text)


def _documented(start: str) -> list[tuple[str, str]]:
    found = set()
    for page in PAGES:
        for line in _code(page):
            line = re.sub(r"^([A-Z_]+=\S+ )+", "", line.removeprefix("$ "))
            if line.startswith(start):
                found.add((str(page.relative_to(ROOT)), line.split("  #")[0].split(" | ")[0].strip()))
    return sorted(found)


@pytest.mark.parametrize(("page", "line"), _documented("./boom "), ids=lambda value: value)
def test_documented_command_and_its_options_exist(page: str, line: str) -> None:
    words = shlex.split(re.sub(r"[\[\]]|\.\.\.", "", line).rstrip("&; "))[1:]
    if not words or words[0] in ("--help", "COMMAND"):
        return
    assert words[0] in cli.command_names(), f"{page}: {line}"
    module = importlib.import_module(f"boom_bringup.commands.{cli.module_name(words[0])}")
    if words[1:] in ([], ["--help"], ["FILE"]):  # named, not typed
        return
    args = cli.parse(module, "boom", words[1:])
    if words[0] == "python":
        _check_python(page, args.words)


def _check_python(page: str, words: list[str]) -> None:
    if words[0] == "-m":
        assert importlib.util.find_spec(words[1]) is not None, f"{page}: no module {words[1]}"
    elif words[0].endswith(".py"):
        assert (ROOT / words[0]).is_file(), f"{page}: no file {words[0]}"
    else:
        compile(words[words.index("-c") + 1], page, "exec")


def test_docs_do_not_ask_for_a_python_that_lacks_our_packages() -> None:
    assert [f"{page}: {line}" for page, line in _documented("python ")] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_recording_that_a_page_names_by_its_path_is_shipped(page: Path) -> None:
    named = re.findall(r"\b(?:healthy|explained|unexplained|damaged)/[\w*]+", page.read_text(encoding="utf-8"))
    assert [name for name in named if not list((ROOT / "bags").glob(name))] == []
