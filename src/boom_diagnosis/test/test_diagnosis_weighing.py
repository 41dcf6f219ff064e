"""What fits are worth: losses of data not used, intervals, unknown physics, on small exact examples."""

import numpy as np
import pytest

from boom_diagnosis import weighing
from boom_diagnosis.coordinates import all_coordinates
from boom_diagnosis.fitting import Point
from boom_diagnosis.search import Fitted
from boom_diagnosis.weighing import (
    BLOCK,
    estimates,
    is_none,
    possible,
    posterior,
    predictive_loss,
    scatter,
    split_loss,
    unknown_probability,
)


def test_predictive_loss_is_the_likelihood_of_data_whose_numbers_are_uncertain() -> None:
    rng = np.random.default_rng(0)
    jacobian, known = rng.standard_normal((30, 3)), np.diag([2.0, 5.0, 1.0])
    w = 0.5 * rng.standard_normal(30)
    covariance = np.eye(30) + jacobian @ np.linalg.inv(known) @ jacobian.T
    exact = 0.5 * w @ np.linalg.solve(covariance, w) + 0.5 * np.linalg.slogdet(covariance)[1]
    assert predictive_loss(w, jacobian, known) == pytest.approx(exact, rel=1e-6)


def test_the_end_of_a_recording_costs_what_its_beginning_did_not_foretell() -> None:
    """-log p(others | used) of a linear model, exactly: the difference of two Gaussian evidences."""
    rng = np.random.default_rng(0)
    jacobian, prior, nominal = rng.standard_normal((30, 3)), np.array([1.0, 1.0, 4.0]), 0.5 * rng.standard_normal(30)
    used = np.arange(30) < 20
    best = -np.linalg.solve(jacobian.T @ jacobian + np.diag(prior), jacobian.T @ nominal)
    scaled = jacobian / np.sqrt(prior)  # unknowns of unit prior
    fitted, others = split_loss(nominal + jacobian @ best, scaled, np.ones(3), best * np.sqrt(prior), used)

    def evidence(rows: np.ndarray) -> tuple[float, float]:
        c = np.eye(int(rows.sum())) + scaled[rows] @ scaled[rows].T
        return 0.5 * float(nominal[rows] @ np.linalg.solve(c, nominal[rows])), 0.5 * float(np.linalg.slogdet(c)[1])

    every, some = evidence(np.ones(30, dtype=bool)), evidence(used)
    assert fitted == pytest.approx(some[0], rel=1e-6)
    assert others == pytest.approx(sum(every) - sum(some), rel=1e-6)


def test_two_channels_that_are_left_as_they_were_speak_for_unknown_physics() -> None:
    """Loss per innovation: angle and rate are explained, the pressures stay; one that stays, or little of both, says nothing."""
    explained = [(4.0, 0.05), (3.2, 0.04)]
    assert unknown_probability(2.0, 0.15, channels=[*explained, (0.25, 0.03), (0.48, 0.05)]) < 0.05
    assert unknown_probability(2.0, 0.15, channels=[*explained, (0.25, 0.23), (0.48, 0.38)]) > 0.6
    assert unknown_probability(2.0, 0.15, channels=[*explained, (0.10, 0.06), (0.37, 0.30)]) < 0.05
    assert unknown_probability(2.0, 0.15, channels=[*explained, (0.03, 0.03), (0.03, 0.03)]) < 0.05


def test_unknown_physics_is_likely_where_much_of_the_mismatch_stays() -> None:
    assert unknown_probability(1.0, 0.001) < 0.05
    assert unknown_probability(1.0, 0.9) > 0.75
    assert unknown_probability(1.0, 0.05) < 0.1
    assert unknown_probability(1.0, 0.5) < 0.5 < unknown_probability(1.0, 0.7)


@pytest.mark.parametrize(
    ("values", "load", "expected"),
    [
        ({"payload_change": {"mass": -16.6, "t_g": 3.0}}, 0.0, False),
        ({"payload_change": {"mass": -16.6, "t_g": 3.0}}, 20.0, True),
        ({"payload_change": {"mass": 4.0, "t_g": 3.0}}, 0.0, True),
        ({"payload_change": {"mass": 5.3, "t_g": 26.0, "tau": 1.5}}, 0.0, False),  # something drifts, nobody grasps
        ({"presliding_friction": {"compliance": 2.5e-5}}, 0.0, False),
        ({"presliding_friction": {"compliance": 1.8e-5}}, 0.0, True),
        ({"presliding_friction": {"compliance": 1.8e-6}}, 0.0, True),
        ({"presliding_friction": {"compliance": 5.4e-8}}, 0.0, True),
        ({"presliding_friction": {"compliance": 4e-8}}, 0.0, False),
        ({"boom_flexibility": {"gain": 0.02, "f": 0.9, "zeta": 0.02, "mu": 0.3, "eta": 1.0, "sag": 0.0}}, 0.0, False),
        ({"boom_flexibility": {"gain": 0.02, "f": 2.0, "zeta": 0.08, "mu": 0.3, "eta": 1.0, "sag": 0.0}}, 0.0, False),
        ({"boom_flexibility": {"gain": 0.02, "f": 2.0, "zeta": 0.02, "mu": 0.3, "eta": 1.0, "sag": 0.0}}, 0.0, True),
        ({"rate_scale": {"a": 0.9}}, 0.0, True),
        ({"compensator_droop": {"k": 0.0, "n": 2.0}}, 0.0, True),  # fitted to nothing: no number is told of it
        ({"hose_burst_valve_lag": {"tau": 0.44}}, 0.0, True),
        ({"hose_burst_valve_lag": {"tau": 0.46}}, 0.0, False),  # as large as any that is looked for
        (
            {
                "end_cushioning": {
                    "kappa_b": 100.0,
                    "kappa_a": 0.0,
                    "kappa_h": 0.0,
                    "kappa_r": 0.0,
                    "length": 0.05,
                    "shape": 1.0,
                }
            },
            0.0,
            True,
        ),  # there is no larger one
    ],
)
def test_an_effect_that_no_boom_can_have_is_no_explanation(
    values: dict[str, dict[str, float]], load: float, expected: bool
) -> None:
    (effect, numbers), *_ = values.items()
    names = all_coordinates([effect])
    rows, count = 1600, 2
    named = {f"effects.{effect}.{k}": v for k, v in numbers.items()}
    point = Point(np.zeros(count), named, np.zeros(rows), np.ones(rows, dtype=bool), 0.0, [], [])
    jacobian = 1e3 * np.random.default_rng(0).standard_normal((rows, count + len(names)))
    fitted = Fitted(effect, point, names, jacobian, 100.0, (0.0,))
    assert possible(fitted, load) is expected


@pytest.mark.parametrize(("frequency", "expected"), [(5.3, True), (0.64, False)])
def test_what_explains_all_is_possible_whatever_its_damping_and_not_whatever_its_frequency(
    frequency: float, expected: bool
) -> None:
    """A load of a stranger's crane made its mode more damped than those of steel booms; nothing was left beside it.

    A base that rocks at 0.64 Hz was a boom that bends, with 0.99.
    """
    names = all_coordinates(["boom_flexibility"])
    numbers = {"gain": 1.0, "f": frequency, "zeta": 0.088, "mu": 0.53, "eta": 0.36, "sag": 0.0}
    point = Point(
        np.zeros(2), {f"effects.boom_flexibility.{k}": v for k, v in numbers.items()}, np.zeros(1600),
        np.ones(1600, dtype=bool), 0.0, [], [],
    )  # fmt: skip
    jacobian = 1e3 * np.random.default_rng(0).standard_normal((1600, 2 + len(names)))
    fitted = Fitted("boom_flexibility", point, names, jacobian, 100.0, (0.0,))
    assert possible(fitted, 0.0, whole=True) is expected
    assert not possible(fitted, 0.0)


def test_what_is_measured_more_often_is_known_better() -> None:
    point = Point(np.zeros(1), {}, np.zeros(4), np.ones(4, dtype=bool), 0.0, [], [])
    once = posterior(point, np.ones((4, 1)), 1)
    twice = posterior(point, np.sqrt(2) * np.ones((4, 1)), 1)
    assert once[0, 0] == pytest.approx(1 / 5) and twice[0, 0] == pytest.approx(1 / 9)


def test_a_number_that_stretches_of_a_recording_disagree_about_is_known_worse() -> None:
    """w = a(block) + noise, for one unknown: the blocks' spread counts, not the number of samples."""
    rng = np.random.default_rng(0)
    column, block = np.ones((40 * BLOCK, 1)), np.repeat(rng.standard_normal(40), BLOCK)
    noise = 0.3 * rng.standard_normal(40 * BLOCK)
    everything = np.ones(40 * BLOCK, dtype=bool)
    spread = []
    for w in (noise, 0.5 * block + noise):
        point = Point(np.zeros(0), {}, w - w.mean(), everything, 0.0, [], [])
        spread.append(float(scatter(point, column, 0)[0, 0]))
    assert spread[0] == pytest.approx(0.3**2 / (40 * BLOCK), rel=0.5)
    assert spread[1] == pytest.approx(0.5**2 * np.var(block, ddof=1) / 40, rel=0.1)


@pytest.mark.parametrize(("gone", "stated"), [(40.0, True), (59.9, False), (60.2, False)])
def test_a_load_that_goes_as_the_recording_ends_does_not_go(gone: float, stated: bool) -> None:
    names = all_coordinates(["payload_change"])
    values = {c.name: 300.0 for c in names} | {"effects.payload_change.t_g": 20.0, "effects.payload_change.t_r": gone}
    point = Point(np.zeros(0), values, np.zeros(8000), np.ones(8000, dtype=bool), 0.0, [], [])
    fitted = Fitted("payload_change", point, names, np.full((8000, len(names)), 1e2), 0.0, ())
    numbers = estimates(fitted, 3.0, over=60.0)
    assert ("effects.payload_change.t_r" in numbers) == stated
    assert numbers["effects.payload_change.t_g"].value == 20.0


def test_an_interval_is_no_narrower_than_its_number_has_a_meaning() -> None:
    """Told to 1e-6 by 8000 innovations: a factor of the pilot's lag means 6 %, a delay what it says."""
    w, everything = np.zeros(8000), np.ones(8000, dtype=bool)
    for effect, name, value, width in (("pilot_lag", "r", 1.5, 1.645 * 0.06), ("command_delay", "T", 0.02, 0.0)):
        values = {f"effects.{effect}.{name}": value}
        point, own = Point(np.zeros(0), values, w, everything, 0.0, [], []), all_coordinates([effect])[:1]
        low, high = estimates(Fitted(effect, point, own, np.full((8000, 1), 1e4), 0.0, ()), 3.0)[
            f"effects.{effect}.{name}"
        ].interval_90
        assert np.log(high / low) / 2.0 == pytest.approx(width, abs=2e-3)


@pytest.mark.parametrize(
    ("effect", "name", "value", "spread", "known", "expected"),
    [
        ("boom_flexibility", "gain", 1.0, 1.35, 0.2, (np.exp(-1.35), np.exp(1.35))),  # told, given its shape
        ("boom_flexibility", "gain", 1.0, 1.35, 1.2, (-0.35, 2.35)),  # not told
        ("boom_flexibility", "gain", 1.0, 0.5, 0.2, (0.5, 1.5)),  # not nothing, whatever its shape
        ("friction_drift", "r", 2.0, 1.0, 0.1, (2.0 ** np.exp(-1.0 / np.log(2.0)), 2.0 ** np.exp(1.0 / np.log(2.0)))),
    ],
)
def test_a_size_that_may_be_nothing_only_with_another_shape_is_away_from_nothing_by_a_factor(
    effect: str, name: str, value: float, spread: float, known: float, expected: tuple[float, float]
) -> None:
    (own,) = (c for c in all_coordinates([effect]) if c.name.endswith(f".{name}"))
    assert weighing._interval(own, value, spread, known) == pytest.approx(expected)


def test_what_another_shape_could_do_as_well_is_known_better_given_the_shape() -> None:
    """gain and mu of a bending boom do nearly the same here: each alone is sharp, their difference is not."""
    same, other = np.random.default_rng(0).standard_normal((2, 8000))
    own = all_coordinates(["boom_flexibility"])
    columns = np.zeros((8000, len(own)))
    columns[:, 0], columns[:, 3] = same, same + 0.3 * other
    point = Point(np.zeros(0), {}, np.zeros(8000), np.ones(8000, dtype=bool), 0.0, [], [])
    fitted, gain = Fitted("boom_flexibility", point, own, columns, 0.0, ()), own[0].name
    alone = weighing._variances(fitted, 3.0, given=[c.name for c in own[1:]])[gain]
    assert alone < 0.12 * weighing._variances(fitted, 3.0)[gain]


@pytest.mark.parametrize(("size", "none"), [(0.0, True), (3.6e3, False), (1e7, False)])
def test_a_size_that_is_sought_by_its_logarithm_may_be_small_beside_its_range(size: float, none: bool) -> None:
    """A soft support of 3.6 kN m/rad was none beside one of 10 MN m/rad, and nothing was told of it."""
    assert is_none("effects.ground_contact.c", size) is none
