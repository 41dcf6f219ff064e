"""A recording with supply pressure drives the model with it."""

from __future__ import annotations

import numpy as np
import pytest

from boom_estimation.currents import driven, held_inputs
from boom_estimation.experiment import prepare
from boom_estimation.free_run import predict
from boom_model.machine_file import load_machine
from boom_recording.recording import Configuration, Recording
from boom_recording.writing import from_columns
from boom_sim.offline import simulate
from boom_sim.simulated_crane import CraneStart

LOW = 1.7e7
CONFIGURATION = Configuration("loader_crane", 0.3, 2.0, 200.0)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Of a crane whose supply is 170 bar, which its file does not know, with the supply pressure measured."""
    machine = load_machine("loader_crane").with_values({"fluid.p_s": LOW})
    time = np.arange(0.0, 8.0, 0.01)
    currents = np.zeros((len(time), 2))
    currents[(time > 1.5) & (time < 4), 1], currents[time > 5, 0] = 0.4, 0.4
    made = simulate(
        machine, CONFIGURATION, CraneStart(angle=0.1), time, currents, noise=machine.sensor_noise(), name="low"
    )
    supply = np.full(len(time), LOW)
    supply[300:310] = np.nan
    made.signals |= from_columns("low", time, {"supply_pressure": supply}, CONFIGURATION).signals
    return made


def test_measured_supply_takes_the_place_of_the_files(recording: Recording) -> None:
    machine = load_machine("loader_crane")
    bare = Recording("low", recording.path, recording.start_ns, recording.duration, dict(recording.signals))
    bare.stored_configuration = recording.configuration
    del bare.signals["supply_pressure"]
    error = {
        name: predict(r, machine, "full").metrics["angle_mae_rad"]
        for name, r in (("with", recording), ("without", bare))
    }
    assert error["with"] is not None and error["without"] is not None
    assert error["with"] < 5e-4 < 5e-3 < error["without"]


def test_inputs_are_the_currents_and_the_pressures_across_their_gaps(recording: Recording) -> None:
    machine = driven(load_machine("loader_crane"), recording)
    assert machine.structure.inputs == ("retract_current", "extend_current", "supply_pressure")
    held = held_inputs(recording, machine)
    assert held.values.shape[1] == 3
    np.testing.assert_allclose(held.values[:, 2], LOW)
    assert held.first_above(0.05, 0.0) == pytest.approx(1.51, abs=0.02)


def test_pressure_that_is_mostly_missing_does_not_drive(recording: Recording) -> None:
    few = dict(recording.signals)
    supply = few["supply_pressure"]
    few["supply_pressure"] = type(supply)(**{**vars(supply), "valid": np.arange(len(supply.time)) % 2 == 0})
    sparse = Recording("low", recording.path, recording.start_ns, recording.duration, few)
    assert driven(load_machine("loader_crane"), sparse).structure.driven == ()


def test_experiment_of_an_estimation_is_driven_too(recording: Recording) -> None:
    experiment = prepare(recording, load_machine("loader_crane"))
    assert experiment.plant.machine.structure.driven == ("supply_pressure",)
    assert experiment.free_run(experiment.segments[0], experiment.plant.p).currents.shape[1] == 3
