"""Replays a recording into the simulated crane over CAN and records what comes back; says then how to validate the new bag.

ros2 launch boom_bringup demo.launch.py bag:=bags/healthy/extended output:=output/demo_bag
ros2 launch boom_bringup demo.launch.py bag:=bags/healthy/extended transport:=topics        # without CAN
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from boom_bringup import demo_processes, environment, replica
from boom_bringup.replica import ReplicaError
from boom_model.errors import ModelError
from boom_recording.errors import RecordingError
from boom_recording.loading import load


def start_processes(context):
    """The processes, the simulated crane in the pose and with the load that the recording tells."""
    share = Path(get_package_share_directory("boom_bringup"))
    names = ("bag", "output", "machine", "seed", "transport")
    value = {name: LaunchConfiguration(name).perform(context) for name in names}

    def node(package, executable, name, parameters, file=None):
        files = [str(share / "config" / f"{file}.yaml")] if file else []
        return Node(
            package=package, executable=executable, name=name, output="screen", parameters=[*files, dict(parameters)]
        )

    if value["transport"] not in demo_processes.TRANSPORTS:
        raise RuntimeError(f"transport:={value['transport']} is unknown: give {' or '.join(demo_processes.TRANSPORTS)}")
    try:
        recording = load(value["bag"])
        machine, source = replica.machine_of({value["bag"]: recording}, value["machine"] or None)
        simulation = replica.simulation_parameters(recording, value["bag"], machine, source, int(value["seed"]))
    except (RecordingError, ModelError, ReplicaError) as error:
        raise RuntimeError(str(error)) from None
    if value["transport"] == "can":
        bus = demo_processes.free_bus()
        crane = [
            # No ROS node: launch would give it arguments that it does not know.
            ExecuteProcess(cmd=demo_processes.bus_command(bus), output="screen"),
            node("boom_can_bridge", "bridge", "boom_can_bridge", replica.bridge_parameters(simulation, machine) | bus),
            node("boom_sim", "ecu", "boom_ecu", replica.ecu_parameters(simulation) | bus),
            node("boom_can_bridge", "enable", "boom_enable", {}),
        ]
        given = demo_processes.CAN_REPLAY
    else:
        crane = [node("boom_sim", "simulation", "boom_simulation", simulation, "simulation")]
        given = demo_processes.REPLAY
    replay = node(
        "boom_recording", "replay", "boom_replay", {"bag": value["bag"], "what": "commands", **given}, "replay"
    )
    hint = f"the new bag is {value['output']}; validate it with: ros2 run boom_bringup boom validate {value['output']}"
    return [
        node("boom_recording", "recorder", "boom_recorder", {"output": value["output"]}, "recorder"),
        *crane,
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
            DeclareLaunchArgument(
                "transport",
                default_value="can",
                description="can: ECU stand-in, bus and bridge; topics: the simulation itself",
            ),
            OpaqueFunction(function=start_processes),
        ]
    )
