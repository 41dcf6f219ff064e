"""Messages of any type become columns: every number of a message is one, named by its path and by the name beside it.

An element of a list is called by the text that stands beside it: ``position[2]`` of a JointState by ``name[2]``, ``array[0]`` of
OPERA's FluidPressureArray by its own ``header.frame_id``. Its stamp is the nearest one above it, else the time of arrival.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_import import units
from boom_import.source import Column, Floats, Stamps, column, unique
from boom_input.channels import CHANNELS, JOINT_NAMES
from boom_recording import cdr_layout
from boom_recording.channels import DEFAULT_JOINT, TYPES
from boom_recording.mcap_records import Batch, Topic

TypesOf = Callable[[Topic], cdr_layout.FieldTypes]
Decoder = Callable[[bytes], dict[str, Any]]

_MANY_WALKS = 50_000
_MOST_FIELDS = 400
_MOST_COLUMNS = 4000
_LONG_UNNAMED = 16
_NAMES = ("name", "names", "joint_name", "joint_names", "label", "labels", "key", "id")
_OWN_NAMES = ("header.frame_id", "name", "joint_name", "label", "key", "frame_id")
_SECONDS, _PARTS = ("sec", "secs", "seconds"), ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")
_STAMP = re.compile(
    r"(?:^|\.)(?:header\.stamp|stamp|timestamp|time|clock)\.(?:sec|secs|seconds|nanosec|nsec|nsecs|nanos|nanoseconds)$"
)
_LEFT_OUT = re.compile(r"covariance|header\.seq$|(?:^|\.)variance$|is_dense|is_bigendian|row_step|point_step")
_UNITS = {
    ("sensor_msgs/msg/FluidPressure", "fluid_pressure"): "Pa",
    ("com3_msgs/msg/FluidPressureArray", "fluid_pressure"): "Pa",
    ("sensor_msgs/msg/JointState", "position"): "rad",
    ("sensor_msgs/msg/JointState", "velocity"): "rad/s",
    ("sensor_msgs/msg/Imu", "angular_velocity"): "rad/s",
    ("sensor_msgs/msg/Temperature", "temperature"): "degC",
}
"""(type, part of the path) -> unit that the message's definition prescribes (REP 103)."""
_JOINTS = {"": DEFAULT_JOINT, **JOINT_NAMES}
_CONTRACT = {
    (
        c.topic,
        f"{c.field}[{_JOINTS[c.joint]}]" if TYPES.get(c.topic) == "sensor_msgs/msg/JointState" else c.field,
    ): c.name
    for c in CHANNELS
}
"""(topic, label) -> signal of the recordings that every command takes."""


@dataclass
class _Series:
    stamps: list[Stamps] = field(default_factory=list)
    values: list[Floats] = field(default_factory=list)


@dataclass(frozen=True)
class _Field:
    """Where a number lies in a layout, under which label it goes, and where its stamp lies."""

    label: str
    path: str
    stamp: tuple[str, str] | None


class MessageColumns:
    """Collects the numbers of all topics, batch by batch."""

    def __init__(self, types_of: TypesOf) -> None:
        self._types_of = types_of
        self._series: dict[tuple[str, str, str], _Series] = {}
        self._layouts: dict[tuple[Topic, int], list[tuple[cdr_layout.Layout, list[_Field]]]] = {}
        self._walks = 0
        self.unreadable: dict[str, str] = {}

    def take(self, topics: dict[int, Topic], batch: Batch) -> None:
        """Take in the messages of a batch that are CDR; `topics` by the number in `batch.channel`."""
        for number in np.unique(batch.channel).tolist():
            topic = topics.get(number)
            if topic is None or topic.message_encoding not in ("", "cdr"):
                continue
            which = np.flatnonzero(batch.channel == number)
            for size in np.unique(batch.size[which]).tolist():
                self._equal(topic, batch, which[batch.size[which] == size], size)

    def _equal(self, topic: Topic, batch: Batch, part: NDArray[np.intp], size: int) -> None:
        known = self._layouts.setdefault((topic, size), [])
        tried = 0
        while len(part) and self._walks < _MANY_WALKS:
            if tried == len(known):
                self._walks += 1
                try:
                    layout = cdr_layout.locate(batch.message(int(part[0])), topic.type, self._types_of(topic))
                except (cdr_layout.LayoutError, ValueError, KeyError) as error:
                    self.unreadable[topic.topic] = str(error)
                    part = part[1:]
                    continue
                known.append((layout, _fields(layout)))
            layout, fields = known[tried]
            rows = cdr_layout.gather(batch.data, batch.offset[part], size)
            match = layout.matches(rows)
            if match.any():
                self._store(topic, layout, fields, rows[match], batch.log_ns[part[match]])
            part = part[~match]
            tried += 1

    def _store(
        self, topic: Topic, layout: cdr_layout.Layout, fields: list[_Field], rows: cdr_layout.Rows, log: Stamps
    ) -> None:
        for entry in fields:
            series = self._of(topic.topic, topic.type, entry.label)
            if series is None:
                return
            stamps = log
            if entry.stamp is not None:
                seconds, parts = (layout.column(rows, path).astype(np.int64) for path in entry.stamp)
                stamps = seconds * 10**9 + parts
                stamps = np.where(stamps > 0, stamps, log)
            series.stamps.append(stamps)
            series.values.append(layout.column(rows, entry.path).astype(np.float64))

    def add(self, topic: Topic, content: dict[str, Any], log_ns: int) -> None:
        """Take in one message that was decoded to nested dicts (JSON, protobuf)."""
        numbers: dict[str, float] = {}
        texts: dict[str, str] = {}
        _flatten("", content, numbers, texts)
        for path, value in numbers.items():
            if _STAMP.search(path) or _LEFT_OUT.search(path):
                continue
            series = self._of(topic.topic, topic.type, _label(path, texts))
            if series is None:
                return
            stamp = _stamp_of(path, numbers)
            at = int(numbers[stamp[0]]) * 10**9 + int(numbers[stamp[1]]) if stamp else 0
            series.stamps.append(np.array([at or log_ns], np.int64))
            series.values.append(np.array([value]))

    def _of(self, topic: str, kind: str, label: str) -> _Series | None:
        key = (topic, kind, label)
        if key not in self._series and len(self._series) >= _MOST_COLUMNS:
            return None
        return self._series.setdefault(key, _Series())

    def columns(self) -> list[Column]:
        """What was collected, in the order in which it came first."""
        result: list[Column] = []
        taken: set[str] = set()
        for (topic, kind, label), series in self._series.items():
            by_type = next((u for (t, part), u in _UNITS.items() if t == kind and part in label), "")
            joint = label.partition("[")[2].rstrip("]") if kind.endswith("/JointState") else ""
            made = column(
                unique(f"{topic}:{label}", taken), f"{topic} {label}", by_type or _stated(topic, label),
                np.concatenate(series.stamps), np.concatenate(series.values), by_type=bool(by_type), joint=joint,
                signal=_CONTRACT.get((topic, label), ""),
            )  # fmt: skip
            result += [made] if made else []
        return result


def _stated(topic: str, label: str) -> str:
    """The unit in a field's name, or in its topic's: "boomAngleDeg", "/valve/current_ma"."""
    for name in (label.rpartition(".")[2], topic.rpartition("/")[2]):
        unit = units.split(re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name))[1]
        if unit:
            return unit
    return ""


def _fields(layout: cdr_layout.Layout) -> list[_Field]:
    result: list[_Field] = []
    for path in layout.numbers:
        if _STAMP.search(path) or _LEFT_OUT.search(path) or len(result) >= _MOST_FIELDS:
            continue
        label = _label(path, layout.texts)
        if label == path and path.endswith("]") and layout.lengths.get(path[: path.rindex("[")], 0) > _LONG_UNNAMED:
            continue
        result.append(_Field(label, path, _stamp_of(path, layout.numbers)))
    return result


def _stamp_of(path: str, numbers: Any) -> tuple[str, str] | None:
    """Paths of seconds and nanoseconds of the nearest stamp above a field."""
    above = path
    while above:
        above = above.rpartition(".")[0]
        for stamp in ("header.stamp", "stamp", "timestamp"):
            for seconds in _SECONDS:
                for parts in _PARTS:
                    pair = tuple(f"{above}.{stamp}.{name}" if above else f"{stamp}.{name}" for name in (seconds, parts))
                    if pair[0] in numbers and pair[1] in numbers:
                        return pair[0], pair[1]
    return None


def _label(path: str, texts: dict[str, str]) -> str:
    """The path with names in the place of indices, where the message gives them."""
    result, begin = "", 0
    for match in re.finditer(r"\[(\d+)\]", path):
        whole, inside = path[: match.end()], path[: match.start()]
        parent = inside.rpartition(".")[0]
        beside = (f"{parent}.{name}[{match[1]}]" if parent else f"{name}[{match[1]}]" for name in _NAMES)
        own = (f"{whole}.{name}" for name in _OWN_NAMES)
        name = next((texts[place] for place in (*beside, *own) if texts.get(place)), match[1])
        result += path[begin : match.start()] + f"[{name}]"
        begin = match.end()
    return result + path[begin:]


def _flatten(path: str, value: Any, numbers: dict[str, float], texts: dict[str, str]) -> None:
    if len(numbers) > _MOST_FIELDS:
        return
    if isinstance(value, dict):
        for name, entry in value.items():
            _flatten(f"{path}.{name}" if path else str(name), entry, numbers, texts)
    elif isinstance(value, list):
        for i, entry in enumerate(value[: 4 * _LONG_UNNAMED]):
            _flatten(f"{path}[{i}]", entry, numbers, texts)
    elif isinstance(value, str):
        texts[path] = value
    elif isinstance(value, (int, float)):
        numbers[path] = float(value)


class Batches:
    """Makes batches of single messages, so that they can be decoded as arrays."""

    def __init__(self, sink: Callable[[dict[int, Topic], Batch], None], size: int = 8_000_000) -> None:
        self._sink, self._limit = sink, size
        self.topics: dict[int, Topic] = {}
        self._clear()

    def _clear(self) -> None:
        self._data: list[bytes] = []
        self._number: list[int] = []
        self._log: list[int] = []
        self._length = 0

    def add(self, number: int, data: bytes, log_ns: int) -> None:
        """One message of the topic with that number."""
        self._data.append(data)
        self._number.append(number)
        self._log.append(log_ns)
        self._length += len(data)
        if self._length > self._limit or len(self._data) >= 100_000:
            self.flush()

    def flush(self) -> None:
        """Hand over what is there."""
        if self._data:
            size = np.array([len(data) for data in self._data], np.int64)
            offset = np.concatenate(([0], np.cumsum(size)[:-1])).astype(np.int64)
            log = np.array(self._log, np.int64)
            joined = np.frombuffer(b"".join(self._data), np.uint8)
            self._sink(self.topics, Batch(joined, np.array(self._number, np.int64), offset, size, log, log))
        self._clear()
