"""Start the simulated crane and its tip pose as ROS 2 processes that others can join.

The crane publishes the topics of the machine in real time and follows /boom/current_command; without commands the valve is closed.
With --control the controller runs too and follows /boom/joint_trajectory, /boom/reference and the action
/boom_controller/follow_joint_trajectory. With --can the crane is behind an ECU on a CAN bus, and the bridge publishes. Ctrl-C ends
all processes. To move the boom without a controller, type in a second terminal: ./boom replay bags/healthy/extended

  ./boom sim
  ./boom sim --control
  ./boom sim --control --can
  ./boom sim --load 300 --telescope-length 2.8 --effect hose_burst_valve_lag.tau=0.09
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from typing import TYPE_CHECKING, Any

from boom_bringup import arguments, environment
from boom_bringup.cli import UsageError
from boom_bringup.commands.simulate import parse_effects
from boom_bringup.node_command import node_command
from boom_controller import laws

if TYPE_CHECKING:
    from boom_bringup.supervisor import Program
    from boom_model.machine import Machine

_PRIORITY = 10
_LOADING = 120.0
"""s. What a controller may take until it runs, on a busy computer."""
_CRANE = "boom_sim.simulation_node"

HELP = "start the simulated crane as ROS 2 processes"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--machine", metavar="FILE", default="tz17", help="machine file or shipped name (default: tz17)"
    )
    parser.add_argument(
        "--effect", metavar="ID.NAME=VALUE", action="append", default=[],
        help="physics in addition to the machine file, SI; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--angle", type=arguments.finite, default=0.3, metavar="RAD", help="initial boom angle [rad] (default: 0.3)"
    )
    parser.add_argument(
        "--q3", "--outer-boom-angle", type=arguments.finite, metavar="RAD",
        help="q3 [rad] (default: 0.28, or the first pose of the file)",
    )  # fmt: skip
    parser.add_argument(
        "--q4", "--telescope-length", type=arguments.finite, metavar="M",
        help="q4 [m] (default: 2.2, or the first pose of the file)",
    )  # fmt: skip
    parser.add_argument(
        "--load", type=arguments.finite, default=0.0, metavar="KG", help="load at the tip [kg] (default: 0)"
    )
    parser.add_argument("--seed", type=arguments.seed, default=0, help="seed of the sensor noise (default: 0)")
    parser.add_argument("--sensors", choices=("thesis", "ideal"), default="thesis", help="noise of ch. 6.4 or none")
    parser.add_argument("--ground-truth", action="store_true", help="publish the true states on /boom/ground_truth")
    parser.add_argument(
        "--lockstep", action="store_true", help="publish /clock: one period per command, as fast as commands come"
    )
    parser.add_argument(
        "--can",
        action="store_true",
        help="crane behind an ECU on a CAN bus inside this computer, and the bridge before it",
    )
    parser.add_argument(
        "--control", nargs="?", const=laws.DEFAULT, choices=tuple(laws.described()), metavar="LAW",
        help=f"run the controller, too: control law {', '.join(laws.described())} (default: {laws.DEFAULT}). "
        "It knows what the machine file holds; --effect is of the crane alone",
    )  # fmt: skip
    parser.add_argument(
        "--realtime-priority", type=int, metavar="N",
        help=f"SCHED_FIFO priority of crane and controller, 0 to 90, 0: none (default: {_PRIORITY} where it is allowed, ulimit -r)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Run until Ctrl-C; returns the exit status."""
    import yaml

    from boom_bringup import replica
    from boom_bringup.supervisor import Program, Supervisor
    from boom_description.shipped import robot_description
    from boom_model.machine_file import load_machine

    if args.can and args.lockstep:
        raise UsageError("--can runs in real time: leave --lockstep out")
    machine = load_machine(args.machine)
    urdf, pose = robot_description(machine.name), replica.pose_of(machine)
    effects = parse_effects(args.effect)
    priority = _allowed_priority(args.lockstep) if args.realtime_priority is None else args.realtime_priority
    crane = {
        "machine": args.machine,
        "effects": yaml.safe_dump(effects, default_flow_style=True).strip() if effects else "",
        "initial_angle": args.angle,
        "outer_boom_angle": pose.outer_boom_angle if args.q3 is None else args.q3,
        "telescope_length": pose.telescope_length if args.q4 is None else args.q4,
        "load_mass": args.load,
        "seed": args.seed,
        "sensors": args.sensors,
        "ground_truth": args.ground_truth,
        "mode": "lockstep" if args.lockstep else "real_time",
        "robot_description": urdf,
        "controller_follows": bool(args.control),
        "realtime_priority": priority,
    }
    programs = (
        _over_can(crane, machine, bool(args.control)) if args.can else [Program("crane", node_command(_CRANE, crane))]
    )
    if urdf:
        programs.append(Program("tip_pose", node_command("boom_description.tip_pose_node", {"publish_tf": True})))
    else:
        print(f"note: no URDF for machine {machine.name}: neither /robot_description nor the tip pose is published")
    if args.control:
        controller = {
            "machine": args.machine,
            "mode": args.control,
            "time": "lockstep" if args.lockstep else "real_time",
            "realtime_priority": priority,
        }
        programs.append(Program("control", node_command("boom_controller.controller_node", controller)))
    outcome = Supervisor(programs, environment=environment.for_processes(os.environ)).run()
    if outcome.interrupted is not None:
        return 0  # Ctrl-C is how it is meant to end
    for name in outcome.failed:
        status = outcome.statuses[name]
        how = f"was killed ({signal.Signals(-status).name})" if status < 0 else f"ended with status {status}"
        print(f"boom: {name} {how}, and all others were stopped: start the simulation again", file=sys.stderr)
    return max((status for status in outcome.statuses.values() if status > 0), default=1)


def _over_can(crane: dict[str, Any], machine: Machine, controlled: bool) -> list[Program]:
    """Bus, ECU with the crane, bridge, and who lets it move; parameters as the simulation on topics has them."""
    from boom_bringup import replica
    from boom_bringup.demo_processes import bus_command, free_bus
    from boom_bringup.supervisor import Program

    bus = free_bus()
    enabling = {"after_controller": True, "wait_timeout": _LOADING} if controlled else {}
    of_bridge = replica.bridge_parameters(crane, machine, lockstep=False)
    return [
        Program("bus", bus_command(bus)),
        Program("bridge", node_command("boom_can_bridge.bridge_node", {**of_bridge, **bus})),
        Program("ecu", node_command("boom_sim.ecu_node", {**replica.ecu_parameters(crane), **bus})),
        Program("enable", node_command("boom_can_bridge.enable_node", enabling), may_end=True),
    ]


def _allowed_priority(lockstep: bool) -> int:
    """The priority at which other programs cannot delay the crane, or 0 where the computer does not allow it."""
    if lockstep:
        return 0
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    except OSError:
        return 0
    return _PRIORITY
