"""How the C library hands memory back to the system."""

from __future__ import annotations

import ctypes

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
"""Of glibc's mallopt (malloc.h)."""
_KEPT, _LARGEST = 1 << 30, 32 << 20
"""Bytes that are kept, and those of the largest array from which on it is handed back at once: the most that glibc takes."""


def keep_memory() -> None:
    """Lets this process keep what it has had: a diagnosis asks for arrays of some MB again and again.

    The system clears each page that it hands out. Where the C library is not glibc, nothing happens.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for option, value in ((_TRIM_THRESHOLD, _KEPT), (_MMAP_THRESHOLD, _LARGEST), (_ARENA_MAX, 1)):
            mallopt(option, value)
