"""./boom export-fmu: what FMPy, an independent importer, checks, builds and simulates is what ./boom simulate gives."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
import yaml
from fmpy.build import build_platform_binary
from fmpy.fmi3 import FMU3Slave
from fmpy.model_description import read_model_description
from fmpy.validation import validate_fmu

from boom_bringup import cli
from boom_model.machine_file import load_machine
from boom_recording.loading import load

OUTPUTS = ("angle", "rate", "hose_pressure", "rod_pressure")
PERIOD = 0.01
POSE = ("--q3", "0.28", "--q4", "2.8", "--load", "300", "--angle", "0.2")


def boom(*words: str) -> None:
    assert cli.main(list(words)) == 0


@pytest.fixture(scope="module")
def explained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine file with effects, with states and dead times among them, and a learnt term with memory."""
    document = dict(load_machine("tz17").document)
    document["effects"] = {
        "hose_burst_valve_lag": {"tau": 0.09}, "accumulator_heat_loss": {"inverse_tau": 0.1}, "command_delay": {"T": 0.0237},
        "pressure_delay": {"T": 0.0153}, "payload_change": {"mass": 150.0, "t_g": 20.0}, "angle_offset": {"b": 0.002},
    }  # fmt: skip
    document["learned"] = [
        {"equation": "torque", "basis": ["minus(angle, 0.3)", "lag(rate, 0.3)"], "coefficients": [3.0, -0.4],
         "unit": "10000 N m", "validity": {"angle": [0.0, 0.8], "rate": [-0.3, 0.3]}},
    ]  # fmt: skip
    path = tmp_path_factory.mktemp("machine") / "explained.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def currents() -> np.ndarray:
    """60 s at 100 Hz (time, retract, extend): lifting and lowering at many speeds."""
    t = np.arange(0.0, 60.0, PERIOD).round(2)
    wanted = np.sin(0.2 * np.pi * t) + 0.3 * np.sin(0.74 * np.pi * t)
    current = np.where(np.abs(wanted) > 0.2, 0.3 + 0.12 * np.abs(wanted), 0.0)
    return np.column_stack((t, np.where(wanted < 0, current, 0.0), np.where(wanted > 0, current, 0.0)))


def simulated(fmu: Path, currents: np.ndarray, step: float, **more: Any) -> np.ndarray:
    """Outputs every 10 ms by FMPy at a fixed communication step."""
    finer = round(PERIOD / step)
    held = np.zeros(len(currents) * finer, [("time", float), ("retract_current", float), ("extend_current", float)])
    held["time"] = np.arange(len(held)) * step
    for k, name in enumerate(("retract_current", "extend_current"), start=1):
        held[name] = np.repeat(currents[:, k], finer)
    end = len(currents) * PERIOD
    result = fmpy.simulate_fmu(str(fmu), stop_time=end, step_size=step, output_interval=step, input=held, **more)
    return np.column_stack([result[name] for name in OUTPUTS])[::finer]


@pytest.fixture(scope="module")
def exported(explained: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The explained machine for both versions of FMI."""
    paths = {version: tmp_path_factory.mktemp("explained") / f"fmi{version}.fmu" for version in (2, 3)}
    for version, path in paths.items():
        boom("export-fmu", "--machine", str(explained), *POSE, "--fmi", str(version), "--output", str(path))
    return paths


def test_an_explained_machine_as_fmu_gives_what_simulate_gives_at_three_steps(
    explained: Path, exported: dict[int, Path], currents: np.ndarray, tmp_path: Path
) -> None:
    np.savetxt(tmp_path / "steps.csv", currents, "%.17g", ",", header="time_s,retract_a,extend_a", comments="")
    words = ("--machine", str(explained), *POSE, "--sensors", "ideal", "--output", str(tmp_path / "own"))
    boom("simulate", str(tmp_path / "steps.csv"), *words)
    own = load(tmp_path / "own").signals
    wanted = np.column_stack([own[name].values for name in OUTPUTS])
    size = np.ptp(wanted, axis=0)
    assert np.all(size > [0.1, 0.1, 5e5, 5e5])
    for version, fmu in exported.items():
        assert validate_fmu(str(fmu)) == []
        driven = currents if version == 3 else currents[:1500]
        for step in (0.01, 0.005, 0.001) if version == 3 else (0.01,):
            made = simulated(fmu, driven, step)
            assert len(made) == len(driven) + 1
            assert np.all(np.abs(made - wanted[: len(made)]).max(axis=0) < 1e-6 * size), (version, step)


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped loader crane, with its load-holding valve, and with the supply pressure as an input."""
    path = tmp_path_factory.mktemp("fmu") / "crane.fmu"
    boom(
        "export-fmu", "--machine", "loader_crane", "--input", "supply_pressure", "--angle", "0.5", "--output", str(path)
    )
    return path


def test_every_variable_says_what_an_importer_asks(crane: Path) -> None:
    description = read_model_description(str(crane))
    rows = {row.name: row for row in description.modelVariables}
    assert {name for name, row in rows.items() if row.causality == "input"} == {
        "retract_current", "extend_current", "supply_pressure",
    }  # fmt: skip
    assert tuple(name for name, row in rows.items() if row.causality == "output") == OUTPUTS
    assert all(row.description for row in rows.values())
    beta = load_machine("loader_crane").parameters["fluid.beta"]
    row = rows["fluid.beta"]
    assert (float(row.start), row.unit, row.variability) == (beta.value[0], "Pa", "tunable")
    assert float(row.min) == beta.specification.minimum
    assert rows["start.angle"].variability == "fixed"
    assert rows["pose.tip[1]"].unit == "m"


def test_a_supply_that_is_not_connected_leaves_the_machine_as_its_file_has_it(
    currents: np.ndarray, tmp_path: Path
) -> None:
    outputs = []
    for given in ((), ("--input", "supply_pressure", "--input", "tank_pressure")):
        path = tmp_path / f"inputs{len(given)}.fmu"
        boom("export-fmu", *given, "--output", str(path))
        outputs.append(simulated(path, currents[:1000], PERIOD))
    assert np.ptp(outputs[0][:, 0]) > 0.1
    assert (np.abs(outputs[0] - outputs[1]).max(axis=0) < 1e-5 * np.ptp(outputs[0], axis=0)).all()


def test_an_fmu_refuses_in_one_sentence_what_the_machine_cannot_be_and_returns_to_a_kept_state(crane: Path) -> None:
    said: list[str] = []
    description = read_model_description(str(crane))
    number = {row.name: row.valueReference for row in description.modelVariables}
    folder = str(fmpy.extract(str(crane)))
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="i",
    )
    fmu.instantiate(
        loggingOn=True, logMessage=lambda _environment, _status, _category, message: said.append(message.decode())
    )

    def refused(name: str, value: float, words: str) -> None:
        with pytest.raises(Exception, match="error"):
            fmu.setFloat64([number[name]], [value])
        assert words in said[-1]

    fmu.enterInitializationMode(startTime=3.0)
    refused("fluid.beta", -1.0, "fluid.beta: -1 is outside")
    refused("angle", 0.0, "neither an input nor a parameter")
    fmu.setFloat64([number["pose.load"]], [400.0])
    fmu.exitInitializationMode()
    refused("start.angle", 0.1, "start.angle is fixed")
    fmu.setFloat64([number["extend_current"]], [0.45])

    def angle_after(begin: float, steps: int) -> float:
        for k in range(steps):
            fmu.doStep(begin + 0.01 * k, 0.01)
        return float(fmu.getFloat64([number["angle"]])[0])

    angle_after(3.0, 50)
    kept = fmu.getFMUState()
    first = angle_after(3.5, 50)
    fmu.setFMUState(kept)
    assert angle_after(3.5, 50) == first
    fmu.setFMUState(kept)
    fmu.setFloat64([number["pose.load"]], [0.0])  # set down during the run
    assert angle_after(3.5, 50) > first
    with pytest.raises(Exception, match="error"):
        fmu.doStep(1.0, 0.01)
    assert "has to go on from 4 s" in said[-1]
    fmu.freeFMUState(kept)
    fmu.terminate()
    fmu.freeInstance()


def test_the_source_inside_is_complete_and_has_the_functions_of_the_standard(
    exported: dict[int, Path], tmp_path: Path
) -> None:
    headers = Path(fmpy.__file__).parent / "c-code"
    for version, path in exported.items():
        folder = tmp_path / str(version)
        zipfile.ZipFile(path).extractall(folder)
        strict = [
            "gcc",
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-Wno-unused-parameter",
            "-fsyntax-only",
        ]
        given = ["-include", str(headers / f"fmi{version}Functions.h"), str(folder / "sources/boom.c")]
        assert subprocess.run([*strict, *given], check=False, capture_output=True, text=True).stderr == ""
    library = next((tmp_path / "3/binaries").rglob("*.so"))
    needed = subprocess.run(["readelf", "-d", str(library)], check=True, capture_output=True, text=True).stdout
    wants = {line.split("[")[1].split("]")[0].split(".so")[0] for line in needed.splitlines() if "(NEEDED)" in line}
    assert wants <= {"libm", "libc", "ld-linux-x86-64"}
    before = simulated(exported[3], np.zeros((20, 3)), 0.01)
    library.unlink()
    build_platform_binary(tmp_path / "3")
    assert np.allclose(simulated(tmp_path / "3", np.zeros((20, 3)), 0.01), before, rtol=1e-9)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--output", "crane.slx"), "ends with .fmu"),
        (("--angle", "9"), "outside the stroke"),
        (("--machine", "stranger.yaml"), "stranger.yaml"),
        (("--effect", "piston_leakage.size=1"), "no such parameter"),
        (("--load", "-3"), "-3"),
    ],
)
def test_what_cannot_be_exported_is_said_in_one_line(
    words: tuple[str, ...],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["export-fmu", "--output", "crane.fmu", *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
