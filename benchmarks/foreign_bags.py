"""Foreign bags: rosbag2 .db3, ROS 1, MCAP with own types, JSON, OPERA."""

from __future__ import annotations

import json
import math

import numpy as np
from foreign_data import ATMOSPHERE, DEG, rng
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

HYDRAULICS = """std_msgs/Header header
float32 p_piston
float32 p_ring
float32 i_up
float32 i_down
float32 p_supply
"""
PRESSURES = "sensor_msgs/FluidPressure[] array\n"


class Ros:
    """Messages of one typestore."""

    def __init__(self, store=Stores.ROS2_JAZZY, more=()):
        self.store = get_typestore(store)
        for name, text in more:
            self.store.register(get_types_from_msg(text, name))
        self.ros1 = store == Stores.ROS1_NOETIC

    def header(self, ns, frame=""):
        """A header."""
        t = self.store.types
        stamp = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        return t["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **({"seq": 0} if self.ros1 else {}))

    def make(self, kind, /, **values):
        """A message."""
        return self.store.types[kind](**values)

    def pressure(self, ns, value, frame=""):
        """A FluidPressure."""
        return self.make(
            "sensor_msgs/msg/FluidPressure", header=self.header(ns, frame), fluid_pressure=float(value), variance=0.0
        )

    def joints(self, ns, names, position, velocity):
        """A JointState."""
        empty = np.zeros(0)
        return self.make("sensor_msgs/msg/JointState", header=self.header(ns), name=names, position=np.array(position, float),
                         velocity=np.array(velocity, float), effort=empty)  # fmt: skip

    def raw(self, name, message):
        """Its bytes."""
        return bytes((self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr)(message, name))


JOINT, PRESSURE, NUMBER = "sensor_msgs/msg/JointState", "sensor_msgs/msg/FluidPressure", "std_msgs/msg/Float64"


def write_ros(writer, ros, d, streams):
    """Write a bag; streams: (topic, type, message of the sample's index)."""
    ends = [(writer.add_connection(topic, kind, typestore=ros.store), kind, make) for topic, kind, make in streams]
    for i, ns in enumerate(d.ns):
        for end, kind, make in ends:
            writer.write(end, ns, ros.raw(kind, make(i, ns)))


def other_joints(d, i):
    """Angles of two joints that have nothing to do with the boom."""
    return 0.3 + 0.2 * math.sin(0.05 * d.t[i]), 1.1 + 0.1 * math.cos(0.03 * d.t[i])


def db3_renamed(d, folder):
    """Other topics, other joints beside the boom's, currents without a header."""
    path = folder / "rosbag2_2025_06_03"
    ros = Ros()

    def joints(i, ns):
        a, b = other_joints(d, i)
        return ros.joints(
            ns, ["slewing", "main_boom", "stick"], [a, d.q[i], b], [0.01 * math.cos(0.05 * d.t[i]), d.w[i], 0.0]
        )

    streams = [
        ("/crane/joint_states", JOINT, joints),
        ("/crane/cylinder/bottom", PRESSURE, lambda i, ns: ros.pressure(ns, d.ph[i] + ATMOSPHERE, "boom_cylinder")),
        ("/crane/cylinder/rod", PRESSURE, lambda i, ns: ros.pressure(ns, d.pb[i] + ATMOSPHERE, "boom_cylinder")),
        ("/valve/lift/current_ma", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.ie[i] * 1e3))),
        ("/valve/lower/current_ma", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.ir[i] * 1e3))),
    ]
    with Ros2Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        write_ros(writer, ros, d, streams)
    return [path]


def ros1_wrong_units(d, folder):
    """Degrees in a JointState, bar in a FluidPressure."""
    path = folder / "2025-06-03-09-41-07.bag"
    ros = Ros(Stores.ROS1_NOETIC)
    streams = [
        ("/joint_states", JOINT, lambda i, ns: ros.joints(ns, ["boom"], [d.q[i] * DEG], [d.w[i] * DEG])),
        ("/pressure/piston", PRESSURE, lambda i, ns: ros.pressure(ns, d.ph[i] / 1e5)),
        ("/pressure/rod", PRESSURE, lambda i, ns: ros.pressure(ns, d.pb[i] / 1e5)),
        ("/current/extend", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.ie[i]))),
        ("/current/retract", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.ir[i]))),
    ]
    with Ros1Writer(path) as writer:
        write_ros(writer, ros, d, streams)
    return [path]


def mcap_file(path, streams, d):
    """Write an MCAP file; streams: (topic, schema name, schema encoding, schema, message encoding, bytes of the sample's index)."""
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        ends = []
        for topic, name, encoding, schema, message, make in streams:
            number = writer.register_schema(name, encoding, schema)
            ends.append((writer.register_channel(topic, message, number), make))
        for i, ns in enumerate(d.ns):
            for end, make in ends:
                writer.add_message(end, ns, make(i, ns), ns)
        writer.finish()


def ros2_streams(ros, streams):
    """The streams of `mcap_file` for messages of ROS 2."""
    for topic, kind, make in streams:
        text = ros.store.generate_msgdef(kind, ros_version=2)[0].encode()
        yield topic, kind, "ros2msg", text, "cdr", lambda i, ns, kind=kind, make=make: ros.raw(kind, make(i, ns))


def mcap_own_type_flipped_gyro(d, folder):
    """A message of the laboratory's own; the gyro of an IMU mounted the other way round."""
    path = folder / "session4.mcap"
    name = "acme_msgs/msg/HydraulicState"
    ros = Ros(more=[(name, HYDRAULICS)])
    supply = d.supply

    def state(i, ns):
        return ros.make(name, header=ros.header(ns), p_piston=float(d.ph[i] / 1e5), p_ring=float(d.pb[i] / 1e5),
                        i_up=float(d.ie[i]), i_down=float(d.ir[i]), p_supply=float(supply[i] / 1e5))  # fmt: skip

    def imu(i, ns):
        v = ros.store.types["geometry_msgs/msg/Vector3"]
        turn = ros.store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        zero = np.zeros(9)
        return ros.make("sensor_msgs/msg/Imu", header=ros.header(ns, "imu"), orientation=turn, orientation_covariance=zero,
                        angular_velocity=v(x=0.001 * math.sin(i), y=-float(d.w[i]), z=0.002 * math.cos(i)),
                        angular_velocity_covariance=zero,
                        linear_acceleration=v(x=9.81 * math.sin(d.q[i]), y=0.0, z=9.81 * math.cos(d.q[i])),
                        linear_acceleration_covariance=zero)  # fmt: skip

    streams = [("/hydraulics", name, state), ("/imu/data", "sensor_msgs/msg/Imu", imu),
               ("/encoder/boom_deg", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.q[i] * DEG)))]  # fmt: skip
    mcap_file(path, ros2_streams(ros, streams), d)
    return [path]


def mcap_json(d, folder):
    """JSON, camel case, units in the names."""
    path = folder / "telemetry.mcap"

    def sample(i, ns):
        return json.dumps({
            "timestamp": {"sec": ns // 10**9, "nsec": ns % 10**9}, "boomAngleDeg": round(d.q[i] * DEG, 4),
            "boomRateDegPerSec": round(d.w[i] * DEG, 4), "headSidePressureBar": round(d.ph[i] / 1e5, 2),
            "rodSidePressureBar": round(d.pb[i] / 1e5, 2), "liftCurrentMa": round(d.ie[i] * 1e3),
            "lowerCurrentMa": round(d.ir[i] * 1e3), "engineRpm": 1500 + i % 7, "mode": "manual",
        }).encode()  # fmt: skip

    mcap_file(path, [("/telemetry", "Telemetry", "jsonschema", b"{}", "json", sample)], d)
    return [path]


def opera(d, folder):
    """OPERA: all pressures of the machine in one array, named by their frames; the other joints move, too."""
    path = folder / "zx120_boom.mcap"
    name = "com3_msgs/msg/FluidPressureArray"
    ros = Ros(more=[(name, PRESSURES)])
    noise = rng.standard_normal(len(d.t))

    def array(i, ns):
        values = {"boom_up_main_pressure": d.ph[i], "boom_down_main_pressure": d.pb[i],
                  "arm_crowd_main_pressure": 6e6 + 1e5 * noise[i], "arm_dump_main_pressure": 2e6 - 1e5 * noise[i],
                  "bucket_crowd_main_pressure": 3e6, "swing_right_main_pressure": 1e6 + 1e6 * math.sin(0.2 * d.t[i])}  # fmt: skip
        return ros.make(name, array=[ros.pressure(ns, value + ATMOSPHERE, frame) for frame, value in values.items()])

    def joints(i, ns):
        a, b = other_joints(d, i)
        return ros.joints(ns, ["swing_joint", "boom_joint", "arm_joint"], [a, d.q[i], b], [0.0, d.w[i], 0.0])

    streams = [("/zx120/main_fluid_pressure", name, array), ("/zx120/joint_states", JOINT, joints),
               ("/zx120/boom_up_solenoid_current", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.ie[i]))),
               ("/zx120/boom_down_solenoid_current", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.ir[i])))]  # fmt: skip
    mcap_file(path, ros2_streams(ros, streams), d)
    return [path]
