"""The codec against its own DBC files, against cantools, and against frames that nobody should believe."""

import math
import time
from pathlib import Path

import can
import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import boom_can_bridge
from boom_can_bridge import crc
from boom_can_bridge.codec import REASONS, CanConfigurationError, Codec, CounterCheck, FrameError
from boom_can_bridge.plausibility import RateCheck

DBC = Path(boom_can_bridge.__file__).parent / "dbc"
MACHINES = ("tz17", "other_machine")
CODECS = {name: Codec.load(name) for name in MACHINES}
FRAMES = [(machine, frame) for machine in MACHINES for frame in CODECS[machine].frames]


def some_values(codec, frame, share=0.5):
    fields = codec.frames[frame].fields.values()
    return {f.name: f.minimum + share * (f.maximum - f.minimum) for f in fields}


def frames_of(codec, count):
    """Frames of all kinds with moving values: (id, extended, data)."""
    found = []
    for k in range(count):
        for spec in codec.incoming:
            identifier, data = codec.encode(spec.name, some_values(codec, spec.name, 0.5 + 0.001 * (k % 7)), k)
            found.append((identifier, spec.is_extended, data))
    return found


@pytest.mark.parametrize(("machine", "frame"), FRAMES)
@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_every_value_comes_back_within_half_a_bit(machine, frame, data):
    codec = CODECS[machine]
    spec = codec.frames[frame]
    values = {f.name: data.draw(st.floats(f.minimum, f.maximum)) for f in spec.fields.values()}
    counter = data.draw(st.integers(0, 1000))
    identifier, payload = codec.encode(frame, values, counter)
    decoded = codec.decode(identifier, payload, extended=spec.is_extended)
    assert decoded.frame == frame
    assert decoded.counter == (counter % 256 if machine == "tz17" else None)
    for name, value in values.items():
        assert abs(decoded.values[name] - value) <= spec.fields[name].tolerance


@pytest.mark.parametrize(("machine", "frame"), FRAMES)
def test_both_ends_of_every_range_can_be_sent(machine, frame):
    codec = CODECS[machine]
    for share in (0.0, 1.0):
        values = some_values(codec, frame, share)
        spec = codec.frames[frame]
        decoded = codec.decode(*codec.encode(frame, values, 1), extended=spec.is_extended)
        for name, value in values.items():
            assert abs(decoded.values[name] - value) <= spec.fields[name].tolerance


@pytest.mark.parametrize(("machine", "frame"), FRAMES)
def test_cantools_reads_the_same_from_the_frames(machine, frame):
    codec = CODECS[machine]
    spec = codec.frames[frame]
    database = cantools.database.load_file(str(DBC / f"{machine}.dbc"))
    for share in (0.01, 0.37, 0.99):
        identifier, payload = codec.encode(frame, some_values(codec, frame, share), 7)
        signals = database.get_message_by_frame_id(identifier).decode(payload, decode_choices=False, scaling=False)
        values = codec.decode(identifier, payload, extended=spec.is_extended).values
        for field in spec.fields.values():
            assert values[field.name] == signals[field.layout.name] * field.scale + field.offset


def test_resolution_is_finer_than_the_sensors():
    fields = {name: f for spec in CODECS["tz17"].incoming for name, f in spec.fields.items()}
    assert abs(fields["angle"].scale) < 3.8e-4 / 100
    assert abs(fields["hose_pressure"].scale) < 1e4 / 100
    assert abs(fields["retract_current"].scale) < 1e-5


def test_checksum_is_sae_j1850():
    assert crc.crc8(b"123456789") == 0x4B


def test_a_frame_under_the_wrong_id_does_not_pass():
    codec = CODECS["tz17"]
    _, data = codec.encode("pressures", some_values(codec, "pressures"), 1)
    with pytest.raises(FrameError) as caught:
        codec.decode(codec.frames["currents"].arbitration_id, data)
    assert caught.value.reason == "crc"


def test_a_line_that_stands_still_never_looks_like_a_frame():
    codec = CODECS["tz17"]
    for spec in codec.frames.values():
        for byte in (0x00, 0x55, 0xAA, 0xFF):
            with pytest.raises(FrameError):
                codec.decode(spec.arbitration_id, bytes([byte] * spec.length))


def test_one_or_two_flipped_bits_never_pass_the_checksum():
    codec = CODECS["tz17"]
    identifier, data = codec.encode("imu", some_values(codec, "imu"), 1)
    word = int.from_bytes(data, "little")
    for i in range(64):
        for j in range(i, 64):
            broken = (word ^ (1 << i) ^ (0 if i == j else 1 << j)).to_bytes(8, "little")
            with pytest.raises(FrameError):
                codec.decode(identifier, broken)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9])
def test_what_cannot_be_represented_is_refused(value):
    with pytest.raises(FrameError) as caught:
        CODECS["tz17"].encode("command", {"retract_current": value, "extend_current": 0, "enable": 1}, 0)
    assert caught.value.reason == "range"


def test_a_page_that_the_mapping_does_not_name_is_no_value():
    codec = CODECS["other_machine"]
    spec = codec.frames["pressures"]
    with pytest.raises(FrameError) as caught:
        codec.decode(spec.arbitration_id, bytes([3, 0, 0, 0, 0, 0, 0, 0]), extended=True)
    assert caught.value.reason == "unknown_id"


def test_standard_and_extended_ids_are_different_ids():
    codec = CODECS["tz17"]
    identifier, data = codec.encode("imu", some_values(codec, "imu"), 1)
    with pytest.raises(FrameError) as caught:
        codec.decode(identifier, data, extended=True)
    assert caught.value.reason == "unknown_id"


@pytest.mark.parametrize("machine", MACHINES)
def test_bulk_decoding_agrees_with_single_frames_bit_for_bit(machine):
    codec = CODECS[machine]
    random = np.random.default_rng(1)
    frames = frames_of(codec, 100)
    ids = np.array([f[0] for f in frames] + [0x7FF] * 5)
    kinds = np.array([f[1] for f in frames] + [False] * 5)
    data = np.zeros((len(ids), 8), np.uint8)
    for row, frame in enumerate(frames):
        data[row, : len(frame[2])] = list(frame[2])
    lengths = np.array([len(f[2]) for f in frames] + [8] * 5)
    for row in random.choice(len(frames), 100, replace=False):
        data[row, random.integers(8)] ^= 1 << random.integers(8)
    lengths[random.choice(len(frames), 20, replace=False)] = 3
    bulk = codec.decode_many(ids, data, lengths, kinds)
    rows = {name: {int(i): k for k, i in enumerate(frame.index)} for name, frame in bulk.frames.items()}
    for i in range(len(ids)):
        try:
            decoded = codec.decode(int(ids[i]), data[i, : lengths[i]].tobytes(), extended=bool(kinds[i]))
        except FrameError as error:
            assert bulk.verdicts[i] == 1 + REASONS.index(error.reason)
            continue
        assert bulk.verdicts[i] == 0
        k = rows[decoded.frame][i]
        frame = bulk.frames[decoded.frame]
        assert {name: column[k] for name, column in frame.values.items()} == decoded.values
        assert decoded.counter is None or frame.counters[k] == decoded.counter
    assert sum(bulk.counts().values()) == np.count_nonzero(bulk.verdicts)


def accepted(counters, times=None):
    check, good = CounterCheck(CODECS["tz17"]), []
    lost = 0
    for k, counter in enumerate(counters):
        try:
            lost += check.accept("imu", counter, 0.01 * k if times is None else times[k])
            good.append(counter)
        except FrameError:
            pass
    return good, lost


def test_lost_frames_are_counted_across_the_wrap():
    assert accepted([253, 254, 1, 2]) == ([253, 254, 1, 2], 2)


def test_a_frozen_counter_is_refused_for_ever():
    assert accepted([5] * 100)[0] == [5]


def test_a_late_frame_is_refused_and_the_next_one_taken():
    assert accepted([1, 2, 4, 3, 5])[0] == [1, 2, 4, 5]


def test_a_sender_that_starts_again_is_believed_after_five_frames_or_a_silence():
    assert accepted([200, 201, 100, 101, 102, 103, 104, 105])[0] == [200, 201, 104, 105]
    assert accepted([200, 201, 100, 101], [0.0, 0.01, 1.0, 1.01])[0] == [200, 201, 100, 101]


@given(st.lists(st.integers(0, 255), max_size=60))
def test_counters_in_bulk_are_judged_as_one_by_one(counters):
    times = 0.01 * np.arange(len(counters))
    good, lost = CounterCheck(CODECS["tz17"]).accept_many("imu", np.array(counters, np.int64), times)
    assert ([c for c, g in zip(counters, good, strict=True) if g], lost) == accepted(counters)


def test_a_jump_is_refused_once_and_a_step_is_taken():
    check = RateCheck(CODECS["tz17"])
    check.accept("imu", {"angle": 0.1, "rate": 0.0}, 0.0)
    with pytest.raises(FrameError):
        check.accept("imu", {"angle": 0.9, "rate": 0.0}, 0.01)
    check.accept("imu", {"angle": 0.9, "rate": 0.0}, 0.02)


@given(st.lists(st.sampled_from([0.1, 0.101, 0.9, -0.5]), min_size=1, max_size=30))
def test_jumps_in_bulk_are_judged_as_one_by_one(angles):
    codec = CODECS["tz17"]
    single, one_by_one = RateCheck(codec), []
    for k, angle in enumerate(angles):
        try:
            single.accept("imu", {"angle": angle, "rate": 0.0}, 0.01 * k)
            one_by_one.append(True)
        except FrameError:
            one_by_one.append(False)
    columns = {"angle": np.array(angles), "rate": np.zeros(len(angles))}
    assert RateCheck(codec).accept_many("imu", columns, 0.01 * np.arange(len(angles))).tolist() == one_by_one


def changed(tmp_path, old, new, machine="tz17", suffix=".yaml"):
    for ending in (".dbc", ".yaml"):
        text = (DBC / f"{machine}{ending}").read_text()
        if ending == suffix:
            assert old in text
            text = text.replace(old, new, 1)
        (tmp_path / f"m{ending}").write_text(text)
    return tmp_path / "m.dbc"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("signal: Angle,", "signal: Angel,", "no signal Angel: did you mean Angle?"),
        ("message: IMU", "message: IMX", "no message IMX"),
        ("      rate: {signal: Rate, rate_limit: 100.0}\n", "", "no frame from the ECU has the field rate"),
        ("rate_limit: 5.0", "rate_limmit: 5.0", "unknown key rate_limmit: did you mean rate_limit?"),
        ("crc: {signal: Crc,", "crc: {signal: Mode,", "no signal Mode"),
        ("counter: Counter", "counter: Angle", "must be an unsigned number"),
        ("direction: to_ecu", "direction: out", "direction is from_ecu or to_ecu"),
        ("      enable: {signal: Enable}\n", "", "needs the field enable"),
        ("{signal: RodPressure,", "{signal: HosePressure,", "used twice"),
        ("rate_limit: 5.0", "factor: fast", "factor must be a number"),
        ("frames:", "frame:", "needs a section frames"),
        ("frames:", "frames: [", "not readable as YAML"),
        ("message: IMU", "message: [IMU]", "no message ['IMU']"),
        ("rate_limit: 5.0", "factor: " + "9" * 500, "at most 64"),
        ("signal: Angle,", "signal: " + "x" * 100_000 + ",", "no signal xxx"),
        ("frames:", "x: &a [1]\ny: *a\nframes:", "aliases"),
    ],
)
def test_a_wrong_mapping_ends_in_one_line(tmp_path, old, new, words):
    with pytest.raises(CanConfigurationError) as caught:
        Codec.load(changed(tmp_path, old, new))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 600
    assert caught.value.exit_status == 2


def test_a_page_must_be_chosen_for_a_multiplexed_signal(tmp_path):
    with pytest.raises(CanConfigurationError, match="say so under select"):
        Codec.load(changed(tmp_path, "    select: {Page: 0}\n", "", "other_machine"))


@pytest.mark.parametrize("text", ["", "BO_ nonsense", "\0\1\2", 'BO_ 1 A: 8 X\n SG_ a : 60|24@1+ (1,0) [0|0] "" X\n'])
def test_a_broken_dbc_file_ends_in_one_line(tmp_path, text):
    path = changed(tmp_path, "frames:", "frames:")
    path.write_text(text)
    with pytest.raises(CanConfigurationError) as caught:
        Codec.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('BO_ 1 A: 8 X\nBO_ 1 B: 8 X\n', "message B: its name or its identifier 0x1 is there twice"),
        ('BO_ 1 A: 8 X\n' + "".join(f' SG_ s{k} m{k} : 8|8@1+ (1,0) [0|0] "" X\n' for k in range(20_000)), "more than 1000"),
        ("x" * 2_000_001, "larger than 2 MB"),
        ('BO_ 1 A: 32768 X\n SG_ a : 0|8@1+ (1,0) [0|0] "" X\n', "a message of more than 1785 bytes"),
        ('BO_ 1 A: 8 X\n SG_ a : 0|2000000000@1+ (1,0) [0|0] "" X\n', "a signal beyond its end"),
    ],
    ids=["twice", "signals", "size", "bytes", "bits"],
)  # fmt: skip
def test_a_dbc_file_that_says_too_much_is_refused_at_once(tmp_path, caplog, text, words):
    path = changed(tmp_path, "frames:", "frames:")
    path.write_text(text)
    begin = time.monotonic()
    with pytest.raises(CanConfigurationError, match=words):
        Codec.load(path)
    assert time.monotonic() - begin < 2.0
    assert not caplog.records
    with pytest.raises(CanConfigurationError, match=r"no such DBC file|not a regular file"):
        Codec.load("/dev/zero", path.with_suffix(".yaml"))


def test_files_that_are_not_there_are_named(tmp_path):
    for arguments in (("nowhere",), (tmp_path / "x.dbc",), ("tz17", tmp_path / "x.yaml")):
        with pytest.raises(CanConfigurationError):
            Codec.load(*arguments)


def test_python_can_messages_are_decoded_as_they_come():
    codec = CODECS["tz17"]
    identifier, data = codec.encode("imu", {"angle": 0.5, "rate": -0.1}, 3)
    message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
    assert codec.decode(message.arbitration_id, message.data).values["angle"] == pytest.approx(0.5)
