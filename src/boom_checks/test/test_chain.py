"""One link after the other driven by measurements; what opens the valve between hose and cylinder."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_checks.chain import chain_of_machine, study
from boom_checks.cylinder_valve import FOLLOWS, ValveData, behind_play, valve_laws
from boom_checks.doubts import first_look
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_recording.recording import Configuration
from boom_recording.writing import from_columns

ROOT = Path(__file__).resolve().parents[3]
BAGS, SHARED = ROOT / "bags", ROOT.parent / "shared" / "recordings" / "strangers"
TZ17 = load_machine("tz17")


def test_no_link_of_a_healthy_machine_breaks() -> None:
    chain = chain_of_machine(load(BAGS / "healthy" / "folded_fast"), TZ17)
    assert [link.name for link in chain.links] == ["kinematics", "mechanics", "head flow", "rod flow"]
    assert all(link.ratio < 0.7 and link.nrmse < 0.15 for link in chain.links)
    assert chain.sentence.startswith("no link breaks")
    assert study([chain]).valve_sentence == ""  # the hose pressure is what the boom needs: nothing to explain


@pytest.mark.parametrize("angle", [4.0, 5.0])
def test_an_angle_that_no_boom_has_drives_no_link_and_gives_no_level(angle: float) -> None:
    healthy = load(BAGS / "healthy" / "folded_fast")
    series = healthy.signals["angle"]
    wrong = replace(series, values=np.full_like(series.values, angle), valid=np.zeros_like(series.valid))
    turned = replace(healthy, signals={**healthy.signals, "angle": wrong})
    chain = chain_of_machine(turned, TZ17)
    assert (chain.links, chain.valve) == ((), None)
    assert {why for _, why in chain.missing} == {"it needs the angle, of which no sample can be used"}
    assert first_look(turned, TZ17).statics is None


def test_links_that_cannot_be_driven_are_named_where_no_other_breaks() -> None:
    healthy = load(BAGS / "healthy" / "folded_fast")
    signals = {name: signal for name, signal in healthy.signals.items() if name != "rod_pressure"}
    chain = chain_of_machine(replace(healthy, signals=signals), TZ17)
    assert chain.sentence.startswith(
        "no link that can be driven breaks: noise and the file's tolerances explain every error; not"
    )
    assert chain.sentence.endswith(", ".join(dict.fromkeys(name for name, _ in chain.missing)))
    assert {why for _, why in chain.missing} == {"it needs the rod pressure, not recorded"}


@pytest.mark.parametrize("bag", ["explained/payload_change_a", "unexplained/crane_4_a"])
def test_a_load_or_a_support_that_nobody_told_breaks_the_mechanics_alone(bag: str) -> None:
    chain = chain_of_machine(load(BAGS / bag), TZ17)
    assert [link.name for link in chain.links if link.ratio > 1.0] == ["mechanics"]
    assert chain.sentence.startswith("the chain breaks at the mechanics (")


def test_a_wrong_area_of_the_main_valve_breaks_its_port_alone() -> None:
    number = TZ17.parameters["main_valve_orifices.A_tb_max"].value[0]
    wrong = TZ17.with_values({"main_valve_orifices.A_tb_max": 3 * number})
    links = chain_of_machine(load(BAGS / "healthy" / "folded_fast"), wrong).links
    assert [link.name for link in links if link.ratio > 1.0] == ["rod flow"]


@pytest.mark.parametrize("samples, nothing", [(1, 0.0), (20, 6e6), (200, 6e6), (700, 0.0)])
def test_a_recording_that_tells_nothing_is_no_error(samples: int, nothing: float) -> None:
    names = ("angle", "rate", "hose_pressure", "rod_pressure", "retract_current", "extend_current")
    columns = {name: np.full(samples, nothing if name == "hose_pressure" else 0.0) for name in names}
    recording = from_columns("rest", np.arange(samples) * 0.01, columns, Configuration("tz17", 4.59, 0.0, float("nan")))
    chain = chain_of_machine(recording, TZ17)
    look = first_look(recording, TZ17)
    assert look.checks == ()
    assert samples == 700 or look.no_levels.startswith(
        "no levels: they need 5 s of the angle and the rate and the hose pressure"
    )
    assert bool(chain.links) == (samples == 700)
    said = "nothing drives the links: the boom did not move" if samples == 700 else "no link can be driven: "
    assert chain.sentence.startswith(said)


def test_without_pressures_the_links_that_need_them_are_named() -> None:
    recording = load(BAGS / "healthy" / "folded_fast")
    recording.signals = {name: s for name, s in recording.signals.items() if name != "rod_pressure"}
    chain = chain_of_machine(recording, TZ17)
    assert [link.name for link in chain.links] == ["kinematics"]
    assert [name for name, _ in chain.missing] == ["mechanics", "head flow", "rod flow"]
    look = first_look(recording, TZ17)
    assert (look.statics, look.no_levels) == (None, "no levels: they need the rod pressure, not recorded")


def test_play_follows_at_its_half() -> None:
    values = np.array([0.0, 1.0, 3.0, 2.0, 0.5, -2.0])
    assert behind_play(values, 1.0).tolist() == [0.0, 0.0, 2.0, 2.0, 1.5, -1.0]
    assert behind_play(values, 0.0) is values


def valve(opened_by_rod: bool, seed: int) -> ValveData:
    """A check valve to lift; to lower an orifice, opened by the rod pressure from 40 bar or not at all, with oil behind it."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.01)
    shape = [rng.uniform(0.2, 0.8, 3), rng.uniform(0, 6, 3)]
    wave = sum(np.sin(w * time + p) for w, p in zip(*shape, strict=True)) / 2
    rod, head = 4.0e6 + 4.0e6 * wave, 8.0e6 + 2.0e6 * np.sin(0.9 * time + seed)
    hose = np.where(wave > 0.2, 1.0e6, head + np.maximum(-wave, 0.0) * 8e5 + 1e5 - 9e5 * (wave > 0))
    drop, rate = hose - head, np.gradient(head, 0.01)
    gate = np.clip(rod - 4.0e6, 0.0, None) if opened_by_rod else 3e6
    flow = 1e-9 * np.maximum(drop, 0.0) + 6e-14 * gate * np.sign(drop) * np.sqrt(np.abs(drop)) - 2e-12 * rate
    return ValveData(flow, hose, head, rod, rate)


def test_a_valve_opened_by_the_rod_pressure_is_found_on_data_that_nothing_was_fitted_to() -> None:
    laws = valve_laws(valve(True, 1), valve(True, 2))
    best, static = laws[0], next(law for law in laws if not law.opened_by)
    assert best.opened_by == "rod pressure"
    assert best.opening == pytest.approx(4.0e6, abs=4e5)
    assert best.held_out < 0.15 < 0.3 < static.held_out
    assert laws[-1].opened_by == FOLLOWS


def test_an_orifice_is_no_valve_that_something_opens() -> None:
    laws = valve_laws(valve(False, 1), valve(False, 2))
    static = next(law for law in laws if not law.opened_by)
    assert static.held_out < 0.01
    assert static.gains[3] == pytest.approx(2e-12, rel=0.01)


def test_the_load_holding_valve_that_a_machine_file_lacks_is_found() -> None:
    if not SHARED.is_dir():
        pytest.skip("no shared/recordings/strangers beside the project")
    machine = load_machine(SHARED / "stranger.yaml")
    chains = [chain_of_machine(load(SHARED / f"stranger_1_{part}"), machine) for part in "ab"]
    found = study(chains)
    assert all([link.name for link in chain.links if link.ratio > 1.0] == ["mechanics"] for chain in chains)
    assert found.best is not None and found.best.opened_by == "rod pressure"
    assert found.best.held_out < 0.3
    assert next(law for law in found.laws if not law.opened_by).held_out > 0.45


def test_the_chain_of_an_explained_file_stands_on_both_sides_of_the_valve_that_it_has_as_an_effect() -> None:
    """Hose and head side had been one volume there, and the flow into it was off by 13 times what the file leaves open."""
    if not SHARED.is_dir():
        pytest.skip("no shared/recordings/strangers beside the project")
    valve = {
        "p_set": 1.225e7,
        "R": 2.33,
        "gain": 5.4e-14,
        "G_max": 5.1e-7,
        "play": 2.9e5,
        "p_check": 4.3e4,
        "r_check": 8.4e8,
    }
    machine = load_machine(SHARED / "stranger.yaml").with_effects({"load_holding_valve": valve})
    recording = load(SHARED / "stranger_1_a")
    ratios = {link.name: link.ratio for link in chain_of_machine(recording, machine).links}
    assert ratios["head flow"] < 2.0 and ratios["rod flow"] < 1.0
    assert "holds the load" in first_look(recording, machine).no_levels


def test_a_rate_that_somebody_derived_and_filtered_breaks_no_kinematics() -> None:
    """A logger's filter of 30 ms broke the link at 5.1 times what noise and tolerances leave."""
    recording = load(BAGS / "healthy" / "extended")
    angle = recording.signals["angle"]
    step = float(np.median(np.diff(angle.time)))
    slope, lagging = np.gradient(angle.values, angle.time), np.zeros(len(angle.time))
    for k in range(1, len(slope)):
        lagging[k] = lagging[k - 1] + step / (0.03 + step) * (slope[k] - lagging[k - 1])
    recording.signals["rate"] = replace(angle, name="rate", unit="rad/s", values=lagging)
    chain = chain_of_machine(recording, TZ17)
    assert ("kinematics", "the recorded rate is derived from the angle, not measured") in chain.missing
    assert all(link.ratio < 1.0 for link in chain.links)
