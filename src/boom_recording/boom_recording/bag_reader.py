"""Collects the messages of a bag: topics of interest, decoded by the layout that their bytes have."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import ESSENTIAL, JOINT_NAMES, of_topic
from boom_input.shown import quoted
from boom_recording import cdr_layout, definitions
from boom_recording.channels import MACHINE_CONFIGURATION, OSCILLOSCOPE, TYPES
from boom_recording.defects import TopicSamples
from boom_recording.errors import RecordingError
from boom_recording.mcap_file import opened_mcap
from boom_recording.mcap_records import Batch, Damage, Topic
from boom_recording.recording import Configuration, Floats

_MANY_LAYOUTS = 16  # so many layouts are tried on whole batches; then the rest is read message by message
_MANY_WALKS = 50_000  # messages that are walked one by one: what goes beyond is no recording, and would take minutes
_MANY_DECLARATIONS = 2  # of one topic, in one file
_OWN = ("/boom/", "/boom_", "/tf", "/diagnostics", "/robot_description", "/clock", "/rosout", "/parameter_events")
_Found = tuple[cdr_layout.Layout, dict[str, str]]  # a layout, and where in it each signal lies


@dataclass
class _Column:
    """What was read of one topic: stamps, log times and values per signal, in pieces."""

    stamps: list[NDArray[np.int64]] = field(default_factory=list)
    log: list[NDArray[np.int64]] = field(default_factory=list)
    values: dict[str, list[Floats]] = field(default_factory=dict)
    unreadable: int = 0
    reason: str = ""


class BagReader:
    """Collects the topics of interest over the files of one bag."""

    def __init__(self, joint: str, joints: Mapping[str, str] = JOINT_NAMES) -> None:
        self.joint = joint
        self.joints = {"": joint, **joints}
        self.columns: dict[str, _Column] = {}
        self.types: dict[str, str] = {}
        self.notes: list[str] = []
        self.unstamped: list[str] = []
        self.cut = False
        self.messages = 0
        self.missing = 0
        self.unknown = 0
        self.configurations: list[Configuration] = []
        self._layouts: dict[tuple[str, str, int], list[_Found]] = {}
        self._definitions: dict[tuple[str, str], Any] = {}
        self._walks = 0

    def read(self, path: Path) -> list[Damage]:
        """Read one file. Returns what of it is damaged."""
        with opened_mcap(path) as file:
            for batch in file.batches():
                self._sort(file.topics, batch)
        self.messages += file.messages
        self.missing += max(0, (file.promised or 0) - file.messages)
        for topic in file.topics.values():
            self.types.setdefault(topic.topic, topic.type)
        self.notes += file.notes
        self.cut = self.cut or not file.complete
        return file.damages

    def _sort(self, topics: dict[int, Topic], batch: Batch) -> None:
        """Give the messages of a batch to their topics."""
        known = np.zeros(1 + max(int(batch.channel.max()), max(topics, default=0)), bool)
        known[list(topics)] = True
        self.unknown += int((~known[batch.channel]).sum())
        wanted: dict[Topic, list[int]] = {}
        for number, topic in topics.items():
            if topic.topic in TYPES and topic.type == TYPES[topic.topic]:
                wanted.setdefault(topic, []).append(number)
        if len(wanted) > _MANY_DECLARATIONS * len(TYPES):
            raise RecordingError("it declares its topics over and over, and differently: no recording does")
        for topic, numbers in wanted.items():
            which = np.flatnonzero(np.isin(batch.channel, numbers) if len(numbers) > 1 else batch.channel == numbers[0])
            if len(which):
                self._take(topic, batch, which)

    def demand(self, require: tuple[str, ...], damages: list[Damage], import_line: str) -> None:
        """Raises RecordingError where a required topic is missing, empty or of another type; a foreign bag is to be imported."""
        for topic, found in self.types.items():
            wanted = TYPES.get(topic)
            if wanted is not None and found != wanted:
                raise RecordingError(
                    f"{topic} is of type {quoted(found) or 'unknown'}: it has to be {wanted}; {import_line}"
                )
        why = f" ({quoted(damages[0].what)})" if damages else ""
        if not self.messages and not self.columns:
            why = why or (" (the file ends before the first one: it was cut)" if self.cut else "")
            raise RecordingError(f"it holds no messages{why}: copy it again or record again, or give another bag")
        missing = [topic for topic in require if not self._has(topic)]
        if missing and self.types.keys() == {OSCILLOSCOPE}:
            raise RecordingError(
                f"it is a bag of the first measurement campaign ({OSCILLOSCOPE}): './boom identify' takes it, "
                "here a recording of the whole machine is wanted"
            )
        for topic in missing:
            column = self.columns.get(topic)
            if column is not None and column.unreadable:
                raise RecordingError(f"no message of {topic} can be read: {quoted(column.reason)}")
        if missing == [MACHINE_CONFIGURATION]:
            raise RecordingError(
                f"{MACHINE_CONFIGURATION} missing: give pose and load with --q3 RAD --q4 M --load KG, "
                f"and the machine with --machine{why}"
            )
        if missing:
            has = quoted(", ".join(sorted(self.types.keys() - missing))) or "no other topic"
            advice = f"record {'it' if len(missing) == 1 else 'them'} too (the bag has {has}){why}"
            if self._is_foreign():
                advice = f"the bag has {has}{why}; {import_line}"
            raise RecordingError(f"{' and '.join(missing)} missing: {advice}")

    def _is_foreign(self) -> bool:
        """Whether there are topics that no recording of this workspace has, which may carry the missing signals."""
        return any(topic not in TYPES and not topic.startswith(_OWN) for topic in self.types)

    def _has(self, topic: str) -> bool:
        if topic == MACHINE_CONFIGURATION:
            return bool(self.configurations)
        column = self.columns.get(topic)
        return column is not None and bool(column.stamps)

    def samples(self) -> dict[str, TopicSamples]:
        """What was read, one table per topic, in the order of arrival."""
        result = {}
        for topic, column in self.columns.items():
            if not column.stamps or topic == MACHINE_CONFIGURATION:
                continue
            stamps, log = np.concatenate(column.stamps), np.concatenate(column.log)
            values = {name: np.concatenate(parts) for name, parts in column.values.items()}
            values = {name: v for name, v in values.items() if name in ESSENTIAL or not np.isnan(v).all()}
            channels = tuple(channel for channel in of_topic(topic) if channel.name in values)
            if not stamps.any():
                self.unstamped.append(f"{topic} carries no stamps: the time of arrival is used")
                stamps = log.copy()
            if (np.diff(log) < 0).any():
                order = np.argsort(log, kind="stable")
                stamps, log = stamps[order], log[order]
                values = {name: column[order] for name, column in values.items()}
            timed = np.ones(len(stamps), bool)
            valid = {name: np.ones(len(stamps), bool) for name in values}
            result[topic] = TopicSamples(topic, channels, stamps, log, values, timed, valid)
        return result

    def configuration(self) -> Configuration | None:
        """The machine's configuration. Raises RecordingError where two differ."""
        if not self.configurations:
            return None
        first = self.configurations[0]
        for other in self.configurations[1:]:
            for label, unit in (
                ("machine", ""),
                ("outer_boom_angle", " rad"),
                ("telescope_length", " m"),
                ("load_mass", " kg"),
            ):
                a, b = getattr(first, label), getattr(other, label)
                if a != b and not (a != a and b != b):  # NaN (not known) equals NaN here
                    raise RecordingError(f"two machines in one bag: {label} is {a}{unit} and {b}{unit}: split the bag")
        return first

    def _take(self, topic: Topic, batch: Batch, which: NDArray[np.intp]) -> None:
        column = self.columns.setdefault(topic.topic, _Column())
        if topic.message_encoding != "cdr":
            column.unreadable += len(which)
            column.reason = f"they are {quoted(topic.message_encoding) or 'unknown'}, not cdr"
            return
        if topic.topic == MACHINE_CONFIGURATION:
            for i in which[: max(_MANY_WALKS - self._walks, 0)].tolist():
                self._walks += 1
                self._configure(topic, column, batch.message(i))
            return
        names = [channel.name for channel in of_topic(topic.topic)]
        stamps = np.zeros(len(which), np.int64)
        values = {name: np.zeros(len(which)) for name in names}
        done = np.zeros(len(which), bool)
        for size in np.unique(batch.size[which]).tolist():
            self._take_equal(
                topic, batch, which, np.flatnonzero(batch.size[which] == size), size, stamps, values, done, column
            )
        if not done.any():
            return
        column.stamps.append(stamps[done])
        column.log.append(batch.log_ns[which][done])
        for name in names:
            column.values.setdefault(name, []).append(values[name][done])

    def _take_equal(
        self, topic: Topic, batch: Batch, which: NDArray[np.intp], part: NDArray[np.intp], size: int,
        stamps: NDArray[np.int64], values: dict[str, Floats], done: NDArray[np.bool_], column: _Column,
    ) -> None:  # fmt: skip
        """Decode messages of one size into the places `part` of the result arrays."""
        if size < 4:
            column.unreadable += len(part)
            column.reason = "too short"
            return
        known = self._layouts.setdefault((topic.topic, topic.definition, size), [])
        tried = 0
        while len(part):
            if tried == len(known):
                if self._walks == _MANY_WALKS:
                    column.unreadable += len(part)
                    column.reason = "too many of them are laid out differently"
                    return
                found = self._layout_or_none(topic, batch, int(which[part[0]]), column)
                if found is None:
                    part = part[1:]
                    continue
                known.append(found)
            layout, paths = known[tried]
            rows = cdr_layout.gather(batch.data, batch.offset[which[part]], size)
            match = layout.matches(rows)
            fits, rest = part[match], part[~match]
            tried += 1
            if tried > _MANY_LAYOUTS:
                # Every message laid out differently: do not compare the rest with all that were seen.
                known.pop()
                tried -= 1
            if len(fits):
                rows = cdr_layout.gather(batch.data, batch.offset[which[fits]], size)
                seconds, nanoseconds = (layout.column(rows, f"header.stamp.{name}") for name in ("sec", "nanosec"))
                possible = nanoseconds.astype(np.int64) < 10**9  # others are no stamps
                stamps[fits] = np.where(possible, seconds.astype(np.int64) * 10**9 + nanoseconds.astype(np.int64), 0)
                for channel in of_topic(topic.topic):
                    there = channel.name in paths
                    values[channel.name][fits] = (
                        layout.column(rows, paths[channel.name]) - channel.wire_offset if there else np.nan
                    )
                done[fits] = True
            part = rest

    def _layout_or_none(self, topic: Topic, batch: Batch, index: int, column: _Column) -> _Found | None:
        self._walks += 1
        try:
            return self._layout(topic, batch.message(index))
        except cdr_layout.LayoutError as error:
            column.unreadable += 1
            column.reason = str(error)
            return None

    def _types(self, topic: Topic) -> Any:
        key = (topic.type, topic.definition)
        if key not in self._definitions:
            types = dict(definitions.typestore().fielddefs)
            if topic.definition.strip():
                try:
                    types.update(definitions.parse(topic.definition, topic.type, topic.definition_encoding))
                except ValueError as error:
                    self.notes.append(f"{quoted(error)}: the one that is installed was taken")
                    definitions.ensure(topic.type)
                    types = dict(definitions.typestore().fielddefs)
            else:
                definitions.ensure(topic.type)
                types = dict(definitions.typestore().fielddefs)
            self._definitions[key] = types
        return self._definitions[key]

    def _layout(self, topic: Topic, data: bytes) -> _Found:
        layout = cdr_layout.locate(data, topic.type, self._types(topic))
        paths = {}
        for channel in of_topic(topic.topic):
            path = channel.field
            if topic.type.endswith("/JointState"):
                names = [layout.texts[f"name[{i}]"] for i in range(layout.lengths.get("name", 0))]
                if self.joint not in names:
                    among = quoted(", ".join(names)) or "no joints"
                    raise cdr_layout.LayoutError(
                        f"joint '{self.joint}' is not among {among}: give its name with --joint"
                    )
                if names.count(self.joints[channel.joint]) > 1:
                    raise cdr_layout.LayoutError(
                        f"joint {quoted(self.joints[channel.joint])} stands {names.count(self.joints[channel.joint])} times in one "
                        "message, and which of them counts it does not say"
                    )
                if self.joints[channel.joint] not in names:
                    continue  # another joint that nobody measures
                path = f"{path}[{names.index(self.joints[channel.joint])}]"
            if path not in layout.numbers and topic.type.endswith("/JointState") and channel.name not in ESSENTIAL:
                continue  # a joint without gyro
            if path not in layout.numbers:
                raise cdr_layout.LayoutError(f"field {channel.field} is missing or empty")
            paths[channel.name] = path
        if not {"header.stamp.sec", "header.stamp.nanosec"} <= layout.numbers.keys():
            raise cdr_layout.LayoutError("it has no header")
        return layout, paths

    def _configure(self, topic: Topic, column: _Column, data: bytes) -> None:
        try:
            layout = cdr_layout.locate(data, topic.type, self._types(topic))
            rows = layout.template[None, :]
            angle, length, load_mass = (
                float(layout.column(rows, name)[0]) for name in ("outer_boom_angle", "telescope_length", "load_mass")
            )
            machine, note = layout.texts["machine"], layout.texts.get("note", "")
        except (cdr_layout.LayoutError, KeyError) as error:
            column.unreadable += 1
            column.reason = str(error)
            return
        self.configurations.append(Configuration(machine, angle, length, load_mass, note))
