"""Runs a program that can open nothing of a trial except its own case: python -m boom_trials.blind.blindfold MODULE ARGUMENTS...

The working directory is the case's folder, TRIAL/blind/NAME. An audit hook refuses to open, list or rename anything
below TRIAL and outside the case, and to start a program on it, in this process and in all processes forked from it. The sealed
answers lie below TRIAL too; the command does not know where.
"""

from __future__ import annotations

import os
import runpy
import sys
from typing import Any

_EVENTS = {
    "open",
    "os.listdir",
    "os.scandir",
    "os.rename",
    "os.link",
    "os.symlink",
    "os.chdir",
    "os.remove",
    "shutil.copyfile",
}
_STARTED = "subprocess.Popen"


def put_on(case: str) -> None:
    """From now on refuse access to everything in the trial outside the folder ``case``."""
    own = os.path.realpath(case)
    trial = os.path.dirname(os.path.dirname(own))

    def look(event: str, arguments: tuple[Any, ...]) -> None:
        if event == _STARTED:
            program, words, folder = arguments[:3]
            given = [program, *([words] if isinstance(words, str | bytes) else words), folder]
        elif event in _EVENTS:
            given = list(arguments[:2])
        else:
            return
        for argument in given:
            if isinstance(argument, str | bytes | os.PathLike):
                path = os.path.realpath(os.fsdecode(argument))
                inside = os.path.commonpath((path, trial)) == trial and os.path.commonpath((path, own)) != own
                if inside and path != trial:
                    raise PermissionError(f"{path} is sealed: the trial is blind")

    sys.addaudithook(look)


def main() -> None:
    """Install the hook and run the module; returns with its exit status."""
    put_on(os.getcwd())
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
