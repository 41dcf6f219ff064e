"""Currents from CSV files as spreadsheets of several countries write them; what is not clear is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from boom_sim import csv_currents
from boom_sim.settings import SimulationSettingError

PLAIN = "time_s,retract_a,extend_a\n0,0,0\n1.5,0,0.25\n"


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", "\t").replace(".", ","),
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        "\ufeff" + PLAIN,
        PLAIN.replace(",", "\t").encode("utf-16"),
        '"time_s";"retract_a";"extend_a"\r\n"0";"0";"0"\r\n"1,5";"0";"0,25"\r\n',
        '"time_s","retract_a","extend_a"\n0,0,0\n"1.5",0,".25"\n',
        "sep=;\n" + PLAIN.replace(",", ";"),
        "# from the log book\n\n" + PLAIN + "\n;;\n\n".replace(";", ","),
        PLAIN.replace("0,0,0\n", "0,0,0\n# a step, at last\n") + "  \n",
        " Time_s , Retract_A , Extend_A \n 0 , 0 , 0 \n 15e-1 , 0 , 25e-2 \n",
    ],
)
def test_what_spreadsheets_write_is_read(content: str | bytes, tmp_path: Path) -> None:
    path = tmp_path / "c.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    times, currents = csv_currents.read(path)
    assert times.tolist() == [0.0, 1.5]
    assert currents.tolist() == [[0.0, 0.0], [0.0, 0.25]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the first line must be time_s,retract_a,extend_a"),
        ("time_s|retract_a|extend_a\n0|0|0\n", "the first line must be"),
        ("time_s,retract_a,extend_a\n", "line 1: no currents"),
        ("time_s,retract_a,extend_a\n0,5,0,0,0,25\n", "line 2: .*decimal commas need semicolons"),
        ('time_s,retract_a,extend_a\n"0,5",0,0\n', "line 2: decimal points and commas are mixed"),
        ("time_s;retract_a;extend_a\n1.000,5;0;0\n", "line 2: expected three numbers"),
        ("time_s;retract_a;extend_a\n0,5;0;0\n1.5;0;0\n", "line 3: decimal points and commas are mixed"),
        ("time_s,retract_a,extend_a\n0;0;0\n", "line 2: expected three numbers"),
        ("time_s,retract_a,extend_a\n0,1_0,0\n", "line 2: expected three numbers"),
        ("time_s,retract_a,extend_a\n0,\u0661,0\n", "line 2: expected three numbers"),
        ("time_s,retract_a,extend_a\n0,0,nan\n", "line 2: expected three numbers"),
        ("time_s,retract_a,extend_a\n0,0,1e999\n", "line 2: current inf A"),
        ("time_s,retract_a,extend_a\n0,0,0\n0,0,0\n", "line 3: time 0 s: times must increase"),
        ("time_s,retract_a,extend_a\n1e9,0,0\n", "line 2: time 1e\\+09 s: .* up to 3600 s"),
        ("time_s,retract_a,extend_a\n-5,0,0\n", "the last time, -5 s"),
        ("time_s,retract_a,extend_a\n0,0.4,0\n", "the last time, 0 s, is not after .* add a line"),
        ("time_s,retract_a,extend_a\n0,\x1b[2J\0" + "x" * 300_000 + ",0\n", "line 2: expected three numbers"),
        ('time_s,retract_a,extend_a\n0,"' + "x" * 300_000 + '",0\n', "line 2: expected three numbers"),
        (b"\xff\xfe\x00\xd8", "not a text file"),
        (b"time_s\x80", "not a text file"),
    ],
)  # fmt: skip
def test_what_is_not_clear_is_refused_in_one_line(content: str | bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "c.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    with pytest.raises(SimulationSettingError, match=message) as caught:
        csv_currents.read(path)
    assert str(caught.value).isprintable() and len(str(caught.value)) < 500


def test_an_hour_of_currents_is_read_in_a_moment_and_more_than_a_file_can_hold_is_not(tmp_path: Path) -> None:
    path = tmp_path / "c.csv"
    path.write_text("time_s;retract_a;extend_a\n" + "".join(f"{k / 10:.1f};0;0.3\n" for k in range(36_000)))
    assert len(csv_currents.read(path)[0]) == 36_000
    path.write_bytes(b"x" * 20_000_001)
    with pytest.raises(SimulationSettingError, match="larger than 20 MB"):
        csv_currents.read(path)
