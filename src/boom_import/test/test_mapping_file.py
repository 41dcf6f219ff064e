"""Mapping files: what is written is read back, and what is wrong in one is told with its entry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_import import conversion, mapping
from boom_import.candidates import candidates
from boom_import.errors import ImportingError
from boom_import.mapping import Mapping, SignalMap
from boom_import.source import Column, Source
from boom_import.timing import TimeChoice
from boom_recording.recording import Configuration

WHOLE = Mapping(
    {
        "angle": SignalMap("Winkel: [°]", "deg", -1.0, 1.0, 90.0),
        "rate": "derivative of angle",
        "hose_pressure": SignalMap("p_A", "bar", reference="absolute"),
        "rod_pressure": "none",
        "extend_current": SignalMap("u", "A", 1.0, 0.006, part="positive"),
        "retract_current": SignalMap("u", "A", -1.0, 0.006, part="negative"),
    },
    TimeChoice("t", "ms"), "boom", "tz17", 0.28, 2.2, None,
)  # fmt: skip


HYDRAULICS = Mapping(
    {
        "angle": SignalMap("x", "mm"),
        "rate": "derivative of angle",
        **dict.fromkeys(("rod_pressure", "extend_current", "retract_current"), "none"),
        **{
            name: SignalMap(name, "bar", reference="gauge")
            for name in ("hose_pressure", "head_pressure", "supply_pressure")
        },
    }
)
"""Of a cylinder alone: the piston in the place of the boom, and pressures that a machine's bus need not have."""


def source() -> Source:
    stamps = np.arange(100, dtype=np.int64) * 10_000_000
    angle = 90.0 - 30.0 * np.sin(0.01 * np.arange(100))
    values = {"Winkel: [°]": angle, "p_A": np.full(100, 51.01325), "u": np.linspace(-100, 100, 100)}
    return Source(Path("x.csv"), "CSV", [Column(k, k, "", stamps, v) for k, v in values.items()], False, "")


def test_a_mapping_survives_its_file(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(mapping.text(WHOLE, {"angle": "a comment"}, ["heading"]))
    assert mapping.read(path) == WHOLE


def test_a_load_that_is_not_known_stays_so(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(mapping.text(replace(WHOLE, load=float("nan"), machine=""), {}, []))
    assert mapping.read(path).load is None and mapping.read(path).machine == ""


def test_pose_and_load_of_the_source_stay_where_the_mapping_says_nothing() -> None:
    own = source()
    own.configuration = Configuration("crane_7", 0.5, 1.0, 40.0)
    told = replace(WHOLE, q3=None, q4=None, load=60.0, machine="")
    made = conversion.convert("made", own, told).configuration
    assert (made.machine, made.outer_boom_angle, made.telescope_length, made.load_mass) == ("crane_7", 0.5, 1.0, 60.0)
    assert conversion.convert("made", source(), told).stored_configuration is None
    assert conversion.convert("made", source(), replace(told, q3=0.1, q4=0.2)).configuration.machine == ""


def test_a_mapping_of_several_files_fits_those_of_the_next_run() -> None:
    """Columns bear the name of their file: run b had needed sed."""
    told = replace(WHOLE, signals={n: replace(s, column=f"run_a/{s.column}") if isinstance(s, SignalMap) else s
                                   for n, s in WHOLE.signals.items()})  # fmt: skip
    own = source()
    own.columns[:] = [replace(c, key=f"run_b/{c.key}") for c in own.columns]
    assert set(conversion.convert("made", own, told).signals) == set(
        conversion.convert("made", source(), WHOLE).signals
    )


def test_a_column_that_counts_is_no_signal() -> None:
    columns = [Column("Index", "Index", "", np.arange(200, dtype=np.int64), np.arange(200.0)),
               Column("p", "p", "", np.arange(200, dtype=np.int64), 100.0 + np.sin(np.arange(200.0)))]  # fmt: skip
    assert {c.column.key for c in candidates(columns, "hose_pressure")} == {"p"}


def test_a_mapping_is_applied() -> None:
    made = conversion.convert("made", source(), WHOLE)
    angle = np.deg2rad(30.0 * np.sin(0.01 * np.arange(100)))
    np.testing.assert_allclose(made.signals["angle"].values, angle, atol=1e-12)
    np.testing.assert_allclose(made.signals["rate"].values[20:-20], np.gradient(angle, 0.01)[20:-20], atol=2e-3)
    np.testing.assert_allclose(made.signals["hose_pressure"].values, 50e5, atol=1e-6)
    assert (
        made.signals["extend_current"].values.max()
        == made.signals["retract_current"].values.max()
        == pytest.approx(0.6)
    )
    assert np.all(made.signals["extend_current"].values * made.signals["retract_current"].values == 0.0)
    assert "rod_pressure" not in made.signals
    assert made.configuration.telescope_length == 2.2 and np.isnan(made.configuration.load_mass)


def test_a_piston_and_the_pressures_beside_it_are_imported(tmp_path: Path) -> None:
    path, own = tmp_path / "m.yaml", source()
    path.write_text(mapping.text(HYDRAULICS, {}, []))
    columns = dict.fromkeys(("hose_pressure", "head_pressure", "supply_pressure"), np.full(100, 51.0))
    for name, values in {**columns, "x": np.linspace(300.0, 350.0, 100)}.items():
        own.columns.append(Column(name, name, "", own.columns[0].stamps_ns, values))
    made = conversion.convert("made", own, mapping.read(path))
    np.testing.assert_allclose(made.signals["angle"].values, np.linspace(0.3, 0.35, 100))
    assert {"head_pressure", "supply_pressure"} < set(made.signals)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('unit: "deg"', 'unit: "bar"', "signals: angle: unit bar: the angle is in rad, mrad, deg, gon, m, mm"),
        ("sign: -1", "sign: 2", "signals: angle: sign: give 1 or -1"),
        ("  rod_pressure: none\n", "", "rod_pressure is missing"),
        ("  rod_pressure: none\n", "  rod_presure: none\n", "unknown entry rod_presure"),
        (', reference: "absolute"', "", "give gauge (0 in air) or absolute"),
        ('column: "p_A", ', "", "hose_pressure: column is missing"),
        ("q3: 0.28", "q3: .nan", "q3: nan is not a number"),
        ("load: null", "load: -50", "configuration: load: -50 kg: a load is 0 or more"),
        (
            "rod_pressure: none",
            "rod_pressure: {column: p_A, unit: bar, reference: gauge}",
            "hose_pressure and rod_pressure: 'p_A' cannot be both",
        ),
        (', part: "negative"', "", "extend_current and retract_current: 'u' cannot be both"),
        ('unit: "ms"', "sample_rate: 100", "time: a sample rate is for a table without a column of time"),
        ('column: "t", unit: "ms"', "sample_rate: 0", "time: sample_rate: 0: give above 0"),
        ('part: "positive"', 'part: "upper"', "give positive or negative"),
    ],
)
def test_a_wrong_entry_is_named(old: str, new: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    text = mapping.text(WHOLE, {}, [])
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ImportingError) as caught:
        mapping.read(path)
    assert told in str(caught.value) and str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        (SignalMap("p_B", "bar", reference="gauge"), "there is no column 'p_B'"),
        (SignalMap("p_A", "MPa", scale=10.0, reference="gauge"), "100 % of 'p_A' in MPa lie outside"),
        ("ask", "hose_pressure is not decided"),
    ],
)
def test_a_mapping_that_does_not_fit_the_file_is_refused(entry: SignalMap | str, told: str) -> None:
    with pytest.raises(ImportingError, match=told):
        conversion.convert("made", source(), Mapping({**WHOLE.signals, "hose_pressure": entry}))


def test_signals_of_one_message_get_common_times_and_no_gap_is_bridged() -> None:
    stamps = np.arange(200, dtype=np.int64) * 10_000_000
    late = np.delete(stamps + 3_000_000, slice(80, 120))
    columns = [Column("q", "q", "", stamps, np.sin(stamps / 1e9)), Column("w", "w", "", late, np.cos(late / 1e9))]
    signals: dict[str, SignalMap | str] = {"angle": SignalMap("q", "rad"), "rate": SignalMap("w", "rad/s")}
    made = conversion.convert("made", Source(Path("x"), "", columns, False, ""), Mapping(signals))
    rate = made.signals["rate"]
    np.testing.assert_array_equal(rate.stamps_ns, made.signals["angle"].stamps_ns)
    np.testing.assert_allclose(rate.values[rate.valid], np.cos(stamps / 1e9)[rate.valid], atol=2e-5)
    assert not rate.valid[81:120].any() and rate.valid[10:80].all()
    assert made.notes == ["rate was interpolated to the times of angle"]


def test_currents_logged_while_they_flow_only_are_zero_else() -> None:
    stamps = np.arange(300, dtype=np.int64) * 10_000_000
    up, down = slice(50, 100), slice(150, 250)
    columns = [
        Column("q", "q", "", stamps, np.sin(stamps / 1e9)),
        Column("up", "up", "", stamps[up], np.full(50, 0.4)), Column("down", "down", "", stamps[down], np.full(100, 0.5)),
    ]  # fmt: skip
    signals: dict[str, SignalMap | str] = {
        "angle": SignalMap("q", "rad"), "extend_current": SignalMap("up", "A"), "retract_current": SignalMap("down", "A"),
    }  # fmt: skip
    made = conversion.convert("made", Source(Path("x"), "", columns, False, ""), Mapping(signals))
    for name, value, there in (("extend_current", 0.4, up), ("retract_current", 0.5, down)):
        expected = np.zeros(300)
        expected[there] = value
        np.testing.assert_array_equal(made.signals[name].values, expected)
    assert any("taken for 0 A" in note for note in made.notes)
