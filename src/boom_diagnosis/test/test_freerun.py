"""Errors of free runs, and what they are measured by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_diagnosis import noisy, tz17

from boom_diagnosis.freerun import Span, errors, typical
from boom_estimation.free_run import FreeRun, Metrics
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
