"""Replays a recording into the simulated crane and records what both publish; says then how to validate the new bag.

ros2 launch boom_bringup demo.launch.py bag:=bags/healthy/extended output:=output/demo_bag
"""

import math
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, LogInfo, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from boom_bringup import environment
from boom_diagnosis.initial_state import resting_start
from boom_recording.errors import RecordingError
from boom_recording.loading import load


def start_processes(context):
    """The three processes, the simulation in the pose and with the load that the recording tells."""
    share = Path(get_package_share_directory("boom_bringup"))
    value = {name: LaunchConfiguration(name).perform(context) for name in ("bag", "output", "machine", "seed")}
    try:
        recording = load(value["bag"])
    except RecordingError as error:
        raise RuntimeError(str(error)) from None
    rest = resting_start(recording)
    if rest is None:
        raise RuntimeError(
            f"{value['bag']}: the boom does not rest at the beginning, so that the simulation cannot start like it"
        )
    configuration = recording.configuration
    simulation = {
        "machine": value["machine"] or configuration.machine,
        "outer_boom_angle": float(configuration.outer_boom_angle),
        "telescope_length": float(configuration.telescope_length),
        "load_mass": 0.0 if math.isnan(configuration.load_mass) else float(configuration.load_mass),
        "initial_angle": float(rest["angle"]),
        "initial_hose_pressure": float(rest["hose_pressure"]),
        "initial_rod_pressure": float(rest["rod_pressure"]),
        "mode": "lockstep",
        "seed": int(value["seed"]),
        "robot_description": str(share / "urdf" / "epsilon_tz17.urdf"),
    }
    replay = Node(
        package="boom_recording",
        executable="replay",
        name="boom_replay",
        output="screen",
        parameters=[
            str(share / "config" / "replay.yaml"),
            {"bag": value["bag"], "what": "commands", "lockstep": True, "wait_for_recorder": True, "wait_for": 2},
        ],
    )
    hint = f"the new bag is {value['output']}; validate it with: ros2 run boom_bringup boom validate {value['output']}"
    return [
        Node(
            package="boom_recording",
            executable="recorder",
            name="boom_recorder",
            output="screen",
            parameters=[str(share / "config" / "recorder.yaml"), {"output": value["output"]}],
        ),
        Node(
            package="boom_sim",
            executable="simulation",
            name="boom_simulation",
            output="screen",
            parameters=[str(share / "config" / "simulation.yaml"), simulation],
        ),
        replay,
        # The recorder writes the bag's index while it shuts down, hence the hint before.
        RegisterEventHandler(
            OnProcessExit(
                target_action=replay,
                on_exit=[LogInfo(msg=hint), EmitEvent(event=Shutdown(reason="the replay is over"))],
            )
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Arguments, then the processes once the recording is known."""
    environment.apply()  # the processes inherit it: loopback only, unless BOOM_NETWORK says otherwise (docs/network.md)
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="recording to replay: a rosbag2 directory or an .mcap file"),
            DeclareLaunchArgument("output", default_value="output/demo_bag", description="new bag; must not exist yet"),
            DeclareLaunchArgument(
                "machine", default_value="", description="machine file; empty: the one that the recording names"
            ),
            DeclareLaunchArgument("seed", default_value="0", description="seed of the simulated sensors' noise"),
            OpaqueFunction(function=start_processes),
        ]
    )
