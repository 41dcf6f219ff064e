"""How many cores a process computes on."""

import os

import pytest

from boom_model.cores import VARIABLE, usable_cores, use_at_most


@pytest.fixture(autouse=True)
def two_cores(monkeypatch):
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5})


def test_all_cores_are_used_that_the_process_may_run_on():
    assert usable_cores() == 2


@pytest.mark.parametrize(("said", "used"), [("1", 1), ("9", 2), ("0", 2), ("-1", 2), ("one", 2)])
def test_the_environment_keeps_a_process_to_fewer_and_what_is_no_number_above_zero_is_no_limit(monkeypatch, said, used):
    monkeypatch.setenv(VARIABLE, said)
    assert usable_cores() == used


def test_a_limit_is_that_of_what_the_process_starts_too():
    use_at_most(1)
    assert (usable_cores(), os.environ[VARIABLE]) == (1, "1")
