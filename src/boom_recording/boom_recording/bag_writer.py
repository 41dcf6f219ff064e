"""Writes rosbag2 directories (MCAP, CDR, zstd chunks with checksums, definitions, metadata.yaml) without ROS."""

import contextlib
import errno
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import yaml
from mcap.writer import CompressionType, Writer

from boom_recording.bag_folder import METADATA
from boom_recording.errors import RecordingError

CHUNK_BYTES = 64_000  # small: what is not yet in a chunk is lost with the process
LIBRARY = "boom_recording"
_INFINITE = {"sec": 9_223_372_036, "nsec": 854_775_807}
_BAG_VERSION = 9


@dataclass(frozen=True)
class OfferedQos:
    """The part of a publisher's QoS that a player needs; latched: transient local, deadline_ns: [ns], None = none."""

    reliable: bool = False
    latched: bool = False
    depth: int = 5
    deadline_ns: int | None = None

    def as_mapping(self) -> dict[str, Any]:
        """As a mapping in the form of rosbag2."""
        deadline = dict(_INFINITE)
        if self.deadline_ns is not None:
            deadline = {"sec": self.deadline_ns // 10**9, "nsec": self.deadline_ns % 10**9}
        return {
            "history": "keep_last",
            "depth": self.depth,
            "reliability": "reliable" if self.reliable else "best_effort",
            "durability": "transient_local" if self.latched else "volatile",
            "deadline": deadline,
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }


SENSOR_QOS = OfferedQos()
LATCHED_QOS = OfferedQos(reliable=True, latched=True, depth=1)


@dataclass
class _Topic:
    name: str
    type: str
    hash: str
    qos: list[dict[str, Any]]
    messages: int = 0


class BagWriter:
    """One bag being written. Use as a context manager, or call `close`.

    path          folder of the bag; must not exist yet (its parent is created)
    chunk_bytes   size of a chunk before compression [byte]

    Raises RecordingError if the folder exists or cannot be created, and from every method if writing fails (disk
    full).
    """

    def __init__(self, path: Path, *, chunk_bytes: int = CHUNK_BYTES) -> None:
        self.path = path
        self.name = os.path.basename(os.path.realpath(path))
        self._topics: dict[int, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._closed = False
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            raise RecordingError(
                f"{path}: it exists already and is not overwritten: give another name or remove it"
            ) from None
        except OSError as error:
            raise RecordingError(f"{path}: the folder cannot be created: {error.strerror}") from None
        self._file = path / f"{self.name}_0.mcap"
        with self._failures():
            self._stream: IO[bytes] = self._file.open("wb")
            self._writer = Writer(
                self._stream, chunk_size=chunk_bytes, compression=CompressionType.ZSTD, enable_data_crcs=True
            )
            self._writer.start(profile="ros2", library=LIBRARY)

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages written per topic."""
        return {topic.name: topic.messages for topic in self._topics.values()}

    def add_topic(
        self, name: str, type_name: str, definition: str, type_hash: str, qos: OfferedQos = SENSOR_QOS
    ) -> int:
        """Declare a topic; returns its number for `write`."""
        offered = [qos.as_mapping()]
        with self._failures():
            if type_name not in self._schemas:
                encoding = "ros2msg" if definition else ""
                self._schemas[type_name] = self._writer.register_schema(type_name, encoding, definition.encode())
            number = self._writer.register_channel(
                name, "cdr", self._schemas[type_name], {"offered_qos_profiles": _plain(offered)}
            )
        self._topics[number] = _Topic(name, type_name, type_hash, offered)
        return number

    def write(self, topic: int, data: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """Append one serialised message. log_ns: when it was received [ns], publish_ns: when it was sent [ns]."""
        with self._failures():
            self._writer.add_message(topic, log_ns, data, publish_ns, sequence)
        self._topics[topic].messages += 1
        self._first_ns = log_ns if self._first_ns is None else min(self._first_ns, log_ns)
        self._last_ns = log_ns if self._last_ns is None else max(self._last_ns, log_ns)

    def flush(self) -> None:
        """Close the chunk in progress and hand it to the operating system: it survives the death of the process.

        Raises:
            RecordingError: it cannot be written, or the bag is not where it was any more.
        """
        with self._failures():
            self._writer.flush()  # type: ignore[no-untyped-call]
            here = self._file.exists() and os.path.samestat(os.fstat(self._stream.fileno()), self._file.stat())
        if not here:
            raise RecordingError(
                f"{self.path}: it was deleted or moved while it was recorded: one that was moved can be read, without its "
                "metadata.yaml; record again"
            )

    def discard(self) -> None:
        """Take a bag back that holds no message: its name is free again."""
        if not any(self.counts.values()):
            self._closed = True
            self._stream.close()
            self._file.unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # somebody has put something there
                self.path.rmdir()

    def close(self) -> None:
        """Write the index and metadata.yaml. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        with self._failures():
            try:
                self._writer.finish()  # type: ignore[no-untyped-call]
            finally:
                self._stream.close()
            (self.path / METADATA).write_text(self._metadata(), encoding="utf-8")

    def _failures(self) -> "_Failures":
        return _Failures(self.path)

    def _metadata(self) -> str:
        first = self._first_ns or 0
        duration = (self._last_ns or 0) - first
        total = sum(topic.messages for topic in self._topics.values())
        file = f"{self.name}_0.mcap"
        topics = [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": topic.qos,
                    "type_description_hash": topic.hash,
                },
                "message_count": topic.messages,
            }
            for topic in self._topics.values()
        ]
        start = {"nanoseconds_since_epoch": first}
        information = {
            "version": _BAG_VERSION,
            "storage_identifier": "mcap",
            "duration": {"nanoseconds": duration},
            "starting_time": start,
            "message_count": total,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [file],
            "files": [
                {
                    "path": file,
                    "starting_time": dict(start),
                    "duration": {"nanoseconds": duration},
                    "message_count": total,
                }
            ],
            "custom_data": None,
            "ros_distro": "jazzy",
        }
        return _plain({"rosbag2_bagfile_information": information})


class _PlainDumper(yaml.SafeDumper):
    """YAML without anchors, which the parser of rosbag2 does not accept."""

    def ignore_aliases(self, _data: Any) -> bool:
        return True


def _plain(document: Any) -> str:
    return str(yaml.dump(document, Dumper=_PlainDumper, sort_keys=False))


class _Failures:
    """Turns an OSError of the file into a RecordingError with a plain reason. Cheaper per message than a generator."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, OSError):
            reason = f"writing failed: {error.strerror}"
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                left = "nothing was written" if self._emptied() else "what was written so far can be read"
                reason = f"the disk is full: make room; {left}"
            raise RecordingError(f"{self._path}: {reason}") from None

    def _emptied(self) -> bool:
        """Whether there is nothing in the bag; its name is free again then."""
        files = [*self._path.iterdir()] if self._path.is_dir() else []
        if any(file.stat().st_size for file in files):
            return False
        for file in files:
            file.unlink()
        with contextlib.suppress(FileNotFoundError):  # closed after a failure, or taken away by somebody
            self._path.rmdir()
        return True
