"""The crane as a standard ROS robot: simulation, robot_state_publisher; with control:=true the controller, and over CAN the bridge.

ros2 launch boom_bringup sim.launch.py control:=true
ros2 launch boom_bringup sim.launch.py control:=true transport:=can      # ECU stand-in on a CAN bus, and the bridge
ros2 launch boom_bringup sim.launch.py load_mass:=300.0 control:=true tip_pose:=true
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from boom_bringup import demo_processes, environment, replica
from boom_controller import laws
from boom_description.shipped import robot_description
from boom_model.errors import ModelError
from boom_model.machine_file import load_machine

# Arguments that are handed to the simulation as parameters of the same name: type, default, what it is.
ARGUMENTS = {
    "machine": (str, "tz17", "machine file: the name of one that is shipped, or a path to a .yaml"),
    "outer_boom_angle": (float, "0.28", "locked outer boom joint q3 [rad], pi/2 = in line, 4.59 = folded"),
    "telescope_length": (float, "2.2", "locked telescope extension q4 [m], both stages"),
    "load_mass": (float, "0.0", "load at the tip at the beginning [kg]"),
    "initial_angle": (float, "0.3", "boom angle at the beginning [rad], 0 = horizontal, positive = up"),
    "mode": (str, "real_time", "real_time, or lockstep: one step per command; over CAN real_time alone"),
    "seed": (int, "0", "seed of the sensor noise"),
    "sensors": (str, "thesis", "thesis: noise and quantisation; ideal: neither"),
    "effects": (str, "", "physics beside the machine file's, as YAML"),
    "ground_truth": (bool, "false", "publish the true states on /boom/ground_truth"),
    "realtime_priority": (int, "0", "SCHED_FIFO priority of simulation and controller, 0 = none"),
}
OTHERS = {
    "control": ("false", "true: start the controller too, with the same machine file"),
    "control_law": (laws.DEFAULT, f"of the controller: {', '.join(laws.described())}"),
    "transport": (
        "topics",
        "topics: the simulation publishes; can: behind an ECU on a CAN bus, and the bridge publishes",
    ),
    "urdf": ("", "URDF file of a machine that is not shipped; empty: that of the machine, where there is one"),
    "simulation_parameters": (
        "",
        "parameter file of the simulation; empty: the shipped one; the arguments come after it",
    ),
    "tip_pose": ("false", "true: start the tip pose example too"),
}


def value_of(name: str, text: str):
    """An argument as the type of its parameter; one plain line where it is none."""
    kind = ARGUMENTS[name][0]
    if kind is not bool:
        try:
            return kind(text)
        except ValueError:
            raise RuntimeError(f"{name}:={text}: give {'a number' if kind is float else 'a whole number'}") from None
    if text not in ("true", "false"):
        raise RuntimeError(f"{name}:={text}: give true or false")
    return text == "true"


def start_processes(context):
    """The processes, once the arguments are known."""
    share = Path(get_package_share_directory("boom_bringup"))
    other = {name: LaunchConfiguration(name).perform(context) for name in OTHERS}
    given = {name: value_of(name, LaunchConfiguration(name).perform(context)) for name in ARGUMENTS}
    control, transport = other["control"] == "true", other["transport"]
    if transport not in demo_processes.TRANSPORTS:
        raise RuntimeError(f"transport:={transport} is unknown: give {' or '.join(demo_processes.TRANSPORTS)}")
    if transport == "can" and given["mode"] != "real_time":
        raise RuntimeError("transport:=can runs in real time: leave mode out")
    try:
        machine = load_machine(given["machine"])
        urdf = other["urdf"] or robot_description(machine.name)
        description = Path(urdf).read_text(encoding="utf-8") if urdf else ""
    except (ModelError, OSError) as error:
        raise RuntimeError(str(error)) from None

    def text(value):
        """A string is a string: launch would read it as YAML."""
        return ParameterValue(value, value_type=str) if isinstance(value, str) else value

    def node(package, executable, name, parameters, *files):
        typed = {key: text(value) for key, value in parameters.items()}
        return Node(package=package, executable=executable, name=name, output="screen", parameters=[*files, typed])

    crane = {**given, "robot_description": urdf, "publish_description": False}
    if transport == "can":
        bus = demo_processes.free_bus()
        bridge = replica.bridge_parameters(crane, machine, lockstep=False) | {"publish_description": False}
        processes = [
            # No ROS node: launch would give it arguments that it does not know.
            ExecuteProcess(cmd=demo_processes.bus_command(bus), output="screen"),
            node("boom_can_bridge", "bridge", "boom_can_bridge", bridge | bus),
            node("boom_sim", "ecu", "boom_ecu", replica.ecu_parameters(crane) | bus),
            node("boom_can_bridge", "enable", "boom_enable", {}),
        ]
    else:
        file = other["simulation_parameters"] or str(share / "config" / "simulation.yaml")
        processes = [node("boom_sim", "simulation", "boom_simulation", crane | {"controller_follows": control}, file)]
    if description:
        # It drops joint states that come sooner than its period: half of theirs keeps all 100 a second.
        frames = {"robot_description": description, "publish_frequency": 200.0}
        processes.append(node("robot_state_publisher", "robot_state_publisher", "robot_state_publisher", frames))
    if control:
        told = {"machine": given["machine"], "mode": other["control_law"], "time": given["mode"]}
        priority = {"realtime_priority": given["realtime_priority"]}
        processes.append(node("boom_controller", "controller", "boom_controller", told | priority))
    if other["tip_pose"] == "true":
        file = str(Path(get_package_share_directory("boom_description")) / "config" / "tip_pose.yaml")
        processes.append(node("boom_description", "tip_pose", "boom_tip_pose", {}, file))
    return processes


def generate_launch_description() -> LaunchDescription:
    """Arguments, then the processes."""
    environment.apply()  # the processes inherit it: loopback only, unless BOOM_NETWORK says otherwise (docs/network.md)
    texts = {name: (value, text) for name, (_, value, text) in ARGUMENTS.items()} | OTHERS
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in texts.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start_processes)])
