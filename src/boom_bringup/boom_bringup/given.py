"""Loads recordings with what the command line says of them: pose, load, name of the joint."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

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
        RecordingError: as `boom_recording.loading.load`.
    """
    from boom_recording import loading
    from boom_recording.channels import DEFAULT_JOINT
    from boom_recording.recording import GivenConfiguration

    wanted = loading.REQUIRED if require is None else require
    given = GivenConfiguration(args.q3, args.q4, args.load)
    return loading.load(bag, require=wanted, joint=args.joint or DEFAULT_JOINT, given=given, joints=args.joints)
