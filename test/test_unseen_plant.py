"""The unseen plant against the model: with nothing concealed they are the same machine."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from boom_estimation.free_run import predict
from boom_model.catalogue import EFFECTS
from boom_model.machine_file import load_machine
from boom_model.sensors import OUTPUTS
from boom_recording.loading import load
from unseen_plant.families import gather, known, outside
from unseen_plant.layout import STEP
from unseen_plant.machine import LockedPose, Owner, crane
from unseen_plant.running import Machinery, rest, run, seen
from unseen_plant.sensing import held

ROOT = Path(__file__).parent.parent
FILE = Path(str(files("boom_model").joinpath("machines", "tz17.yaml")))
# Largest differences at any time [rad, rad/s, Pa, Pa], and rms differences.
LARGEST = (0.3e-3, 1.5e-3, 0.5e5, 0.5e5)
RMS = (0.2e-3, 0.1e-3, 0.08e5, 0.15e5)


@pytest.mark.parametrize("bag", ["extended", "extended_log", "folded_fast", "folded_slow"])
def test_with_nothing_concealed_its_free_run_is_that_of_the_model(bag):
    recording = load(ROOT / "bags" / "healthy" / bag)
    count = int(recording.duration / STEP)
    begin = {name: float(np.mean(s.values[s.time < 0.95])) for name, s in recording.signals.items()}
    at = recording.configuration
    pose = LockedPose(at.outer_boom_angle, at.telescope_length, 0.0 if np.isnan(at.load_mass) else at.load_mass)
    m = Machinery(crane(Owner.read(FILE), pose))
    shown = seen(run(m, rest(m, begin["angle"], begin["rod_pressure"]), held(recording, count)))
    assert len(shown) == count and recording.duration > 30.0
    model = predict(recording, load_machine("tz17"), "full").values
    time = np.arange(1, count + 1) * STEP
    for k, (name, largest, rms) in enumerate(zip(OUTPUTS, LARGEST, RMS, strict=True)):
        signal = recording.signals[name]
        inside = signal.valid & (signal.time < time[-1]) & np.isfinite(model[name])
        difference = (np.interp(signal.time, time, shown[:, k]) - model[name])[inside]
        assert np.abs(difference).max() < largest, name
        assert np.sqrt(np.mean(difference**2)) < rms, name


def test_it_conceals_every_effect_of_the_contract_and_more():
    gather()
    added = {"load_holding_valve", "edge_overlap", "neutral_offset", "cavitation", "supply_variation"}
    assert set(EFFECTS) <= set(known())
    assert set(known()) - set(EFFECTS) <= added
    assert len(known()) == 34 and len(outside()) >= 6 and not set(outside()) & set(EFFECTS)
