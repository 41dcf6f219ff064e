"""Writes a `Recording` (or columns of numbers) as a bag like the machine's. The same input gives the same bytes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import BY_NAME, JOINT_NAMES, Channel, of_topic
from boom_recording import cdr_layout, definitions
from boom_recording.bag_writer import CHUNK_BYTES, LATCHED_QOS, SENSOR_QOS, BagWriter, OfferedQos
from boom_recording.channels import (
    CURRENT_COMMAND,
    DEFAULT_JOINT,
    JOINT_STATES,
    MACHINE_CONFIGURATION,
    OTHER_TYPES,
    REFERENCE,
    ROBOT_DESCRIPTION,
    TYPES,
)
from boom_recording.errors import RecordingError
from boom_recording.recording import Configuration, Floats, Recording, Signal

START_NS = 1_790_000_000 * 10**9  # time zero of a bag that no clock was running for

_QOS = {
    JOINT_STATES: OfferedQos(reliable=True, depth=10),
    MACHINE_CONFIGURATION: LATCHED_QOS,
    ROBOT_DESCRIPTION: LATCHED_QOS,
    CURRENT_COMMAND: OfferedQos(reliable=True, depth=1, deadline_ns=50_000_000),
    REFERENCE: OfferedQos(reliable=True, depth=1),
}


def from_columns(
    name: str,
    time: Floats,
    columns: Mapping[str, Floats],
    configuration: Configuration,
    *,
    start_ns: int = START_NS,
    phase_s: Mapping[str, float] | None = None,
) -> Recording:
    """A recording of signals that were computed on one grid.

    time      (n,) [s], strictly increasing
    columns   signal name (see `boom_input.channels`) -> (n,) values [SI, pressures gauge]; NaN = no sample of this
              topic at that time
    phase_s   topic -> delay of its stamps after `time` [s]

    Raises RecordingError for an unknown signal or an array of another length.
    """
    unknown = sorted(set(columns) - set(BY_NAME))
    if unknown:
        raise RecordingError(f"no topic carries the signal {', '.join(unknown)}: known are {', '.join(BY_NAME)}")
    ticks = np.rint(np.asarray(time, float) * 1e9).astype(np.int64)
    if len(ticks) == 0 or (np.diff(ticks) <= 0).any():
        raise RecordingError("the times of a recording have to increase, and there has to be at least one")
    signals = {}
    for signal, values in columns.items():
        channel = BY_NAME[signal]
        column = np.asarray(values, float)
        if column.shape != ticks.shape:
            raise RecordingError(
                f"signal {signal} has shape {column.shape}, the times have {ticks.shape}: they have to agree"
            )
        siblings = [
            np.asarray(columns[other.name], float) for other in of_topic(channel.topic) if other.name in columns
        ]
        there = ~np.logical_and.reduce([np.isnan(sibling) for sibling in siblings])
        stamps = start_ns + ticks[there] + round((phase_s or {}).get(channel.topic, 0.0) * 1e9)
        valid = np.isfinite(column[there])
        signals[signal] = Signal(
            signal, channel.unit, channel.topic, stamps, (stamps - start_ns) / 1e9, column[there], valid
        )
    duration = max((float(signal.time[-1]) for signal in signals.values() if len(signal.time)), default=0.0)
    return Recording(name, Path(name), start_ns, duration, signals, stored_configuration=configuration)


def write(
    path: str | Path,
    recording: Recording,
    *,
    joint: str = DEFAULT_JOINT,
    pressure_variance: float = 0.0,
    robot_description: str = "",
    chunk_bytes: int = CHUNK_BYTES,
) -> None:
    """Write all samples of `recording`, masked ones too, as a new bag at `path` (a folder that does not exist yet).

    joint               name of the boom's joint
    pressure_variance   [Pa^2] for the pressure messages, 0 = unknown
    robot_description   URDF text of the machine, stored once; empty: none

    Raises RecordingError if the folder exists, the disk is full, or signals of one topic have different stamps.
    """
    topics = [topic for topic in TYPES if any(signal.topic == topic for signal in recording.signals.values())]
    tables = {topic: _encode(topic, recording, joint, pressure_variance) for topic in topics}
    with BagWriter(Path(path), chunk_bytes=chunk_bytes) as bag:
        if recording.stored_configuration is not None:
            number = _declare(bag, MACHINE_CONFIGURATION)
            data = _configuration(recording.stored_configuration, recording.start_ns)
            bag.write(number, data, recording.start_ns, recording.start_ns)
        if robot_description:
            number = _declare(bag, ROBOT_DESCRIPTION)
            bag.write(number, _text(robot_description), recording.start_ns, recording.start_ns)
        numbers = [_declare(bag, topic) for topic in topics]
        if not topics:
            return
        stamps = np.concatenate([tables[topic][0] for topic in topics])
        which = np.concatenate([np.full(len(tables[topic][0]), k) for k, topic in enumerate(topics)])
        place = np.concatenate([np.arange(len(tables[topic][0])) for topic in topics])
        # By time, equal times in the order of the topics. Within a topic the recorded order stands even where its
        # stamps go back.
        order = np.lexsort((which, np.concatenate([np.maximum.accumulate(tables[topic][0]) for topic in topics])))
        rows = [tables[topic][1] for topic in topics]
        logs = np.maximum.accumulate(stamps[order])
        for k, i, log in zip(which[order].tolist(), place[order].tolist(), logs.tolist(), strict=True):
            bag.write(numbers[k], rows[k][i].tobytes(), log, log, i)


def _declare(bag: BagWriter, topic: str) -> int:
    kind = TYPES.get(topic) or OTHER_TYPES[topic]
    text, type_hash = definitions.definition(kind)
    return bag.add_topic(topic, kind, text, type_hash, _QOS.get(topic, SENSOR_QOS))


def _encode(
    topic: str, recording: Recording, joint: str, variance: float
) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Stamps [ns] and serialised messages (n, size) of one topic."""
    own = {signal.name: signal for signal in recording.signals.values() if signal.topic == topic}
    stamps = next(iter(own.values())).stamps_ns
    if any(not np.array_equal(signal.stamps_ns, stamps) for signal in own.values()):
        raise RecordingError(
            f"the signals of {topic} ({', '.join(own)}) have different stamps: one message carries them all"
        )
    if len(stamps) and (stamps.min() < 0 or stamps.max() >= 2**31 * 10**9):
        raise RecordingError(f"stamps of {topic} lie outside what a ROS stamp can hold")
    names = {"": joint, **JOINT_NAMES}
    told = [channel for channel in of_topic(topic) if channel.name in own]
    order = list(dict.fromkeys([names[""], *(names[channel.joint] for channel in told)]))
    template = _template(topic, order, told)
    layout = cdr_layout.locate(template, TYPES[topic], definitions.typestore().fielddefs)
    rows = np.tile(layout.template, (len(stamps), 1))
    layout.store(rows, "header.stamp.sec", stamps // 10**9)
    layout.store(rows, "header.stamp.nanosec", stamps % 10**9)
    if TYPES[topic].endswith("/FluidPressure"):
        layout.store(rows, "variance", np.full(len(stamps), variance))
    for channel in of_topic(topic):
        path = channel.field
        if path not in layout.numbers:
            path = f"{path}[{order.index(names[channel.joint])}]" if names[channel.joint] in order else ""
        if channel.name in own:
            layout.store(rows, path, own[channel.name].values + channel.wire_offset)
        elif path in layout.numbers:
            layout.store(rows, path, np.full(len(stamps), np.nan))
    return stamps, rows


def _template(topic: str, joints: list[str], told: list[Channel]) -> bytes:
    """A message of the topic with zeros, and with an element for each joint in those lists of a joint's that are ``told``."""
    fields = {channel.field for channel in told}
    name = TYPES[topic]
    definitions.ensure(name)
    store = definitions.typestore()
    values: dict[str, Any] = {"header": _header(0)}
    if name.endswith("/JointState"):
        values |= {"name": joints} | {
            part: np.zeros(len(joints) * (part in fields)) for part in ("position", "velocity", "effort")
        }
    else:
        values |= {field: 0.0 for field, _ in store.fielddefs[name][1] if field != "header"}
    return bytes(store.serialize_cdr(store.types[name](**values), name))


def _header(nanoseconds: int) -> Any:
    types = definitions.typestore().types
    stamp = types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id="")


def _text(text: str) -> bytes:
    name = OTHER_TYPES[ROBOT_DESCRIPTION]
    store = definitions.typestore()
    return bytes(store.serialize_cdr(store.types[name](data=text), name))


def _configuration(configuration: Configuration, start_ns: int) -> bytes:
    name = TYPES[MACHINE_CONFIGURATION]
    definitions.ensure(name)
    store = definitions.typestore()
    message = store.types[name](
        header=_header(start_ns),
        machine=configuration.machine,
        outer_boom_angle=configuration.outer_boom_angle,
        telescope_length=configuration.telescope_length,
        load_mass=configuration.load_mass,
        note=configuration.note,
    )
    return bytes(store.serialize_cdr(message, name))
