"""Errors of free runs, and what they are measured by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_diagnosis import noisy, tz17

from boom_diagnosis.freerun import Span, errors, noise_floor, typical
from boom_estimation.free_run import FreeRun, Metrics
from boom_model.errors import SimulationError
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS


def test_the_errors_of_a_channel_that_stands_still_are_measured_by_its_noise() -> None:
    made = noisy(tz17(), 3.0, 1)
    angle = replace(made.signals["angle"], values=np.full_like(made.signals["angle"].values, 0.3))
    made = replace(made, signals={**made.signals, "angle": angle})
    said = {name: made.signals[name].values + (1e-3 if name == "angle" else 0.0) for name in OUTPUTS}
    run = FreeRun("full", said, Metrics({}))
    assert errors(Span(made, 0.0, 3.0, resolution=(2e-4, 0.0, 0.0, 0.0)), run) == pytest.approx((5.0, 0.0, 0.0, 0.0))


def test_a_noise_floor_is_that_of_alike_draws_and_a_few_that_diverge_do_not_make_it() -> None:
    """A floor of 45 % stood beside a run that was off by 0.1 %: a valve had chattered in some of the draws."""
    walks = np.sum(np.cumsum(np.random.default_rng(0).standard_normal((16, 400)), axis=1) ** 2, axis=1)
    alike = np.column_stack((np.ones(16), walks))
    assert typical(alike) == pytest.approx(np.mean(alike, axis=0))
    alike[:2] *= 1e6
    assert typical(alike) == pytest.approx(4.0 * np.median(alike, axis=0))


def test_a_noise_floor_has_draws_left_where_one_leaves_the_range_of_the_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rod side ran empty in one of sixteen draws, and the report had no floor at all."""
    made, whole, runs = noisy(tz17(), 3.0, 1), Plant.run, []

    def run(*given: object, **options: object) -> object:
        runs.append(given)
        if len(runs) == 5:
            raise SimulationError("at 2 s rod_pressure (p_b) left its range", 2.0, np.zeros(11))
        return whole(*given, **options)  # type: ignore[arg-type]

    alike = np.array(noise_floor(Span(made, 0.0, 3.0), tz17(), 0))
    monkeypatch.setattr(Plant, "run", run)
    floor = np.array(noise_floor(Span(made, 0.0, 3.0), tz17(), 0))
    assert np.all(np.isfinite(floor)) and np.all(floor > 0.6 * alike) and np.all(floor < 1.6 * alike)
