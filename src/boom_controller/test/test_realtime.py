"""Garbage is collected between cycles and nowhere else."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator

import pytest

from boom_controller.realtime import Garbage


class Loop:
    """Something that only the collector can free."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture
def garbage() -> Iterator[Garbage]:
    made = Garbage()
    made.hold()
    yield made
    made.release()


def test_nothing_is_collected_until_a_cycle_is_over(garbage: Garbage) -> None:
    left = weakref.ref(Loop())
    kept = [[k] for k in range(20_000)]  # more than Python's own threshold
    assert len(kept) == 20_000
    assert left() is not None
    for _ in range(100):
        garbage.cycle_is_over()
    assert left() is None


def test_afterwards_python_collects_as_it_likes() -> None:
    made = Garbage()
    made.hold()
    assert not gc.isenabled()
    made.release()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
