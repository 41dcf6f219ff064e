"""./boom view in a browser: a recording as a file, and the page that is opened before, during and after a simulation."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headless_browser import _LOOK, Browser

from boom_bringup import cli
from boom_bringup.node_command import node_command
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_recording.writing import write
from boom_view.recorded import series

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 90
LAG = ROOT / "bags/explained/hose_burst_valve_lag_b"
EVIL = "<img src=x onerror=alert(1)>"


def until(browser: Browser, condition: str) -> Any:
    """What a condition of the page gives once it is true."""
    look = f"(() => {{ try {{ return {condition}; }} catch (_) {{ return false; }} }})()"
    script = f"""new Promise((done) => {{ const end = performance.now() + {PATIENCE}e3;
      const look = () => {{ const v = {look}; v || performance.now() > end ? done(v) : setTimeout(look, 30); }}; look(); }})"""
    for _ in range(PATIENCE // 20):  # the pipe to the browser has a patience of its own
        found = browser.value(script.replace(f"{PATIENCE}e3", "20e3"))
        if found:
            return found
    raise AssertionError(f"{condition}: {browser.value('document.body.innerText')[:600]}")


def test_a_recording_moves_in_one_file_beside_the_model_and_fits_a_phone(tmp_path: Path, browser: Browser) -> None:
    page = tmp_path / "crane.html"
    assert cli.main(["view", str(LAG), "--from", "10", "--to", "20", "--output", str(page)]) == 0
    assert page.stat().st_size < 1e6
    for width in (1300, 400):
        browser.open(page, width)
        # the ghost has been drawn, time goes on, and the model of a machine without the lag parts from this one
        until(
            browser,
            "view.player.state.t > 0.1 && document.querySelector('[data-view=said]').textContent.includes('model')",
        )
        assert browser.value("document.querySelector('[data-view=no-webgl]').hidden")
        assert browser.value("document.querySelectorAll('[data-view=marks] i').length") > 0
        browser.value("view.player.seek(document.querySelector('[data-view=time]').max / 2)")
        until(browser, "document.querySelector('[data-value=hose]').textContent.endsWith(' bar')")
        assert browser.value(_LOOK)["out"] == [] and browser.complaints() == []


def test_a_recording_at_20_hz_without_gyro_and_rod_pressure_is_shown(tmp_path: Path) -> None:
    recording = load(LAG)
    parts = ("stamps_ns", "time", "values", "valid")
    recording.signals = {
        name: replace(signal, **{part: getattr(signal, part)[::5] for part in parts})
        for name, signal in recording.signals.items()
        if name not in ("rate", "rod_pressure")
    }
    write(tmp_path / "slow", recording)
    page = tmp_path / "crane.html"
    assert cli.main(["view", str(tmp_path / "slow"), "--to", "10", "--output", str(page)]) == 0
    shown = series(load(tmp_path / "slow"), load_machine("tz17"), 0.0, 10.0)
    assert shown.period == 0.05
    assert np.isfinite(shown.measured["angle"]).mean() > 0.95 and not np.isfinite(shown.measured["rod_pressure"]).any()


def test_the_page_of_a_cut_recording_says_what_is_lost(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = next(LAG.glob("*.mcap")).read_bytes()
    bag, page = tmp_path / "cut.mcap", tmp_path / "crane.html"
    bag.write_bytes(content[: len(content) // 2])
    assert cli.main(["view", str(bag), "--to", "2", "--output", str(page)]) == 0
    said = capsys.readouterr().out.splitlines()[0]
    assert said.startswith("damaged file: cut at") and said in page.read_text()


def test_a_hostile_name_of_a_recording_is_shown_as_text(tmp_path: Path, browser: Browser) -> None:
    recording = load(LAG)
    bag = tmp_path / EVIL
    write(bag, recording)
    page = tmp_path / "crane.html"
    assert cli.main(["view", str(bag), "--to", "2", "--output", str(page)]) == 0
    browser.open(page, 1300)
    until(browser, "view.player.state.t > 0")
    assert EVIL in browser.value("document.querySelector('h1').textContent")
    assert browser.value("document.querySelectorAll('img').length") == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["no/such/bag"], "no/such/bag"),
        ([str(LAG), "--from", "500"], "give a stretch inside it"),
        (["--output", "crane.html"], "give its BAG"),
        (["--q3", "0.2"], "give both --q3 and --q4"),
        ([str(LAG), "--port", "99999"], "is not a port"),
    ],
)
def test_wrong_input_is_told_in_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["view", *words]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert said in error[-1]


# When the curves of a live page are drawn: six times, each with samples that the one before had not.
CURVES = """new Promise((done) => {
  const drawn = [], sizes = [];
  (function look() {
    const at = view.player.state.curves;
    if (at !== drawn[drawn.length - 1]) { drawn.push(at); sizes.push(view.data.time.length); }
    if (drawn.length < 6) requestAnimationFrame(look); else done(sizes.every((n, k) => !k || n > sizes[k - 1]) ? drawn : []);
  })();
})"""


@contextmanager
def process(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    started = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=dict(os.environ)
    )
    try:
        yield started
    finally:
        started.send_signal(signal.SIGINT)
        assert started.wait(PATIENCE) in (0, 130)


@pytest.mark.process
def test_a_page_opened_before_during_and_after_a_simulation_shows_it(browser: Browser) -> None:
    with process(node_command("boom_view.view_node", {"port": 0})) as view:
        assert view.stdout is not None
        address = view.stdout.readline().removeprefix("page: ").split()[0]
        assert address.startswith("http://127.0.0.1:")
        browser.open(address, 1300)
        until(browser, "document.getElementById('state').textContent.startsWith('Waiting for the machine')")
        with process(
            node_command(
                "boom_sim.simulation_node",
                {"machine": "loader_crane", "outer_boom_angle": 0.3, "telescope_length": 2.0},
            )
        ):
            until(browser, "view.data.models[0].values.angle.some(Number.isFinite)")  # before: the model follows
            assert (
                browser.value("document.querySelector('[data-view=scheme]').textContent").count("load-holding valve")
                > 0
            )
            browser.open(address, 1300)  # during
            until(browser, "view.player.state.t !== null && view.data.time.length > 50")
            drawn = browser.value(CURVES)
            assert min(b - a for a, b in pairwise(drawn)) >= 100  # ms: thirty batches a second are drawn ten times
        until(browser, "document.getElementById('state').textContent.startsWith('No angle for')")
        browser.open(address, 1300)  # after
        assert until(browser, "view.data.time.length") > 50
        assert browser.complaints() == []
