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
from boom_recording.recording import Configuration, Recording

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


@pytest.mark.parametrize(("unit", "shift"), [("rad", -2.0 * np.pi), ("m", 0.0)])
def test_a_whole_turn_is_taken_out_of_an_angle_and_not_out_of_a_piston_s_way(unit: str, shift: float) -> None:
    stamps = np.arange(200, dtype=np.int64) * 10_000_000
    values = (6.5 if unit == "rad" else 3.15) + 0.01 * np.sin(stamps / 1e9)
    made = conversion.convert(
        "made",
        Source(Path("x"), "", [Column("q", "q", "", stamps, values)], False, ""),
        Mapping({"angle": SignalMap("q", unit)}),
    )
    np.testing.assert_allclose(made.signals["angle"].values, values + shift)
    assert bool(made.notes) == bool(shift)


def with_currents(up: tuple[np.ndarray, np.ndarray], down: tuple[np.ndarray, np.ndarray]) -> Recording:
    """An angle every 5 ms for 3 s, which rises from 0.2 to 1.4 s, and currents [A] at their own times [ms]."""
    stamps = np.arange(600, dtype=np.int64) * 5_000_000
    columns = [Column("q", "q", "", stamps, 0.2 * np.clip(stamps / 1e9 - 0.2, 0.0, 1.2))]
    columns += [Column(n, n, "", (t * 1e6).astype(np.int64), i) for n, (t, i) in (("up", up), ("down", down))]
    signals: dict[str, SignalMap | str] = {
        "angle": SignalMap("q", "rad"), "extend_current": SignalMap("up", "A"), "retract_current": SignalMap("down", "A"),
    }  # fmt: skip
    return conversion.convert("made", Source(Path("x"), "", columns, False, ""), Mapping(signals))


def test_currents_logged_while_they_flow_only_are_zero_else() -> None:
    up, down = np.arange(500.0, 1301.0, 20.0), np.arange(1900.0, 2501.0, 20.0)
    made = with_currents((up, np.linspace(0.3, 0.4, len(up))), (down, np.full(len(down), 0.5)))
    for name, begin, end in (("extend_current", 0.5, 1.3), ("retract_current", 1.9, 2.5)):
        signal = made.signals[name]
        flows = (signal.time >= begin) & (signal.time <= end)
        away = (signal.time < begin - 0.03) | (signal.time > end + 0.03)
        assert signal.valid.all() and (signal.values[flows] >= 0.3).all() and (signal.values[away] == 0.0).all()
    assert any("0 A is taken" in note for note in made.notes)


def test_currents_that_are_logged_by_turns_all_the_time_are_never_zero() -> None:
    """Two frames of each per flush."""
    times = np.arange(0.0, 3000.0, 10.0).reshape(-1, 4)
    made = with_currents(
        *((times[:, part].ravel(), np.full(2 * len(times), 0.4)) for part in (slice(0, 2), slice(2, 4)))
    )
    for name in ("extend_current", "retract_current"):
        np.testing.assert_allclose(made.signals[name].values[made.signals[name].valid], 0.4)


def test_what_a_current_does_between_changes_is_not_known() -> None:
    """A logger that writes what changes holds the value, where one that writes what flows would have none."""
    ramp = np.arange(0.0, 200.0, 10.0)
    up = np.concatenate([200.0 + ramp, 1200.0 + ramp])
    level = np.concatenate([0.02 * np.arange(20), 0.38 - 0.02 * np.arange(20)])
    made = with_currents((up, level), (np.arange(2000.0, 2400.0, 10.0), np.full(40, 0.5)))
    signal = made.signals["extend_current"]
    assert not signal.valid[(signal.time > 0.5) & (signal.time < 1.1)].any()
