"""Prepared bytes are read as the same message that rclpy makes; between aligned fields it leaves whatever was there."""

import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import FluidPressure, JointState

from boom_can_bridge.prepared_message import PreparedMessage
from boom_interfaces.msg import SolenoidCurrents

STAMP_NS = 1_795_245_757_024_839_218


def stamped(message):
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(STAMP_NS, 1_000_000_000)
    return message


def test_filled_bytes_are_read_as_the_whole_message():
    names = ["inner_boom_joint", "outer_boom_joint", "telescope_joint"]
    joints = JointState(name=names, position=[0.0, 4.59, 2.2], velocity=[0.0, 0.0, 0.0])
    prepared = PreparedMessage(joints, ("position.0", "velocity.0"), serialize_message)
    expected = stamped(JointState(name=names, position=[0.3125, 4.59, 2.2], velocity=[-0.01, 0.0, 0.0]))
    filled = prepared.fill(STAMP_NS, 0.3125, -0.01)
    assert len(filled) == len(serialize_message(expected))
    assert deserialize_message(filled, JointState) == expected


@pytest.mark.parametrize("frame", ["hose", "rod", ""])
def test_numbers_are_found_behind_texts_of_any_length(frame):
    pressure = FluidPressure(variance=3.0e8)
    pressure.header.frame_id = frame
    prepared = PreparedMessage(pressure, ("fluid_pressure",), serialize_message)
    for value in (101_325.0, 2.5e7, float("nan")):
        read = deserialize_message(prepared.fill(STAMP_NS, value), FluidPressure)
        assert read.fluid_pressure == value or value != value
        assert (read.variance, read.header.frame_id) == (3.0e8, frame)
        assert read.header.stamp.sec * 1_000_000_000 + read.header.stamp.nanosec == STAMP_NS


def test_each_publication_stands_alone():
    prepared = PreparedMessage(SolenoidCurrents(), ("retract", "extend"), serialize_message)
    first = prepared.fill(0, 0.1, 0.2)
    prepared.fill(1, 0.3, 0.4)
    read = deserialize_message(first, SolenoidCurrents)
    assert (read.retract, read.extend) == (0.1, 0.2)


def test_a_place_that_is_no_number_is_refused():
    with pytest.raises((ValueError, AttributeError, AssertionError)):
        PreparedMessage(SolenoidCurrents(), ("header.frame_id",), serialize_message)
