"""The closed loop at the limits of what the law was told: a pump that is too small, dead time, oscillations, other cranes."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, pi
from pathlib import Path

import numpy as np
import pytest

from boom_trials.robustness.oscillation import SAFE, oscillation_of
from boom_trials.robustness.plants import DEAD_ZONE, SPRING, PlantCase
from boom_trials.robustness.requirements import PUMP
from boom_trials.robustness.study import Result, StudyRun, carry_out_one

FOLDER = str(Path(__file__).parents[3] / "bags")
T = 0.01


def short(case: PlantCase, bag: str, duration: float = 8.0, *, governed: bool = False) -> Result:
    return carry_out_one(StudyRun("improved", bag, case, folder=FOLDER, duration=duration, governed=governed))


def test_a_path_that_the_pump_cannot_follow_is_slowed_and_not_left() -> None:
    pump = PlantCase("pump", effects=PUMP)
    told = short(replace(pump, told=True), "healthy/extended", governed=True)
    assert told.finished
    assert told.maxe < 3e-3
    assert short(replace(pump, told=True), "healthy/extended").maxe > 5 * told.maxe


def test_a_pump_that_is_smaller_than_the_file_says_is_found_out_while_the_valve_is_wide_open() -> None:
    pump = PlantCase("pump", effects=PUMP)
    governed, left = (short(pump, "healthy/extended", 20.0, governed=governed) for governed in (True, False))
    assert governed.mae < 0.4 * left.mae
    assert governed.maxe < 0.4 * left.maxe


def test_a_dead_time_that_nobody_told_is_found_before_it_does_harm() -> None:
    late, later = (
        short(PlantCase("late", effects={"command_delay": {"T": delay}}), "healthy/extended", 16.0)
        for delay in (0.04, 0.06)
    )
    assert late.finished
    assert later.finished
    assert max(late.mae, later.mae) < 0.5e-3


def test_a_spring_and_a_dead_zone_that_are_five_per_cent_off_are_learnt() -> None:
    off = short(PlantCase("off", factors={DEAD_ZONE: 1.05, SPRING: 1.05}), "healthy/extended", 16.0)
    assert off.late_mae < 0.3e-3


@pytest.mark.parametrize("gain", [0.7, 1.4])
def test_a_spool_that_goes_a_third_less_or_further_than_its_file_says_is_learnt_in_the_first_motion(
    gain: float,
) -> None:
    off = short(PlantCase("off", factors={"main_valve_spool.A_s": gain}), "healthy/extended", 16.0, governed=True)
    assert off.finished
    assert off.noted is None
    assert off.mae < 0.4e-3  # in the first motions part of it passes for dead time


@pytest.mark.parametrize(("noted", "recognised"), [(3.6, 0.6), (None, inf)])
def test_an_oscillation_is_timed_from_its_beginning(noted: float | None, recognised: float) -> None:
    time = np.arange(0.0, 10.0, T)
    error = np.where(time > 3.0, 2e-3 * np.sin(2 * pi * 2.0 * (time - 3.0)), 0.0)
    found = oscillation_of(error, T, noted, stopped=False)
    assert found.recognised == pytest.approx(recognised, abs=0.05)
    fading = error * np.where(time > 3.0 + SAFE, 0.3, 1.0)
    assert oscillation_of(fading, T, noted, stopped=False).calmed
    assert not oscillation_of(error * np.where(time > 6.0, 2.0, 1.0), T, noted, stopped=False).calmed


def test_a_motion_that_rings_down_is_no_oscillation() -> None:
    time = np.arange(0.0, 10.0, T)
    error = 2e-3 * np.exp(-3.0 * time) * np.sin(2 * pi * 2.0 * time)
    assert isnan(oscillation_of(error, T, None, stopped=False).recognised)
