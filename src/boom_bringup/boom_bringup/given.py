"""Loads recordings with what the command line says of them: pose, load, name of the joint."""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup.cli import UsageError

if TYPE_CHECKING:
    from boom_recording.recording import Recording


def load_all(
    bags: Sequence[str], args: argparse.Namespace, say: Callable[[str], None], require: Iterable[str] | None = None
) -> list[Recording]:
    """The recordings of one command, each with a name of its own.

    Args:
        bags: rosbag2 folders or .mcap files.
        args: the parsed options.
        say: called with what is being read.
        require: as of `load_given`.

    Raises:
        RecordingError: as `boom_recording.loading.load`.
    """
    from boom_recording.recording import told_apart

    recordings = []
    for bag in bags:
        say(f"reading {bag}")
        recordings.append(load_given(bag, args, require))
    return told_apart(recordings)


def load_given(bag: str | Path, args: argparse.Namespace, require: Iterable[str] | None = None) -> Recording:
    """The recording at `bag` with the options of `arguments.add_configuration` applied.

    Args:
        bag: rosbag2 folder or .mcap file.
        args: the parsed options.
        require: topics that must be there (default: those of a recording of the machine).

    Raises:
        UsageError: the boom's joint is given for another one.
        RecordingError: as `boom_recording.loading.load`.
    """
    from boom_recording import loading
    from boom_recording.channels import DEFAULT_JOINT
    from boom_recording.recording import GivenConfiguration

    for part, name in args.joints.items():
        if name == (args.joint or DEFAULT_JOINT):
            raise UsageError(f"--joints {part}={name}: this is the boom's own joint: give the name of the {part}'s")
    wanted = loading.REQUIRED if require is None else require
    given = GivenConfiguration(args.q3, args.q4, args.load)
    return loading.load(bag, require=wanted, joint=args.joint or DEFAULT_JOINT, given=given, joints=args.joints)


def sha256(path: Path) -> str:
    """Checksum of a recording's files, in the order of their names: a path has many spellings, and a file many paths."""
    files = sorted(path.glob("*.mcap*")) if path.is_dir() else [path]
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


def refuse_repeated(bags: Sequence[str], checksums: Sequence[str]) -> None:
    """Raises UsageError: a recording is given twice; it would count as two that agree."""
    for bag, checksum, k in zip(bags, checksums, range(len(bags)), strict=True):
        if checksum in checksums[:k]:
            same = bags[checksums.index(checksum)]
            what = f"{bag} is given twice" if bag == same else f"{bag} is the same recording as {same}"
            raise UsageError(f"{what} and would count twice: leave one of the two out")
