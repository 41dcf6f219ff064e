"""Runs one function over many cases: in local worker processes, or on an existing dask cluster.

A call that raises is repeated (``RETRIES``); if a worker dies, another one repeats its case. Results are passed on as they arrive.
Local workers receive their work through inherited pipes: no port is opened, and they end with the process that started them,
however that ends.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import os
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol
from uuid import uuid4

from boom_model.cores import use_at_most
from boom_node.children import die_with_parent, without_ctrl_c

RETRIES = 2
STARTING = 6
"""A cluster that grows with its work may take so much longer to start a worker than to answer."""


class EngineError(RuntimeError):
    """There are no workers, or a case failed repeatedly."""

    exit_status = 2


class Engine(Protocol):
    """Workers. Use through :func:`workers`."""

    def each(
        self, function: Callable[..., Any], cases: Sequence[str], arguments: Callable[[str], tuple[Any, ...]],
        done: Callable[[str, Any], None], failed: Callable[[str, str], None] | None = None,
    ) -> None:  # fmt: skip
        """Calls function(*arguments(case)) for every case; done(case, result) in this process, in the order in which they finish.

        A case that failed in every attempt is passed to failed(case, reason), and the rest goes on.

        Raises:
            EngineError: a case failed in every attempt and there is no ``failed``; other running cases are abandoned.
        """


@contextmanager
def workers(scheduler: str | None, count: int, patience: float = 10.0) -> Iterator[Engine]:
    """``count`` local worker processes, or those of the scheduler at tcp://HOST:PORT, waiting for it for ``patience`` [s].

    While it has no worker, a call of ``each`` waits for ``STARTING`` times as long and then raises EngineError.

    Raises:
        EngineError: no scheduler answers at that address.
    """
    if scheduler is not None:
        with _cluster(scheduler, patience) as engine:
            yield engine
        return
    local = _LocalWorkers(count)
    try:
        yield local
    finally:
        local.close()


class _Worker:
    """A process that executes one call at a time."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, os.getpid()))
        with without_ctrl_c():  # it is for the command, which ends its workers
            self._process.start()
        theirs.close()

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


class _LocalWorkers:
    def __init__(self, count: int) -> None:
        self._count = count
        self._idle: list[_Worker] = []

    def each(
        self, function: Callable[..., Any], cases: Sequence[str], arguments: Callable[[str], tuple[Any, ...]],
        done: Callable[[str, Any], None], failed: Callable[[str, str], None] | None = None,
    ) -> None:  # fmt: skip
        waiting, attempts = deque(cases), Counter[str]()
        busy: dict[Connection, tuple[_Worker, str]] = {}
        try:
            while waiting or busy:
                while waiting and len(busy) < self._count:
                    worker = self._idle.pop() if self._idle else _Worker()
                    busy[worker.pipe] = worker, waiting[0]
                    with suppress(OSError):  # it has died: its pipe says so below
                        worker.pipe.send((function, arguments(waiting[0])))
                    waiting.popleft()
                ready = wait(list(busy))
                for pipe in [p for p in busy if p in ready]:
                    worker, case = busy.pop(pipe)
                    try:
                        good, result = worker.pipe.recv()
                        self._idle.append(worker)
                    except (EOFError, OSError):
                        worker.end()
                        good, result = False, "its worker process ended"
                    if good:
                        done(case, result)
                        continue
                    attempts[case] += 1
                    if attempts[case] > RETRIES:
                        _give_up(failed, case, result)
                    else:
                        waiting.append(case)
        finally:
            for worker, _ in busy.values():
                worker.end()

    def close(self) -> None:
        """End all workers."""
        for worker in self._idle:
            worker.end()


def _serve(pipe: Connection, parent: int) -> None:
    """Main loop of a local worker: executes calls until the pipe is closed, with one thread."""
    use_at_most(1)
    die_with_parent(parent)()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with suppress(EOFError, BrokenPipeError):
        while True:
            function, arguments = pipe.recv()
            try:
                answer = True, function(*arguments)
            except Exception as error:
                answer = False, _said(error)
            pipe.send(answer)


class _Dask:
    def __init__(self, client: Any, scheduler: str, patience: float) -> None:
        self._client, self._scheduler, self._patience = client, scheduler, patience

    def each(
        self, function: Callable[..., Any], cases: Sequence[str], arguments: Callable[[str], tuple[Any, ...]],
        done: Callable[[str, Any], None], failed: Callable[[str, str], None] | None = None,
    ) -> None:  # fmt: skip
        from distributed import as_completed

        futures = {
            self._client.submit(
                function, *arguments(case), pure=False, retries=RETRIES, key=f"{function.__name__}-{case}-{uuid4().hex}"
            ): case
            for case in cases
        }
        coming = as_completed(futures)
        try:
            while coming.count():
                self._wait(coming)
                future = next(coming)
                case = futures[future]
                if future.cancelled():  # no fault of the case
                    raise EngineError(f"--scheduler {self._scheduler}: it has ended: start it and this command again")
                try:
                    result = future.result()
                except Exception as error:
                    _give_up(failed, case, _said(error))
                    continue
                done(case, result)
        finally:
            self._client.cancel(list(futures))

    def _wait(self, coming: Any) -> None:
        """Until a case has finished. Raises EngineError: there has been no worker for long; dask waits for one without end."""
        for second in itertools.count():
            for _ in range(10):
                if coming.has_ready():
                    return
                time.sleep(0.1)
            if second % 5 == 0:  # not always: a large cluster has a long answer
                try:
                    self._client.wait_for_workers(1, self._patience)
                except TimeoutError:
                    raise EngineError(
                        f"--scheduler {self._scheduler}: no worker for {self._patience:g} s: start "
                        f"`dask worker {self._scheduler}`, or leave the option out"
                    ) from None
                except OSError:
                    pass  # the scheduler has gone: the cases say so


def _said(error: Exception) -> str:
    known = isinstance(getattr(error, "exit_status", None), int)
    return str(error) if known else f"{type(error).__name__}: {error}"


def _give_up(failed: Callable[[str, str], None] | None, case: str, reason: str) -> None:
    if failed is None:
        raise EngineError(f"case {case} failed {RETRIES + 1} times: {reason}")
    failed(case, reason)


@contextmanager
def _cluster(scheduler: str, patience: float) -> Iterator[Engine]:
    import dask
    from distributed import Client

    settings = {"distributed.comm.timeouts.connect": f"{patience}s", "distributed.admin.low-level-log-length": 0}
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # a page of traceback where a scheduler ends
    with dask.config.set(settings):
        try:
            asyncio.run(_greet(scheduler, patience))
            client = Client(scheduler, timeout=f"{patience}s")
        except Exception as error:  # of any kind: a protocol that dask lacks, or that needs certificates
            why = str(error).partition("\n")[0] or "it says nothing"
            raise EngineError(
                f"--scheduler {scheduler}: no answer ({why}): start `dask scheduler` there, or leave the option out"
            ) from None
        with client:
            yield _Dask(client, scheduler, STARTING * patience)


async def _greet(scheduler: str, patience: float) -> None:
    """Raises OSError: what listens there does not answer; Client would wait for its greeting without end."""
    from distributed.comm import connect

    comm = await asyncio.wait_for(connect(scheduler, timeout=patience), 1.5 * patience)
    await comm.close()
