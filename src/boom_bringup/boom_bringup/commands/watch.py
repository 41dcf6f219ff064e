"""Watch a running machine: raise an alarm when it leaves the tolerance of its model, and name the subsystem.

The node subscribes to the machine's topics and to /boom/machine_configuration, and publishes on /diagnostics. Alarms are also
printed here. Ctrl-C ends it. To try it, type in two more terminals:

  ./boom sim --effect hose_burst_valve_lag.tau=0.09
  ./boom replay bags/healthy/extended
"""

from __future__ import annotations

import argparse

from boom_bringup.node_command import become_node

HELP = "watch a running machine and raise an alarm when it leaves the tolerance of its model"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--machine", metavar="FILE",
        help="machine file, or the name of a shipped one (default: the machine that the configuration names)",
    )  # fmt: skip
    parser.add_argument("--joint", metavar="NAME", help="name of the boom's joint (default: inner_boom_joint)")
    parser.add_argument(
        "--threshold",
        type=float,
        metavar="X",
        help="score above which an alarm is raised, 1 = noise (default: 1.35)",
    )


def run(args: argparse.Namespace) -> int:
    """Replace this process by the node; does not return."""
    become_node(
        "boom_monitor.watch_node", {"machine": args.machine, "joint_name": args.joint, "threshold": args.threshold}
    )
