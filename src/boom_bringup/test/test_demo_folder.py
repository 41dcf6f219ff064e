"""The demo's folder: the last good bag stays until the next is good, nobody else's is touched, one demo at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from boom_bringup.demo_folder import BAG, FolderError, held
from boom_input.whole import InUseError


def record(folder: Path, text: str) -> None:
    folder.mkdir(parents=True)
    (folder / "metadata.yaml").write_text(text)


def test_a_new_bag_takes_the_place_of_the_old_one_when_it_is_good(tmp_path: Path) -> None:
    for text in ("first", "second"):
        with held(tmp_path / "demo") as folder:
            record(folder.recording(), text)
            assert folder.keep() == tmp_path / "demo" / BAG
    assert (tmp_path / "demo" / BAG / "metadata.yaml").read_text() == "second"
    assert [path.name for path in (tmp_path / "demo").iterdir() if path.is_dir()] == [BAG]


def test_a_run_that_fails_leaves_the_old_bag_and_nothing_else(tmp_path: Path) -> None:
    with held(tmp_path) as folder:
        record(folder.recording(), "good")
        folder.keep()
    with pytest.raises(KeyboardInterrupt), held(tmp_path) as folder:
        record(folder.recording(), "half")
        raise KeyboardInterrupt
    assert (tmp_path / BAG / "metadata.yaml").read_text() == "good"
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()] == [BAG]


def test_a_bag_that_is_no_demos_is_not_touched(tmp_path: Path) -> None:
    record(tmp_path / BAG, "mine")
    with pytest.raises(FolderError, match="not the bag of an earlier demo"), held(tmp_path):
        pass
    assert (tmp_path / BAG / "metadata.yaml").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == [BAG]


def test_a_second_demo_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    with held(tmp_path), pytest.raises(InUseError, match="in use by another"), held(tmp_path):
        pass
    with held(tmp_path):
        pass


def test_what_a_killed_demo_left_is_removed(tmp_path: Path) -> None:
    record(tmp_path / f".{BAG}-4194305", "half")
    with held(tmp_path):
        assert not (tmp_path / f".{BAG}-4194305").exists()


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FolderError, match="give another --output"), held(tmp_path / "file" / "demo"):
        pass
