"""What others wrote, through the front door: names, machine files and caches that are damaged or meant badly end in plain words."""

from __future__ import annotations

import json
import os
import pty
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from refusals import refusal

from boom_input.cache import cache_folder

ROOT = Path(__file__).parents[1]
HOSTILE = "a[/red]\x1b[2J\x1b]0;title\x07:bomb:[blink]"


def boom(*words: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "boom"), *words]
    environment = {**os.environ, **variables}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False, timeout=60)


def on_a_terminal(*words: str, cwd: Path) -> tuple[int, str]:
    """Status and all output of a command whose three streams are a terminal."""
    near, far = pty.openpty()
    with subprocess.Popen(
        [sys.executable, str(ROOT / "boom"), *words],
        cwd=cwd,
        env={**os.environ, "COLUMNS": "120"},
        stdin=far,
        stdout=far,
        stderr=far,
    ) as process:
        os.close(far)
        shown = b""
        while True:
            try:
                part = os.read(near, 65536)
            except OSError:  # the last writer has gone
                break
            shown += part
    os.close(near)
    return process.returncode, shown.decode()


def test_a_folder_with_markup_and_escape_sequences_in_its_name_is_shown_and_not_obeyed(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "bags" / "healthy" / "extended", tmp_path / HOSTILE)
    status, shown = on_a_terminal("validate", HOSTILE, "--no-report", cwd=tmp_path)
    assert status == 0, shown
    assert "red]\\x1b[2J\\x1b]0;title\\x07:bomb:[blink]" in shown
    assert "\x1b[2J" not in shown and "\x1b]0" not in shown
    assert "\x1b[" in shown  # our own colours

    result = boom("simulate", HOSTILE, "--output", f"{HOSTILE}2", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert "a[/red]\\x1b[2J" in result.stdout and "\x1b" not in result.stdout


@pytest.mark.parametrize(
    "words",
    [
        ("validate", f"{HOSTILE}/none"),
        (HOSTILE,),
        ("validate", f"--{HOSTILE}"),
        ("check-machine", "\n" * 9 + "x" * 9999),
    ],
)
def test_an_error_that_quotes_a_hostile_word_is_one_line_that_can_be_shown(
    words: tuple[str, ...], tmp_path: Path
) -> None:
    result = boom(*words, cwd=tmp_path)
    assert result.returncode == 2
    assert (said := refusal(result.stderr)).isprintable() and len(said) < 1100


def test_a_library_cut_short_in_the_cache_does_not_end_a_run(tmp_path: Path) -> None:
    words = ("simulate", str(ROOT / "bags" / "healthy" / "extended"), "--duration", "1", "--output")
    shutil.copytree(cache_folder(), tmp_path / "cache", ignore=shutil.ignore_patterns("numba"))
    if not [*(tmp_path / "cache").glob("*.so")]:  # the first test of this user
        assert boom(*words, "first", cwd=tmp_path, BOOM_CACHE=str(tmp_path / "cache")).returncode == 0
    for library in (tmp_path / "cache").glob("*.so"):
        os.truncate(library, 4096)
    again = boom(*words, "second", cwd=tmp_path, BOOM_CACHE=str(tmp_path / "cache"))
    assert (again.returncode, again.stderr) == (0, "")
    (tmp_path / "cache").chmod(0o777)
    refused = boom(*words, "third", cwd=tmp_path, BOOM_CACHE=str(tmp_path / "cache"))
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1
    assert "may be written by others" in refused.stderr and "chmod go-w" in refused.stderr


def test_a_machine_file_is_checked_as_a_whole_and_its_numbers_are_explained(tmp_path: Path) -> None:
    shown = boom("check-machine", "tz17", cwd=tmp_path)
    assert (shown.returncode, shown.stderr) == (0, "")
    for meaning, value in {
        "piston and rod diameter": "140.0 mm, 90.0 mm", "lift, valve fully open: flow": "120 l/min", "T3_extended: reach": "6.98 m",
        "current: the valve opens .. is open": "0.29 .. 0.55 A", "T3_extended: 250 bar hold level": "2861 kg",
    }.items():  # fmt: skip
        (line,) = [line for line in shown.stdout.splitlines() if line.startswith(meaning)]
        assert f"  {value}  " in line

    text = (ROOT / "src/boom_model/boom_model/machines/tz17.yaml").read_text()
    text = (
        text.replace("  rho:  {value: 870.0", "  rho:  {value: 8700")
        .replace("  beta:", "  beat:")
        .replace("A_a: {", "A_a: {nn: 1, ")
    )
    (tmp_path / "mine.yaml").write_text(text + 'learned:\n  - {equation: torque, basis: ["plus(angle, 1e999)"], coefficients: [1],'
                                        ' unit: 10000 N m, validity: {angle: [0, 1]}}\n')  # fmt: skip
    refused = boom("check-machine", "mine.yaml", cwd=tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
    for words in (
        "mine.yaml, line 14: fluid.rho: 8700.0 is outside 600 .. 1200 kg/m^3", "fluid.beat: no such key; did you mean beta?",
        "fluid.beta: missing (bulk modulus", "cylinder.A_a.nn: no such key", "plus(angle, 1e999)",
    ):  # fmt: skip
        assert sum(words in line for line in refused.stderr.splitlines()) == 1, words
    assert all(line.startswith("boom: mine.yaml, line ") for line in refused.stderr.splitlines())


def test_a_machine_file_that_cannot_be_read_has_its_fault_in_the_document_too(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("a: [1, 2")
    refused = boom("check-machine", "mine.yaml", "--json", "mine.json", cwd=tmp_path)
    assert refused.returncode == 2
    (fault,) = json.loads((tmp_path / "mine.json").read_text())["faults"]
    assert refused.stderr == f"boom: {fault}\n" and fault.startswith("mine.yaml, line 2: not readable as YAML")
