"""Converts between ROS messages and the core. Converts absolute to gauge pressure, only here."""

from __future__ import annotations

from typing import Any

from boom_controller.loop.cycle import Cycle
from boom_controller.references.joint_trajectory import MOST_POINTS, Code, TrajectoryError, TrajectoryPoint
from boom_input.shown import quoted
from boom_interfaces.msg import ControllerState, ReferenceState
from boom_model.components.oil import AMBIENT_PRESSURE
from boom_node.stamps import set_ns


def gauge(message: Any) -> float:
    """Gauge pressure [Pa] of a sensor_msgs/FluidPressure."""
    return float(message.fluid_pressure) - AMBIENT_PRESSURE


def points_of(message: Any, joint: str) -> list[TrajectoryPoint]:
    """The points of a trajectory_msgs/JointTrajectory for the boom's joint.

    Raises:
        TrajectoryError: another joint, or fields of another length than the names.
    """
    if list(message.joint_names) != [joint]:
        raise TrajectoryError(
            f"the trajectory is for {quoted(', '.join(message.joint_names[:8])) or 'no joint'}: "
            f"this controller moves {joint} alone",
            Code.INVALID_JOINTS,
        )
    if len(message.points) > MOST_POINTS:
        raise TrajectoryError(f"the trajectory has {len(message.points)} points: give at most {MOST_POINTS}")
    return [_point(k, point) for k, point in enumerate(message.points)]


def _point(k: int, point: Any) -> TrajectoryPoint:
    fields = []
    for name, needed in (("positions", True), ("velocities", False), ("accelerations", False)):
        values = getattr(point, name)
        if len(values) not in ((1,) if needed else (0, 1)):
            raise TrajectoryError(f"point {k} has {len(values)} {name}: give one for the one joint")
        fields.append(float(values[0]) if len(values) else None)
    angle, rate, acceleration = fields
    assert angle is not None  # its length was checked
    since = point.time_from_start
    return TrajectoryPoint(since.sec + 1e-9 * since.nanosec, angle, rate, acceleration)


def fill_reference(message: ReferenceState, cycle: Cycle, stamp_ns: int) -> ReferenceState:
    """The reference of a cycle."""
    r = cycle.reference
    set_ns(message.header.stamp, stamp_ns)
    message.angle, message.rate, message.acceleration, message.jerk = r.angle, r.rate, r.acceleration, r.jerk
    return message


def fill_state(message: ControllerState, cycle: Cycle, stamp_ns: int) -> ControllerState:
    """Inputs, reference and outputs of a cycle."""
    r, m, o = cycle.reference, cycle.measurement, cycle.output
    set_ns(message.header.stamp, stamp_ns)
    message.mode = cycle.state.value
    message.reference_angle, message.reference_rate = r.angle, r.rate
    message.reference_acceleration, message.reference_jerk = r.acceleration, r.jerk
    message.angle, message.rate = m.angle, m.rate
    message.hose_pressure, message.rod_pressure = m.hose_pressure, m.rod_pressure
    message.angle_error = r.angle - m.angle
    message.piston_position_error, message.force_error = o.piston_position_error, o.force_error
    message.feedforward_force, message.feedback_force = o.feedforward_force, o.feedback_force
    message.force_set_point, message.force = o.force_set_point, o.force
    message.spool_position = o.spool_position
    message.pilot_pressure_retract, message.pilot_pressure_extend = o.pilot_pressure_retract, o.pilot_pressure_extend
    message.current_retract, message.current_extend = cycle.retract, cycle.extend
    message.estimated_load = cycle.load
    message.cycle_time = cycle.duration
    message.status, message.reason = cycle.status, cycle.reason
    return message
