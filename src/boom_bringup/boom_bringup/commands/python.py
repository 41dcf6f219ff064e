"""Run Python in the workspace: a benchmark, a node, a script of yours, with our packages and network settings.

./boom python benchmarks/integration.py --quick
./boom python -m boom_can_bridge.bus_server --port 54701
./boom python                                            an interactive session
"""

from __future__ import annotations

import argparse
import os
import sys

from boom_bringup import environment

HELP = "run a benchmark, a node or a script in the workspace"
VERBATIM = "words"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add no option: all arguments go to Python."""
    parser.usage = "%(prog)s [PYTHON-OPTIONS] [SCRIPT | -m MODULE] [ARGUMENTS]"


def run(args: argparse.Namespace) -> int:
    """Replace this process by Python, so that signals and the exit status are those of the script."""
    variables = environment.for_processes(os.environ)
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, *args.words], variables)
