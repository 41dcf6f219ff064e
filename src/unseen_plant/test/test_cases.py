"""Which cases a trial with Q has, and what a case consists of."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml

from boom_recording.recording import Configuration
from unseen_plant import generator
from unseen_plant.families import FAMILIES, known, outside
from unseen_plant.generator import CaseError, make
from unseen_plant.layout import STEP
from unseen_plant.lots import SHARES, Lot, lots
from unseen_plant.machine import DRAWN, LockedPose, Owner, crane
from unseen_plant.sensing import Fitting, fitted, held, recorded
from unseen_plant.structures import restructured
from unseen_plant.visibility import NotVisibleError

MACHINE = Path(__file__).parents[3] / "src" / "boom_model" / "boom_model" / "machines" / "tz17.yaml"


def test_the_same_seed_gives_the_same_lots_and_another_seed_or_structure_others():
    assert lots(7, 40) == lots(7, 40)
    names = [{lot.name for lot in drawn} for drawn in (lots(7, 40), lots(8, 40), lots(7, 40, True))]
    assert all(len(own) == 40 for own in names)
    assert not names[0] & names[1] and not names[0] & names[2]


def test_300_lots_hold_every_effect_at_every_class_and_every_kind_in_no_order():
    drawn = lots(3, 300)
    singles = Counter(lot.effects[0] for lot in drawn if lot.kind == "effect")
    assert set(singles) == {(name, strength) for name in known() for strength in (0.5, 1.0, 3.0)}
    assert max(singles.values()) == 2
    assert {lot.effects[0][0] for lot in drawn if lot.kind == "outside"} == set(outside())
    assert Counter(lot.kind for lot in drawn) == {kind: round(300 * share) for kind, share in SHARES.items()}
    assert sum(a.kind != b.kind for a, b in pairwise(drawn)) > 100


def test_pairs_lie_in_different_subsystems_and_share_no_equation_of_motion():
    pairs = [lot.effects for lot in lots(5, 300) if lot.kind == "pair"]
    assert len(pairs) == 30
    for effects in pairs:
        first, second = (FAMILIES[name] for name, _ in effects)
        assert not set(first.subsystems) & set(second.subsystems)
        assert not (first.coupled and second.coupled)


def test_no_lot_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        lots(1, 0)


def test_a_lot_that_no_crane_shows_gives_way_to_another_of_its_kind_and_class_and_always_to_the_same(monkeypatch):
    tried = []

    def attempt(lot, *_):
        tried.append(lot.effects)
        raise NotVisibleError("not seen")

    monkeypatch.setattr(generator, "_attempt", attempt)
    for _ in range(2):
        with pytest.raises(CaseError, match="could not be made in 60 attempts: not seen"):
            make(Lot("ddd", (9, 8), "outside", (("sticking_spool", 3.0),)), MACHINE)
    first, again = tried[: generator.ATTEMPTS], tried[generator.ATTEMPTS :]
    assert first == again and len(first) == generator.ATTEMPTS
    assert set(first[: generator.REDRAWN]) == {(("sticking_spool", 3.0),)}
    assert len(set(first)) > 3 and {name for ((name, _),) in first} <= set(outside())
    assert {strength for ((_, strength),) in first} == {3.0}


@pytest.fixture(scope="module")
def short():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generator, "DURATION", 10.0)
        yield


def values(recording):
    return {name: (signal.stamps_ns.tobytes(), signal.values.tobytes()) for name, signal in recording.signals.items()}


def test_a_case_is_a_function_of_its_lot(short):
    lot = Lot("aaa", (9, 3), "parameters")
    first, again = make(lot, MACHINE), make(lot, MACHINE)
    assert first.truth == again.truth
    assert values(first.first) == values(again.first) and values(first.second) == values(again.second)
    assert values(first.first) != values(first.second)
    other = make(Lot("aaa", (9, 4), "parameters"), MACHINE)
    assert values(first.first) != values(other.first)


def test_numbers_that_are_wrong_stay_within_tolerance_and_the_oracle_comes_to_the_noise(short):
    case = make(Lot("bbb", (9, 5), "parameters"), MACHINE)
    assert 2 <= len(case.truth["wrong"]) <= 5
    assert all(1.2 <= abs(off) <= 2.0 for off in case.truth["wrong"].values())
    assert case.machine is None and case.first.configuration.machine == "tz17"
    for channel, error in zip(
        ("angle", "hose_pressure", "rod_pressure"), np.array(case.truth["oracle"])[[0, 2, 3]], strict=True
    ):
        assert error * np.std(case.second.signals[channel].values) < {"angle": 2e-3}.get(channel, 0.6e5)


def test_the_truth_of_an_effect_tells_where_it_acts_and_a_visible_one_stands_out_of_the_noise(short):
    lot = Lot("ccc", (9, 6), "effect", (("piston_leakage", 1.0),))
    case = make(lot, MACHINE)
    (effect,) = case.truth["effects"]
    assert (effect["effect"], effect["subsystems"], effect["equation"], effect["unit"]) == (
        "piston_leakage", ("cylinder",), "5.39c,d", "m^3/s",
    )  # fmt: skip
    assert effect["size"] == effect["detectable"]
    assert 0.5 < effect["shown"] < 3.0


def test_a_crane_is_scattered_within_its_tolerances_and_what_is_wrong_is_off_by_as_much_as_told():
    owner, pose = Owner.read(MACHINE), LockedPose(0.28, 2.2, 200.0)
    factors = owner.drawn(np.random.default_rng(1), pose, 3.0, {"fluid.beta": -1.5})
    assert set(factors) == {key for key in DRAWN if owner.has(key)}
    assert all(abs(f - 1.0) <= owner.tolerance(key, pose) * 1.000001 for key, f in factors.items())
    assert factors["fluid.beta"] == pytest.approx(1.0 - 1.5 * 0.10 / 2.0)
    own = crane(replace(owner, factors=factors), pose)
    assert own.beta == pytest.approx(0.925 * 1.6e9)
    assert own.load == pytest.approx(200.0 * factors["load"])


@pytest.mark.parametrize("seed", range(6))
def test_a_crane_of_another_structure_can_be_written_down_and_read_again(seed, tmp_path):
    rng = np.random.default_rng(seed)
    owner = restructured(Owner.read(MACHINE), ("gas",), fitted(rng, True), rng)
    path = tmp_path / "machine.yaml"
    path.write_text(yaml.safe_dump(dict(owner.document), sort_keys=False))
    pose = LockedPose(0.28, 2.2)
    assert crane(Owner.read(path), pose) == crane(owner, pose)
    assert crane(owner, pose).gas == 1.0


def test_samples_are_quantised_stamped_and_held_as_the_fitting_tells():
    count = 2000
    rng = np.random.default_rng(3)
    outputs = np.stack([np.linspace(0, 1, count), np.full(count, 0.1), np.full(count, 50e5), np.full(count, 9e5)], -1)
    currents = np.repeat(np.round(rng.uniform(0, 0.5, (count // 2, 2)), 3), 2, axis=0)
    fitting = Fitting(loss=0.01, gyro=False, current_sigma=0.0)
    recording = recorded("x", outputs, currents, Configuration("tz17", 0.28, 2.2, 0.0), fitting, rng)
    angle, rate, hose = (recording.signals[name] for name in ("angle", "rate", "hose_pressure"))
    assert 970 < len(angle.time) < 1000 and np.all(np.diff(angle.time) > 0.009)
    assert np.allclose(angle.values / fitting.angle_quantum, np.round(angle.values / fitting.angle_quantum))
    assert np.allclose(hose.values / 1e4, np.round(hose.values / 1e4)) and hose.values.mean() == pytest.approx(
        50e5, rel=1e-3
    )
    assert rate.values[200:].mean() == pytest.approx(1.0 / (count * STEP), rel=0.02), (
        "without a gyro: the angle's slope"
    )
    missed = np.abs(held(recording, count) - currents).max(axis=1) > 1e-9
    assert missed.mean() < 0.03
