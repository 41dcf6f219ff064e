"""Parts of recordings are chosen by what they tell together."""

import numpy as np
import pytest

from boom_estimation.design import SHARPER, knowledge, most_telling, sharpens

SAME, OTHER = np.diag([100.0, 0.0]), np.diag([0.0, 50.0])


def test_the_next_part_is_the_one_that_adds_most_to_those_before():
    order = list(most_telling([SAME, 0.9 * SAME, OTHER]))

    assert [k for k, _ in order] == [0, 2, 1]
    assert [known for _, known in order] == pytest.approx([np.log(101), np.log(101 * 51), np.log(191 * 51)])
    assert list(most_telling([])) == []


def test_numbers_are_sharper_if_their_standard_deviations_shrink_on_the_mean():
    shrunk = (1.0 + SHARPER * 1.01) ** 2
    assert sharpens(knowledge(SAME), knowledge(shrunk * (SAME + np.eye(2)) - np.eye(2)), 2)
    assert not sharpens(knowledge(SAME), knowledge(1.3 * SAME), 2), (
        "one of two is sharper by 15 %, the other not at all"
    )
