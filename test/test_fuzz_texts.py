"""A short run of the fuzzers of YAML and CSV; the long ones are run by hand (benchmarks/README.md)."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(("program", "cases"), [("fuzz_yaml.py", 120), ("fuzz_csv.py", 150)])
def test_damaged_texts_end_in_one_line_or_are_sound(program: str, cases: int) -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / program), "--cases", str(cases), "--seed", "22"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert (result.returncode, result.stderr) == (0, ""), result.stdout + result.stderr
    assert f"{cases} cases, seed 22" in result.stdout
