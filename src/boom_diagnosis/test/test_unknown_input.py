"""Unknown inputs: what acts on the machine and is in no catalogue is seen, put into a term, and proves itself."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_samples import BAGS, PERIOD, constant, tz17
from test_diagnosis import noisy

from boom_diagnosis import rounds
from boom_diagnosis.bag_samples import SETTLING, prepare
from boom_diagnosis.disturbances import capacities
from boom_diagnosis.fitting import WHITE
from boom_diagnosis.learning import Learned, Setting, learn_plainly, reading
from boom_diagnosis.nuisances import tolerances
from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.run import diagnose
from boom_diagnosis.unknown_input import Forced, regress
from boom_model.learned import VARIABLES, LearnedTerm
from boom_model.machine import Machine
from boom_recording.loading import load
from boom_recording.recording import Recording

NUMBER = {
    "pose.D0": 3e4, "pose.load": 0.0, "pose.tip.0": 0.0, "pose.tip.1": 0.0, "fluid.beta": 1e9, "cylinder.V_h": 1e-3,
    "cylinder.A_a": 0.02, "cylinder.A_b": 0.01, "cylinder.l_p": 1.0,
}  # fmt: skip
CORNER, STIFFNESS, DAMPING = 0.55, 40.0, 0.6  # rad, 1e4 N m/rad, 1e4 N m at 0.3 rad/s


def touching() -> Machine:
    """A boom that is lifted against something elastic beyond an angle."""
    basis = (f"plus(angle,{CORNER})", f"rate*above(angle,{CORNER})")
    ranges = {"angle": (-0.3, 0.8), "rate": (-0.5, 0.5)}
    return replace(tz17(), learned=(LearnedTerm("torque", basis, (-STIFFNESS, -DAMPING), ranges),))


def recorded(machine: Machine) -> Recording:
    return noisy(machine, 24.0, 1)


def forced(torque: np.ndarray, angle: np.ndarray) -> list[Forced]:
    """What an observer would have given for a torque [1e4 N m] that it does not know."""
    correction = torque * 1e4 * PERIOD / capacities(NUMBER)["rate"]
    return [Forced({"rate": correction}, {"angle": angle, "rate": np.gradient(angle, PERIOD)})]


def swinging(n: int = 3000) -> np.ndarray:
    return np.asarray(0.3 + 0.2 * np.sin(2 * np.pi * np.arange(n) / 500))


def everything(n: int) -> list[np.ndarray]:
    return [np.ones((n, 4), dtype=bool)]


def test_a_spring_behind_a_corner_is_found_with_its_corner_among_other_products() -> None:
    angle = swinging()
    torque = 40.0 * np.maximum(0.0, 0.22 - angle) + 0.05 * np.random.default_rng(1).standard_normal(len(angle))
    found = regress(
        forced(torque, angle),
        "torque",
        "rate",
        NUMBER,
        ["rate", "angle", "sign(rate)"],
        everything(3000),
        everything(3000),
    )
    assert found is not None and found.basis == ("minus(angle,0.220)",)
    assert found.coefficients == pytest.approx((40.0,), rel=0.01)
    assert found.share > 0.99


def test_a_torque_with_a_memory_of_the_rate_is_found_with_its_size() -> None:
    angle = swinging()
    rate, lagged = np.gradient(angle, PERIOD), np.zeros(len(angle))
    decay, scaled = np.exp(-PERIOD / 0.5), rate / VARIABLES["rate"].scale
    for k, v in enumerate(scaled):
        lagged[k] = decay * lagged[k - 1] + (1.0 - decay) * v

    found = regress(
        forced(3.0 * lagged, angle),
        "torque",
        "rate",
        NUMBER,
        ("lag(rate,0.5)",),
        everything(len(angle)),
        everything(len(angle)),
    )

    assert found is not None
    assert found.basis[0] == "lag(rate,0.5)"
    assert found.coefficients[0] == pytest.approx(3.0, rel=1e-3)


def test_what_an_observer_had_already_counts_as_seen() -> None:
    angle = swinging()
    whole = forced(40.0 * np.maximum(0.0, 0.22 - angle), angle)
    first = regress(whole, "torque", "rate", NUMBER, [], everything(3000), everything(3000))
    assert first is not None
    nothing_left = forced(np.zeros(3000), angle)
    again = regress(nothing_left, "torque", "rate", NUMBER, [], everything(3000), everything(3000), first)
    assert again is not None and again.basis == first.basis
    assert again.coefficients == pytest.approx(first.coefficients, rel=1e-3)


def test_what_is_seen_in_one_part_of_a_recording_only_explains_nothing_elsewhere() -> None:
    angle = np.concatenate([np.linspace(0.0, 0.3, 500), np.full(2500, 0.5)])
    torque = 40.0 * np.maximum(0.0, 0.22 - angle)
    found = regress(forced(torque, angle), "torque", "rate", NUMBER, [], everything(3000), everything(3000))
    assert found is not None and found.share < 0.1


def learnt(machine: Machine) -> Learned | None:
    bag = prepare(recorded(machine))
    assert bag is not None
    training = [bag.counted & (bag.time < 16.0)[:, None]]
    judged = [bag.counted & (bag.time >= 16.0)[:, None]]
    pose = tz17().pose(4.59, 0.0)
    setting = Setting(tz17(), [bag], training, judged, tolerances(tz17(), pose), [], 1.0)
    z = np.zeros(len(setting.nuisances))
    at = setting.problem(tz17(), z, {}, 1.0).points([(z, {})])[0]
    return learn_plainly(setting, at, ["torque", "hose_flow", "rod_flow"])


def test_a_boom_that_touches_something_gets_its_spring_and_damper() -> None:
    learned = learnt(touching())
    assert learned is not None and learned.term.equation == "torque"
    coefficient = dict(zip((b.split("(")[0] for b in learned.term.basis), learned.term.coefficients, strict=True))
    assert coefficient["plus"] == pytest.approx(-STIFFNESS, rel=0.03)
    corner = next(float(b[len("plus(angle,") : -1]) for b in learned.term.basis if b.startswith("plus"))
    assert corner == pytest.approx(CORNER, abs=0.003)
    assert learned.held_out_gain > 0.0
    assert learned.point.excess(WHITE) < 0.05


def relieving() -> Machine:
    """A relief valve at the hose of the head side that opens at 60 bar, 1.2 l/min a bar."""
    ranges = {"hose_pressure": (0.0, 3e7)}
    return replace(tz17(), learned=(LearnedTerm("hose_flow", ("plus(hose_pressure,0.6)",), (-20.0,), ranges),))


def test_a_valve_that_a_pressure_opens_is_found_with_that_pressure_and_its_flow() -> None:
    learned = learnt(relieving())
    assert learned is not None
    factors = dict(zip(learned.term.basis, learned.term.coefficients, strict=True))
    opened = max(factors, key=lambda b: abs(factors[b]))
    before, _, corner = opened.rstrip(")").partition(",")
    assert before in ("plus(hose_pressure", "plus(head_pressure")
    assert float(corner) == pytest.approx(0.6, abs=0.02)
    assert factors[opened] == pytest.approx(-20.0, rel=0.2)
    assert learned.curve.reading.startswith("a relief valve: it opens beyond 60 bar")
    assert learned.point.excess(WHITE) < 0.05


def test_a_healthy_machine_has_no_unknown_input_that_is_plain_to_see() -> None:
    assert learnt(tz17()) is None


def test_what_touches_the_boom_is_physics_of_no_catalogue_and_brings_free_runs_to_the_noise() -> None:
    result = diagnose([recorded(touching())], tz17())
    document = result.document
    assert document.verdict == "unknown_physics"
    assert (document.findings[0].effect, document.findings[0].subsystem) == (None, "structure")
    assert [f.effect for f in document.findings] == [None]
    found = document.findings[0]
    assert found.like == "mechanical_stop" and not result.learned
    assert found.parameters["c"].value == pytest.approx(1e4 * STIFFNESS, rel=0.05)  # a term counts in 10 kN m
    assert found.parameters["q_0"].value == pytest.approx(CORNER, abs=0.003)
    held = {stage: np.array(values) for stage, values in document.fit.held_out.items()}
    assert np.all(held["explained"] < 1.5 * np.array(document.fit.noise_floor))
    assert np.all(held["explained"][2:] < 0.2 * held["nominal"][2:])


@pytest.mark.parametrize(("left", "kept"), [(0.05, True), (0.3, False)], ids=["far less", "not much less"])
def test_a_term_takes_the_place_of_effects_only_if_it_leaves_far_less(
    monkeypatch: pytest.MonkeyPatch, left: float, kept: bool
) -> None:
    learned = SimpleNamespace(point=SimpleNamespace(excess=lambda floor: left))
    case: Any = SimpleNamespace(
        setting=None, trained=["alone", "with"], taken=["effect"], spared={0: "a", 1: "b"}, floor=WHITE, learned=None,
        last=SimpleNamespace(z=None, effects=None), rest=lambda at: 1.0,
    )  # fmt: skip
    monkeypatch.setattr(rounds, "learn_plainly", lambda *_: learned)
    assert rounds._plain(case) is kept
    assert (case.learned is learned, case.taken, case.trained, case.spared) == (
        (True, [], ["alone"], {0: "a"}) if kept else (False, ["effect"], ["alone", "with"], {0: "a", 1: "b"})
    )


def with_hose_pressure(low: np.ndarray) -> Recording:
    """30 s in which nothing changes but the hose pressure, which is zero where ``low`` says so."""
    made = constant(30.0, angle=0.4, hose_pressure=8e6, rod_pressure=1e6)
    signal = made.signals["hose_pressure"]
    return replace(
        made, signals={**made.signals, "hose_pressure": replace(signal, values=np.where(low, 0.0, signal.values))}
    )


def test_where_the_oil_evaporates_nothing_is_learnt_about_the_machine() -> None:
    time = np.arange(3000) * PERIOD
    bag = prepare(with_hose_pressure((time > 9.995) & (time < 10.095)))
    assert bag is not None
    away = bag.time[bag.cavitating]
    assert away[0] == pytest.approx(10.0, abs=2 * PERIOD) and away[-1] == pytest.approx(
        10.09 + SETTLING, abs=2 * PERIOD
    )
    assert not bag.counted[bag.cavitating].any() and bag.counted[~bag.cavitating & (bag.time > 2.0)].all()


def test_a_hose_pressure_that_is_always_low_is_a_sensor_and_no_evaporation() -> None:
    bag = prepare(with_hose_pressure(np.arange(3000) % 5 == 0))
    assert bag is not None and not bag.cavitating.any()


def test_no_recording_of_a_healthy_machine_evaporates() -> None:
    for path in sorted((BAGS / "healthy").iterdir()):
        bag = prepare(load(path))
        assert bag is not None and not bag.cavitating.any()


def test_results_of_parallel_work_come_in_the_order_of_the_work() -> None:
    assert in_parallel(lambda k: k * k, range(9)) == [k * k for k in range(9)]
    with pytest.raises(ZeroDivisionError):
        in_parallel(lambda k: 1 / k, [2, 1, 0])


@pytest.mark.parametrize(
    ("basis", "coefficient", "said"),
    [
        ("rate*below(angle,0.2)", -0.6, "dissipative: acts against the movement beyond a certain angle"),
        ("rate*below(angle,0.2)", 0.6, "driving, not dissipative: doubt it"),
        ("minus(rate,0)", 0.6, "dissipative: acts against the movement, in one direction only"),
        ("rate*minus(angle,0.2)", -0.6, "dissipative: acts against the movement"),
        ("sign(rate)*bump(angle,0.3,0.1)", -1.0, "dissipative: acts against the movement at one spot"),
        ("minus(angle,0.2)", 40.0, "elastic and one-sided: something is touched beyond a certain angle"),
        ("angle", -3.0, "elastic: depends on the angle alone"),
        ("lag(rate,2)", -3.0, "has a memory: it depends on what happened before"),
        ("hose_pressure", -3.0, "depends on the pressure: friction under load, or a wrong area"),
    ],
)
def test_the_shape_of_a_torque_is_put_into_words(basis: str, coefficient: float, said: str) -> None:
    assert reading(LearnedTerm("torque", (basis,), (coefficient,), {})) == said


@pytest.mark.parametrize(
    ("basis", "coefficient", "said"),
    [
        ("plus(hose_pressure,0.98)", -25.0, "a relief valve: it opens beyond 98 bar of the hose pressure, 1.5 l/min a bar"),
        ("plus(rod_pressure,0.5)", 25.0, "something that lets flow in beyond 50 bar of the rod pressure, 1.5 l/min a bar"),
        ("plus(spool,0.28)", -1.0, "depends on the flow, in one direction only"),
        ("head_pressure", -3.0, "depends on the pressure: a leak or a compliance"),
    ],
)  # fmt: skip
def test_the_shape_of_a_flow_is_put_into_words(basis: str, coefficient: float, said: str) -> None:
    assert reading(LearnedTerm("hose_flow", (basis,), (coefficient,), {})) == said
