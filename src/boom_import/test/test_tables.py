"""Tables: dialects, times, units; each on a few lines whose numbers are known."""

from __future__ import annotations

import struct
import zlib
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import h5py
import numpy as np
import pytest
import scipy.io

from boom_import import reading, units
from boom_import.errors import ImportingError
from boom_import.readers import csv_text
from boom_import.timing import TimeChoice

T0 = 1_748_943_667_250_000_000  # 2025-06-03 09:41:07.25 UTC


def made(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    path = folder / "table.csv"
    path.write_bytes(text.encode(encoding))
    return path


def rows(separator: str = ",", decimal: str = ".", count: int = 30, step: float = 0.01) -> str:
    lines = [f"{k * step:.3f}{separator}{1.5 * k:.2f}" for k in range(count)]
    return "\n".join(line.replace(".", decimal) for line in lines) + "\n"


@pytest.mark.parametrize(
    ("head", "separator", "decimal", "encoding"),
    [
        ("time [s],p [bar]\n", ",", ".", "utf-8"),
        ("time [s];p [bar]\n", ";", ",", "cp1252"),
        ("time [s]\tp [bar]\n", "\t", ",", "utf-16"),
        ("\ufefftime [s]|p [bar]\n", "|", ".", "utf-8"),
        ("# time p\n", " ", ".", "utf-8"),
        ("Prüfstand 3;;\nLauf 7;;\n\ntime;p\ns;bar\n", ";", ",", "cp1252"),
        ('"time [s]";"p [bar]"\n', ";", ",", "utf-8"),
    ],
)
def test_a_dialect_is_found(head: str, separator: str, decimal: str, encoding: str, tmp_path: Path) -> None:
    source = reading.read([made(tmp_path, head + rows(separator, decimal), encoding)])
    (column,) = source.columns
    np.testing.assert_allclose(column.values, 1.5 * np.arange(30))
    np.testing.assert_array_equal(column.stamps_ns, 10_000_000 * np.arange(30))
    assert column.unit == ("" if head.startswith("# time") else "bar")
    assert not source.dated


def test_a_heading_with_line_breaks_in_its_cells_is_one_record(tmp_path: Path) -> None:
    """As office programs write it: read line by line, every name would stand one column too far left, and rows be lost."""
    head = 'Time (s),"Angle\nraw (deg)",Angle (deg),"Hose\npressure (bar)"\n'
    body = "".join(f"{0.01 * k:.2f},{k},{k + 0.5},{80 + k}\n" for k in range(40))
    columns = reading.read([made(tmp_path, head + body)]).columns
    assert [(c.name, c.unit) for c in columns] == [("Angle raw", "deg"), ("Angle", "deg"), ("Hose pressure", "bar")]
    np.testing.assert_array_equal(columns[2].values, 80.0 + np.arange(40))


@pytest.mark.parametrize(("unit", "turn"), [("deg", 360.0), ("rad", 2.0 * np.pi)])
def test_an_angle_that_counts_from_zero_to_a_turn_jumps_no_more_and_that_is_said(
    unit: str, turn: float, tmp_path: Path
) -> None:
    angle = turn * (0.02 * np.sin(np.arange(60) / 5.0) - 0.005)
    body = "".join(f"{0.01 * k:.2f},{a % turn:.6f},{80 + k}\n" for k, a in enumerate(angle))
    source = reading.read([made(tmp_path, f"time [s],boom angle [{unit}],hose [bar]\n{body}")])
    values = source.columns[0].values
    np.testing.assert_allclose(values - values[0], angle - angle[0], atol=2e-6)
    assert any("jumps by whole turns" in note for note in source.notes)


@pytest.mark.parametrize("wrong", [200.0, 710.0, 3.6e5])
def test_what_is_no_whole_turn_and_what_is_damage_stays_in_an_angle(wrong: float, tmp_path: Path) -> None:
    angle = np.where(np.arange(60) != 30, 10.0, wrong)
    body = "".join(f"{0.01 * k:.2f},{a:.1f},{80 + k}\n" for k, a in enumerate(angle))
    source = reading.read([made(tmp_path, "time [s],slewing angle [deg],hose [bar]\n" + body)])
    np.testing.assert_array_equal(source.columns[0].values, angle)


def test_a_preamble_may_have_lines_of_numbers_and_one_of_units(tmp_path: Path) -> None:
    """As LabVIEW writes measurements: two headings, the second with numbers of samples, first times and steps of each channel."""
    head = (
        "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nDate\t2026/03/12\n***End_of_Header***\t\n\t\n"
        "Channels\t2\t\t\nSamples\t30\t30\t\nDate\t2026/03/12\t2026/03/12\t\nTime\t10:12:01.5\t10:12:01.5\t\n"
        "Y_Unit_Label\tbar\tA\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.01\t0.01\t\n***End_of_Header***\t\t\t\n"
        "X_Value\tHose pressure\tCurrent up\tComment\n"
    )
    body = "".join(f"{0.01 * k:.6f}\t{80 + k}\t{0.1 * (k % 3):.1f}\t\n" for k in range(30))
    source = reading.read([made(tmp_path, head + body)])
    assert [(c.name, c.unit) for c in source.columns] == [("Hose pressure", "bar"), ("Current up", "A")]
    np.testing.assert_allclose(source.columns[0].values, 80.0 + np.arange(30))
    np.testing.assert_array_equal(source.columns[0].stamps_ns, 10_000_000 * np.arange(30))


@pytest.mark.parametrize("line", ["# trigger", "0.05;OVERFLOW;OVERFLOW", "ERR;ERR;ERR"])
def test_a_line_without_numbers_among_the_first_ones_costs_only_itself(line: str, tmp_path: Path) -> None:
    body = [f"{0.01 * k:.2f};{80 + k};{0.1 * (k % 3):.1f}" for k in range(40)]
    text = "\n".join(["time [s];hose pressure [bar];current up [A]", *body[:5], line, *body[5:]]) + "\n"
    columns = reading.read([made(tmp_path, text)]).columns
    assert [(c.name, c.unit) for c in columns] == [("hose pressure", "bar"), ("current up", "A")]
    assert len(columns[0].values) == 40


def test_units_of_a_heading_are_not_those_of_a_preamble(tmp_path: Path) -> None:
    text = "Display;kPa;kPa\ntime [s];hose pressure [bar];rod pressure [bar]\n"
    body = "".join(f"{0.01 * k:.2f};{80 + k};20\n" for k in range(30))
    assert [c.unit for c in reading.read([made(tmp_path, text + body)]).columns] == ["bar", "bar"]


def test_a_minus_as_office_programs_write_it_is_one(tmp_path: Path) -> None:
    (column,) = reading.read([made(tmp_path, "time [s];p [bar]\n" + rows(";", ",").replace(";", ";\u2212"))]).columns
    np.testing.assert_allclose(column.values, -1.5 * np.arange(30))


@pytest.mark.parametrize(
    ("header", "first", "second", "dated", "step_ns"),
    [
        ("t", "0.00", "0.01", False, 10_000_000),
        ("time_ms", "100", "110", False, 10_000_000),
        ("Zeit [us]", "1000", "11000", False, 10_000_000),
        ("stamp", "1748943667250", "1748943667260", True, 10_000_000),
        ("stamp", "1748943667250000", "1748943667260000", True, 10_000_000),
        ("Date", "45811.4035561343", "45811.4035562500", True, 10_000_000),
        ("when", "2025-06-03T09:41:07.250Z", "2025-06-03T09:41:07.260Z", True, 10_000_000),
        ("when", "2025-06-03 11:41:07.250+02:00", "2025-06-03 11:41:07.260+02:00", True, 10_000_000),
        ("Datum", "03.06.2025 09:41:07.250", "03.06.2025 09:41:07.260", True, 10_000_000),
        ("Uhrzeit", "23:59:59.995", "00:00:00.005", False, 10_000_000),
    ],
)
def test_a_time_is_read(header: str, first: str, second: str, dated: bool, step_ns: int, tmp_path: Path) -> None:
    """The first two times are given; a long even tail follows for numbers, so that the column can be told."""
    text = f"{header};p\n{first};1.5\n{second};3.5\n"
    if first.replace(".", "").isdigit():
        a, step = float(first), float(second) - float(first)
        text = f"{header};p\n" + "".join(f"{a + k * step:.10f};{k}\n" for k in range(30))
    source = reading.read([made(tmp_path, text)])
    column = next(c for c in source.columns if c.key == "p")
    assert source.dated == dated
    assert abs(int(column.stamps_ns[1] - column.stamps_ns[0]) - step_ns) < 20_000
    if dated:
        assert abs(int(column.stamps_ns[0]) - T0) < 20_000


def test_without_a_time_the_rate_is_asked_for_and_taken(tmp_path: Path) -> None:
    text = "p;q\n" + "".join(f"{100 + (k % 7)};{k % 5}\n" for k in range(40))
    path = made(tmp_path, text)
    with pytest.raises(ImportingError, match=r"no column is recognisable as the time .*--sample-rate"):
        reading.read([path])
    source = reading.read([path], TimeChoice(rate=50.0))
    assert source.columns[0].stamps_ns[1] == 20_000_000


def test_a_counter_is_not_the_time(tmp_path: Path) -> None:
    text = "sample;p\n" + "".join(f"{k};{k % 5}\n" for k in range(40))
    with pytest.raises(ImportingError, match="no column is recognisable as the time"):
        reading.read([made(tmp_path, text)])


def test_a_topic_exported_to_csv_has_words_among_its_numbers_and_the_stamp_of_its_header(tmp_path: Path) -> None:
    lines = ["%time,field.header.stamp,field.header.frame_id,field.name0,field.position0,field.velocity0"]
    lines += [f"{T0 + k * 10**7 + 900_000},{T0 + k * 10**7},base,boom,{0.1 * k},{1.0}" for k in range(30)]
    source = reading.read([made(tmp_path, "\n".join(lines))])
    keys = {column.key: column for column in source.columns}
    assert set(keys) == {"time", "field.position0", "field.velocity0"} and source.dated
    assert np.abs(keys["field.position0"].stamps_ns - (T0 + 10**7 * np.arange(30))).max() < 500


def test_missing_cells_and_short_lines_cost_only_themselves(tmp_path: Path) -> None:
    text = "t,p\n" + "".join(f"{k / 100},{'' if k == 5 else k}\n" for k in range(30)) + "1.0,2,3,4\n"
    source = reading.read([made(tmp_path, text)])
    (column,) = source.columns
    assert 5.0 not in column.values and len(column.values) == 29
    assert source.notes == [
        "lines with another number of cells are left out: 1",
        "cells without a number are left out: 1 of 30 of 'p'",
    ]


def table(times: list[str], cells: list[str] | None = None) -> str:
    cells = cells or [str(100 + k) for k in range(len(times))]
    return "Time (s);p\n" + "".join(f"{time};{cell}\n" for time, cell in zip(times, cells, strict=True))


def clock(first: datetime, *, zone: str = "Europe/Vienna", seconds: int = 20) -> list[str]:
    """Local times without an offset, as loggers write them."""
    return [
        f"{(first + timedelta(seconds=0.1 * k)).astimezone(ZoneInfo(zone)):%Y-%m-%d %H:%M:%S.%f}"
        for k in range(10 * seconds)
    ]


EVEN = [f"{k / 100:.2f}" for k in range(60)]
AUTUMN, SPRING = datetime(2025, 10, 26, 0, 59, 55, tzinfo=UTC), datetime(2025, 3, 30, 0, 59, 55, tzinfo=UTC)


@pytest.mark.parametrize("chosen", ["", "Time (s)"])
@pytest.mark.parametrize(
    ("times", "told"),
    [
        (clock(AUTUMN), r"'Time \(s\)' goes back by 3599.9 s at row 51 .*150 samples follow: the end of summer.*UTC or with"),
        (EVEN[:40] + EVEN[20:], r"'Time \(s\)' goes back by 0.19 s at row 41 .*remove what it repeats"),
        (EVEN[:30] + [f"{float(t) - 100:.2f}" for t in EVEN[30:]], "goes back by 99.99 s at row 31 .*cut the file there"),
        (["0.5"] * 40, r"'Time \(s\)' does not rise: .*--sample-rate"),
    ],
)  # fmt: skip
def test_a_time_that_goes_back_is_refused_with_its_reason(
    times: list[str], told: str, chosen: str, tmp_path: Path
) -> None:
    with pytest.raises(ImportingError, match=told):
        reading.read([made(tmp_path, table(times))], TimeChoice(chosen))


def test_rows_in_falling_order_are_turned_where_the_time_was_named(tmp_path: Path) -> None:
    path = made(tmp_path, table(EVEN[::-1]))
    with pytest.raises(ImportingError, match=r"'Time \(s\)' do not rise from row to row: .*--time"):
        reading.read([path])
    source = reading.read([path], TimeChoice("Time (s)"))
    (column,) = source.columns
    np.testing.assert_array_equal(column.stamps_ns, 10_000_000 * np.arange(60))
    assert column.values[0] == 159.0 and source.notes == [
        "the rows stand in falling order of their times: they are turned"
    ]


def test_a_row_that_was_written_late_is_put_in_its_place_and_said(tmp_path: Path) -> None:
    late = EVEN[:3] + EVEN[4:6] + EVEN[3:4] + EVEN[6:]
    source = reading.read([made(tmp_path, table(late))], TimeChoice("Time (s)"))
    (column,) = source.columns
    assert (np.diff(column.stamps_ns) == 10_000_000).all() and column.values[3] == 105.0
    assert source.notes == ["rows up to 0.02 s older than the one above were put in their place: 1"]


def test_a_gap_of_the_times_and_a_row_without_one_are_noted(tmp_path: Path) -> None:
    spring = reading.read([made(tmp_path, table(clock(SPRING)))])
    assert spring.notes[0].startswith("no samples for 3600.1 s from 4.9 s on: the beginning of summer time?")
    source = reading.read([made(tmp_path, table([*EVEN, "", "9.0"]))])
    assert source.notes == ["rows without a time are left out: 1", "no samples for 8.41 s from 0.59 s on"]


def test_cells_that_hold_no_number_are_noted_with_their_column(tmp_path: Path) -> None:
    cells = ["abc", "nan", "inf", ""] + [str(k) for k in range(56)]
    source = reading.read([made(tmp_path, table(EVEN, cells))])
    assert source.notes == ["cells without a number are left out: 4 of 60 of 'p'"]


def test_a_small_file_that_unpacks_to_gigabytes_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    count = 500_000_000
    flags = struct.pack("<8I", 6, 8, 6, 0, 5, 8, count, 1)
    matrix = (
        struct.pack("<2I", 14, 48 + 8 * count)
        + flags
        + struct.pack("<2H4s2I", 1, 1, b"t", 9, 8 * count)
        + bytes(10_000)
    )
    packed = zlib.compress(matrix)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
    (tmp_path / "bomb.mat").write_bytes(head + struct.pack("<2I", 15, len(packed)) + packed)
    with h5py.File(tmp_path / "wide.mat", "w") as file:
        file.create_dataset("t", (count,), np.float64, chunks=True)
    for name in ("bomb.mat", "wide.mat"):
        with pytest.raises(ImportingError, match=r"its array '/?t' holds 5e\+08 numbers"):
            reading.read([tmp_path / name])


def test_a_file_that_does_not_fit_into_the_memory_is_told_as_such(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(csv_text, "read", full)
    with pytest.raises(ImportingError, match=r"table.csv: it does not fit into the memory: import it in parts"):
        reading.read([made(tmp_path, table(EVEN))])


def test_an_array_whose_time_goes_back_is_refused(tmp_path: Path) -> None:
    t = np.concatenate((np.arange(50), np.arange(20, 50))) / 100
    scipy.io.savemat(tmp_path / "out.mat", {"time": t, "p_A": 2 * t})
    with pytest.raises(ImportingError, match=r"'time' goes back by 0.29 s at row 51"):
        reading.read([tmp_path / "out.mat"])


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("Druck Kolben [bar]", "Druck Kolben", "bar"), ("p_A (MPa)", "p_A", "MPa"), ("p / bar", "p", "bar"),
        ("angle_deg", "angle", "deg"), ("rate_deg_s", "rate", "deg_s"), ("p_a", "p_a", ""), ("p_head", "p_head", ""),
        ("extend_current_a", "extend_current", "a"), ("pressure in kPa", "pressure", "kPa"), ("boom (inner)", "boom (inner)", ""),
        ("i_ext_mA", "i_ext", "mA"), ("p [bar(a)]", "p", "bar(a)"), ("p bar(a)", "p", "bar(a)"),
        ("p_head_bar(a)", "p_head", "bar(a)"),
        ("Boom angle [0.01 deg]", "Boom angle", "0.01 deg"), ("boom_angle_cdeg", "boom_angle", "cdeg"),
        ("boom angle 0.01 deg", "boom angle", "0.01 deg"), ("head pressure / 0.1 bar", "head pressure", "0.1 bar"),
    ],
)  # fmt: skip
def test_a_header_is_split(header: str, name: str, unit: str) -> None:
    found = units.split(header)
    assert found == ((name, unit) if unit else (header, ""))


@pytest.mark.parametrize(
    ("text", "name", "reference"),
    [("bar", "bar", ""), ("barg", "bar", "gauge"), ("bar abs", "bar", "absolute"), ("psia", "psi", "absolute"), ("MPA", "MPa", ""),
     ("°/s", "deg/s", ""), ("mA", "mA", ""), ("N/mm²", "MPa", ""), ("[kPa(abs)]", "kPa", "absolute"), ("0-250 bar", "bar", ""),
     ("kgf/cm2", "kgf/cm2", "")],
)  # fmt: skip
def test_a_unit_is_known(text: str, name: str, reference: str) -> None:
    found = units.parse(text)
    assert found.measure is not None and (found.measure.name, found.reference) == (name, reference)


@pytest.mark.parametrize(
    ("text", "name", "scale"),
    [("0.01 deg", "deg", 0.01), ("0,1 bar", "bar", 0.1), ("cdeg/s", "deg/s", 0.01), ("mdeg", "deg", 1e-3), ("mbar", "hPa", 1.0)],
)  # fmt: skip
def test_a_multiple_of_a_unit_is_known(text: str, name: str, scale: float) -> None:
    found = units.parse(text)
    assert found.measure is not None and (found.measure.name, found.scale) == (name, scale)
    assert not units.is_unknown(text)


def test_a_unit_that_is_not_known_is_told_from_a_remark() -> None:
    assert units.is_unknown("bar x10") and units.is_unknown("raw deg")
    assert not any(map(units.is_unknown, ("", "filtered", "IMU 2", "-")))
    assert units.parse("1 2 3 bar").measure is None and units.parse("1 " * 5000 + "bar").measure is None


@pytest.mark.parametrize(("missing", "count"), [(6553.5, 50), (-9999.0, 300), (65535.0, 2)])
def test_a_value_that_says_no_measurement_is_left_out_and_said(missing: float, count: int, tmp_path: Path) -> None:
    values = 100.0 + 50.0 * np.sin(np.arange(1000) / 40.0)
    values[200 : 200 + count] = missing
    lines = "".join(f"{k / 100:.2f},{value:.1f}\n" for k, value in enumerate(values))
    source = reading.read([made(tmp_path, "time [s],p [bar]\n" + lines)])
    assert len(source.columns[0].values) == 1000 - count and source.columns[0].values.max() < 151.0
    assert source.notes == [
        f"'p [bar]': {count} times {missing:g} is left out: so far from all others it is no measurement"
    ]


@pytest.mark.parametrize(
    "values",
    [
        np.where(np.arange(1000) % 7 < 2, 0.8, 0.01), np.where(np.arange(1000) < 800, 20.0, 200.0 + np.arange(1000) % 17),
        np.where(np.arange(1000) > 900, 250.0, 30.0 + np.arange(1000) % 3), np.where(np.arange(1000) < 500, -12.5, 41.0),
        np.where(np.arange(1000) < 700, 999.0, 20.0), 990.0 + np.arange(1000) % 10,
    ],
    ids=["lever", "standby", "transducer at its end", "parked", "mostly there", "a code in between"],
)  # fmt: skip
def test_what_a_machine_may_do_is_no_missing_measurement(values: np.ndarray, tmp_path: Path) -> None:
    lines = "".join(f"{k / 100:.2f},{value:.3f}\n" for k, value in enumerate(values))
    source = reading.read([made(tmp_path, "time [s],x\n" + lines)])
    assert (len(source.columns[0].values), source.notes) == (1000, [])


def test_a_stated_unit_of_the_time_is_not_overruled_in_silence(tmp_path: Path) -> None:
    slow = made(tmp_path, "time [s],p [bar]\n" + "".join(f"{10 * k},{100 + k % 7}\n" for k in range(1000)))
    said = r"'time \[s\]' is said to be in s, samples 10 s apart; in ms they would be 0.01 s apart: give --time-unit"
    with pytest.raises(ImportingError, match=said):
        reading.read([slow])
    assert np.ptp(reading.read([slow], TimeChoice(unit="s")).columns[0].stamps_ns) == 9990 * 10**9


def test_a_current_that_is_either_off_or_on_keeps_both_values(tmp_path: Path) -> None:
    lines = "".join(f"{k / 100:.2f},{0.5 * (k // 100 % 2):.1f}\n" for k in range(1000))
    assert len(reading.read([made(tmp_path, "time [s],i [A]\n" + lines)]).columns[0].values) == 1000


def test_a_pump_that_is_off_has_no_pressure_and_keeps_it(tmp_path: Path) -> None:
    lines = "".join(f"{k / 100:.2f},{0.0 if k < 300 else 200.0 + k % 17:.1f}\n" for k in range(1000))
    assert reading.read([made(tmp_path, "time [s],p [bar]\n" + lines)]).columns[0].values.min() == 0.0


def test_rows_that_share_whole_seconds_are_spread_and_the_first_second_may_be_cut(tmp_path: Path) -> None:
    first = datetime(2026, 10, 25, 13, 0, tzinfo=UTC)
    rows = [f"{first + timedelta(seconds=(k + 60) // 100):%Y-%m-%d %H:%M:%S},{k}\n" for k in range(1000)]
    source = reading.read([made(tmp_path, "time,p [bar]\n" + "".join(rows))])
    np.testing.assert_array_equal(np.diff(source.columns[0].stamps_ns), 10_000_000)
    assert source.columns[0].stamps_ns[40] == round(first.timestamp() + 1) * 10**9
    assert source.notes == ["100 rows share each stamp: they are spread evenly until the next one"]


def test_a_second_with_lost_rows_and_a_pause_cost_only_themselves(tmp_path: Path) -> None:
    seconds = [*range(10), *range(70, 80)]
    rows = [f"{second},{row}\n" for second in seconds for row in range(60 if second == 5 else 100)]
    (column,) = reading.read([made(tmp_path, "time [s],p [bar]\n" + "".join(rows))]).columns
    time = column.stamps_ns / 1e9
    assert np.diff(time).max() == pytest.approx(60.01)
    assert (np.diff(time) > 0).all() and np.median(np.diff(time)) == pytest.approx(0.01)


def test_rows_of_one_signal_each_keep_the_stamp_that_they_share(tmp_path: Path) -> None:
    rows = "".join(f"{k / 10:.1f},{k},,\n{k / 10:.1f},,{2 * k},\n{k / 10:.1f},,,{3 * k}\n" for k in range(200))
    columns = reading.read([made(tmp_path, "time [s],angle [deg],p [bar],i [A]\n" + rows)]).columns
    assert [int(c.stamps_ns[0]) for c in columns] == [0, 0, 0]


@pytest.mark.parametrize(("unit", "step"), [("10 us", 1000), ("0.01 s", 1), ("0.1 ms", 100)])
def test_a_time_may_count_in_multiples_of_its_unit(unit: str, step: int, tmp_path: Path) -> None:
    rows = "".join(f"{step * k},{k}\n" for k in range(1000))
    (column,) = reading.read([made(tmp_path, f"time [{unit}],p [bar]\n" + rows)], TimeChoice("time")).columns
    np.testing.assert_array_equal(np.diff(column.stamps_ns), 10_000_000)


@pytest.mark.parametrize("turned", [False, True])
def test_a_log_that_rolls_over_is_one_recording_whatever_the_order_of_its_files(turned: bool, tmp_path: Path) -> None:
    whole = [f"{k / 100:.2f},{k}\n" for k in range(200)]
    files = [tmp_path / name for name in ("1.csv", "2.csv")]
    for file, part in zip(files, (whole[:120], whole[120:]), strict=True):
        file.write_text("time [s],p [bar]\n" + "".join(part))
    source = reading.read(files[::-1] if turned else files)
    (column,) = source.columns
    np.testing.assert_array_equal(column.values, np.arange(200))
    np.testing.assert_array_equal(np.diff(column.stamps_ns), 10_000_000)
    assert source.notes[0] == "2 files with the same columns are one after the other: 1.csv, 2.csv"


@pytest.mark.parametrize("later", [0.0, 3600.0])
def test_files_with_the_same_columns_that_do_not_follow_on_another_stand_side_by_side(
    later: float, tmp_path: Path
) -> None:
    for name, begin in (("angle.csv", 0.0), ("hose.csv", later)):
        lines = "".join(f"{begin + k / 100:.2f},{k}\n" for k in range(30))
        (tmp_path / name).write_text("time [s],value\n" + lines)
    source = reading.read([tmp_path / "angle.csv", tmp_path / "hose.csv"])
    assert [c.key for c in source.columns] == ["angle/value", "hose/value"]


def test_a_struct_of_each_signal_may_call_its_time_t(tmp_path: Path) -> None:
    t = np.arange(50) / 100
    signals = {"angle": {"t": t, "v": 2 * t, "unit": "deg"}, "p_A": {"t": t[::5], "v": 3 * t[::5], "unit": "bar"}}
    scipy.io.savemat(tmp_path / "out.mat", signals)
    found = reading.read([tmp_path / "out.mat"]).columns
    assert {c.unit: (len(c.values), int(c.stamps_ns[-1])) for c in found} == {
        "deg": (50, 490_000_000), "bar": (10, 450_000_000),
    }  # fmt: skip


def test_a_structure_with_time_is_read(tmp_path: Path) -> None:
    t = np.arange(50) / 100
    values = [{"values": t * 2, "label": "angle [deg]"}, {"values": t * 3, "label": "p_A [bar]"}]
    scipy.io.savemat(tmp_path / "out.mat", {"out": {"time": t, "signals": np.array(values, object)}})
    source = reading.read([tmp_path / "out.mat"])
    assert {c.unit: float(c.values[-1]) for c in source.columns} == {
        "deg": pytest.approx(0.98),
        "bar": pytest.approx(1.47),
    }
    assert all(c.stamps_ns[-1] == 490_000_000 for c in source.columns)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.xlsx", b"PK\x03\x04rest", "save the table as CSV"),
        ("a.gz", b"\x1f\x8brest", "gunzip"),
        ("a.blf", b"LOGGrest", "import-can"),
        ("a.csv", b"", "empty"),
        ("a.csv", b"no table at all\n", "no table of numbers"),
        ("a.csv", b"a\n1\n2\n3\n4\n", "one number each"),
        ("a.csv", b"1;" * 10**6, "no table with at most"),
        ("a.csv", b"time [s],angle [deg],p [bar]\n", "below its header there are 0 rows of numbers"),
        ("a.csv", b"time [s];angle [deg];p [bar]\n\n", "below its header there are 0 rows of numbers"),
        ("a.csv", b"time [s];p [Pa]\n0,00;8.019.962,2\n0,01;8.019.870,1\n", "thousands separators"),
        ("a.csv", b'time [s];p [bar]\n="0,00";="80,1"\n="0,01";="80,2"\n', "formulas"),
        ("a.mat", b"MATLAB 5.0 MAT-file" + b"\0" * 300, "export it again"),
        ("a.mat", b"no such thing" * 30, "it is called .mat, but is no MAT file"),
        ("a.mf4", b"MDF     4.10" + b"\xff" * 300, "export it again"),
        ("a.bag", b"#ROSBAG V2.0\n" + b"\xff" * 300, "export it again"),
        ("a.db3", b"SQLite format 3\0" + b"\xff" * 300, "export it again"),
        ("a.mcap", b"\x89MCAP0\r\n", "the file was not closed .*no message is left: copy it again"),
        ("a.mcap", b"\x89MCAP0\r\n\x01\x0c\0\0", "the file was not closed .*no message is left: copy it again"),
        ("a.png", b"\x89PNG\r\n\x1a\n\0\0", "neither text nor of a kind that is known"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(name: str, content: bytes, told: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ImportingError, match=told) as caught:
        reading.read([path])
    assert str(caught.value).startswith(str(path)) and str(caught.value).isprintable()
