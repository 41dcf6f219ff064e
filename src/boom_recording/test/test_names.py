"""Names of files are bytes; a recording's name is text that every page and table can hold."""

import os
import shutil
from pathlib import Path

from boom_recording.loading import load
from boom_recording.recording import told_apart

BAG = Path(__file__).resolve().parents[3] / "bags" / "healthy" / "extended"


def test_a_bag_whose_name_is_no_text_is_read_under_one_that_is(tmp_path: Path) -> None:
    odd = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfebad"))
    shutil.copytree(BAG, odd)
    assert load(odd).name == r"\udcff\udcfebad"


def test_recordings_of_one_name_are_told_apart_by_their_folders_and_others_keep_theirs(tmp_path: Path) -> None:
    (tmp_path / "c7" / "day").mkdir(parents=True)
    (tmp_path / "c13" / "day").mkdir(parents=True)
    for path in ("c7/a.mcap", "c13/a.mcap", "c7/day/b.mcap", "c13/day/b.mcap", "c7/d.mcap"):
        shutil.copy(next(BAG.glob("*.mcap*")), tmp_path / path)
    paths = ("c7/a.mcap", "c13/a.mcap", "c7/day/b.mcap", "c13/day/b.mcap", "c7/d.mcap", "c7/../c7/a.mcap")
    found = told_apart([load(tmp_path / path) for path in paths])
    assert [r.name for r in found] == ["c7/a", "c13/a", "c7/day/b", "c13/day/b", "d", "c7/a (2)"]
