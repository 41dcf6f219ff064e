"""Bags: what is written is read, what is damaged as far as it goes, and what is no bag is refused in one line."""

import dataclasses
import math
import os
import shutil
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from recording_samples import CONFIGURATION, columns, recording
from rosbags.highlevel import AnyReader

from boom_recording import cdr_layout, definitions
from boom_recording.bag_writer import BagWriter
from boom_recording.errors import RecordingError
from boom_recording.loading import load
from boom_recording.writing import from_columns, write


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bags") / "made"
    write(path, recording())
    return path


@pytest.fixture
def bag(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "made"))


def mcap(bag: Path) -> Path:
    return next(bag.glob("*.mcap"))


def test_what_was_written_is_loaded(made: Path) -> None:
    expected, found = recording(), load(made)
    assert found.events == [] and found.warnings == [] and found.notes == []
    assert found.configuration == CONFIGURATION
    assert found.start_ns == expected.start_ns
    for name, signal in expected.signals.items():
        assert np.array_equal(found.signals[name].stamps_ns, signal.stamps_ns)
        assert np.allclose(found.signals[name].values, signal.values, rtol=0, atol=1e-8)
        assert found.signals[name].valid.all()
        assert found.signals[name].unit == signal.unit


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    steps=st.lists(st.integers(1, 40_000_000), min_size=1, max_size=30),
    start=st.integers(0, 2**31 * 10**9 - 2 * 10**9),
    mass=st.floats(allow_nan=True, allow_infinity=False),
    machine=st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
)
def test_any_numbers_survive_being_written_and_loaded(
    tmp_path: Path, data: st.DataObject, steps: list[int], start: int, mass: float, machine: str
) -> None:
    time = np.cumsum(steps) / 1e9
    numbers = st.floats(-1e9, 1e9)
    names = ["angle", "rate", "hose_pressure", "retract_current", "extend_current"]
    signals = {name: np.array(data.draw(st.lists(numbers, min_size=len(time), max_size=len(time)))) for name in names}
    configuration = dataclasses.replace(CONFIGURATION, load_mass=mass, machine=machine)
    shutil.rmtree(tmp_path / "any", ignore_errors=True)
    made = from_columns("any", time, signals, configuration, start_ns=start)
    write(tmp_path / "any", made)
    found = load(tmp_path / "any", require=())
    for name in names:
        assert np.array_equal(found.signals[name].stamps_ns, made.signals[name].stamps_ns)
        assert np.allclose(found.signals[name].values, signals[name], rtol=1e-15, atol=1e-7)
    assert found.configuration.machine == machine
    assert found.configuration.load_mass == mass or (math.isnan(mass) and math.isnan(found.configuration.load_mass))


def test_the_same_recording_is_written_as_the_same_bytes(made: Path, tmp_path: Path) -> None:
    write(tmp_path / "made", recording())
    assert mcap(tmp_path / "made").read_bytes() == mcap(made).read_bytes()
    assert (tmp_path / "made/metadata.yaml").read_text() == (made / "metadata.yaml").read_text()


def test_other_readers_read_what_was_written(made: Path) -> None:
    expected = recording().signals["hose_pressure"]
    with AnyReader([made]) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == "/boom/hose_pressure"]
        values = [
            reader.deserialize(raw, connection.msgtype).fluid_pressure for connection, _, raw in reader.messages(chosen)
        ]
    assert np.allclose(np.array(values) - 101_325, expected.values)
    with mcap(made).open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        assert sum(1 for _ in reader.iter_messages()) == 4 * 600 + 1
        summary = reader.get_summary()
        assert summary is not None and len(summary.chunk_indexes) > 1
        assert all(index.compression == "zstd" for index in summary.chunk_indexes)


def test_a_bare_file_is_a_bag(made: Path, tmp_path: Path) -> None:
    shutil.copy(mcap(made), tmp_path / "bare.mcap")
    assert load(tmp_path / "bare.mcap").duration == load(made).duration


@pytest.mark.parametrize(
    "text",
    [
        None, "", "{", "a: 1", "\0", "a: &a [1]\nb: *a", "[" * 5000, "a: " + "9" * 5000, "- 2026-02-31", "a: !!python/name:os.x",
        "rosbag2_bagfile_information: [1]", "rosbag2_bagfile_information: {relative_file_paths: [[1], {}]}",
        "rosbag2_bagfile_information: {relative_file_paths: made_0.mcap}", "x" * 2_000_000,
    ],
)  # fmt: skip
def test_without_a_usable_metadata_file_the_mcap_file_is_read(bag: Path, text: str | None) -> None:
    (bag / "metadata.yaml").unlink()
    if text is not None:
        (bag / "metadata.yaml").write_text(text)
    found = load(bag)
    assert found.events == [] and len(found.warnings) == 1 and "metadata.yaml" in found.warnings[0]


def test_metadata_that_is_no_file_or_lies_costs_nothing_but_a_warning(bag: Path) -> None:
    metadata = bag / "metadata.yaml"
    text = metadata.read_text()
    for wrong, told in (
        ("message_count: 2401", "message_count: 1e999"), ("nanoseconds: ", "nanoseconds: x"),
        ("compression_mode: ''", "compression_mode: [1]"), ("- made_0.mcap", "- made_0.mcap\n  - ../../etc/passwd"),
    ):  # fmt: skip
        metadata.write_text(text.replace(wrong, told))
        assert metadata.read_text() != text
        assert load(bag).duration == load(mcap(bag)).duration
    shutil.copy(mcap(bag), bag / "more.mcap")
    metadata.write_text(text)
    assert load(bag).warnings == ["more.mcap is not named in metadata.yaml and was not read"]
    metadata.unlink()
    (bag / "more.mcap").unlink()
    os.mkfifo(metadata)
    (warning,) = load(bag).warnings
    assert "not a regular file" in warning and "were read" in warning


def test_a_bag_split_into_files_is_one_recording(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    time, signals = columns()
    for part in range(2):
        half = slice(part * 300, part * 300 + 300)
        write(
            tmp_path / f"part{part}",
            from_columns("x", time[half], {k: v[half] for k, v in signals.items()}, CONFIGURATION),
        )
        shutil.move(mcap(tmp_path / f"part{part}"), folder / f"split_{part}.mcap")
    assert load(folder).signals["angle"].values.tolist() == signals["angle"].tolist()


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_cut_file_is_read_up_to_the_break_and_the_loss_is_stated(bag: Path, share: float) -> None:
    file = mcap(bag)
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    whole, found = recording(), load(bag)
    assert 0.15 * share < found.duration / whole.duration <= 1
    assert any(
        warning.startswith(f"cut at {found.duration:.1f} s") and "of 2401 messages are lost" in warning
        for warning in found.warnings
    )
    n = int(found.signals["angle"].valid.sum())
    assert np.array_equal(found.signals["angle"].values[:n], whole.signals["angle"].values[:n])


def test_a_file_cut_in_a_large_chunk_is_unpacked_up_to_the_break(tmp_path: Path) -> None:
    write(tmp_path / "large", recording(60.0), chunk_bytes=10_000_000)
    file = mcap(tmp_path / "large")
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 3])
    assert load(tmp_path / "large").duration > 10


def test_a_flipped_byte_in_a_chunk_is_reported_with_its_time_and_the_rest_is_read(bag: Path) -> None:
    file = mcap(bag)
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[1]
    content = bytearray(file.read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length - 100] ^= 0x10
    file.write_bytes(content)
    whole, found = recording(), load(bag)
    start, end = ((t - whole.start_ns) / 1e9 for t in (chunk.message_start_time, chunk.message_end_time))
    assert any(f"from {start:.1f} s to {end:.1f} s are lost" in warning for warning in found.warnings)
    assert {event.kind for event in found.events} <= {"gap"}
    gap = next(event for event in found.events if event.topic == "/joint_states")
    assert start - 0.02 < gap.start_s and gap.end_s < end + 0.02
    assert found.duration == pytest.approx(whole.duration, abs=0.01)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_anywhere_never_changes_a_number_unnoticed(
    made: Path, tmp_path: Path, place: float, bit: int
) -> None:
    content = bytearray(mcap(made).read_bytes())
    content[int(place * len(content))] ^= 1 << bit
    flipped = tmp_path / "flipped.mcap"
    flipped.write_bytes(content)
    whole = load(mcap(made))
    try:
        found = load(flipped)
    except RecordingError as error:
        assert str(flipped) in str(error) and "\n" not in str(error)
        return
    told = found.warnings or found.notes
    for name, signal in whole.signals.items():
        same = np.array_equal(found.signals[name].values, signal.values)
        assert same or found.warnings
        assert set(found.signals[name].stamps_ns.tolist()) <= set(signal.stamps_ns.tolist())
    assert told


def test_a_file_without_checksums_is_read_and_that_is_only_noted(made: Path, tmp_path: Path) -> None:
    found = load(_unprotected(made, tmp_path / "plain.mcap"))
    assert found.warnings == [] and found.events == []
    assert any("no checksums" in note for note in found.notes)


def _unprotected(made: Path, target: Path, definition: Callable[[bytes], bytes] = bytes, **options: Any) -> Path:
    """The bag again without checksums, its chunks not packed; `target`: a new .mcap file."""
    with mcap(made).open("rb") as source, target.open("wb") as stream:
        writer = Writer(stream, enable_crcs=False, compression=CompressionType.NONE, **options)
        writer.start("ros2")
        known: dict[int, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            assert schema is not None
            if channel.id not in known:
                number = writer.register_schema(schema.name, schema.encoding, definition(schema.data))
                known[channel.id] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(known[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    return target


def _first_message(content: bytes, behind: int) -> int:
    """Where, behind that place, the first message of the third topic begins."""
    return next(
        k for k in range(behind, len(content)) if content[k] == 5 and content[k + 2 : k + 11] == bytes(7) + b"\3\0"
    )


@pytest.mark.parametrize("opcode", [0, 7, 0x90])
def test_one_bad_opcode_in_a_bag_without_checksums_is_told(made: Path, bag: Path, opcode: int) -> None:
    content = bytearray(_unprotected(made, mcap(bag)).read_bytes())
    content[_first_message(content, len(content) // 2)] = opcode
    mcap(bag).write_bytes(content)
    found = load(bag)
    lost = 600 - int(found.signals["hose_pressure"].valid.sum())
    assert any("of the 2401 messages that" in warning and "are lost" in warning for warning in found.warnings)
    assert opcode == 0 or lost <= 1, "a wrong kind alone costs its record"


@pytest.mark.parametrize("size", [2**63, 2**64 - 1, 10**9, 1])
def test_a_chunk_of_an_impossible_size_is_damage_and_told(bag: Path, size: int) -> None:
    content = bytearray(mcap(bag).read_bytes())
    with mcap(bag).open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    struct.pack_into("<Q", content, summary.chunk_indexes[1].chunk_start_offset + 9 + 16, size)
    mcap(bag).write_bytes(content)
    found = load(bag)
    assert any("a chunk is damaged (it claims" in warning for warning in found.warnings)
    assert found.duration == pytest.approx(recording().duration, abs=0.02)


def test_a_definition_that_contains_itself_is_refused_and_a_damaged_one_replaced(made: Path, tmp_path: Path) -> None:
    inner = b"std_msgs/Inner inner\n" + b"=" * 80 + b"\nMSG: std_msgs/Inner\nstd_msgs/Inner inner\n"
    path = _unprotected(made, tmp_path / "endless.mcap", lambda text: inner)
    with pytest.raises(RecordingError, match="nested deeper than 32 levels"):
        load(path)
    path = _unprotected(made, tmp_path / "damaged.mcap", lambda text: text[: len(text) // 2] + b"\x1b\n" * 3)
    found = load(path)
    assert found.events == [] and all(note.isprintable() for note in found.notes)
    assert any("the one that is installed was taken" in note for note in found.notes)


def test_a_bag_without_chunks_loads_in_a_time_that_grows_with_its_length(tmp_path: Path) -> None:
    write(tmp_path / "long", recording(120.0))
    path = _unprotected(tmp_path / "long", tmp_path / "long.mcap", use_chunking=False)
    begin = time.process_time()
    found = load(path)
    assert time.process_time() - begin < 0.6, "10 minutes have to load within 3 s"
    assert len(found.signals["angle"].values) == 12_000


@pytest.mark.parametrize(("hours", "kept"), [(1.0, 600), (24.0, 400), (9000.0, 400)])
def test_what_lies_behind_a_silence_of_hours_is_another_recording(tmp_path: Path, hours: float, kept: int) -> None:
    """A clock that was set by a day took 2 GB and minutes: time was filled with nothing."""
    whole = recording()
    for name, signal in whole.signals.items():
        stamps = signal.stamps_ns + np.where(np.arange(len(signal.stamps_ns)) < 400, 0, int(hours * 3600e9))
        whole.signals[name] = dataclasses.replace(signal, stamps_ns=stamps)
    write(tmp_path / "set", whole)
    found = load(tmp_path / "set")
    assert int(found.signals["angle"].valid.sum()) == kept
    assert any("another recording, or a clock that was set" in e.detail for e in found.events) == (kept < 600)


@pytest.mark.parametrize("nanosec", [0, 0xFFFFFFFF])
def test_stamps_that_are_none_are_told_and_the_arrival_counts(nanosec: int, tmp_path: Path) -> None:
    write(tmp_path / "bag", recording())
    (file,) = (tmp_path / "bag").glob("*.mcap")
    with file.open("rb") as source:
        read = make_reader(source)
        messages = [(schema, channel, message) for schema, channel, message in read.iter_messages()]
    with file.open("wb") as target:
        writer = Writer(target)
        writer.start(profile="ros2")
        known: dict[int, int] = {}
        for schema, channel, message in messages:
            if channel.id not in known:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            stamp = struct.pack("<iI", 0, nanosec)
            data = message.data[:4] + stamp + message.data[12:]
            writer.add_message(known[channel.id], message.log_time, data, message.publish_time)
        writer.finish()
    found = load(tmp_path / "bag")
    assert [w for w in found.warnings if "/joint_states carries no stamps: the time of arrival is used" in w]
    assert found.duration == pytest.approx(recording().duration, abs=0.05)


def test_a_stamp_of_another_year_costs_its_sample(tmp_path: Path) -> None:
    whole = recording()
    stamps = whole.signals["hose_pressure"].stamps_ns.copy()
    stamps[[10, 300]] = 5, 2**31 * 10**9 - 1
    whole.signals["hose_pressure"] = dataclasses.replace(whole.signals["hose_pressure"], stamps_ns=stamps)
    write(tmp_path / "odd", whole)
    found = load(tmp_path / "odd")
    assert found.duration == pytest.approx(whole.duration, abs=0.01)
    assert int(found.signals["hose_pressure"].valid.sum()) == 598
    assert any(
        event.detail.startswith("2 stamps lie ") and "days from all others" in event.detail for event in found.events
    )


def _rewrite(bag: Path, change: Callable[[str, str, bytes], tuple[str, bytes] | None]) -> None:
    """Write the bag anew with (topic, type, message) -> (type, message), None = leave out."""
    old = bag.rename(bag.with_name("old"))
    with mcap(old).open("rb") as stream, BagWriter(bag) as writer:
        numbers: dict[str, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            changed = change(channel.topic, schema.name, message.data)
            if changed is None:
                continue
            if channel.topic not in numbers:
                text, digest = definitions.definition(changed[0])
                numbers[channel.topic] = writer.add_topic(channel.topic, changed[0], text, digest)
            writer.write(numbers[channel.topic], changed[1], message.log_time, message.publish_time)


def test_a_missing_topic_is_named(bag: Path) -> None:
    _rewrite(bag, lambda topic, kind, data: None if topic == "/boom/solenoid_currents" else (kind, data))
    with pytest.raises(RecordingError, match="/boom/solenoid_currents missing"):
        load(bag)
    assert "retract_current" not in load(bag, require=("/joint_states",)).signals


def test_a_topic_without_a_message_is_not_told_as_there(tmp_path: Path) -> None:
    columns = {name: np.full(20, np.nan if "current" in name else 1.0) for name in ("angle", "rate", "retract_current")}
    write(tmp_path / "made", from_columns("made", np.arange(20) * 0.01, columns, CONFIGURATION))
    with pytest.raises(RecordingError, match="/boom/solenoid_currents missing") as told:
        load(tmp_path / "made", require=("/boom/solenoid_currents",))
    assert str(told.value).count("/boom/solenoid_currents") == 1


def test_a_sensor_that_was_not_recorded_has_no_valid_sample(bag: Path) -> None:
    _rewrite(bag, lambda topic, kind, data: None if topic == "/boom/rod_pressure" else (kind, data))
    found = load(bag)
    assert len(found.signals["rod_pressure"].time) == 0
    assert "rod_pressure was not recorded" in found.notes
    assert "rod_pressure" not in load(bag, require=("/boom/hose_pressure",)).signals


def test_a_joint_without_gyro_has_an_angle_and_no_rate(tmp_path: Path) -> None:
    table = {name: np.arange(200.0) for name in ("angle", "hose_pressure", "retract_current", "extend_current")}
    write(tmp_path / "made", from_columns("made", np.arange(200) * 0.01, table, CONFIGURATION))
    found = load(tmp_path / "made", check=False)
    assert found.signals["angle"].values.tolist() == list(range(200))
    assert np.isnan(found.signals["rate"].values).all() and not found.signals["rate"].valid.any()
    assert {"rate was not recorded", "rod_pressure was not recorded"} <= set(found.notes)


def test_a_topic_of_another_type_is_named_with_the_right_one(bag: Path) -> None:
    wrong = "sensor_msgs/msg/Temperature"
    _rewrite(bag, lambda topic, kind, data: (wrong if topic == "/boom/rod_pressure" else kind, data))
    with pytest.raises(
        RecordingError, match=r"/boom/rod_pressure is of type sensor_msgs/msg/Temperature: .*FluidPressure"
    ):
        load(bag)


def test_two_machines_in_one_bag_are_refused_and_the_same_one_twice_is_not(bag: Path) -> None:
    def twice(kind: str, data: bytes, other: bool) -> bytes:
        return data.replace(b"tz17", b"tz18") if other else data

    configurations = iter([False, True])
    _rewrite(bag, lambda topic, kind, data: (kind, data))
    old = load(bag)
    assert old.configuration.machine == "tz17"
    second = bag.with_name("second")
    with mcap(bag).open("rb") as stream, BagWriter(second) as writer:
        for schema, channel, message in make_reader(stream).iter_messages(topics=["/boom/machine_configuration"]):
            assert schema is not None
            text, digest = definitions.definition(schema.name)
            number = writer.add_topic(channel.topic, schema.name, text, digest)
            for other in configurations:
                writer.write(number, twice(schema.name, message.data, other), message.log_time, message.publish_time)
    shutil.copy(mcap(second), bag / "more.mcap")
    metadata = (bag / "metadata.yaml").read_text()
    (bag / "metadata.yaml").write_text(
        metadata.replace("relative_file_paths:\n", "relative_file_paths:\n  - more.mcap\n")
    )
    with pytest.raises(RecordingError, match="two machines in one bag: machine is tz17 and tz18"):
        load(bag)


def test_a_joint_of_another_name_has_to_be_asked_for(tmp_path: Path) -> None:
    write(tmp_path / "other", recording(), joint="boom_joint")
    with pytest.raises(RecordingError, match="joint 'inner_boom_joint' is not among boom_joint"):
        load(tmp_path / "other")
    assert len(load(tmp_path / "other", joint="boom_joint").signals["angle"].values) == 600


def test_a_joint_that_stands_twice_in_one_message_is_no_joint(tmp_path: Path) -> None:
    """Which of the two values counts nobody knows; the first one had been taken without a word."""
    write(tmp_path / "one", recording())
    second = tmp_path / "second"
    with mcap(tmp_path / "one").open("rb") as stream, BagWriter(second) as writer:
        channels = dict[str, int]()
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            if channel.topic not in channels:
                text, digest = definitions.definition(schema.name)
                channels[channel.topic] = writer.add_topic(channel.topic, schema.name, text, digest)
            data = message.data
            if channel.topic == "/joint_states":
                store = definitions.typestore()
                state = store.deserialize_cdr(data, schema.name)
                state.name = [state.name[0]] * 2
                state.position, state.velocity = (np.array([v[0], 9.0]) for v in (state.position, state.velocity))
                data = bytes(store.serialize_cdr(state, schema.name))
            writer.write(channels[channel.topic], data, message.log_time, message.publish_time)
    with pytest.raises(RecordingError, match="stands 2 times in one message"):
        load(second)


def _empty(folder: Path) -> Path:
    with BagWriter(folder / "empty"):
        pass
    return folder / "empty"


def _campaign(folder: Path) -> Path:
    with BagWriter(folder / "campaign") as writer:
        text, digest = definitions.definition("boom_interfaces/msg/OscilloscopeTrace")
        number = writer.add_topic(
            "/boom/pilot_valve/oscilloscope", "boom_interfaces/msg/OscilloscopeTrace", text, digest
        )
        writer.write(number, b"\0\1\0\0" + bytes(60), 1, 1)
    return folder / "campaign"


def _several(folder: Path) -> Path:
    for name in ("one", "two"):
        (folder / "several" / name).mkdir(parents=True)
        (folder / "several" / name / "metadata.yaml").touch()
    return folder / "several"


def _file(name: str, content: bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / name).write_bytes(content)
        return folder / name

    return make


def _sqlite(folder: Path) -> Path:
    (folder / "lite").mkdir()
    (folder / "lite" / "lite_0.db3").touch()
    return folder / "lite"


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda folder: folder / "absent", "no such file or folder"),
        (_empty, "no messages"),
        (_campaign, "boom identify"),
        (_several, "several bags \\(one, two\\)"),
        (lambda folder: folder, "no .mcap file"),
        (_file("a.db3", b"SQLite"), "sqlite3"),
        (_sqlite, "sqlite3"),
        (_file("a.mcap", b""), "empty"),
        (_file("a.mcap", b"garbage" * 9), "not an MCAP file"),
        (_file("a.txt", b"garbage" * 9), "not an MCAP file"),
        (_file("a.mcap", b"\x89MCAP0\r\n" + b"\xff" * 99), "no messages"),
        (_file("a.mcap", b"\x89MCAP0\r\n"), "it was cut"),
        (_file("a.mcap", b"\x89MCAP0\r\n\x01\x0c\0\0"), "no messages \\(.*: copy it again"),
    ],
)
def test_what_is_no_recording_is_refused_in_one_line_with_its_path(
    tmp_path: Path, make: Callable[[Path], Path], told: str
) -> None:
    path = make(tmp_path)
    with pytest.raises(RecordingError, match=told) as caught:
        load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_existing_folder_is_not_overwritten(made: Path) -> None:
    with pytest.raises(RecordingError, match="exists already"):
        write(made, recording())


def test_big_endian_messages_are_located_too() -> None:
    types = definitions.typestore().fielddefs
    data = b"\0\0\0\0" + struct.pack(">iI I4s d d", 7, 8, 1, b"\0", 1.5, 2.5)
    layout = cdr_layout.locate(data, "sensor_msgs/msg/FluidPressure", types)
    rows = np.frombuffer(data, np.uint8)[None, :]
    assert layout.column(rows, "header.stamp.sec")[0] == 7
    assert layout.column(rows, "fluid_pressure")[0] == 1.5


@given(data=st.binary(max_size=120))
def test_bytes_that_are_no_message_are_refused_and_nothing_else_is_raised(data: bytes) -> None:
    types = definitions.typestore().fielddefs
    try:
        layout = cdr_layout.locate(data, "sensor_msgs/msg/JointState", types)
    except cdr_layout.LayoutError:
        return
    assert layout.size <= len(data)


def test_messages_of_changing_layout_are_read_one_by_one(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "odd") as writer:
        text, digest = definitions.definition("sensor_msgs/msg/FluidPressure")
        number = writer.add_topic("/boom/hose_pressure", "sensor_msgs/msg/FluidPressure", text, digest)
        for k in range(100):
            frame = b"f" * (k % 40) + b"\0"
            body = struct.pack("<iII", 1, k * 10_000_000, len(frame)) + frame
            body += b"\0" * (-len(body) % 8) + struct.pack("<dd", 101_325 + k, 0)
            writer.write(number, b"\0\1\0\0" + body, 10**9 + k * 10_000_000, 0)
    found = load(tmp_path / "odd", require=("/boom/hose_pressure",))
    assert found.signals["hose_pressure"].values.tolist() == list(range(100))
