"""Start the simulated crane as ROS 2 processes that others can join: crane, and the pose of its boom tip.

It publishes the topics of the machine in real time and takes /boom/current_command; without commands the valve is closed.
Ctrl-C ends it. To move it, in a second terminal: ./boom replay bags/healthy/extended

  ./boom sim
  ./boom sim --load 300 --telescope-length 2.8 --effect hose_burst_valve_lag.tau=0.09
"""

from __future__ import annotations

import argparse
import os

from boom_bringup import arguments, environment
from boom_bringup.commands._node_command import node_command
from boom_bringup.commands.simulate import parse_effects

HELP = "start the simulated crane as ROS 2 processes"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--machine", metavar="FILE", default="tz17", help="machine file or shipped name (default: tz17)"
    )
    parser.add_argument(
        "--effect", metavar="ID.NAME=VALUE", action="append", default=[],
        help="physics beside the machine file's, SI; may be given again",
    )  # fmt: skip
    parser.add_argument(
        "--angle", type=float, default=0.3, metavar="RAD", help="initial boom angle [rad] (default: 0.3)"
    )
    parser.add_argument("--outer-boom-angle", type=float, default=0.28, metavar="RAD", help="q3 [rad] (default: 0.28)")
    parser.add_argument("--telescope-length", type=float, default=2.2, metavar="M", help="q4 [m] (default: 2.2)")
    parser.add_argument("--load", type=float, default=0.0, metavar="KG", help="load at the tip [kg] (default: 0)")
    parser.add_argument("--seed", type=arguments.seed, default=0, help="seed of the sensor noise (default: 0)")
    parser.add_argument("--sensors", choices=("thesis", "ideal"), default="thesis", help="noise of ch. 6.4 or none")
    parser.add_argument("--ground-truth", action="store_true", help="publish the true states on /boom/ground_truth")
    parser.add_argument(
        "--lockstep", action="store_true", help="own /clock: one period per command, as fast as they come"
    )


def run(args: argparse.Namespace) -> int:
    """Run until Ctrl-C; returns the exit status."""
    import yaml

    from boom_bringup.supervisor import Program, Supervisor
    from boom_bringup.urdf_of import robot_description
    from boom_model.machine_file import load_machine

    machine = load_machine(args.machine)
    urdf = robot_description(machine.name)
    effects = parse_effects(args.effect)
    crane = {
        "machine": args.machine,
        "effects": yaml.safe_dump(effects, default_flow_style=True).strip() if effects else "",
        "initial_angle": args.angle,
        "outer_boom_angle": args.outer_boom_angle,
        "telescope_length": args.telescope_length,
        "load_mass": args.load,
        "seed": args.seed,
        "sensors": args.sensors,
        "ground_truth": args.ground_truth,
        "mode": "lockstep" if args.lockstep else "real_time",
        "robot_description": urdf,
    }
    programs = [Program("crane", node_command("boom_sim.simulation_node", crane))]
    if urdf:
        programs.append(Program("tip_pose", node_command("boom_bringup.tip_pose_node", {})))
    else:
        print(f"note: no URDF for machine {machine.name}: neither /robot_description nor the tip pose is published")
    outcome = Supervisor(programs, environment=environment.for_processes(os.environ)).run()
    if outcome.interrupted is not None:
        return 0  # Ctrl-C is how it is meant to end
    return max((status for status in outcome.statuses.values() if status > 0), default=1)
