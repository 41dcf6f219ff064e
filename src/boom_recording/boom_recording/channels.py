"""Which topic and field each signal comes from, its unit, its range, and the conversion from wire to gauge pressure."""

from dataclasses import dataclass
from typing import Literal

AMBIENT_PRESSURE_PA = 101_325.0  # sensor_msgs/FluidPressure is absolute; inside, pressures are gauge
DEFAULT_JOINT = "inner_boom_joint"

JOINT_STATES = "/joint_states"
HOSE_PRESSURE = "/boom/hose_pressure"
ROD_PRESSURE = "/boom/rod_pressure"
SOLENOID_CURRENTS = "/boom/solenoid_currents"
MACHINE_CONFIGURATION = "/boom/machine_configuration"
CURRENT_COMMAND = "/boom/current_command"
REFERENCE = "/boom/reference"
OSCILLOSCOPE = "/boom/pilot_valve/oscilloscope"

SENSOR_TOPICS = (JOINT_STATES, HOSE_PRESSURE, ROD_PRESSURE, SOLENOID_CURRENTS)

TYPES = {
    JOINT_STATES: "sensor_msgs/msg/JointState",
    HOSE_PRESSURE: "sensor_msgs/msg/FluidPressure",
    ROD_PRESSURE: "sensor_msgs/msg/FluidPressure",
    SOLENOID_CURRENTS: "boom_interfaces/msg/SolenoidCurrents",
    CURRENT_COMMAND: "boom_interfaces/msg/SolenoidCurrents",
    REFERENCE: "sensor_msgs/msg/JointState",
    MACHINE_CONFIGURATION: "boom_interfaces/msg/MachineConfiguration",
}


@dataclass(frozen=True)
class Channel:
    """One signal on the wire.

    name     of the signal
    unit     SI unit inside (pressures gauge)
    field    field of the message; a JointState's list is indexed by the joint's name
    low, high   plausible range [unit]; outside, a value is a fault of the sensor or the bus, not of the machine
    """

    name: str
    unit: str
    topic: str
    field: str
    low: float
    high: float

    @property
    def is_pressure(self) -> bool:
        """True where the wire carries absolute pressure."""
        return self.unit == "Pa"

    @property
    def wire_offset(self) -> float:
        """What the wire value is larger by [unit]."""
        return AMBIENT_PRESSURE_PA if self.is_pressure else 0.0


_BAR = 1e5

# Ranges hold for any machine of this kind (the machine file's own limits are the model's affair): an angle is within a
# turn, a boom of 2 rad/s would tear itself off, a pressure transducer ends at 600 bar and cannot read below vacuum, a
# solenoid of 0.6 A is fed by a driver of 3 A, and a current is clipped at zero.
CHANNELS: tuple[Channel, ...] = (
    Channel("angle", "rad", JOINT_STATES, "position", -3.2, 3.2),
    Channel("rate", "rad/s", JOINT_STATES, "velocity", -2.0, 2.0),
    Channel("hose_pressure", "Pa", HOSE_PRESSURE, "fluid_pressure", -1.02 * _BAR, 600 * _BAR),
    Channel("rod_pressure", "Pa", ROD_PRESSURE, "fluid_pressure", -1.02 * _BAR, 600 * _BAR),
    Channel("retract_current", "A", SOLENOID_CURRENTS, "retract", -0.01, 3.0),
    Channel("extend_current", "A", SOLENOID_CURRENTS, "extend", -0.01, 3.0),
    Channel("retract_current_command", "A", CURRENT_COMMAND, "retract", -0.01, 3.0),
    Channel("extend_current_command", "A", CURRENT_COMMAND, "extend", -0.01, 3.0),
    Channel("reference_angle", "rad", REFERENCE, "position", -3.2, 3.2),
)

BY_NAME = {channel.name: channel for channel in CHANNELS}


def of_topic(topic: str) -> tuple[Channel, ...]:
    """The signals that `topic` carries."""
    return tuple(channel for channel in CHANNELS if channel.topic == topic)


FaultKind = Literal["gap", "loss", "stale", "stuck", "clock_jump", "out_of_range", "nan"]
