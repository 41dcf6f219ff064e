"""`./boom chain`: output, document, report, and one plain line for every wrong input."""

import json
from pathlib import Path

import numpy as np
import pytest
from headless_browser import faults

from boom_bringup import cli
from boom_recording.recording import Configuration
from boom_recording.writing import from_columns, write

BAGS = Path(__file__).parents[1] / "bags"
LOAD = BAGS / "explained" / "payload_change_a"


@pytest.fixture
def chain(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BOOM_PROGRAM", "./boom")

    def run(*arguments):
        status = cli.main(["chain", *map(str, arguments)])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return run


def cylinder(path, head=True):
    """A piston [m] whose load is held by a valve that the rod pressure opens; no machine, no boom."""
    time = np.arange(0.0, 40.0, 0.01)
    speed = 0.05 * np.sin(0.6 * time)
    lowering = speed < 0
    rod = np.where(lowering, 3e6 - 6e7 * speed, 4e5)
    pressures = {"hose_pressure": np.where(lowering, 5e5, 8.2e6 + 2e7 * speed), "rod_pressure": rod}
    if head:
        pressures["head_pressure"] = np.full(len(time), 8e6)
    noise = np.random.default_rng(1)
    pressures = {
        name: p + 1e4 * noise.standard_normal(len(time)) for name, p in pressures.items()
    }  # else they count as stuck
    columns = {"angle": 0.3 + np.cumsum(speed) * 0.01, "rate": speed, **pressures}
    write(path, from_columns(path.name, time, columns, Configuration("", 0.0, 0.0, float("nan"))), joint="piston")
    return path


def test_the_broken_link_is_told_in_words_numbers_and_a_page(chain, tmp_path, browser):
    status, out, _ = chain(LOAD, "--json", "c.json", "--report", "c.html")
    assert status == 0
    assert out.startswith("payload_change_a: the chain breaks at the mechanics (")
    assert "a load was picked up, 26" in out
    document = json.loads((tmp_path / "c.json").read_text())
    ratios = {link["link"]: link["ratio"] for link in document["bags"][0]["links"]}
    assert max(ratios, key=ratios.get) == "mechanics"
    assert document["bags"][0]["checks"] == []
    assert faults(browser, tmp_path / "c.html") == []


def test_the_hydraulics_at_a_cylinder_are_examined_without_a_machine(chain, tmp_path):
    status, out, _ = chain(
        cylinder(tmp_path / "run"),
        "--areas",
        "0.0201",
        "0.0123",
        "--joint",
        "piston",
        "--no-report",
        "--json",
        "c.json",
    )
    assert status == 0
    assert "run: the hydraulics at the cylinder alone" in out
    assert "the valve at the cylinder is opened by the rod pressure from" in out
    opened_by = {law["opened_by"] for law in json.loads((tmp_path / "c.json").read_text())["valve"]["laws"]}
    assert opened_by >= {None, "rod pressure"}


def test_what_is_lost_of_a_cut_file_is_told_on_terminal_page_and_in_the_document(chain, tmp_path):
    file = next((BAGS / "healthy" / "extended").glob("*.mcap"))
    (tmp_path / "cut.mcap").write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    pose = ("--q3", "0.28", "--q4", "2.2", "--load", "0", "--machine", "tz17")
    status, out, _ = chain("cut.mcap", *pose, "--json", "c.json", "--report", "c.html")
    assert status == 0
    (said,) = json.loads((tmp_path / "c.json").read_text())["bags"][0]["warnings"]
    assert said.startswith("cut at ") and f"damaged file: {said}" in out
    page = (tmp_path / "c.html").read_text()
    assert f"<p class=warning>damaged file: {said}" in page and "--q3 0.28 --q4 2.2 --load 0.0" in page


@pytest.mark.parametrize("arguments, told", [
    ((LOAD, "--areas", "0.02", "0.01", "--q3", "0.2"), "--q3: with --areas there is no boom"),
    (("missing",), "missing"),
    ((LOAD, "--areas", "1", "ten"), "ten is not the area of a piston"),
    ((LOAD, "--areas", "0.02", "0.01", "--machine", "tz17"), "not allowed with"),
    ((LOAD, "--machine", "nothing"), "nothing: no such machine"),
    ((LOAD, "--areas", "0.02", "0.01", "--no-report"), "/boom/head_pressure are needed"),
])  # fmt: skip
def test_wrong_input_is_one_line_and_status_2(chain, arguments, told):
    status, _, err = chain(*arguments)
    assert status == 2
    assert told in err and err.count("\n") == 1


def test_a_recording_without_machine_is_told_what_to_give(chain, tmp_path):
    status, _, err = chain(cylinder(tmp_path / "run"))
    assert (status, err.count("\n")) == (2, 1)
