"""Samples of the simulated crane as ROS messages for the topics of the contract. Converts to absolute pressure, only here."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Header

from boom_input.channels import AMBIENT_PRESSURE_PA
from boom_interfaces.msg import GroundTruth, MachineConfiguration, SolenoidCurrents
from boom_node.joint_set import JointSet
from boom_node.stamps import set_ns
from boom_sim.simulated_crane import CraneSample


def header(nanoseconds: int, frame: str = "") -> Header:
    """A header with this stamp [ns]."""
    return Header(stamp=set_ns(Time(), nanoseconds), frame_id=frame)


def joint_state(sample: CraneSample, joints: JointSet, stamp_ns: int) -> JointState:
    """The boom's joint as the IMU shows it [rad, rad/s], and all others at the values that follow."""
    return JointState(
        header=header(stamp_ns),
        name=joints.names,
        position=joints.positions(sample.angle),
        velocity=joints.velocities(sample.angle, sample.rate),
    )


def pressure(gauge: float, frame: str, variance: float, stamp_ns: int) -> FluidPressure:
    """Absolute pressure [Pa] from gauge pressure [Pa]; variance [Pa^2], 0 = unknown."""
    return FluidPressure(header=header(stamp_ns, frame), fluid_pressure=gauge + AMBIENT_PRESSURE_PA, variance=variance)


def currents(sample: CraneSample, stamp_ns: int) -> SolenoidCurrents:
    """Measured solenoid currents [A]."""
    return SolenoidCurrents(header=header(stamp_ns), retract=sample.retract_current, extend=sample.extend_current)


def configuration(machine: str, q3: float, q4: float, load: float, note: str, stamp_ns: int) -> MachineConfiguration:
    """Machine, pose of the fixed joints [rad, m] and load [kg]."""
    return MachineConfiguration(
        header=header(stamp_ns), machine=machine, outer_boom_angle=q3, telescope_length=q4, load_mass=load, note=note
    )


def ground_truth(names: tuple[str, ...], values: list[float], units: tuple[str, ...], stamp_ns: int) -> GroundTruth:
    """True states [SI]."""
    return GroundTruth(header=header(stamp_ns), names=list(names), values=values, units=list(units))
