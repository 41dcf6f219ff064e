"""Which message carries each topic of ``boom_input.channels``, and the topics that carry no channel."""

from typing import Literal

DEFAULT_JOINT = "inner_boom_joint"

JOINT_STATES = "/joint_states"
SOLENOID_CURRENTS = "/boom/solenoid_currents"
MACHINE_CONFIGURATION = "/boom/machine_configuration"
CURRENT_COMMAND = "/boom/current_command"
REFERENCE = "/boom/reference"
REFERENCE_STATE = "/boom/reference_state"
OSCILLOSCOPE = "/boom/pilot_valve/oscilloscope"
ROBOT_DESCRIPTION = "/robot_description"

TYPES = {
    JOINT_STATES: "sensor_msgs/msg/JointState",
    "/boom/hose_pressure": "sensor_msgs/msg/FluidPressure",
    "/boom/rod_pressure": "sensor_msgs/msg/FluidPressure",
    "/boom/head_pressure": "sensor_msgs/msg/FluidPressure",
    "/boom/supply_pressure": "sensor_msgs/msg/FluidPressure",
    "/boom/tank_pressure": "sensor_msgs/msg/FluidPressure",
    SOLENOID_CURRENTS: "boom_interfaces/msg/SolenoidCurrents",
    CURRENT_COMMAND: "boom_interfaces/msg/SolenoidCurrents",
    REFERENCE: "sensor_msgs/msg/JointState",
    REFERENCE_STATE: "boom_interfaces/msg/ReferenceState",
    MACHINE_CONFIGURATION: "boom_interfaces/msg/MachineConfiguration",
}
"""Topic -> type of its messages; a channel is read and written only where its topic has one."""

OTHER_TYPES = {OSCILLOSCOPE: "boom_interfaces/msg/OscilloscopeTrace", ROBOT_DESCRIPTION: "std_msgs/msg/String"}
"""The same for topics that carry no signal."""

FaultKind = Literal["gap", "loss", "stale", "stuck", "clock_jump", "out_of_range", "nan"]
