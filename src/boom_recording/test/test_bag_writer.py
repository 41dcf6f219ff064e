"""A bag that cannot be written any more."""

import errno

import pytest

from boom_recording.bag_writer import BagWriter
from boom_recording.errors import RecordingError


def test_a_full_disk_leaves_no_empty_bag_however_often_it_is_met(tmp_path):
    """Again when the bag is closed."""
    writer = BagWriter(tmp_path / "bag")
    for _ in range(2):
        with pytest.raises(RecordingError, match="nothing was written"), writer._failures():
            raise OSError(errno.ENOSPC, "No space left on device")
    assert not (tmp_path / "bag").exists()
