"""Writes recordings as other laboratories write them: CSV, MAT, MF4, rosbag2 .db3, ROS 1, MCAP, OPERA; wrong units and signs included.

Independent of `boom_import`: every file is written with the library that its laboratory would use, from a recording that is known.

  ./boom python benchmarks/foreign_recordings.py FOLDER [--bag BAG]
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import h5py
import numpy as np
import scipy.io
from asammdf import MDF, Signal
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from boom_recording.loading import load

DEG = 180 / math.pi
ATMOSPHERE = 101_325.0
BEGIN = datetime(2025, 6, 3, 9, 41, 7, 250_000, tzinfo=UTC)
rng = np.random.default_rng(4)


@dataclass
class Data:
    """The known recording on one grid: t [s], angle [rad], rate [rad/s], pressures [Pa gauge], currents [A]."""

    t: np.ndarray
    q: np.ndarray
    w: np.ndarray
    ph: np.ndarray
    pb: np.ndarray
    ie: np.ndarray
    ir: np.ndarray

    @property
    def temperature(self):
        return 38 + 4 * (1 - np.exp(-self.t / 60)) + 0.05 * rng.standard_normal(len(self.t))

    @property
    def supply(self):
        return 2.1e7 + 2e5 * rng.standard_normal(len(self.t)) - 0.1 * np.maximum(self.w, 0) * 1e7

    @property
    def dates(self):
        return [BEGIN + timedelta(seconds=float(s)) for s in self.t]

    @property
    def ns(self):
        return [round(BEGIN.timestamp() * 1e9) + round(float(s) * 1e9) for s in self.t]


def data_of(bag):
    """The recording without what is missing in it."""
    table = load(bag).on_grid()
    c = table.columns
    names = ("angle", "rate", "hose_pressure", "rod_pressure", "extend_current", "retract_current")
    whole = np.logical_and.reduce([np.isfinite(c[name]) for name in names])
    return Data(table.time[whole], *(c[name][whole] for name in names))


def table(path, header, columns, separator=",", decimal=".", encoding="utf-8", above=(), digits=6, units=None):
    with path.open("w", newline="", encoding=encoding) as file:
        file.writelines(line + "\r\n" for line in above)
        out = csv.writer(file, delimiter=separator)
        out.writerow(header)
        if units:
            out.writerow(units)
        for row in zip(*columns, strict=True):
            cells = [v if isinstance(v, str) else f"{v:.{digits}f}" for v in row]
            out.writerow(
                [
                    c.replace(".", ",") if decimal == "," and c[:1] in "-0123456789" and ":" not in c else c
                    for c in cells
                ]
            )


def csv_german(d, folder):
    path = folder / "Messung_03.csv"
    header = ["Zeit [ms]", "Winkel Ausleger [°]", "Winkelgeschwindigkeit [°/s]", "Druck Kolbenseite [bar]", "Druck Stangenseite [bar]",
              "Strom Heben [mA]", "Strom Senken [mA]", "Öltemperatur [°C]"]  # fmt: skip
    above = ["Messprotokoll Kran 3;;;;;;;", "Prüfer: M. Huber;;;;;;;", ""]
    columns = [d.t * 1e3, d.q * DEG, d.w * DEG, d.ph / 1e5, d.pb / 1e5, d.ie * 1e3, d.ir * 1e3, d.temperature]
    table(path, header, columns, ";", ",", "cp1252", above, digits=4)
    return [path]


def csv_iso_psi(d, folder):
    path = folder / "run_2025-06-03.csv"
    stamps = [s.isoformat(timespec="milliseconds").replace("+00:00", "Z") for s in d.dates]
    header = [
        "timestamp",
        "boom_angle_deg",
        "bottom_pressure_psi",
        "rod_pressure_psi",
        "raise_solenoid_mA",
        "lower_solenoid_mA",
        "supply_pressure_psi",
    ]
    columns = [
        stamps,
        d.q * DEG,
        d.ph / 6894.757293,
        d.pb / 6894.757293,
        d.ie * 1e3,
        d.ir * 1e3,
        d.supply / 6894.757293,
    ]
    table(path, header, columns)
    return [path]


def csv_excel_opaque(d, folder):
    """Excel's dates, a line of units, the angle counted downwards, absolute MPa."""
    path = folder / "export.txt"
    days = (np.array(d.ns) / 1e9) / 86400 + 25569.0
    header = ["Date", "phi", "dphi", "pA", "pB", "I_Y1a", "I_Y1b"]
    units = ["d", "deg", "deg/s", "MPa abs", "MPa abs", "A", "A"]
    columns = [
        [f"{v:.10f}" for v in days],
        -d.q * DEG,
        -d.w * DEG,
        (d.ph + ATMOSPHERE) / 1e6,
        (d.pb + ATMOSPHERE) / 1e6,
        d.ie,
        d.ir,
    ]
    table(path, header, columns, "\t", units=units)
    return [path]


def mat_struct(d, folder):
    path = folder / "boom_test7.mat"
    log = {"t": d.t, "q": d.q, "dq": d.w, "p_A": d.ph, "p_B": d.pb, "i_ext": d.ie, "i_ret": d.ir, "p_pump": d.supply}
    scipy.io.savemat(path, {"log": log, "Ts": 0.01, "comment": "inner boom, extended"})
    return [path]


def mat_v73(d, folder):
    path = folder / "messdaten_v73.mat"
    names = ["Zeit", "Hubwinkel", "Drehrate", "p_Boden_abs", "p_Ring_abs", "I_Ausfahren", "I_Einfahren", "T_Oel"]
    units = ["s", "rad", "rad/s", "kPa", "kPa", "A", "A", "degC"]
    columns = [d.t, d.q, d.w, (d.ph + ATMOSPHERE) / 1e3, (d.pb + ATMOSPHERE) / 1e3, d.ie, d.ir, d.temperature]
    with h5py.File(path, "w", userblock_size=512) as file:
        made = file.create_dataset("data", data=np.array(columns))
        made.attrs["MATLAB_class"] = np.bytes_("double")
        for label, texts in (("names", names), ("units", units)):
            references = []
            for i, text in enumerate(texts):
                one = file.create_dataset(f"#refs#/{label}{i}", data=np.array([[ord(c)] for c in text], np.uint16))
                one.attrs["MATLAB_class"] = np.bytes_("char")
                references.append(one.ref)
            cell = file.create_dataset(label, data=np.array(references, dtype=h5py.ref_dtype).reshape(-1, 1))
            cell.attrs["MATLAB_class"] = np.bytes_("cell")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return [path]


def mf4_signed(d, folder):
    """Three groups; one signed current; bar."""
    path = folder / "kran_0042.mf4"
    with MDF(version="4.10") as file:
        file.start_time = BEGIN
        slow = slice(None, None, 5)
        file.append(
            [
                Signal(d.temperature[slow], d.t[slow], "degC", "Oil_Temp"),
                Signal(d.supply[slow] / 1e5, d.t[slow], "bar", "Pump_Pressure"),
            ]
        )
        file.append(
            [
                Signal(d.ph / 1e5, d.t + 0.002, "bar", "Cyl_Press_Piston"),
                Signal(d.pb / 1e5, d.t + 0.002, "bar", "Cyl_Press_Rod"),
            ]
        )
        file.append([Signal(d.q * DEG, d.t, "deg", "Boom_Angle"), Signal(d.w * DEG, d.t, "deg/s", "Boom_AngVel")])
        file.append([Signal((d.ie - d.ir) * 1e3, d.t + 0.004, "mA", "Boom_Valve_Current")])
        file.save(path, overwrite=True)
    return [path]


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
        t = self.store.types
        stamp = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        return t["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **({"seq": 0} if self.ros1 else {}))

    def make(self, kind, /, **values):
        return self.store.types[kind](**values)

    def pressure(self, ns, value, frame=""):
        return self.make(
            "sensor_msgs/msg/FluidPressure", header=self.header(ns, frame), fluid_pressure=float(value), variance=0.0
        )

    def joints(self, ns, names, position, velocity):
        empty = np.zeros(0)
        return self.make("sensor_msgs/msg/JointState", header=self.header(ns), name=names, position=np.array(position, float),
                         velocity=np.array(velocity, float), effort=empty)  # fmt: skip

    def raw(self, name, message):
        return bytes((self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr)(message, name))


JOINT, PRESSURE, NUMBER = "sensor_msgs/msg/JointState", "sensor_msgs/msg/FluidPressure", "std_msgs/msg/Float64"


def write_ros(writer, ros, d, streams):
    """streams: (topic, type, message of the sample's index)."""
    ends = [(writer.add_connection(topic, kind, typestore=ros.store), kind, make) for topic, kind, make in streams]
    for i, ns in enumerate(d.ns):
        for end, kind, make in ends:
            writer.write(end, ns, ros.raw(kind, make(i, ns)))


def other_joints(d, i):
    return 0.3 + 0.2 * math.sin(0.05 * d.t[i]), 1.1 + 0.1 * math.cos(0.03 * d.t[i])


def db3_renamed(d, folder):
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
    """streams: (topic, schema name, schema encoding, schema, message encoding, bytes of the sample's index)."""
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
        return ros.make(name, header=ros.header(ns), p_piston=float(d.ph[i] / 1e5), p_ring=float(d.pb[i] / 1e5), i_up=float(d.ie[i]),
                        i_down=float(d.ir[i]), p_supply=float(supply[i] / 1e5))  # fmt: skip

    def imu(i, ns):
        v = ros.store.types["geometry_msgs/msg/Vector3"]
        turn = ros.store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        zero = np.zeros(9)
        return ros.make("sensor_msgs/msg/Imu", header=ros.header(ns, "imu"), orientation=turn, orientation_covariance=zero,
                        angular_velocity=v(x=0.001 * math.sin(i), y=-float(d.w[i]), z=0.002 * math.cos(i)), angular_velocity_covariance=zero,
                        linear_acceleration=v(x=9.81 * math.sin(d.q[i]), y=0.0, z=9.81 * math.cos(d.q[i])),
                        linear_acceleration_covariance=zero)  # fmt: skip

    streams = [("/hydraulics", name, state), ("/imu/data", "sensor_msgs/msg/Imu", imu),
               ("/encoder/boom_deg", NUMBER, lambda i, ns: ros.make(NUMBER, data=float(d.q[i] * DEG)))]  # fmt: skip
    mcap_file(path, ros2_streams(ros, streams), d)
    return [path]


def mcap_json(d, folder):
    path = folder / "telemetry.mcap"

    def sample(i, ns):
        return json.dumps({
            "timestamp": {"sec": ns // 10**9, "nsec": ns % 10**9}, "boomAngleDeg": round(d.q[i] * DEG, 4),
            "boomRateDegPerSec": round(d.w[i] * DEG, 4), "headSidePressureBar": round(d.ph[i] / 1e5, 2),
            "rodSidePressureBar": round(d.pb[i] / 1e5, 2), "liftCurrentMa": round(d.ie[i] * 1e3), "lowerCurrentMa": round(d.ir[i] * 1e3),
            "engineRpm": 1500 + i % 7, "mode": "manual",
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


def csv_percent(d, folder):
    """The valve's command in percent: how many amperes those are is in no file. Has to be asked."""
    path = folder / "plc_trace.csv"
    header = ["Time (s)", "Boom angle (deg)", "Pressure A (bar)", "Pressure B (bar)", "Valve command (%)"]
    table(path, header, [d.t, d.q * DEG, d.ph / 1e5, d.pb / 1e5, (d.ie - d.ir) / 0.6 * 100], digits=3)
    return [path]


def csv_nameless(d, folder):
    """Numbers without a name or unit, the angle counted downwards: nothing says which direction is up. Has to be asked."""
    path = folder / "log.dat"
    with path.open("w") as file:
        for row in zip(
            d.t, d.ir, d.ie, -d.q * DEG, d.ph / 1e5, d.pb / 1e5, d.ph / 1e5 + rng.normal(0, 0.3, len(d.t)), strict=True
        ):
            file.write(" ".join(f"{v:.5f}" for v in row) + "\n")
    return [path]


KINDS = {function.__name__: function for function in (
    csv_german, csv_iso_psi, csv_excel_opaque, mat_struct, mat_v73, mf4_signed, db3_renamed, ros1_wrong_units,
    mcap_own_type_flipped_gyro, mcap_json, opera, csv_percent,
)}  # fmt: skip
MORE = {"csv_nameless": csv_nameless}
ASKS = ("csv_percent", "csv_nameless")
"""What cannot be told from the file and has to be asked."""


def write(kind, bag, folder):
    """One foreign recording of the kind in `folder`. Returns its files."""
    folder.mkdir(parents=True, exist_ok=True)
    return {**KINDS, **MORE}[kind](data_of(bag), folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bag", default="bags/healthy/extended")
    args = parser.parse_args()
    for name in (*KINDS, *MORE):
        print(*write(name, args.bag, args.folder / name))
