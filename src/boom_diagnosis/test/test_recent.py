"""What was made last is kept, and made once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from boom_diagnosis.recent import Recent


def test_what_was_made_is_not_made_again() -> None:
    made: list[str] = []
    kept = Recent[str](2)
    for key in ("a", "b", "a", "c", "a"):
        assert kept.get(key, lambda key=key: made.append(key) or key) == key  # type: ignore[misc]
    assert made == ["a", "b", "c"]


def test_the_one_that_nobody_wanted_for_longest_goes_first() -> None:
    made: list[str] = []
    kept = Recent[str](2)
    for key in ("a", "b", "a", "c", "b"):
        kept.get(key, lambda key=key: made.append(key) or key)  # type: ignore[misc]
    assert made == ["a", "b", "c", "b"]


def test_threads_that_want_the_same_get_the_same() -> None:
    kept = Recent[object](1)
    with ThreadPoolExecutor(8) as pool:
        assert len({id(x) for x in pool.map(lambda _: kept.get("a", object), range(64))}) == 1


def test_what_could_not_be_made_is_not_kept() -> None:
    kept = Recent[int](1)
    with pytest.raises(ZeroDivisionError):
        kept.get("a", lambda: 1 // 0)
    assert kept.get("a", lambda: 2) == 2
