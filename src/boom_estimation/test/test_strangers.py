"""Cranes of another make, from the shared recordings: what their file leaves out, written into it, explains them."""

from __future__ import annotations

from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boom_estimation.free_run import predict
from boom_input.yaml_text import read_yaml
from boom_model.machine_file import machine_from
from boom_recording.loading import load
from boom_recording.measurement import measurements

STRANGERS = Path(__file__).resolve().parents[4] / "shared" / "recordings" / "strangers"
pytestmark = pytest.mark.skipif(not STRANGERS.exists(), reason="no shared/recordings/strangers beside the project")

BAR, LPM = 1e5, 1 / 60_000
EDGES = {"sa": (0.108, 13.8), "tb": (0.092, 12.1), "sb": (0.101, 10.4), "ta": (0.095, 11.9)}
"""Overlap, and gain [(l/min)/sqrt(bar)] per full stroke, of each edge."""
LOAD_HOLDING_VALVE = {
    "p_set": (132 * BAR, "Pa"), "R": (2.6, "-"), "gain": (0.10 * LPM / BAR**1.5, "m^3/s/Pa^1.5"),
    "G_max": (10 * LPM / BAR**0.5, "m^3/s/Pa^0.5"), "play": (2.5 * BAR, "Pa"), "p_check": (1.2 * BAR, "Pa"),
    "r_check": (0.14 * BAR / LPM, "Pa s/m^3"),
}  # fmt: skip


def number(value: float, unit: str) -> dict[str, Any]:
    return {"value": value, "unit": unit}


def believed() -> dict[str, Any]:
    document: dict[str, Any] = read_yaml(STRANGERS / "stranger.yaml")
    return document


def with_numbers(document: dict[str, Any]) -> dict[str, Any]:
    """The file with the numbers that were told to be wrong in it, in the forms that these need."""
    fluid, cylinder, spool = document["fluid"], document["cylinder"], document["main_valve_spool"]
    hole = 0.65 * sqrt(2 / 870)
    edges: dict[str, Any] = {"n": number(1.0, "-"), "x_n": number(0.0, "-")}
    for edge, (overlap, gain) in EDGES.items():
        edges[f"x0_{edge}"] = number(overlap, "-")
        edges[f"A_{edge}_max"] = number(gain * (1 - overlap) * LPM / sqrt(BAR) / hole, "m^2")
    old = document["main_valve_orifices"]
    seals = {"F_C_pos": (430.0, "N"), "F_C_neg": (430.0, "N"), "d_pos": (1800.0, "N s/m"), "d_neg": (1800.0, "N s/m"),
             "sigma_p": (1.65e-3, "m/s")}  # fmt: skip
    return document | {
        "fluid": fluid | {"beta": number(1.12e9, "Pa")},
        "cylinder": cylinder | {"V_h": number(0.52e-3, "m^3")},
        "main_valve_spool": spool | {"T_s": number(1 / 38, "s")},
        "main_valve_orifices": edges
        | {"type": "four_edges", "compensator": False, "anti_cavitation": old["anti_cavitation"]},
        "friction": {"type": "cylinder"} | {name: number(*value) for name, value in seals.items()},
    }


def with_valve(document: dict[str, Any]) -> dict[str, Any]:
    valve = {name: number(*value) for name, value in LOAD_HOLDING_VALVE.items()}
    return document | {"hose_burst_valve": {"type": "pilot_opened"} | valve}


def pressures(bag: str, document: dict[str, Any]) -> tuple[float, float]:
    """Errors of the free run over the standard deviation of what was measured: hose and rod pressure."""
    recording = load(STRANGERS / bag)
    run = predict(recording, machine_from(document), "full")
    result = []
    for name in ("hose_pressure", "rod_pressure"):
        error = run.metrics[f"{name}_rmse_pa"]
        assert error is not None
        result.append(error / float(np.std(recording.signals[name].values)))
    return result[0], result[1]


@pytest.mark.parametrize("bag", ["stranger_5_a", "stranger_5_b"])
def test_crane_with_wrong_numbers_is_reproduced_with_the_right_ones(bag: str) -> None:
    assert max(pressures(bag, with_numbers(believed()))) < 0.02 < 0.4 < max(pressures(bag, believed()))


@pytest.mark.parametrize("bag", ["stranger_1_a", "stranger_1_b"])
def test_load_holding_valve_explains_what_numbers_alone_do_not(bag: str) -> None:
    numbers_only, both = with_numbers(believed()), with_valve(with_numbers(believed()))
    hose, rod = pressures(bag, numbers_only)
    assert max(pressures(bag, both)) < 0.06
    assert hose > 0.2 and rod > 0.05


def test_their_rate_is_the_derivative_of_their_angle() -> None:
    found = measurements(load(STRANGERS / "stranger_1_a"))
    assert found["rate"].derived_from == "angle"
    assert [found[n].quantum for n in ("angle", "hose_pressure")] == pytest.approx([1e-4, 1200.0])
