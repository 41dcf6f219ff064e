"""Names of files are bytes; a recording's name is text that every page and table can hold."""

import os
import shutil
from pathlib import Path

from boom_recording.loading import load

BAG = Path(__file__).resolve().parents[3] / "bags" / "healthy" / "extended"


def test_a_bag_whose_name_is_no_text_is_read_under_one_that_is(tmp_path: Path) -> None:
    odd = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfebad"))
    shutil.copytree(BAG, odd)
    assert load(odd).name == r"\udcff\udcfebad"
