"""Processes that another one starts: no orphan is left, in whatever way the parent ends."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True)


def die_with_parent(parent: int) -> Callable[[], None]:
    """For ``preexec_fn``: the new process is killed when the process ``parent``, which starts it, ends in whatever way."""

    def run() -> None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # The parent may have gone between fork and prctl.
        if os.getppid() != parent:
            os._exit(1)

    return run
