"""Temporary folders: gone at the end, cleared away after a kill, never those of a living process."""

import subprocess
import sys
import tempfile

import pytest

from boom_fleet import scratch as module
from boom_fleet.scratch import PREFIX, clear, scratch

HOLDS = """
from boom_fleet.scratch import scratch
with scratch() as folder:
    (folder / "machine.yaml").write_text("a: 1")
    print(folder, flush=True)
    input()
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    module._cleared_once.cache_clear()
    return tmp_path


def test_a_folder_is_gone_at_the_end_also_after_an_error(temporary):
    with pytest.raises(ValueError, match="no machine"), scratch() as folder:
        (folder / "machine.yaml").write_text("a: 1")
        raise ValueError("no machine")
    assert list(temporary.iterdir()) == []


def test_what_a_killed_process_left_goes_and_what_a_living_one_uses_stays(temporary):
    (temporary / "boom-other").mkdir()
    process = subprocess.Popen([sys.executable, "-c", HOLDS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    held = process.stdout.readline().strip()

    clear()
    assert [str(p) for p in temporary.glob(f"{PREFIX}*")] == [held]

    process.kill()
    process.communicate()
    with scratch() as mine:
        assert list(temporary.glob(f"{PREFIX}*")) == [mine]
    assert [p.name for p in temporary.iterdir()] == ["boom-other"]


def test_a_folder_that_another_start_cleared_away_at_once_is_made_again(temporary, monkeypatch):
    made, mkdtemp = [], module.mkdtemp

    def cleared_at_first(**options):
        made.append(mkdtemp(**options))
        if len(made) == 1:
            clear()
        return made[-1]

    monkeypatch.setattr(module, "mkdtemp", cleared_at_first)
    with scratch() as folder:
        assert str(folder) == made[1] and folder.is_dir()
