"""Runs one function over many cases through dask: local worker processes, or a cluster somebody else has started.

A result that raises is repeated (``RETRIES``), a worker that dies costs the case it was at, which another one repeats. What is
finished is told as it comes in. Everything listens on 127.0.0.1 only, unless a scheduler elsewhere was asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

RETRIES = 2


class EngineError(RuntimeError):
    """The workers cannot be had, or a case failed again and again."""

    exit_status = 2


class Engine:
    """Workers. Use through :func:`workers`."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def each(
        self, function: Callable[..., Any], cases: Sequence[str], arguments: Callable[[str], tuple[Any, ...]],
        done: Callable[[str, Any], None],
    ) -> None:  # fmt: skip
        """Calls function(*arguments(case)) for every case; done(case, result) here, in the order in which they finish.

        Raises:
            EngineError: a case failed in every attempt; the others that were running are given up.
        """
        from distributed import as_completed

        futures = {
            self._client.submit(
                function, *arguments(case), pure=False, retries=RETRIES, key=f"{function.__name__}-{case}"
            ): case
            for case in cases
        }
        try:
            for future in as_completed(futures):
                case = futures[future]
                try:
                    result = future.result()
                except Exception as error:
                    raise EngineError(
                        f"case {case} failed {RETRIES + 1} times: {type(error).__name__}: {error}"
                    ) from error
                done(case, result)
        finally:
            self._client.cancel(list(futures))


@contextmanager
def workers(scheduler: str | None, count: int, patience: float = 10.0) -> Iterator[Engine]:
    """``count`` local worker processes, or those of the scheduler at an address (tcp://HOST:PORT), waited for ``patience`` [s].

    Raises:
        EngineError: nobody answers at that address.
    """
    import dask
    from distributed import Client, LocalCluster

    settings = {
        "distributed.worker.daemon": False,  # a diagnosis may start processes of its own
        "distributed.scheduler.allowed-failures": 2 * RETRIES,
        "distributed.comm.timeouts.connect": f"{patience}s",
        "distributed.admin.low-level-log-length": 0,
        "logging.distributed": "error",
        # a worker's bookkeeping cost a tenth of each core, its memory, handed back with every array, a sixth more
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.system-monitor.interval": "5s",
        "distributed.admin.system-monitor.gil.enabled": False,
        "distributed.nanny.pre-spawn-environ": {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    }
    with dask.config.set(settings):
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=f"{patience}s")
            except (OSError, ValueError) as error:
                raise EngineError(
                    f"--scheduler {scheduler}: nobody answers ({error}): start `dask scheduler` there, or leave the option out"
                ) from None
            with client:
                yield Engine(client)
            return
        cluster = LocalCluster(
            n_workers=count, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address="127.0.0.1:0",
            memory_limit=None, silence_logs=50,
        )  # fmt: skip
        with cluster, Client(cluster) as client:
            yield Engine(client)
