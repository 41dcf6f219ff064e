"""Files are written whole or not at all; a folder has one writer, and a killed one leaves no lock."""

import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from boom_input import whole
from boom_input.whole import InUseError, one_writer, write_whole

HOLDER = """
import sys
from boom_input.whole import one_writer
with one_writer(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_new_file_has_the_usual_permissions_and_nothing_else_is_there(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_whole(tmp_path / "a.json", "{}\n")
    finally:
        os.umask(before)
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
    assert stat.S_IMODE((tmp_path / "a.json").stat().st_mode) == 0o640


@pytest.mark.parametrize("where", ["fsync", "getpid"])
def test_an_interruption_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    write_whole(tmp_path / "a.json", "old")
    monkeypatch.setattr(whole.os, where, interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "a.json", "new")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("a.json", "old")]


def test_a_link_stays_a_link_and_a_device_is_written_to(tmp_path: Path) -> None:
    (tmp_path / "real").touch()
    (tmp_path / "link").symlink_to("real")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"
    write_whole("/dev/null", "gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_a_second_writer_is_refused_and_a_killed_one_leaves_nothing(tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None and holder.stdout.readline() == "held\n"
    with pytest.raises(InUseError, match="in use by another"), one_writer(tmp_path):
        pass
    holder.send_signal(signal.SIGKILL)
    holder.communicate()
    with one_writer(tmp_path):
        assert list(tmp_path.iterdir()) == []
