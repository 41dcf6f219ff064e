"""What numba keeps on disk lies in the user's own cache folder, and damage there costs a compilation, not the run."""

import os
import subprocess
import sys
from pathlib import Path

MODULE = """
from concealed_plant.compiling import compiled

@compiled
def twice(x):
    return 2.0 * x

print(twice(21.0))
"""


def test_damage_in_numbas_cache_costs_a_compilation_and_no_more(tmp_path: Path) -> None:
    (tmp_path / "doubling.py").write_text(MODULE)
    environment = {**os.environ, "BOOM_CACHE": str(tmp_path / "cache")}

    def run() -> tuple[int, str, str]:
        command = [sys.executable, str(tmp_path / "doubling.py")]
        result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        return result.returncode, result.stdout, result.stderr

    assert run() == (0, "42.0\n", "")
    kept = [*(tmp_path / "cache" / "numba").rglob("*.nb?")]
    assert len(kept) == 2 and not [*tmp_path.glob("__pycache__/*.nb?")]
    for path in kept:
        path.write_bytes(path.read_bytes()[:-20])
        assert run() == (0, "42.0\n", "")
