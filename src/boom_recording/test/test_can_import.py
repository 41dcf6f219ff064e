"""CAN logs in all formats become the same bag; what is damaged, unknown or cut off is left out and told."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import can
import numpy as np
import pytest
import yaml

from boom_can_bridge.codec import Codec
from boom_can_bridge.errors import CanConfigurationError
from boom_recording import can_import, can_log, writing
from boom_recording.can_import import Imported
from boom_recording.errors import RecordingError
from boom_recording.loading import load
from boom_recording.recording import Configuration

CONFIGURATION = Configuration("tz17", 0.28, 2.2, 0.0)
START = 1_790_000_000.0
FORMATS = [suffix[1:] for suffix in can_log.SUFFIXES]


def values(k: int) -> dict[str, float]:
    k %= 300
    return {
        "angle": 0.3 + 0.001 * k, "rate": 0.1, "hose_pressure": 9e6 + 1e3 * k, "rod_pressure": 1e6 + 500.0 * k,
        "retract_current": 0.0, "extend_current": 0.3 + 1e-4 * k, "mode": 2, "faults": 0, "uptime_s": 0.1 * (k // 10),
        "enable": 1,
    }  # fmt: skip


def message(codec: Codec, frame: str, k: int, stamp: float | None = None, counter: int | None = None) -> can.Message:
    identifier, data = codec.encode(frame, values(k), k if counter is None else counter)
    stamp = START + 0.01 * k if stamp is None else stamp
    return can.Message(
        timestamp=stamp, arbitration_id=identifier, is_extended_id=codec.frames[frame].is_extended, data=data, channel=0
    )


def traffic(codec: Codec, periods: int = 300) -> list[can.Message]:
    """All frames of the mapping every 10 ms, a fifth of a millisecond after each other."""
    names = list(codec.frames)
    return [
        message(codec, name, k, START + 0.01 * k + 0.0002 * j) for k in range(periods) for j, name in enumerate(names)
    ]


def logged(path: Path, messages: list[can.Message]) -> Path:
    with can.Logger(path) as log:
        for one in messages:
            log(one)
    return path


def imported(path: Path, codec: Codec) -> Imported:
    return can_import.convert("made", can_log.read(path), codec, CONFIGURATION)


@pytest.fixture(scope="module")
def codec() -> Codec:
    return Codec.load("tz17")


@pytest.mark.parametrize("machine", ["tz17", "other_machine"])
def test_every_format_gives_the_same_bag(machine: str, tmp_path: Path) -> None:
    codec = Codec.load(machine)
    bags = {}
    for suffix in FORMATS:
        path = logged(tmp_path / f"log.{suffix}", traffic(codec))
        writing.write(tmp_path / suffix / "bag", imported(path, codec).recording)
        bags[suffix] = [file.read_bytes() for file in sorted((tmp_path / suffix / "bag").iterdir())]
    assert all(bag == bags["blf"] for bag in bags.values())


def test_bag_holds_what_was_on_the_bus_at_the_time_of_the_frames(codec: Codec, tmp_path: Path) -> None:
    result = imported(logged(tmp_path / "log.blf", traffic(codec)), codec)
    writing.write(tmp_path / "bag", result.recording)
    recording = load(tmp_path / "bag")
    assert recording.events == []
    assert recording.configuration == CONFIGURATION
    assert recording.start_ns == START * 1e9
    k = np.arange(300)
    for signal, wanted, frame in (
        ("angle", 0.3 + 0.001 * k, "imu"), ("hose_pressure", 9e6 + 1e3 * k, "pressures"),
        ("extend_current", 0.3 + 1e-4 * k, "currents"), ("extend_current_command", 0.3 + 1e-4 * k, "command"),
    ):  # fmt: skip
        column = recording.signals[signal]
        spec = next(f for f in codec.frames[frame].fields.values() if signal.startswith(f.name))
        assert np.abs(column.values - wanted).max() <= spec.tolerance * (1 + 1e-9)
        assert np.abs(column.time - 0.01 * k - 0.0002 * list(codec.frames).index(frame)).max() < 1e-8


def test_a_passive_logger_needs_neither_a_command_nor_every_sensor(codec: Codec, tmp_path: Path) -> None:
    shipped = Path(str(files("boom_can_bridge") / "dbc"))
    mapping = yaml.safe_load((shipped / "tz17.yaml").read_text(encoding="utf-8"))
    del mapping["frames"]["command"], mapping["frames"]["pressures"]["fields"]["rod_pressure"]
    path = tmp_path / "logger.yaml"
    path.write_text(yaml.safe_dump(mapping), encoding="utf-8")
    with pytest.raises(CanConfigurationError):
        Codec.load(shipped / "tz17.dbc", path)
    logger = Codec.load(shipped / "tz17.dbc", path, of_log=True)
    made = imported(logged(tmp_path / "log.blf", traffic(codec)), logger).recording
    assert set(made.signals) == {"angle", "rate", "hose_pressure", "retract_current", "extend_current"}


def test_command_that_is_not_enabled_is_zero_in_the_bag(codec: Codec, tmp_path: Path) -> None:
    identifier, data = codec.encode("command", values(0) | {"enable": 0}, 1)
    off = can.Message(timestamp=START + 0.005, arbitration_id=identifier, is_extended_id=False, data=data)
    result = imported(
        logged(tmp_path / "log.blf", [message(codec, "imu", 0), message(codec, "command", 0), off]), codec
    )
    assert result.recording.signals["extend_current_command"].values == pytest.approx([0.3, 0.0])


def test_bad_frames_are_counted_by_reason_and_not_in_the_bag(codec: Codec, tmp_path: Path) -> None:
    messages = [message(codec, "imu", k) for k in range(20)]
    damaged = message(codec, "imu", 20)
    damaged.data[3] ^= 0x10
    short = message(codec, "imu", 21)
    short = can.Message(
        timestamp=short.timestamp, arbitration_id=short.arbitration_id, is_extended_id=False, data=short.data[:4]
    )
    messages += [damaged, short, message(codec, "imu", 22), message(codec, "imu", 23, counter=22)]
    result = imported(logged(tmp_path / "log.blf", messages), codec)
    row = next(row for row in result.frames if row.name == "imu")
    assert row.bad == {"crc": 1, "length": 1, "counter": 1}
    assert (row.used, row.lost) == (21, 2)
    assert len(result.recording.signals["angle"].values) == 21


@pytest.mark.parametrize("ahead", [0, 1])
def test_a_log_of_two_buses_is_refused(ahead: int, codec: Codec, tmp_path: Path) -> None:
    """The other crane's samples had been taken from the second frame on, with those of the first left out without a word."""
    other = [message(codec, name, k, START + 0.01 * k + 0.003, k + ahead) for k in range(300) for name in codec.frames]
    both = sorted([*traffic(codec), *other], key=lambda m: m.timestamp)
    with pytest.raises(
        RecordingError, match=r"contradict their counter, .* two nodes send it, as where a log holds two buses"
    ):
        imported(logged(tmp_path / "two.log", both), codec)


def test_times_that_go_back_are_told_and_times_that_stand_refused(codec: Codec, tmp_path: Path) -> None:
    frames = traffic(codec, 100)
    joined = [*frames, *(message(codec, name, k, START + 0.5 + 0.01 * k) for k in range(100) for name in codec.frames)]
    (told,) = can_log.read(logged(tmp_path / "joined.log", joined)).warnings
    assert told.startswith("times go back once, by up to 0.49")
    still = [message(codec, name, k, START) for k in range(100) for name in codec.frames]
    with pytest.raises(RecordingError, match="all 500 frames have the same time"):
        can_log.read(logged(tmp_path / "still.log", still))


def test_unknown_identifiers_are_listed_with_their_counts(codec: Codec, tmp_path: Path) -> None:
    messages = [message(codec, "imu", k) for k in range(5)]
    messages += [can.Message(timestamp=START, arbitration_id=0x7AB, is_extended_id=False, data=b"12")] * 3
    messages += [can.Message(timestamp=START, arbitration_id=0x101, is_extended_id=True, data=b"12345678")]
    result = imported(logged(tmp_path / "log.asc", messages), codec)
    assert result.unknown == {"7AB": 3, "00000101x": 1}


def test_error_and_remote_frames_are_left_out(codec: Codec, tmp_path: Path) -> None:
    for suffix in ("blf", "asc", "csv", "log"):
        messages = [message(codec, "imu", k) for k in range(3)]
        messages.append(
            can.Message(timestamp=START, arbitration_id=0x101, is_extended_id=False, is_remote_frame=True, dlc=8)
        )
        messages.append(can.Message(timestamp=START, is_error_frame=True))
        messages.append(message(codec, "imu", 3))
        frames = can_log.read(logged(tmp_path / f"log.{suffix}", messages))
        assert len(frames.ids) == 4, suffix
        assert frames.left_out == {"remote frames": 1, "error frames": 1}


@pytest.mark.parametrize("suffix", FORMATS)
def test_log_that_was_cut_off_is_read_up_to_there(suffix: str, codec: Codec, tmp_path: Path) -> None:
    whole = logged(tmp_path / f"whole.{suffix}", traffic(codec, 3000))
    content = whole.read_bytes()
    cut = tmp_path / f"cut.{suffix}"
    cut.write_bytes(content[: content.rindex(b"\n", 0, len(content) * 3 // 5) - 3])
    frames, all_frames = can_log.read(cut), can_log.read(whole)
    count = len(frames.ids)
    assert 6000 < count < 15000
    assert len(frames.warnings) == 1
    assert (frames.data == all_frames.data[:count]).all()
    assert (frames.stamps_ns == all_frames.stamps_ns[:count]).all()


@pytest.mark.parametrize("suffix", ["asc", "log", "csv", "trc"])
def test_unreadable_lines_cost_themselves_only(suffix: str, codec: Codec, tmp_path: Path) -> None:
    path = logged(tmp_path / f"log.{suffix}", traffic(codec, 100))
    lines = path.read_bytes().splitlines(keepends=True)
    lines[200] = b"\xff\xfe garbage \x00 7 7\n"
    lines[300] = lines[300][: len(lines[300]) // 2] + b"\n"
    path.write_bytes(b"".join(lines))
    frames = can_log.read(path)
    assert len(frames.ids) >= 498
    assert sum(frames.left_out.values()) >= 1
    assert imported(path, codec).recording.duration > 0.9


@pytest.mark.parametrize("suffix", ["asc", "log", "csv", "trc"])
def test_a_byte_order_mark_before_a_text_costs_nothing(suffix: str, codec: Codec, tmp_path: Path) -> None:
    path = logged(tmp_path / f"log.{suffix}", traffic(codec, 20))
    plain = can_log.read(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    marked = can_log.read(path)
    assert (marked.left_out, marked.dated) == (plain.left_out, True)
    assert np.array_equal(marked.stamps_ns, plain.stamps_ns)


def test_damaged_container_of_a_blf_costs_itself_only(codec: Codec, tmp_path: Path) -> None:
    path = logged(tmp_path / "log.blf", traffic(codec, 5000))
    content = bytearray(path.read_bytes())
    middle = content.index(b"LOBJ", len(content) // 2)
    content[middle + 40 : middle + 60] = bytes(20)
    path.write_bytes(content)
    frames = can_log.read(path)
    assert 15_000 < len(frames.ids) < 25_000
    assert any("damaged" in warning for warning in frames.warnings)


def test_random_bytes_never_end_in_a_traceback(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    for suffix in FORMATS:
        for size in (0, 1, 40, 200, 5000):
            path = tmp_path / f"noise{size}.{suffix}"
            path.write_bytes((b"LOGG\x90\0\0\0" if suffix == "blf" else b"") + random.bytes(size))
            with pytest.raises(RecordingError) as error:
                can_log.read(path)
            assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("date Sat Sep 30 10:06:13.191 pm 2017\nbase dec  timestamps relative\nno internal events logged\n"
         "   0.001000 1  256             Rx   d 2 1 255\n   0.002000 1  257x            Tx   d 1 16\n",
         [(256, "01ff"), (0x80000101, "10")]),
        ("date Mon Sep 21 14:13:20 2026\nbase hex  timestamps absolute\n// version 9.0.0\n"
         "   0.1 1  1F0             Rx   d 3 01 02 03 Length = 0 BitCount = 0\n   0.2 CANFD 1 Rx 1F1 1 0 8 8 0\n"
         "   0.3 1 Statistic: D 0 R 0 XD 0\n", [(0x1F0, "010203")]),
    ],
)  # fmt: skip
def test_asc_of_other_programs_is_read(text: str, frames: list[tuple[int, str]], tmp_path: Path) -> None:
    path = tmp_path / "log.asc"
    path.write_text(text)
    read = can_log.read(path)
    rows = zip(read.ids.tolist(), read.data, read.lengths.tolist(), strict=True)
    assert [(identifier, bytes(data[:length]).hex()) for identifier, data, length in rows] == frames


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (";$FILEVERSION=1.1\n;$STARTTIME=46286.5\n     1)      1.0  Rx         0101  2  01 02\n"
         "     2)      3.0  Warng  FFFFFFFF  4  00 00 00 08  BUSLIGHT\n", 0x101),
        ("     1)      1 000101 2 01 02\n", 0x80000101),
        (";$FILEVERSION=1.3\n;$STARTTIME=46286.5\n     1)      1.0 1  Rx     0101 -  2    01 02\n", 0x101),
        (";$FILEVERSION=2.0\n;$STARTTIME=46286.5\n;$COLUMNS=N,O,T,I,d,l,D\n      1         1.0 DT     0101 Rx 2  01 02\n", 0x101),
    ],
)  # fmt: skip
def test_trc_of_every_version_is_read(text: str, expected: int, tmp_path: Path) -> None:
    path = tmp_path / "log.trc"
    path.write_text(text)
    read = can_log.read(path)
    assert read.ids.tolist() == [expected]
    assert read.data[0, :2].tolist() == [1, 2]


def test_log_without_date_begins_where_bags_without_clock_do(codec: Codec, tmp_path: Path) -> None:
    path = tmp_path / "log.log"
    _, data = codec.encode("imu", values(0), 0)
    path.write_text(f"(000.500000) can0 101#{data.hex()}\n")
    assert imported(path, codec).recording.start_ns == writing.START_NS


def test_log_of_another_machine_says_which_identifiers_it_has(tmp_path: Path, codec: Codec) -> None:
    path = logged(tmp_path / "log.blf", traffic(Codec.load("other_machine"), 3))
    with pytest.raises(RecordingError, match="is it the right DBC file") as error:
        imported(path, codec)
    assert "x" in str(error.value).rsplit("The log has", 1)[1]


def boom(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "boom_bringup.cli", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=60)


def _with(path: Path, old: str, new: str, line: int) -> Path:
    """The log with a text of one of its lines exchanged."""
    lines = path.read_text().split("\n")
    assert old in lines[line], lines[line]
    lines[line] = lines[line].replace(old, new, 1)
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("time", ["nan", "inf", "-5", "7790000000.5", "179000000.5", "1e300"])
@pytest.mark.parametrize("place", [0, 600, -1])
def test_a_time_that_cannot_be_costs_its_frame_and_is_told(time: str, place: int, codec: Codec, tmp_path: Path) -> None:
    path = logged(tmp_path / "machine.log", traffic(codec))
    lines = path.read_text().splitlines()
    rest = lines[place].split(")")[1]
    lines[place] = f"({time}){rest}"
    path.write_text("\n".join(lines) + "\n")
    made = imported(path, codec)
    assert sum(row.used for row in made.frames) == 1499
    assert made.recording.warnings == ["1 frame is left out: of a time that cannot be"]
    assert made.recording.duration == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize(
    ("suffix", "line", "old", "new"),
    [
        ("asc", 3, "2026", "20260"), ("asc", 3, "2026", "1e999"), ("asc", 3, " 20", " 99"), ("asc", 3, "Sep", "Foo"),
        ("asc", 3, "14:13:20", "1e999:0:0"), ("asc", 3, "14:13:20", "nan:13:20"), ("trc", 1, "46", "1e999 "),
        ("trc", 1, "46", "nan "), ("trc", 1, "46", "-9946"), ("trc", 1, "46", "9999946"),
    ],
)  # fmt: skip
def test_a_date_that_cannot_be_is_told_and_the_times_count_from_the_beginning(
    suffix: str, line: int, old: str, new: str, codec: Codec, tmp_path: Path
) -> None:
    made = imported(_with(logged(tmp_path / f"log.{suffix}", traffic(codec, 20)), old, new, line), codec)
    assert sum(row.used for row in made.frames) == 100
    assert made.recording.start_ns == writing.START_NS and made.recording.duration == pytest.approx(0.19, abs=0.01)
    (warning,) = made.recording.warnings
    assert "the date of its beginning cannot be read" in warning


def test_pauses_and_clocks_that_were_set_are_no_wrong_times() -> None:
    for times in (
        np.arange(100) * 60.0,  # a heartbeat
        np.concatenate([np.arange(50) * 0.01, 40_000 + np.arange(50) * 0.01]),  # a night
        np.concatenate([np.arange(50) * 0.01, np.arange(50) * 0.01 - 3600 + 4000]),  # an hour back, and on
        np.array([0.0, 1.0, 2.0]), np.array([5.0]),
    ):  # fmt: skip
        assert can_log.possible(times).all()
    for wrong in (7_790_000_000.0, np.nan, -1.0, 950.0):
        times = 1000 + np.arange(100) * 0.01
        times[40] = wrong
        assert np.flatnonzero(~can_log.possible(times)).tolist() == [40]


def test_command_writes_a_bag_and_says_what_it_left_out(codec: Codec, tmp_path: Path) -> None:
    other = can.Message(timestamp=START, arbitration_id=0x7AB, is_extended_id=False, data=b"12")
    logged(tmp_path / "machine.log", [*traffic(codec), other])
    result = boom("import-can", "machine.log", "--dbc", "tz17", "--output", "made", "--load", "300", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "7AB: 1" in result.stdout
    recording = load(tmp_path / "made")
    assert recording.configuration.load_mass == 300.0
    assert "machine.log" in recording.configuration.note
    assert recording.events == []


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["nowhere.blf", "--output", "x"], "nowhere.blf: cannot be read"),
        (["machine.log", "--output", "there"], "there exists already"),
        (["machine.txt", "--output", "x"], "give one of .blf"),
        (["machine.log", "--dbc", "tz71", "--output", "x"], "no DBC tz71"),
        (["machine.log", "--load", "inf", "--output", "x"], "inf is not a number"),
        (["empty.log", "--output", "x"], "not one CAN frame"),
        (["machine.log", "--dbc", "other_machine", "--output", "x"], "right DBC file"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(words: list[str], part: str, codec: Codec, tmp_path: Path) -> None:
    logged(tmp_path / "machine.log", traffic(codec, 3))
    (tmp_path / "there").mkdir()
    (tmp_path / "empty.log").write_text("")
    (tmp_path / "machine.txt").write_text("")
    result = boom("import-can", *words, cwd=tmp_path)
    assert result.returncode == 2, result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert part in result.stderr
    assert not (tmp_path / "x").exists()


@pytest.fixture
def zone() -> Callable[[str], None]:
    before = os.environ.get("TZ")

    def change(name: str) -> None:
        os.environ["TZ"] = name
        time.tzset()

    yield change  # type: ignore[misc]
    os.environ.pop("TZ", None) if before is None else os.environ.update(TZ=before)
    time.tzset()


def test_asc_times_are_local_times_of_its_writer(zone: Callable[[str], None], codec: Codec, tmp_path: Path) -> None:
    zone("Europe/Berlin")
    path = logged(tmp_path / "log.asc", [message(codec, "imu", 0)])
    assert can_log.read(path).stamps_ns[0] == START * 1e9
