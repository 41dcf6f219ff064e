"""Run all checks and tests: style, types, import rules, tests.

Prints the time of each step; all steps run even if one fails. Options that are not listed here go to pytest, for
example: ./boom test -k friction -x
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

from boom_bringup import environment

HELP = "run all checks and tests (style, types, import rules, pytest)"
REST = "pytest_arguments"

_STEPS = ("lint", "format", "types", "imports", "tests")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; the remaining ones go to pytest."""
    parser.add_argument("--only", choices=_STEPS, action="append", help="run only this step (repeatable)")
    parser.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="number of processes that run tests in parallel (default: 2)"
    )


def workspace_root() -> Path:
    """Find the top of the source tree.

    Raises:
        WorkspaceError: this package is installed without its source tree.
    """
    for folder in Path(__file__).resolve().parents:
        if (folder / "pyproject.toml").is_file() and (folder / "src").is_dir():
            return folder
    raise WorkspaceError("the tests need the source tree: run ./boom test at the top of the repository")


class WorkspaceError(RuntimeError):
    """There is no source tree to test."""

    exit_status = 2


def steps(root: Path, jobs: int, pytest_arguments: list[str]) -> dict[str, list[str]]:
    """Give the command of every step, by name."""
    python = [sys.executable, "-m"]
    program = os.path.relpath(Path(sys.executable).with_name("lint-imports"), root)
    parallel = [] if jobs <= 1 else ["-n", str(jobs)]
    return {
        "lint": [*python, "ruff", "check", "--quiet", "."],
        "format": [*python, "ruff", "format", "--check", "--quiet", "."],
        "types": [*python, "mypy"],
        "imports": [program, "--no-cache"],
        "tests": [*python, "pytest", *parallel, *pytest_arguments],
    }


def run(args: argparse.Namespace) -> int:
    """Run the steps; returns 0 if all pass, else 1 (130 after Ctrl-C)."""
    root = workspace_root()
    given = list(args.pytest_arguments)
    wanted = set(args.only or (["tests"] if given else _STEPS))
    variables = dict(os.environ)
    environment.apply(variables)
    results: list[tuple[str, int, float]] = []
    for name, command in steps(root, args.jobs, given).items():
        if name not in wanted:
            continue
        print(f"== {name}: {' '.join([Path(command[0]).name, *command[1:]])}", flush=True)
        begin = time.monotonic()
        status = subprocess.run(command, cwd=root, env=variables, check=False).returncode
        results.append((name, status, time.monotonic() - begin))
    print("\nstep      result   time [s]")
    for name, status, seconds in results:
        print(f"{name:<9} {'ok' if status == 0 else 'FAILED':<8} {seconds:8.1f}")
    return max((1 if status else 0 for _, status, _ in results), default=0)
