"""Bags of any kind with topics of any kind: MCAP (ROS 2, ROS 1, JSON, protobuf inside), rosbag2 .db3, ROS 1 .bag."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from boom_import.errors import ImportingError
from boom_import.readers.messages import Batches, Decoder, MessageColumns
from boom_import.source import Source
from boom_input.shown import quoted
from boom_recording import bag_folder, definitions
from boom_recording.bag_reader import BagReader
from boom_recording.channels import DEFAULT_JOINT, MACHINE_CONFIGURATION
from boom_recording.errors import RecordingError
from boom_recording.mcap_file import opened_mcap
from boom_recording.mcap_records import Batch, Topic

Progress = Callable[[float], None]

_ROS2_HEAD = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
KNOWN = {"com3_msgs/msg/FluidPressureArray": "sensor_msgs/FluidPressure[] array\n"}
"""Types of OPERA (construction machines, com3_msgs) for bags that do not bring their definitions."""
_MOST_DECODED = 3_000_000


def read_mcap(path: Path, progress: Progress) -> Source:
    """The numbers of all topics of an MCAP file or a folder of them. Raises RecordingError where there is none."""
    bag = bag_folder.find(path)
    collector = MessageColumns(_types_of)
    foreign = _Foreign(collector)
    notes = list(bag.warnings)
    declared: list[set[str]] = []
    for i, name in enumerate(bag.files):
        with opened_mcap(name) as file:
            for batch in file.batches():
                collector.take(file.topics, batch)
                foreign.take(file.topics, batch)
                progress((i + 0.5) / len(bag.files))
        declared.append({topic.topic for topic in file.topics.values()})
        notes += [damage.what for damage in file.damages[:4]]
        if not file.complete:
            notes.append(
                "the file was not closed (recorder killed or still running, or copied in part): it is read up to its end"
            )
    foreign.flush()
    if not any(declared) and len(notes) > len(bag.warnings):
        raise ImportingError(
            f"{notes[-1].partition(': it is')[0]}: no message is left: copy it again, or give another one"
        )
    source = _source(path, "MCAP", collector, notes)
    if any(MACHINE_CONFIGURATION in topics for topics in declared):
        reader = BagReader(DEFAULT_JOINT)
        for name in bag.files:
            reader.read(name)
        source.configuration = reader.configuration()
    return source


def read_db3(path: Path, progress: Progress) -> Source:
    """The same of a rosbag2 SQLite file, or of a rosbag2 folder that `rosbags` reads."""
    collector = MessageColumns(_types_of)
    batches = Batches(collector.take)
    reader: Any = Ros2Reader(path) if path.is_dir() else Sqlite3Reader(path)
    reader.open()
    with closing(reader):
        numbers = {}
        for number, connection in enumerate(reader.connections):
            numbers[connection.id] = number
            definition = connection.msgdef
            encoding = "ros2idl" if definition.format is MessageDefinitionFormat.IDL else "ros2msg"
            batches.topics[number] = Topic(connection.topic, connection.msgtype, definition.data, encoding, "cdr")
        messages = reader.messages() if path.is_dir() else reader.messages(reader.connections)
        for connection, stamp, data in messages:
            batches.add(numbers[connection.id], bytes(data), stamp)
        batches.flush()
    progress(1.0)
    return _source(path, "rosbag2 SQLite", collector, [])


def read_ros1(path: Path, progress: Progress) -> Source:
    """The same of a ROS 1 bag."""
    collector = MessageColumns(_types_of)
    batches = Batches(collector.take)
    decoders: dict[tuple[str, str], _Ros1Type] = {}
    with Ros1Reader(path) as reader:
        of_connection = {}
        for number, connection in enumerate(reader.connections):
            key = (connection.msgtype, connection.msgdef.data)
            of_connection[connection.id] = number, decoders.setdefault(key, _Ros1Type(*key))
            batches.topics[number] = Topic(
                connection.topic, connection.msgtype, connection.msgdef.data, "ros1msg", "cdr"
            )
        total = max(reader.message_count, 1)
        for count, (connection, stamp, data) in enumerate(reader.messages()):
            number, kind = of_connection[connection.id]
            if kind.store is not None:
                batches.add(number, bytes(kind.store.ros1_to_cdr(data, connection.msgtype)), stamp)
            if count % 20_000 == 0:
                progress(count / total)
        batches.flush()
    return _source(path, "ROS 1 bag", collector, [])


class _Ros1Type:
    """A type of a ROS 1 bag with its own definitions; the header loses its sequence number, as in ROS 2."""

    def __init__(self, name: str, definition: str) -> None:
        self.store: Typestore | None = None
        try:
            store = get_typestore(Stores.EMPTY)
            ros2 = definitions.typestore().fielddefs
            types = {k: v for k, v in get_types_from_msg(definition, name).items() if k not in _ROS2_HEAD}
            store.register({**{k: ros2[k] for k in _ROS2_HEAD}, **types})
            self.store = store
        except Exception:  # rosbags raises several kinds from its parser; the topic is then left out
            self.store = None

    @property
    def fields(self) -> Any:
        return self.store.fielddefs if self.store is not None else {}


_parsed: dict[tuple[str, str], Any] = {}


def _types_of(topic: Topic) -> Any:
    """Field definitions that the messages of a topic need. Raises ValueError where they are not to be had."""
    key = (topic.type, topic.definition)
    if key not in _parsed:
        if topic.definition_encoding == "ros1msg":
            _parsed[key] = _Ros1Type(topic.type, topic.definition).fields
        elif topic.definition.strip():
            parsed = definitions.parse(topic.definition, topic.type, topic.definition_encoding)
            _parsed[key] = {**definitions.typestore().fielddefs, **parsed}
        elif topic.type in KNOWN:
            _parsed[key] = {**definitions.typestore().fielddefs, **definitions.parse(KNOWN[topic.type], topic.type)}
        else:
            try:
                definitions.ensure(topic.type)
            except RecordingError as error:
                raise ValueError(str(error)) from None
            _parsed[key] = dict(definitions.typestore().fielddefs)
    return _parsed[key]


class _Foreign:
    """Messages of an MCAP file that are not CDR."""

    def __init__(self, collector: MessageColumns) -> None:
        self._collector = collector
        self._decoders: dict[Topic, Decoder | None] = {}
        self._ros1: dict[Topic, _Ros1Type] = {}
        self._batches = Batches(collector.take)
        self._numbers: dict[Topic, int] = {}
        self._count = 0

    def take(self, topics: dict[int, Topic], batch: Batch) -> None:
        """Decode what `MessageColumns.take` has left."""
        for i, number in enumerate(batch.channel.tolist()):
            topic = topics.get(number)
            if topic is None or topic.message_encoding in ("", "cdr") or self._count >= _MOST_DECODED:
                continue
            self._count += 1
            try:
                if topic.message_encoding == "ros1":
                    self._convert(topic, batch.message(i), int(batch.log_ns[i]))
                else:
                    self._decode(topic, batch.message(i), int(batch.log_ns[i]))
            except Exception as error:  # a garbled message, in as many ways as there are decoders
                self._collector.unreadable[topic.topic] = str(error).splitlines()[0] if str(error) else repr(error)

    def flush(self) -> None:
        """Hand over what was converted."""
        self._batches.flush()

    def _convert(self, topic: Topic, data: bytes, log_ns: int) -> None:
        kind = self._ros1.setdefault(topic, _Ros1Type(topic.type, topic.definition))
        if kind.store is None:
            raise ValueError(f"the definition of {topic.type} cannot be parsed")
        number = self._numbers.setdefault(topic, len(self._numbers))
        self._batches.topics[number] = Topic(topic.topic, topic.type, topic.definition, "ros1msg", "cdr")
        self._batches.add(number, bytes(kind.store.ros1_to_cdr(data, topic.type)), log_ns)

    def _decode(self, topic: Topic, data: bytes, log_ns: int) -> None:
        if topic not in self._decoders:
            self._decoders[topic] = _decoder(topic)
        decoder = self._decoders[topic]
        if decoder is None:
            raise ValueError(f"messages of encoding {quoted(topic.message_encoding, 40)} are not read")
        content = decoder(data)
        if isinstance(content, dict):
            self._collector.add(topic, content, log_ns)


def _decoder(topic: Topic) -> Decoder | None:
    if topic.message_encoding == "json":
        return json.loads
    if topic.message_encoding != "protobuf":
        return None
    described = descriptor_pb2.FileDescriptorSet.FromString(topic.definition.encode("utf-8", "surrogateescape"))
    pool = descriptor_pool.DescriptorPool()
    for file in described.file:
        pool.Add(file)
    made = message_factory.GetMessageClass(pool.FindMessageTypeByName(topic.type))

    return lambda data: _plain(made.FromString(data))


def _plain(message: Any) -> dict[str, Any]:
    """A protobuf message as nested dicts, with the fields that are zero."""
    result: dict[str, Any] = {}
    for one in message.DESCRIPTOR.fields:
        if one.message_type is not None and not one.is_repeated and not message.HasField(one.name):
            continue
        value = getattr(message, one.name)
        if one.message_type is None:
            result[one.name] = list(value) if one.is_repeated else value
        elif one.message_type.GetOptions().map_entry:
            continue
        else:
            result[one.name] = [_plain(entry) for entry in value] if one.is_repeated else _plain(value)
    return result


def _source(path: Path, kind: str, collector: MessageColumns, notes: list[str]) -> Source:
    columns = collector.columns()
    bad = [f"{topic}: {quoted(why, 120)}: left out" for topic, why in sorted(collector.unreadable.items())]
    if not columns:
        raise ImportingError("; ".join(bad[:1]) or "none of its topics carries numbers")
    notes += bad[:6] + ([f"{len(bad) - 6} more topics are left out"] if len(bad) > 6 else [])
    return Source(path, kind, columns, True, "stamps of the messages", notes)
