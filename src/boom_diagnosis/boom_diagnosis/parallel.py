"""Several pieces of work at a time, for those that are not wide enough to fill all cores by themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from boom_model.cores import usable_cores

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_parallel(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """``function`` of every item, on all cores, in the order of the items; the observers hold no lock of Python."""
    if len(items) < 2:
        return [function(item) for item in items]
    pool = ThreadPoolExecutor(usable_cores())
    try:
        return list(pool.map(function, items))
    finally:
        pool.shutdown(cancel_futures=True)
