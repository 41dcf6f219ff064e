"""All numbers within their tolerances from recordings of a crane that is far from its file."""

from functools import cache

import numpy as np
import pytest

from boom_diagnosis.tolerance_fit import fit_tolerances
from boom_identification.refine import Refinement, refine
from boom_model.machine import Machine
from boom_model.machine_file import load_machine, machine_from
from boom_model.plant import Plant
from boom_recording.recording import Configuration, Recording
from boom_recording.writing import from_columns

POSE = (0.30, 2.0, 0.0)
TRUE = {
    "friction.tau_C_pos": 6000.0, "friction.tau_C_neg": 5500.0, "fluid.beta": 0.98e9, "main_valve_spool.T_s": 0.05,
    "main_valve_orifices.A_sa_max": 1.4e-5, "main_valve_orifices.A_sb_max": 7e-6, "main_valve_orifices.passage": 0.5,
}  # fmt: skip


def believed() -> Machine:
    """A crane whose owner guesses areas, overlap, lag, oil and friction, and has measured how far a current opens the valve.

    A lag beyond its tolerance would be made up for by the form of the edges, which has one where areas are guessed.
    """
    document = dict(load_machine("triangle_direct").document)
    guessed = ("A_sa_max", "A_tb_max", "A_sb_max", "x0")
    valve = document["main_valve_orifices"]
    document["main_valve_orifices"] = valve | {k: valve[k] | {"conf": "low"} for k in guessed}
    spool = document["main_valve_spool"]
    document["main_valve_spool"] = spool | {
        "K_i": spool["K_i"] | {"tol": 0.01}, "T_s": spool["T_s"] | {"conf": "low"},
    }  # fmt: skip
    document["fluid"] = document["fluid"] | {"beta": document["fluid"]["beta"] | {"conf": "low"}}
    return machine_from(document)


def recorded(machine: Machine, seconds: float = 32.0) -> Recording:
    """Lifts and lowerings of random size, with the sensors' noise."""
    rng = np.random.default_rng(1)
    time = np.arange(round(seconds / 0.01)) * 0.01
    currents, at, up = np.zeros((len(time), 2)), 1.2, True
    while at < seconds - 1.5:
        currents[(time >= at) & (time < at + 1.2), 1 if up else 0] = rng.uniform(0.2, 0.48)
        at, up = at + rng.uniform(1.8, 2.6), not up
    currents = np.column_stack([np.convolve(column, np.ones(30) / 30)[: len(time)] for column in currents.T])
    plant = Plant(machine, machine.pose(*POSE), "full")
    outputs = plant.run(time, currents, time, plant.equilibrium(0.3, 1e6)).outputs
    seen, shown = machine.sensor_noise().outputs(outputs, rng), machine.sensor_noise().currents(currents, rng)
    names = ("angle", "rate", "hose_pressure", "rod_pressure")
    columns = {name: seen[:, i] for i, name in enumerate(names)}
    columns |= {"retract_current": shown[:, 0], "extend_current": shown[:, 1]}
    return from_columns("made", time, columns, Configuration("triangle_direct", *POSE))


@cache
def found() -> Refinement:
    machine = believed()
    return fit_tolerances([recorded(machine.with_values(TRUE))], machine, lambda _: None)


def test_a_machine_far_from_its_file_is_found_where_a_search_near_the_file_ends_nowhere() -> None:
    machine = believed()
    near = refine([recorded(machine.with_values(TRUE))], machine)
    assert not near.explains
    assert found().explains and found().errs < 0.5 * near.errs
    before, after = found().held_out[0].before, found().held_out[0].after
    assert all(after[channel] < 0.1 * before[channel] for channel in ("angle", "hose_pressure", "rod_pressure"))


@pytest.mark.parametrize("key", TRUE)
def test_numbers_are_found_with_intervals(key: str) -> None:
    estimate = next(e for e in found().estimates if e.key == key)
    assert estimate.value == pytest.approx(TRUE[key], rel=0.1)
    low, high = estimate.interval_90
    assert low < estimate.value < high < 1.2 * estimate.value


def test_a_boom_at_rest_tells_nothing() -> None:
    machine = believed()
    still = recorded(machine.with_values(TRUE), 2.0)
    assert fit_tolerances([still], machine, lambda _: None).estimates == ()
