"""Watch a running machine: raise an alarm when it leaves the tolerance of its model, and name the subsystem.

The node subscribes to the machine's topics and to /boom/machine_configuration, and publishes on /diagnostics. Alarms are also
printed here. Ctrl-C ends it. To try it, type in two more terminals:

  ./boom sim --effect hose_burst_valve_lag.tau=0.09
  ./boom replay bags/healthy/extended
"""

from __future__ import annotations

import argparse
import math

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.node_command import become_node

HELP = "watch a running machine and raise an alarm when it leaves the tolerance of its model"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--machine", metavar="FILE",
        help="machine file, or the name of a shipped one (default: the machine that the configuration names)",
    )  # fmt: skip
    arguments.add_configuration(parser)
    parser.add_argument(
        "--threshold",
        type=arguments.finite,
        metavar="X",
        help="score above which an alarm is raised, 1 = noise (default: 1.35)",
    )


def run(args: argparse.Namespace) -> int:
    """Replace this process by the node; does not return."""
    own = args.q3 is not None and args.q4 is not None
    if not own and (args.q3, args.q4, args.load) != (None, None, None):
        raise UsageError(
            "--q3, --q4 and --load stand for a missing /boom/machine_configuration: give both --q3 and --q4"
        )
    if own and not args.machine:
        raise UsageError("--q3 and --q4 say no machine: give its file, or tz17, with --machine")
    load = None if args.load is None or math.isnan(args.load) else args.load
    become_node(
        "boom_monitor.watch_node",
        {
            "machine": args.machine, "joint_name": args.joint, "threshold": args.threshold, "own_configuration": own or None,
            "outer_boom_angle": args.q3, "telescope_length": args.q4, "load_mass": load,
        },
    )  # fmt: skip
