"""The second plant against the model and against recordings: with nothing concealed they are the same machine."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from boom_estimation.free_run import predict
from boom_model.machine_file import load_machine
from boom_model.rigid_body import locked_inertia
from boom_model.sensors import OUTPUTS
from boom_recording.loading import load
from concealed_plant.concealments import KNOWN
from concealed_plant.kernel import NAMES
from concealed_plant.machine import MachineFile, Posture, linkage, quantities
from concealed_plant.plant import InitialValues, per_millisecond, run

ROOT = Path(__file__).parent.parent
FILE = Path(str(files("boom_model").joinpath("machines", "tz17.yaml")))
HEALTHY = ("extended", "extended_log", "folded_fast", "folded_slow")
# Largest rms differences [rad, rad/s, Pa, Pa] to the model, and to the recording: there it is the noise of sensors and currents.
TO_MODEL = (1.0e-4, 2.0e-4, 0.04e5, 0.1e5)
TO_RECORDING = (6.0e-4, 2.0e-3, 0.25e5, 0.30e5)


def _concealed(recording):
    """The second plant on the recorded currents, at the stamps of each channel: {channel: values}."""
    count = round(recording.duration * 100)
    columns = []
    for name in ("retract_current", "extend_current"):
        signal = recording.signals[name]
        last = np.searchsorted(signal.time, np.arange(count) / 100.0 + 0.005) - 1
        columns.append(signal.values[np.maximum(last, 0)])
    rest = {name: float(np.mean(s.values[s.time < 0.95])) for name, s in recording.signals.items()}
    at = recording.configuration
    pose = Posture(at.outer_boom_angle, at.telescope_length, 0.0 if np.isnan(at.load_mass) else at.load_mass)
    machine = MachineFile.read(FILE)
    table, m = linkage(machine), quantities(machine, pose)
    done = run(
        m, table, InitialValues(rest["angle"], rest["rod_pressure"]), per_millisecond(np.stack(columns, axis=-1))
    )
    time = np.arange(1, len(done.outputs) + 1) / 1000.0
    return {
        name: np.interp(recording.signals[name].time, time, done.outputs[:, k]) for k, name in enumerate(OUTPUTS)
    }, time[-1]


@pytest.mark.parametrize("bag", HEALTHY)
def test_with_nothing_concealed_it_is_the_model_and_the_recorded_machine(bag):
    recording = load(ROOT / "bags" / "healthy" / bag)
    concealed, end = _concealed(recording)
    model = predict(recording, load_machine("tz17"), "full").values
    for name, to_model, to_recording in zip(OUTPUTS, TO_MODEL, TO_RECORDING, strict=True):
        signal = recording.signals[name]
        inside = signal.valid & (signal.time < end) & np.isfinite(model[name])
        for other, bound in ((model[name], to_model), (signal.values, to_recording)):
            difference = (concealed[name] - other)[inside]
            assert np.sqrt(np.mean(difference**2)) < bound, (name, bound)


@pytest.mark.parametrize(("q3", "q4", "load"), [(4.59, 0.0, 0.0), (0.28, 2.2, 250.0), (1.1, 1.7, 120.0)])
def test_the_locked_body_is_that_of_the_model(q3, q4, load):
    machine = load_machine("tz17")
    model = locked_inertia(machine.document["rigid_body"], q3, q4)
    m = quantities(MachineFile.read(FILE), Posture(q3, q4, load))
    assert m.load == load
    assert m.inertia == pytest.approx(model.D0, rel=1e-3)
    assert (m.moment_x, m.moment_y) == pytest.approx((model.Sx, model.Sy), rel=1e-3)
    assert (m.tip_x, m.tip_y) == pytest.approx(model.tip, rel=1e-3)


NOT_CONCEALED = {
    "load_holding_valve",
    "edge_overlap",
    "neutral_offset",
    "cavitation",
    "supply_variation",
    "load_holding_valve_lag",
    "load_holding_valve_setting",
    "vented_neutral",
    "spool_lag",
    "stroke_limit",
    "transducer_lag",
}
"""Of cranes of other makes, which this plant is none of, and newer than it."""


def test_it_conceals_the_effects_of_the_catalogue_and_no_other_under_their_names():
    from boom_model.catalogue import EFFECTS

    foreign = {name for name, effect in EFFECTS.items() if effect.foreign}  # told as physics of no catalogue
    assert set(KNOWN) == set(EFFECTS) - NOT_CONCEALED - foreign
    assert len(KNOWN) == 29
    assert NAMES[:4] == ("angle", "rate", "hose", "rod")
