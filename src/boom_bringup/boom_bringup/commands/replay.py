"""Replay a recording on topics: its currents as commands, or its angle as reference.

Starts the replay node. It waits for a subscriber, sends the samples with the timing of the recording, and ends. When replaying
commands it sends zero currents over a gap, at the end and on Ctrl-C, so that the boom stops.
"""

from __future__ import annotations

import argparse

from boom_bringup import arguments
from boom_bringup.node_command import become_node

HELP = "replay a recording on topics"


def _not_negative(text: str) -> float:
    value = arguments.finite(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("bag", metavar="BAG", help="rosbag2 directory or .mcap file")
    parser.add_argument(
        "--what",
        choices=("commands", "reference"),
        default="commands",
        help="commands: currents to /boom/current_command; reference: angle to /boom/reference (default: commands)",
    )
    parser.add_argument(
        "--rate", type=arguments.positive, default=1.0, metavar="X", help="times faster than recorded (default: 1)"
    )
    parser.add_argument("--start", type=_not_negative, default=0.0, metavar="S", help="start [s] (default: 0)")
    parser.add_argument("--duration", type=arguments.positive, metavar="S", help="duration [s] (default: to the end)")
    arguments.add_joint(parser)
    parser.add_argument("--loop", action="store_true", help="restart at the end; a reference is led back slowly")
    parser.add_argument("--paused", action="store_true", help="wait for the service /boom_replay/pause (data: false)")
    parser.add_argument("--clock", action="store_true", help="publish the replayed time on /clock")
    parser.add_argument(
        "--lockstep", action="store_true", help="one command per /clock tick of the simulation, as fast as both allow"
    )
    parser.add_argument("--wait-for-recorder", action="store_true", help="wait until the recorder reports ready")
    parser.add_argument(
        "--wait-timeout",
        type=arguments.positive,
        metavar="S",
        help="longest wait for subscribers [s] (default: as in the node)",
    )


def run(args: argparse.Namespace) -> int:
    """Replace this process by the replay node."""
    become_node(
        "boom_recording.replay_node",
        {
            "bag": args.bag,
            "what": args.what,
            "rate": args.rate,
            "start": args.start,
            "duration": args.duration,
            "loop": args.loop,
            "paused": args.paused,
            "clock": args.clock,
            "lockstep": args.lockstep,
            "wait_for_recorder": args.wait_for_recorder,
            "wait_timeout": args.wait_timeout,
            "joint": args.joint,
        },
    )
