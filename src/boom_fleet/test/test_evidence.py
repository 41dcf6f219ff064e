"""The posterior that a machine has changed, on machines of two numbers and an effect, whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from boom_fleet.designs import ChangeCandidate, Design, weigh
from boom_fleet.evidence import YEAR, NumberKinds, posterior, spreads
from boom_fleet.habits import likeliest, profile, usual
from boom_fleet.past import Direction, Evidence, MachinePast
from boom_fleet.paths import Path, straight

KINDS = NumberKinds(np.array([0.0, 0.0, 1.0]), np.zeros(3, dtype=bool), np.zeros(3))
LEAK = straight(Direction("leak", np.array([0.0, 0.0, 1.0]), 0.0, 2.0))
WEAR = straight(Direction("wear", np.array([1.0, 0.0, 0.0]), -2.0, 2.0))
FORM, WANDER = 0.03, 0.1
MACHINES = 20
THRESHOLD = 0.05 / MACHINES


def recordings(rng, leak, count=12, form=FORM):
    """A machine at its own place in the tolerance; ``leak``: size in each recording."""
    spread, wander = spreads(KINDS, form, WANDER)
    own = spread * rng.standard_normal(3)
    result = []
    for k in range(count):
        rows = rng.standard_normal((200, 3)) * np.array([8.0, 3.0, 20.0])
        z = own + wander * rng.standard_normal(3) + np.array([0.0, 0.0, leak(k / count)])
        seen = rows @ z + rng.standard_normal(200)
        result.append(Evidence(k / count * YEAR, rows.T @ rows, rows.T @ seen))
    return result


def past(evidence):
    return posterior(evidence, KINDS, FORM, WANDER, (LEAK, WEAR))


def first_raised(evidence):
    machine = past(evidence)
    counts = [len(machine.history(k + 1, THRESHOLD).changes) for k in range(len(evidence))]
    return next((k for k, count in enumerate(counts) if count), None)


def test_of_many_healthy_machines_none_is_raised():
    rng = np.random.default_rng(1)

    assert [first_raised(recordings(rng, lambda share: 0.0)) for _ in range(MACHINES)] == [None] * MACHINES


def test_healthy_machines_that_the_form_of_the_model_fits_worse_than_the_rest_are_not_raised():
    rng = np.random.default_rng(7)

    assert [first_raised(recordings(rng, lambda share: 0.0, 4, 4.0 * FORM)) for _ in range(8)] == [None] * 8


def test_a_sensor_that_is_off_by_its_accuracy_from_the_beginning_is_not_raised_and_one_that_jumps_is():
    rng = np.random.default_rng(9)
    accurate = KINDS._replace(sound=np.array([0.0, 0.0, 0.3]))
    off = [recordings(rng, lambda share: 0.6, 6) for _ in range(4)]
    jump = recordings(rng, lambda share: 0.6 + 0.5 * (share >= 0.5), 6)

    def raised(evidence, kinds):
        return bool(posterior(evidence, kinds, FORM, WANDER, (LEAK, WEAR)).history(6, THRESHOLD).changes)

    assert [raised(evidence, KINDS) for evidence in off] == [True] * 4
    assert [raised(evidence, accurate) for evidence in [*off, jump]] == [False] * 4 + [True]


def seeming(rng, sizes):
    """A machine with twelve effects, of which it seems to have next to nothing but of the first: so much in each recording."""
    result = []
    for k, size in enumerate(sizes):
        rows = rng.standard_normal((200, 14)) * 20.0
        z = np.append([0.0, 0.0, size], np.zeros(11))
        seen = rows @ z + rng.standard_normal(200)
        result.append(Evidence(k / len(sizes) * YEAR, rows.T @ rows, rows.T @ seen))
    return result


def odd_or_changed(evidence, usual):
    """What has changed in such a machine of a fleet in which ``usual`` is had of an effect."""
    kinds = NumberKinds(np.append(np.zeros(2), np.ones(12)), np.zeros(14, dtype=bool), np.zeros(14))
    effects = [straight(Direction(f"effect_{k}", np.eye(14)[k + 2], -2.0, 2.0, usual)) for k in range(12)]
    wear = straight(Direction("wear", np.eye(14)[0], -2.0, 2.0))
    return [c.quantity for c in posterior(evidence, kinds, 0.01, 0.02, (*effects, wear)).history(8, THRESHOLD).changes]


ALWAYS, RESTLESS = [0.08] * 8, [0.0, 0.0, 0.0, 0.0, 0.09, 0.08, 0.09, -0.05]


@pytest.mark.parametrize("sizes", [ALWAYS, RESTLESS])
def test_an_effect_that_a_machine_seems_to_have_always_or_anew_in_every_recording_is_no_change(sizes):
    evidence = seeming(np.random.default_rng(5), sizes)
    assert odd_or_changed(evidence, 0.0)[:1] == ["effect_0"]
    assert odd_or_changed(evidence, 0.01) == []


def test_a_change_is_found_beside_an_effect_that_the_machine_seems_to_have_anew_in_every_recording():
    worn = [
        replace(e, vector=e.vector + e.matrix @ np.append(1.5 * (k >= 4), np.zeros(13)))
        for k, e in enumerate(seeming(np.random.default_rng(5), RESTLESS))
    ]
    assert odd_or_changed(worn, 0.01) == ["wear"]


def test_a_change_that_seems_to_be_of_another_size_in_each_recording_is_one_and_no_restlessness():
    """A lag of 80 ms, gas sunk by a third: far from nothing the size that a linear screen sees depends on the motion."""
    uneven = [0.0, 0.0, 0.0, 0.0, 0.2, 0.5, 0.1, 0.4]
    assert odd_or_changed(seeming(np.random.default_rng(5), uneven), 0.05) == ["effect_0"]
    assert odd_or_changed(seeming(np.random.default_rng(5), [0.3, -0.1, 0.2, 0.0, 0.4, -0.2, 0.1, 0.3]), 0.05) == []


NEAR = Direction("near", np.eye(14)[2], 0.0, 2.0, 0.05, 0.1)
FAR = Direction("far", np.eye(14)[3], 0.0, 2.0, 0.05, 0.7)
BENT = Path("gas", (NEAR, FAR))


def along_bent(levels, path=BENT):
    """A machine that has gone along a path: so far in each recording."""
    rng = np.random.default_rng(0)
    result = []
    for k, level in enumerate(levels):
        rows = rng.standard_normal((200, 14)) * 20.0
        z = path.at(np.array(float(level))) @ np.array([column.along for column in path.columns])
        result.append(Evidence(k / len(levels) * YEAR, rows.T @ rows, rows.T @ (rows @ z + rng.standard_normal(200))))
    return result


def bent_posterior(evidence, *paths):
    kinds = NumberKinds(np.append(np.zeros(2), np.ones(12)), np.zeros(14, dtype=bool), np.zeros(14))
    others = [straight(Direction(f"effect_{k}", np.eye(14)[k], -2.0, 2.0, 0.05)) for k in range(4, 14)]
    return posterior(evidence, kinds, 0.01, 0.02, (*paths, *others))


DRIFT = [0.0, 0.0, 0.06, 0.15, 0.24, 0.33, 0.42, 0.51]


def test_a_drift_along_a_bent_path_is_one_and_along_its_columns_alone_it_was_restlessness():
    """Gas that sinks by 2.7, 6.7, 10.6 %: along no single column, and so it was raised three recordings late."""
    machine = bent_posterior(along_bent(DRIFT), BENT)
    for count in (4, 5, 6, 8):
        (change,) = machine.history(count, THRESHOLD).changes
        assert (change.quantity, change.shape, change.begin) == ("gas", "ramp", 1)
        assert change.size == pytest.approx(DRIFT[count - 1], abs=0.02)

    linear = bent_posterior(along_bent(DRIFT), straight(NEAR), straight(FAR))
    assert [linear.history(count, THRESHOLD).changes for count in (4, 5, 6, 8)] == [()] * 4


def test_the_level_along_a_bent_path_is_that_of_each_recording():
    mean, deviation = bent_posterior(along_bent([0.0, 0.05, 0.4, 0.1, 0.9, 0.3]), BENT).levels(BENT)

    assert np.all(np.abs(mean - [0.0, 0.05, 0.4, 0.1, 0.9, 0.3]) <= 4.0 * deviation)
    assert np.all(deviation[1:] < 0.02) and np.all(deviation[1:] > 0.0)


def test_what_goes_back_along_a_bent_path_is_a_second_change_that_takes_all_of_it_back():
    """Where no machine seems to have another size of it in every recording."""
    firm = Path("gas", tuple(replace(column, usual=0.0) for column in BENT.columns))
    evidence = along_bent([0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.0, 0.0])
    first, second = bent_posterior(evidence, firm).history(8, 1e-6).changes

    assert {(c.quantity, c.shape, c.begin) for c in (first, second)} == {("gas", "step", 3), ("gas", "step", 6)}
    assert first.size + second.size == pytest.approx(0.0, abs=0.02)


def bent_design(levels, accepted=()):
    past = MachinePast(along_bent(levels), np.append(np.ones(2), np.full(12, 0.01)), np.full(14, 1e-3))
    return past, Design(past, len(levels), accepted)


def candidates(path, count):
    return [ChangeCandidate(path, shape, begin, 0.1) for begin in range(1, count - 1) for shape in ("step", "ramp")]


def test_with_columns_in_one_line_a_path_gives_what_one_column_gives():
    """And that is the linear answer: score^2 / 2 precision - ln(precision) / 2, and how much of it is in the range."""
    _, design = bent_design([0.0, 0.0, 0.05, 0.1, 0.15])
    line = Path("gas", (NEAR, replace(FAR, along=NEAR.along)))
    inline, single = (weigh(candidates(path, 5), [design], np.zeros(1)) for path in (line, straight(NEAR)))

    for a, b in zip(inline, single, strict=True):
        assert (a.log_odds, a.size, a.deviation) == pytest.approx((b.log_odds, b.size, b.deviation), abs=1e-6)
    information, score = (array[..., 0] for array in design.sizes((NEAR,)))
    for w in single:
        course = w.candidate.course(design.times)
        precision = 1.0 + course @ information[:, 0] @ course
        mean, deviation = course @ score / precision, precision**-0.5
        inside, before = (
            np.diff(ndtr((np.array([0.0, 2.0 / course[-1]]) - m) / d)) for m, d in ((mean, deviation), (0, 1))
        )
        odds = np.log(0.1) + 0.5 * precision * mean**2 - 0.5 * np.log(precision) + np.log(inside / before)
        assert w.log_odds == pytest.approx(float(odds[0]), abs=1e-6)
        assert (w.size, w.deviation) == pytest.approx((max(0.0, mean), deviation))


def test_the_odds_of_a_change_along_a_bent_path_are_the_integral_over_its_sizes():
    """Summed over many sizes, each a hypothesis of its own, beside a change that was accepted."""
    past, design = bent_design([0.0, 0.05, 0.05, 0.06, 0.08])
    (first,) = weigh([ChangeCandidate(BENT, "step", 1, 0.1)], [design], np.zeros(1))
    design = Design(past, 5, (first,))
    start = first.size * np.array([0.0, 1.0, 1.0, 1.0, 1.0])
    information, score = design.sizes(BENT.columns)

    for w in weigh(candidates(BENT, 5), [design], np.zeros(1)):
        course = w.candidate.course(design.times)
        sizes, width = np.linspace(-start[-1] / course[-1], (2.0 - start[-1]) / course[-1], 400001, retstep=True)
        x = BENT.at(start + sizes[:, None] * course) - BENT.at(start)
        gains = np.einsum("grc,rc->g", x, score) - 0.5 * np.sum(
            x.reshape(-1, 10) @ information.reshape(10, 10) * x.reshape(-1, 10), 1
        )
        prior = np.exp(-0.5 * sizes**2)
        assert w.log_odds == pytest.approx(np.log(0.1) + np.log(np.exp(gains) @ prior / prior.sum()), abs=1e-3)
        assert w.size == pytest.approx(sizes[np.argmax(gains - 0.5 * sizes**2)], abs=2 * width)


def test_a_step_is_raised_at_once_and_dated_to_the_interval_in_which_it_came():
    evidence = recordings(np.random.default_rng(2), lambda share: 0.5 if share >= 0.5 else 0.0)

    assert first_raised(evidence) == 6
    (change,) = past(evidence).history(12, THRESHOLD).changes
    assert (change.quantity, change.shape) == ("leak", "step")
    assert change.since == pytest.approx((5 / 12 * YEAR, 6 / 12 * YEAR))
    assert change.interval[0] < 0.5 < change.interval[1]


def told(evidence, form=0.002, wander=0.02):
    return [c.quantity for c in posterior(evidence, KINDS, form, wander, (LEAK, WEAR)).history(12, THRESHOLD).changes]


def test_a_change_that_matters_to_nobody_is_certain_and_not_told_and_another_is_found_beside_it():
    def leaking(size):
        rng = np.random.default_rng(8)
        _, wander = spreads(KINDS, 0.002, 0.02)
        result = []
        for k in range(12):
            rows = rng.standard_normal((4000, 3)) * 20.0
            z = wander * rng.standard_normal(3) + np.array([0.0, 0.0, size * (k >= 6)])
            result.append(Evidence(k / 12 * YEAR, rows.T @ rows, rows.T @ (rows @ z + rng.standard_normal(4000))))
        return result

    def worn(evidence):
        return [replace(e, vector=e.vector + e.matrix @ [1.5 * (k >= 8), 0.0, 0.0]) for k, e in enumerate(evidence)]

    assert told(leaking(0.06)) == ["leak"]
    assert told(leaking(0.04)) == []
    assert posterior(leaking(0.04), KINDS, 0.002, 0.02, (LEAK, WEAR)).history(12, THRESHOLD).odds > 10.0
    assert told(worn(leaking(0.04))) == ["wear"]


def test_a_drift_is_told_as_a_drift_with_its_size_at_the_end():
    evidence = recordings(np.random.default_rng(3), lambda share: max(0.0, share - 0.25))

    (change,) = past(evidence).history(12, THRESHOLD).changes
    assert (change.quantity, change.shape) == ("leak", "ramp")
    assert change.size == pytest.approx(11 / 12 - 0.25, abs=0.02)
    assert change.since[0] <= 0.25 * YEAR <= change.since[1]


def test_what_is_repaired_is_a_second_change():
    evidence = recordings(np.random.default_rng(4), lambda share: 0.6 if 0.3 < share < 0.7 else 0.0)

    changes = past(evidence).history(12, THRESHOLD).changes
    assert [c.quantity for c in changes] == ["leak", "leak"]


def test_a_level_is_counted_from_the_first_recording_and_has_an_interval():
    mean, deviation = past(recordings(np.random.default_rng(5), lambda share: 0.4 if share > 0.5 else 0.0)).levels(LEAK)

    assert mean[0] == deviation[0] == 0.0
    assert np.all(np.abs(mean[1:7]) < 4 * deviation[1:7])
    assert np.all(np.abs(mean[7:] - 0.4) < 4 * deviation[7:])


def test_the_habits_of_a_fleet_are_found_from_its_machines():
    rng = np.random.default_rng(6)
    form, wander = usual([likeliest(recordings(rng, lambda share: 0.0), KINDS) for _ in range(12)])

    assert FORM / 3 < form < 3 * FORM and WANDER / 2 < wander < 2 * WANDER


def test_how_much_healthy_machines_seem_to_have_of_an_effect_is_found_effect_by_effect():
    """Of 21 machines that have much of the first effect and little of the second, some of which have changed."""
    rng = np.random.default_rng(8)
    squares = (rng.standard_normal((21, 2)) * [0.1, 0.01]) ** 2
    squares[:4] += 0.5

    much, little = profile(squares)

    assert 4.0 < much / little < 15.0
    assert much * little == pytest.approx(1.0)
