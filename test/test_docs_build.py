"""The pages that are made from the code are up to date, link to one another as HTML, and the tutorial does what it says."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from boom_bringup import cli, environment

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages as HTML: ``./boom python docs/build.py --check --html FOLDER``, as its user types it."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "docs/build.py", "--check", "--html", str(folder)]
    variables = environment.for_processes(os.environ)
    done = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{folder}/docs/index.html\n", "")
    return folder


def test_made_pages_are_up_to_date_and_every_link_and_picture_of_the_html_leads_to_a_file(site: Path) -> None:
    broken = []
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r'(?:href|src)="([^":#]+)(?:#[^"]*)?"', text):
            found = (page.parent / target).resolve()
            if found.is_relative_to(site) and found.suffix in (".html", ".svg") and not found.is_file():
                broken.append(f"{page.relative_to(site)}: {target}")
    assert broken == []
    assert (site / "docs" / "index.html").read_text(encoding="utf-8").count("<img ") == 6
    for picture in site.rglob("*.svg"):  # a browser draws nothing of one that is no XML
        ElementTree.parse(picture)


def test_the_tutorial_runs_as_a_notebook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells that take a minute are parsed; the diagnosis of that crane runs in test_diagnose_command.py."""
    (tmp_path / "bags").symlink_to(ROOT / "bags")
    (tmp_path / "boom").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BOOM_PROGRAM", "./boom")
    names: dict[str, object] = {}
    ran = 0
    for cell in json.loads((ROOT / "docs" / "tutorial.ipynb").read_text(encoding="utf-8"))["cells"]:
        code = "".join(cell["source"])
        if cell["cell_type"] != "code":
            continue
        if "slow" in cell["metadata"]["tags"]:
            compile(code.replace("!./boom", "#"), "tutorial", "exec")
            continue
        commands = [shlex.split(line.removeprefix("!./boom ")) for line in code.splitlines() if line.startswith("!")]
        for words in commands:
            assert cli.main(words) == 0, words
            ran += 1
        if not commands:
            exec(compile(code, "tutorial", "exec"), names)
    assert ran == 4
    assert "differs" in Path("output/validate-run_7.html").read_text(encoding="utf-8")
