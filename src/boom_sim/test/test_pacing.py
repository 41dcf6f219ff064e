"""Time of the real-time simulation, with clocks given by hand."""

from __future__ import annotations

import pytest

from boom_sim.pacing import LARGEST_BACKLOG, SimulationPacer, WatchedCommand


def test_periods_follow_the_steady_clock_without_drift() -> None:
    pacer = SimulationPacer(0.01)
    pacer.due(5.0)
    assert sum(pacer.due(5.0 + 0.0101 * k) for k in range(1, 1001)) == pytest.approx(1010, abs=1)


def test_late_tick_is_made_up_for() -> None:
    pacer = SimulationPacer(0.01)
    pacer.due(0.0)
    assert pacer.due(0.1) == 10


def test_a_tick_that_is_called_twice_is_one_period() -> None:
    pacer = SimulationPacer(0.01)
    pacer.due(0.0)
    assert [pacer.due(t) for t in (0.01, 0.02, 0.02, 0.04, 0.05)] == [1, 1, 0, 2, 1]


def test_long_standstill_is_skipped_and_counted() -> None:
    pacer = SimulationPacer(0.01)
    pacer.due(0.0)
    assert pacer.due(10.0) == LARGEST_BACKLOG
    assert pacer.skipped == 1000 - LARGEST_BACKLOG
    assert pacer.due(10.01) == 1


def test_paused_time_is_not_made_up_for() -> None:
    pacer = SimulationPacer(0.01)
    pacer.due(0.0)
    pacer.hold(5.0)
    assert pacer.due(5.01) == 1
    assert pacer.skipped == 0


def test_command_expires_once_after_100_ms_and_a_new_one_opens_again() -> None:
    watch = WatchedCommand()
    assert not watch.has_expired(0.0)
    assert watch.receive(1.0, 0.0, True) == ""
    assert not watch.has_expired(1.099)
    assert watch.has_expired(1.101)
    assert not watch.has_expired(1.2)
    assert watch.closed
    watch.receive(2.0, 0.0, True)
    assert not watch.closed


def test_command_that_arrives_late_is_refused_but_an_unstamped_one_is_fresh() -> None:
    watch = WatchedCommand()
    assert "older than 100 ms" in watch.receive(1.0, 0.2, True)
    assert watch.closed
    assert watch.receive(1.0, 1.7e9, False) == ""
    assert "in the future" in watch.receive(1.0, -0.2, True)
    assert (watch.received, watch.late) == (3, 2)


def test_after_a_standstill_a_command_without_a_stamp_may_be_old_and_is_refused() -> None:
    watch = WatchedCommand()
    for k in range(100):
        watch.has_expired(1.0 + 0.01 * k)
        assert watch.receive(1.0 + 0.01 * k, 0.0, False) == ""
    assert watch.has_expired(5.0)  # frozen for 3 s
    assert "stood still" in watch.receive(5.001, 0.0, False)
    assert watch.closed
    assert watch.receive(5.002, 0.001, True) == ""
    assert watch.receive(5.2, 0.0, False) == ""
