"""Which cases a trial has."""

from collections import Counter
from itertools import pairwise

import pytest

from concealed_plant.cases import SHARES, cases
from concealed_plant.concealments import CONCEALMENTS, KNOWN, OUTSIDE


def test_the_same_seed_gives_the_same_cases_and_another_seed_others():
    assert cases(7, 40) == cases(7, 40)
    assert cases(7, 40) != cases(8, 40)
    assert {c.name for c in cases(7, 40)}.isdisjoint(c.name for c in cases(8, 40))


def test_300_cases_hold_every_effect_at_every_strength_and_every_kind():
    drawn = cases(3, 300)
    singles = Counter(c.effects[0] for c in drawn if c.kind == "effect")
    assert set(singles) == {(name, strength) for name in KNOWN for strength in (0.5, 1.0, 3.0)}
    assert {c.effects[0][0] for c in drawn if c.kind == "outside"} == set(OUTSIDE)
    assert set(Counter(c.kind for c in drawn)) == set(SHARES)
    assert len(drawn) == 300 == len({c.name for c in drawn})


def test_few_cases_are_shared_out_without_one_more_or_less():
    for count in (1, 5, 12, 47):
        assert len(cases(1, count)) == count


def test_pairs_lie_in_different_subsystems():
    for case in cases(5, 300):
        if case.kind == "pair":
            first, second = (set(CONCEALMENTS[name].subsystems) for name, _ in case.effects)
            assert not first & second


def test_order_and_names_tell_nothing_of_the_kind():
    kinds = [c.kind for c in cases(11, 300)]
    assert kinds != sorted(kinds)
    runs = sum(a != b for a, b in pairwise(kinds))
    assert runs > 100


def test_no_case_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        cases(1, 0)
