"""Keeps the C library from returning memory to the system."""

from __future__ import annotations

import ctypes

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
"""Of glibc's mallopt (malloc.h)."""
_KEPT, _LARGEST = 1 << 30, 32 << 20
"""Bytes that are kept, and size of an array above which it is returned at once: the largest values that glibc accepts."""


def keep_memory() -> None:
    """Let this process keep freed memory: a diagnosis allocates arrays of some MB again and again.

    The system clears each page before it provides it, which takes time. Without glibc this does nothing.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for option, value in ((_TRIM_THRESHOLD, _KEPT), (_MMAP_THRESHOLD, _LARGEST), (_ARENA_MAX, 1)):
            mallopt(option, value)
