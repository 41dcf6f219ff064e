"""The times of an MDF file's groups are read as those of a table: what is wrong with them is said, or refused in one line."""

from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal

from boom_import.errors import ImportingError
from boom_import.readers import mdf

TIME = np.arange(500) * 0.01


def written(path: Path, time: np.ndarray) -> Path:
    file = MDF(version="4.10")
    file.append([Signal(np.sin(TIME), time, "rad", name="Angle")])
    file.save(path, overwrite=True)
    file.close()
    return path


def test_a_time_that_is_no_number_is_left_out_with_a_note(tmp_path: Path) -> None:
    source = mdf.read(written(tmp_path / "a.mf4", np.where(np.arange(500) == 100, np.nan, TIME)), lambda share: None)
    assert source.notes == ["rows without a time are left out: 1"]
    (angle,) = source.columns
    assert len(angle.values) == 499 and angle.values == pytest.approx(np.delete(np.sin(TIME), 100))


def test_times_that_stand_twice_are_spread(tmp_path: Path) -> None:
    source = mdf.read(written(tmp_path / "a.mf4", np.repeat(TIME[::2], 2)), lambda share: None)
    assert source.notes == ["2 rows share each stamp: they are spread evenly until the next one"]
    stamps = source.columns[0].stamps_ns
    assert (stamps - stamps[0]) / 1e9 == pytest.approx(TIME, abs=1e-6)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (np.where(np.arange(500) < 250, TIME, TIME - 2.0), "'Angle' goes back by 1.99 s at row 251 of the numbers"),
        (np.zeros(500), "all 500 samples of 'Angle' have the same time"),
        (TIME * 1e12, "beyond the year 2096"),
    ],
)
def test_times_that_no_machine_has_are_refused_in_one_line(tmp_path: Path, time: np.ndarray, words: str) -> None:
    with pytest.raises(ImportingError, match=words):
        mdf.read(written(tmp_path / "a.mf4", time), lambda share: None)


def test_a_group_that_cannot_be_read_is_left_out_with_the_reason(tmp_path: Path) -> None:
    file = MDF(version="4.10")
    file.append([Signal(np.zeros(3), np.zeros(3), "", name="Event")])
    step = (TIME > 2.0).astype(float)
    twice = np.repeat(TIME[::2], 2)
    file.append([Signal(np.sin(TIME), twice, "rad", name="Angle"), Signal(step, twice, "A", name="Current")])
    file.save(tmp_path / "a.mf4", overwrite=True)
    file.close()
    source = mdf.read(tmp_path / "a.mf4", lambda share: None)
    assert source.notes[-1].startswith("a group is left out: all 3 samples of 'Event' have the same time")
    angle, current = source.columns
    assert np.array_equal(angle.stamps_ns, current.stamps_ns)  # also of one that stands still while times stand twice
