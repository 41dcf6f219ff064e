"""Cases on worker processes: results as they come, a failure repeated, a lost worker made good."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from engine_cases import computes_on, fails_always, fails_at_first, kills_its_worker_at_first, slow, twice

from boom_fleet.engine import RETRIES, EngineError, workers


@pytest.fixture(scope="module")
def engine():
    with workers(None, 2) as started:
        yield started


def collect(engine, function, names, *arguments):
    results = {}
    engine.each(function, names, lambda name: (name, *arguments), results.__setitem__)
    return results


def test_every_case_is_told_once(engine):
    assert collect(engine, twice, ["a", "b", "c"]) == {"a": "aa", "b": "bb", "c": "cc"}


def test_a_worker_has_one_thread_and_every_core_is_open_to_it(engine):
    assert collect(engine, computes_on, ["a", "b"]) == dict.fromkeys("ab", (1, os.sched_getaffinity(0)))


def test_a_case_that_fails_is_repeated(engine, tmp_path):
    assert collect(engine, fails_at_first, ["a", "b"], str(tmp_path)) == {"a": "well", "b": "well"}
    assert len(list(tmp_path.iterdir())) == 4


def test_a_case_that_fails_always_ends_the_run_with_its_name(engine, tmp_path):
    with pytest.raises(EngineError, match=f"case a failed {RETRIES + 1} times: ValueError: no way"):
        collect(engine, fails_always, ["a"], str(tmp_path))
    assert len(list(tmp_path.iterdir())) == RETRIES + 1


def test_a_worker_that_dies_costs_the_repetition_of_its_case_only(engine, tmp_path):
    names = ["a", "b", "c", "d"]
    assert collect(engine, kills_its_worker_at_first, names, str(tmp_path)) == {n: n for n in names}
    begun = {n: len(list(tmp_path.glob(f"{n}-*"))) for n in names}
    assert begun["b"] == 2
    assert sum(begun.values()) <= len(names) + 2, "the killed case, and at most what its worker had been given besides"


def test_a_scheduler_that_is_not_there_is_said_in_one_line():
    nobody = workers("tcp://127.0.0.1:9", 1, patience=0.5)
    with pytest.raises(EngineError, match=r"--scheduler tcp://127.0.0.1:9: no answer") as told:
        nobody.__enter__()
    assert "\n" not in str(told.value)


def test_a_scheduler_that_runs_elsewhere_is_used():
    from distributed import LocalCluster

    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as cluster,
        workers(cluster.scheduler_address, 1) as remote,
    ):
        assert collect(remote, twice, ["x"]) == {"x": "xx"}


def test_a_scheduler_without_workers_is_given_up_in_one_line():
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as cluster,
        workers(cluster.scheduler_address, 1, patience=0.5) as remote,
        pytest.raises(EngineError, match=r"no worker for 3 s: start `dask worker tcp://127.0.0.1:\d+`"),
    ):
        collect(remote, twice, ["x"])


def test_a_scheduler_that_ends_is_no_fault_of_the_cases():
    from distributed import LocalCluster

    done, failed = [], []
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:

        def first(case, _):
            done.append(case)
            cluster.close()

        with (
            workers(cluster.scheduler_address, 1, patience=1.0) as remote,
            pytest.raises(EngineError, match="it has ended: start it and this command again"),
        ):
            remote.each(slow, list("abcdef"), lambda case: (case,), first, lambda *of: failed.append(of))
    assert len(done) == 1 and failed == []
