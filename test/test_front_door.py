"""Every command of the README by its name in a fresh clone, and every report that they write in a real browser.

The clone is what git has in the tree. Where CI=true it sets itself up; elsewhere it borrows the packages that are installed here,
for a set-up takes 40 s. HOME is empty, nothing of the developer's environment is there.
"""

from __future__ import annotations

import dataclasses
import json
import re
import threading
import zipfile
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from foreign_recordings import csv_german, data_of
from fresh_clone import ROOT, Clone, Running, children, ended_well
from headless_browser import Browser, faults
from mcap.reader import make_reader

from boom_bringup import cli, environment
from boom_can_bridge.codec import Codec
from boom_recording.loading import load
from boom_recording.writing import write
from boom_trials.robustness.plants import TRAJECTORIES

pytestmark = pytest.mark.process
TABLE = re.findall(r"^\| `\./boom ([a-z-]+)", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
BESIDE = [name for name in cli.command_names() if name not in TABLE]


def cut(source: str, target: Path, seconds: float) -> Path:
    """The beginning of a shipped recording as a bag of its own."""
    recording = load(ROOT / "bags" / source)
    signals = {}
    for name, signal in recording.signals.items():
        kept = signal.time < seconds
        columns = {key: getattr(signal, key)[kept] for key in ("stamps_ns", "time", "values", "valid")}
        signals[name] = dataclasses.replace(signal, **columns)
    target.parent.mkdir(parents=True, exist_ok=True)
    write(target, dataclasses.replace(recording, signals=signals))
    return target


class Door:
    """The clone, recordings for it, and what each command left: it runs once, whoever asks."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.clone = folder, Clone(folder)
        self.short = cut("healthy/extended", folder / "short", 8.0)
        self._left: dict[Callable[[Door], list[Path]], list[Path] | BaseException] = {}

    def __call__(self, name: str) -> list[Path]:
        """Run a command's case, unless it has been run; the reports that it wrote."""
        case = CASES[name]
        if case not in self._left:
            try:
                self._left[case] = case(self)
            except BaseException as error:
                self._left[case] = error
        left = self._left[case]
        if isinstance(left, BaseException):
            raise left
        return left

    @property
    def boom(self) -> Callable[..., str]:
        return self.clone.run


@pytest.fixture(scope="module")
def door(tmp_path_factory: pytest.TempPathFactory) -> Door:
    return Door(tmp_path_factory.mktemp("door"))


def _demo(door: Door) -> list[Path]:
    """The whole demo as a newcomer starts it: one minute of recording, six processes, then the closed loop, all on the loopback."""
    process = door.clone.begin("demo", "--json", "demo.json")
    sockets: dict[int, set[environment.BoundSocket]] = {}
    ended = threading.Event()

    def look() -> None:
        while not ended.wait(0.1):
            for pid in children(process.pid):
                sockets.setdefault(pid, set()).update(environment.bound_sockets(pid))

    looker = threading.Thread(target=look)
    looker.start()
    try:
        out = ended_well(process)
    finally:
        ended.set()
        looker.join()
    assert len([found for found in sockets.values() if found]) >= 6
    assert environment.off_loopback(set().union(*sockets.values())) == []
    assert "no socket outside the loopback" in out
    assert "extended: agrees within sensor noise" in out
    (bag,) = json.loads((door.clone.path / "demo.json").read_text())["bags"]
    assert bag["full"]["angle_mae_rad"] < 1e-3
    for name in ("simulated", "closed_loop"):
        folder = door.clone.path / "output/demo" / name
        assert {file.name for file in folder.iterdir()} == {"metadata.yaml", f"{name}_0.mcap"}
        assert f"- {name}_0.mcap\n" in (folder / "metadata.yaml").read_text()
    simulated = load(door.clone.path / "output/demo/simulated")
    assert (simulated.events, simulated.warnings) == ([], [])
    assert simulated.duration == pytest.approx(60.0, abs=0.05)
    return [door.clone.path / "output/demo/report.html"]


def _validate(door: Door) -> list[Path]:
    said = door.boom("validate", door.short, "bags/damaged/gap_in_motion", "--report", "validation.html")
    assert "short: agrees within sensor noise" in said and "gap_in_motion: agrees" in said
    return [door.clone.path / "validation.html"]


def _chain(door: Door) -> list[Path]:
    assert "no link breaks" in door.boom("chain", door.short, "--report", "chain.html")
    return [door.clone.path / "chain.html"]


def _diagnose(door: Door) -> list[Path]:
    """The README's command, and a healthy recording."""
    explained = [f"bags/explained/hose_burst_valve_lag_{name}" for name in ("b", "a")]
    healthy = cut("healthy/extended", door.folder / "no_mismatch", 8.0)
    reports = []
    for verdict, words in {
        "identified": (explained[0], "--hold-out", explained[1]), "no_mismatch": (healthy,)
    }.items():  # fmt: skip
        door.boom("diagnose", *words, "--output", verdict)
        folder = door.clone.path / verdict
        assert json.loads((folder / "diagnosis.json").read_text())["verdict"] == verdict
        reports.append(folder / "report.html")
    return reports


def _identify(door: Door) -> list[Path]:
    door.boom("simulate", "--campaign", "pilot", "--output", "pilot")
    bags = [f"pilot/{name}" for name in ("extend_ramp", "extend_general_1")]
    assert "pilot_valves.a1_s" in door.boom("identify", *bags, "--report", "pilot.html")
    bag = cut("healthy/folded_fast", door.folder / "fast", 20.0)
    words = ("--parameters", "friction.tau_C_pos", "--report", "cylinder.html", "--output", "found.yaml")
    assert "friction.tau_C_pos" in door.boom("identify", bag, *words)
    door.boom("validate", bag, "--machine", "found.yaml", "--no-report")
    return [door.clone.path / "pilot.html", door.clone.path / "cylinder.html"]


def _simulate(door: Door) -> list[Path]:
    door.boom("simulate", door.short, "--output", "simulated")
    assert load(door.clone.path / "simulated").duration == pytest.approx(8.0, abs=0.05)
    return []


def _robustness(door: Door) -> list[Path]:
    for bag in (bag for group in TRAJECTORIES.values() for bag in group):
        cut(bag, door.folder / "bags" / bag, 5.0)
    words = ("--bags", door.folder / "bags", "--modes", "improved", "--stability-map")
    assert "C4" in door.boom("robustness", *words)
    return [door.clone.path / "output/robustness.html"]


def _live(door: Door) -> list[Path]:
    """The commands that run until they are stopped, together: crane, watch, recorder, and a replay that moves the crane."""
    names = {
        "sim": [],
        "watch": [],
        "record": ["recorded", "--topic", "*"],
        "replay": [door.short, "--loop", "--wait-for-recorder"],
    }
    live = dict[str, Running]()
    try:
        for name, words in names.items():
            live[name] = Running(door.clone.begin(name, *words))
            if name == "watch":
                live[name].says("watching tz17")  # on a busy machine it is there after eight seconds
        live["replay"].says("replayed 5 of 8 s")
        statuses = {name: live[name].stop() for name in ("replay", "record", "watch", "sim")}
        assert statuses == dict.fromkeys(statuses, 0), {name: each.lines for name, each in live.items()}
    finally:
        for each in live.values():
            each.process.kill()
    bag = door.clone.path / "recorded"
    recording = load(bag)
    assert recording.signals["extend_current_command"].values.max() > 0.3
    assert max(recording.signals["angle"].values) - min(recording.signals["angle"].values) > 0.05
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        said = [message.data for _, _, message in make_reader(stream).iter_messages(topics=["/diagnostics"])]
    assert any(b"tolerance of the model" in data or b"finds the state" in data for data in said)
    return []


def _import(door: Door) -> list[Path]:
    folder = door.folder / "laboratory"
    folder.mkdir()
    (table,) = csv_german(data_of(cut("healthy/extended", door.folder / "first", 25.0)), folder)
    said = door.boom("import", table, "--yes", "--q3", "0.28", "--q4", "2.2", "--load", "0", "--output", "table")
    assert "./boom validate table --machine FILE" in said
    assert "table: agrees within sensor noise" in door.boom("validate", "table", "--machine", "tz17", "--no-report")
    return [door.clone.path / "output/import-Messung_03.csv.html"]


def _import_can(door: Door) -> list[Path]:
    codec, log = Codec.load("tz17"), door.folder / "log.blf"
    values = {"angle": 0.3, "rate": 0.1, "hose_pressure": 9e6, "rod_pressure": 1e6, "retract_current": 0.0, "extend_current": 0.3,
              "mode": 2, "faults": 0, "enable": 1}  # fmt: skip
    with can.Logger(log) as file:
        for k in range(200):
            for name, frame in codec.frames.items():
                identifier, data = codec.encode(name, values | {"uptime_s": 0.01 * k}, k)
                stamp = 1_790_000_000 + 0.01 * k
                file(
                    can.Message(timestamp=stamp, arbitration_id=identifier, is_extended_id=frame.is_extended, data=data)
                )
    assert "./boom validate imported" in door.boom("import-can", log, "--output", "imported")
    assert load(door.clone.path / "imported").duration == pytest.approx(1.99, abs=0.02)
    return []


def _prove(door: Door) -> list[Path]:
    said = door.boom("prove", "--seed", "1", "--cases", "1", "--output", "trial")
    assert "1 answers are sealed" in said
    return [door.clone.path / "trial/report.html"]


def _test(door: Door) -> list[Path]:
    assert re.search(r"lint +ok", door.boom("test", "--only", "lint"))
    return []


def _check_machine(door: Door) -> list[Path]:
    door.boom("check-machine", "src/boom_model/boom_model/machines/tz17.yaml")
    return []


def _new_machine(door: Door) -> list[Path]:
    lengths = ("--foot-distance", "1.32", "--eye-distance", "0.61", "--closed-length", "0.905", "--stroke", "0.62")
    cylinder = ("--lowest-angle", "-21.6", "--piston-diameter", "80", "--rod-diameter", "45", "--pump-pressure", "165")
    valve = ("--opening-current", "0.1", "--full-current", "1", "--lift-flow", "26", "--lower-flow", "22")
    words = (*lengths, *cylinder, *valve, "--inner-mass", "300", "--inner-length", "2.2", "--no-manoeuvre")
    door.boom("new-machine", *words, "--output", "own.yaml")
    assert "80.0 mm, 45.0 mm" in door.boom("check-machine", "own.yaml")
    return []


def _view(door: Door) -> list[Path]:
    door.boom("view", door.short, "--output", "crane.html")
    assert "id=replay" in (door.clone.path / "crane.html").read_text("utf-8")  # looked at in test_view_command
    return []


def _fleet(door: Door) -> list[Path]:
    cut("healthy/extended", door.folder / "fleet" / "monday", 8.0)
    door.boom("fleet", door.folder / "fleet", "--output", "fleet", "--no-diagnosis")
    pages = list((door.clone.path / "fleet").glob("*.html"))
    assert pages and list((door.clone.path / "fleet").rglob("*.parquet"))
    return pages


def _export_fmu(door: Door) -> list[Path]:
    door.boom("export-fmu", "--output", "tz17.fmu")
    assert zipfile.ZipFile(door.clone.path / "tz17.fmu").testzip() is None
    return []


def _setup(door: Door) -> list[Path]:
    assert "is set up" in door.boom("setup")
    return []


def _python(door: Door) -> list[Path]:
    where = door.boom("python", "-c", "import rclpy, boom_model, boom_interfaces.msg; print(boom_model.__file__)")
    assert Path(where.strip()).is_relative_to(door.clone.path)
    return []


REPORTING = [
    name
    for name in TABLE
    if name in ("demo", "validate", "chain", "diagnose", "identify", "robustness", "prove", "import", "fleet")
]
CASES: dict[str, Callable[[Door], list[Path]]] = {
    "demo": _demo, "validate": _validate, "chain": _chain, "diagnose": _diagnose, "identify": _identify, "simulate": _simulate,
    "robustness": _robustness, "sim": _live, "watch": _live, "record": _live, "replay": _live,
    "import": _import, "import-can": _import_can,
    "view": _view, "fleet": _fleet, "prove": _prove, "test": _test, "check-machine": _check_machine, "new-machine": _new_machine,
    "export-fmu": _export_fmu, "setup": _setup, "python": _python,
}  # fmt: skip


@pytest.mark.parametrize("name", [*BESIDE, *TABLE])
def test_the_command_does_its_work_in_a_fresh_clone(door: Door, name: str) -> None:
    door(name)


@pytest.mark.parametrize("name", REPORTING)
def test_its_reports_are_drawn_fit_a_phone_and_can_be_printed(door: Door, browser: Browser, name: str) -> None:
    for report in door(name):
        assert faults(browser, report) == []
