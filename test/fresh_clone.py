"""A clone of the tree in a folder of its own, as a user has it, with nothing of the developer's around it."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from boom_model.codegen.compiled import cache_folder

ROOT = Path(__file__).resolve().parents[1]
PATIENCE, SET_UP = 300.0, 900.0


class Clone:
    """The clone; commands run in it by their names."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "clone"
        home = folder / "home"
        home.mkdir()
        self.environment = {"PATH": os.environ["PATH"], "HOME": str(home), "ROS_DOMAIN_ID": os.environ["ROS_DOMAIN_ID"]}
        # A cache of its own would compile every model once more: 25 s that show nothing about the commands.
        self.environment["BOOM_CACHE"] = str(cache_folder())
        _copy(self.path)
        if os.environ.get("CI") == "true":
            self._set_up()
        else:
            _borrow_packages(self.path)

    def _set_up(self) -> None:
        # What installs packages keeps what the machine tells it: its cache, its proxy, where packages come from.
        installer = {
            k: v for k, v in os.environ.items() if k.startswith(("PIP_", "UV_", "SSL_")) or k.lower().endswith("_proxy")
        }
        installer |= {"HOME": os.environ.get("HOME", "/")}
        ended_well(self.begin("setup", **installer), patience=SET_UP)

    def run(self, *words: str | Path, status: int = 0, **variables: str) -> str:
        """Run ``./boom WORDS`` to its end; its output. Fails on another exit status or a traceback."""
        return ended_well(self.begin(*words, **variables), status)

    def begin(self, *words: str | Path, **variables: str) -> subprocess.Popen[str]:
        """Start ``./boom WORDS``."""
        return subprocess.Popen(
            ["./boom", *map(str, words)], cwd=self.path, env=self.environment | variables, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip


def ended_well(process: subprocess.Popen[str], status: int = 0, patience: float = PATIENCE) -> str:
    """The output of a process that ends by itself. Fails on another exit status or a traceback."""
    try:
        out, err = process.communicate(timeout=patience)
    finally:
        process.kill()
    assert process.returncode == status, f"{process.args}: {process.returncode}\n{out[-2000:]}{err[-2000:]}"
    assert "Traceback" not in err
    return out


class Running:
    """A command that runs until it is stopped; its lines can be waited for."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process, self.lines, self._news = process, [], threading.Condition()
        self._readers = [threading.Thread(target=self._read, args=(s,)) for s in (process.stdout, process.stderr)]
        for reader in self._readers:
            reader.start()

    def _read(self, stream) -> None:
        for line in stream:
            with self._news:
                self.lines.append(line.rstrip())
                self._news.notify_all()
        with self._news:
            self._news.notify_all()

    def says(self, words: str) -> None:
        """Wait for a line that holds the words."""
        with self._news:
            said = self._news.wait_for(lambda: any(words in line for line in self.lines) or self._silent(), timeout=60)
        assert said and any(words in line for line in self.lines), f"never said {words!r}: {self.lines}"

    def _silent(self) -> bool:
        return self.process.poll() is not None

    def stop(self) -> int:
        """Ctrl-C; the exit status."""
        self.process.send_signal(signal.SIGINT)
        return self.ended()

    def ended(self) -> int:
        try:
            return self.process.wait(30)
        finally:
            self.process.kill()
            for reader in self._readers:
                reader.join()


def _copy(target: Path) -> None:
    """What git has in the tree, as it is now: a file that nobody added is not there."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("the tree was unpacked without .git: which files belong to it is not known")
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)


def _borrow_packages(tree: Path) -> None:
    """An environment for the clone's own sources with the packages that are installed here: a set-up in one second."""
    environment = tree / ".venv"
    base = getattr(sys, "_base_executable", sys.executable)
    subprocess.run([base, "-m", "venv", "--without-pip", str(environment)], check=True)
    packages = next(Path(sys.prefix).glob("lib/python3*/site-packages"))
    own = environment / packages.relative_to(sys.prefix)
    for folder in (packages, packages.parent, packages.parent.parent, Path(sys.prefix) / "bin", Path(sys.prefix)):
        for entry in folder.iterdir():
            place = environment / entry.relative_to(sys.prefix)
            if entry.name not in ("boom_workspace.pth", ".boom") and not place.exists():
                place.symlink_to(entry)
    loader = importlib.machinery.SourceFileLoader("launcher_of_the_clone", str(tree / "boom"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    launcher = importlib.util.module_from_spec(spec)
    loader.exec_module(launcher)
    (own / "boom_workspace.pth").write_text("".join(f"{line}\n" for line in launcher.workspace_paths()))
    (environment / ".boom").mkdir()
    (environment / ".boom" / "complete").write_text(launcher.quick_key())


def children(parent: int) -> list[int]:
    """Process ids of the children of ``parent``."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(fields[1]) == parent:
                found.append(int(entry.name))
    return found
