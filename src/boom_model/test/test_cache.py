"""The cache folder: what lies in it is run, so damage, other owners and open doors end in no crash and no foreign code."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from boom_input.cache import cache_folder, is_whole, keep
from boom_input.files import InputError
from boom_model.codegen import compiled
from boom_model.errors import BuildError

SOURCE = "int answer(void) { return 42; }\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("BOOM_CACHE", str(tmp_path / "cache"))
    compiled.load_c.cache_clear()
    return tmp_path / "cache"


def answer_of_another_process() -> subprocess.CompletedProcess[str]:
    code = f"from boom_model.codegen.compiled import load_c; print(load_c({SOURCE!r}).answer())"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("size", [0, 31, 4096, -1])
def test_a_library_cut_short_is_made_anew(folder: Path, size: int) -> None:
    library = compiled.load_c(SOURCE)
    assert library.answer() == 42
    (path,) = folder.glob("*.so")
    whole = path.read_bytes()
    copy = path.with_suffix(".cut")  # not in place: this process runs the file itself
    copy.write_bytes(whole[:size])
    copy.replace(path)
    result = answer_of_another_process()
    assert (result.returncode, result.stdout, result.stderr) == (0, "42\n", "")
    assert is_whole(path)


def test_folder_and_files_are_for_their_owner_only_under_any_umask(folder: Path) -> None:
    before = os.umask(0)
    try:
        compiled.load_c(SOURCE)
    finally:
        os.umask(before)
    assert [oct(path.stat().st_mode & 0o777) for path in (folder, *folder.glob("*.so"))] == ["0o700", "0o600"]
    assert [path.suffix for path in folder.iterdir()] == [".so"]


def test_what_others_may_write_or_own_is_refused_with_what_to_do(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.mkdir(mode=0o700)
    folder.chmod(0o777)
    with pytest.raises(BuildError, match=r"may be written by others.*: chmod go-w .*, or set BOOM_CACHE$"):
        compiled.load_c(SOURCE)
    folder.chmod(0o755)
    compiled.load_c(SOURCE)
    (path,) = folder.glob("*.so")
    path.chmod(0o622)
    compiled.load_c.cache_clear()
    with pytest.raises(BuildError, match=r"cache file .* may be written by others.* or remove it$"):
        compiled.load_c(SOURCE)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    with pytest.raises(BuildError, match=r"cache folder .* belongs to another user.*: set BOOM_CACHE"):
        compiled.load_c(SOURCE)


def test_an_empty_setting_counts_as_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("BOOM_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "boom"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_folder() == tmp_path / "home" / ".cache" / "boom"


def test_a_folder_that_cannot_be_made_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("BOOM_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.raises(
        InputError, match=r"cache folder .*: (Not a directory|File exists): set BOOM_CACHE to a folder of your own"
    ):
        cache_folder()


def test_a_reader_never_finds_half_of_what_several_write(folder: Path) -> None:
    path = cache_folder() / "x"
    keep(path, b"")
    contents = [bytes([k]) * 200_000 for k in range(3)]
    writers = [threading.Thread(target=lambda c=c: [keep(path, c) for _ in range(10)]) for c in contents]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        assert is_whole(path)
    for writer in writers:
        writer.join()
    assert [p.name for p in folder.iterdir()] == ["x"]


def test_what_the_compiler_complains_of_is_one_line_that_names_the_cause() -> None:
    with pytest.raises(BuildError, match=r"could not build the model: .*error: .*missing\.h") as caught:
        compiled.compiled('#include "missing.h"')
    assert "\n" not in str(caught.value)
