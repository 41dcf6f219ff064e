"""Set up the workspace and say where it is.

`./boom` sets itself up on first use; this command does only that. `requirements/` names all installed packages with versions and
hashes. The environment is in `.venv`; to start over, remove that folder.
"""

from __future__ import annotations

import argparse
import os
import sys

from boom_bringup import __version__

HELP = "set up the workspace (other commands do so on first use)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add no option."""


def run(_args: argparse.Namespace) -> int:
    """Print what is set up. `./boom` has done the work before calling this."""
    version = ".".join(str(part) for part in sys.version_info[:3])
    print(f"boom {__version__} is set up: Python {version} in {os.path.relpath(sys.prefix)}")
    return 0
