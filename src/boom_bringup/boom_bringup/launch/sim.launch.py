"""The simulated crane with its robot description; with control:=true the controller, with tip_pose:=true the perception example.

ros2 launch boom_bringup sim.launch.py load_mass:=300.0 control:=true tip_pose:=true
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from boom_bringup import environment
from boom_controller import laws

# Arguments that are handed to the simulation as parameters of the same name: type, default, what it is.
ARGUMENTS = {
    "machine": (str, "tz17", "machine file: the name of one that is shipped, or a path to a .yaml"),
    "outer_boom_angle": (float, "0.28", "locked outer boom joint q3 [rad], pi/2 = in line, 4.59 = folded"),
    "telescope_length": (float, "2.2", "locked telescope extension q4 [m], both stages"),
    "load_mass": (float, "0.0", "load at the tip at the beginning [kg]"),
    "initial_angle": (float, "0.3", "boom angle at the beginning [rad], 0 = horizontal, positive = up"),
    "mode": (str, "real_time", "real_time, or lockstep: one step per command"),
    "seed": (int, "0", "seed of the sensor noise"),
    "sensors": (str, "thesis", "thesis: noise and quantisation; ideal: neither"),
    "effects": (str, "", "physics beside the machine file's, as YAML"),
    "ground_truth": (bool, "false", "publish the true states on /boom/ground_truth"),
    "realtime_priority": (int, "0", "SCHED_FIFO priority of simulation and controller, 0 = none"),
}


def generate_launch_description() -> LaunchDescription:
    """Simulation, robot description and, on request, controller and tip pose."""
    environment.apply()  # the processes inherit it: loopback only, unless BOOM_NETWORK says otherwise (docs/network.md)
    share = Path(get_package_share_directory("boom_bringup"))
    description = Path(get_package_share_directory("boom_description"))
    urdf = str(description / "urdf" / "epsilon_tz17.urdf")
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (_, value, text) in ARGUMENTS.items()
    ]
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (kind, _, _) in ARGUMENTS.items()
    }
    control = LaunchConfiguration("control")
    return LaunchDescription(
        [
            *declared,
            DeclareLaunchArgument(
                "control",
                default_value="false",
                description="true: start the controller too, with the same machine file",
            ),
            DeclareLaunchArgument(
                "control_law",
                default_value=laws.DEFAULT,
                description=f"of the controller: {', '.join(laws.described())}",
            ),
            DeclareLaunchArgument(
                "urdf",
                default_value=urdf,
                description="URDF published on /robot_description; empty for another machine than tz17",
            ),
            DeclareLaunchArgument(
                "simulation_parameters",
                default_value=str(share / "config" / "simulation.yaml"),
                description="parameter file of the simulation; the arguments above come after it",
            ),
            DeclareLaunchArgument(
                "tip_pose", default_value="false", description="true: start the perception example too"
            ),
            Node(
                package="boom_sim",
                executable="simulation",
                name="boom_simulation",
                output="screen",
                parameters=[
                    LaunchConfiguration("simulation_parameters"),
                    {
                        **given,
                        "robot_description": ParameterValue(LaunchConfiguration("urdf"), value_type=str),
                        "controller_follows": ParameterValue(control, value_type=bool),
                    },
                ],
            ),
            Node(
                package="boom_controller",
                executable="controller",
                name="boom_controller",
                output="screen",
                parameters=[
                    {
                        "machine": given["machine"],
                        "mode": ParameterValue(LaunchConfiguration("control_law"), value_type=str),
                        "time": given["mode"],
                        "realtime_priority": given["realtime_priority"],
                    }
                ],
                condition=IfCondition(control),
            ),
            Node(
                package="boom_description",
                executable="tip_pose",
                name="boom_tip_pose",
                output="screen",
                parameters=[str(description / "config" / "tip_pose.yaml")],
                condition=IfCondition(LaunchConfiguration("tip_pose")),
            ),
        ]
    )
