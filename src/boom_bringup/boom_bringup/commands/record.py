"""Record topics into a bag until Ctrl-C.

Starts the recorder node. The bag is a rosbag2 directory with one MCAP file, whose chunks have CRCs and are written at least every
half second, so that little is lost even if the process is killed. After a clean end it also has metadata.yaml.
"""

from __future__ import annotations

import argparse

from boom_bringup.node_command import become_node

HELP = "record topics into a bag"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("output", metavar="BAG", help="folder of the new bag; an existing one is never overwritten")
    parser.add_argument(
        "--topic",
        action="append",
        metavar="NAME",
        help="topic to record, repeatable; * = all (default: sensors, configuration and commands)",
    )
    parser.add_argument(
        "--require",
        action="append",
        metavar="NAME",
        help="report ready once this topic has a publisher, repeatable (default: the four sensor topics)",
    )


def run(args: argparse.Namespace) -> int:
    """Replace this process by the recorder node."""
    topics = tuple(args.topic) if args.topic else None
    # Only topics of their own: then those are what there is to wait for.
    required = tuple(args.require) if args.require else (None if topics is None or "*" in topics else topics)
    become_node("boom_recording.recorder_node", {"output": args.output, "topics": topics, "required_topics": required})
