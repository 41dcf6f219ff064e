"""What was made last, to be had again without making it again; safe to use from several threads."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import RLock
from typing import Generic, TypeVar

T = TypeVar("T")


class Recent(Generic[T]):
    """Up to ``most`` things by their keys; the one that nobody has wanted for longest goes first."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[Hashable, T] = OrderedDict()
        self._using = RLock()

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """What has this key; made where it is not there. Two threads that want the same wait for the first."""
        with self._using:
            if key not in self._kept:
                self._kept[key] = make()
            self._kept.move_to_end(key)
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
            return self._kept[key]
