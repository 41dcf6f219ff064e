"""Child processes that end with their parent, however it ends, and leave a Ctrl-C to it."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from select import POLLIN, poll
from threading import Thread

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True)


def die_with_parent(parent: int) -> Callable[[], None]:
    """For ``preexec_fn``: the kernel kills the new process when its parent process ``parent`` ends, however it ends."""

    def run() -> None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # The parent may have gone between fork and prctl.
        if os.getppid() != parent:
            os._exit(1)

    return run


def end_with(process: int) -> None:
    """For a pool's ``initializer``: this process ends when ``process`` does, however it ends.

    A worker of multiprocessing holds the pipes open by which it, and the server that forked it, would see that.
    """

    def wait() -> None:
        with suppress(ProcessLookupError):  # it has gone already
            try:
                gone = poll()
                gone.register(os.pidfd_open(process), POLLIN)
                gone.poll()
            except ProcessLookupError:
                raise
            except (AttributeError, OSError):  # not on this system
                return
        os._exit(1)

    Thread(target=wait, name="end_with", daemon=True).start()


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Processes of multiprocessing that are started in here never see a Ctrl-C, and their parent sees it once they are started.

    One that still imports, or whose parent ends while it starts, would end in a traceback.
    """
    resource_tracker.ensure_running()  # here, because it lets the signal through once it has started
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
