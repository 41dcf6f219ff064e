"""When a fit to free runs counts."""

from types import SimpleNamespace
from typing import Any

import pytest

from boom_diagnosis import free_fit


@pytest.mark.parametrize(
    ("better", "worst_before", "worst_after", "kept"),
    [(0.6, 1.0, 1.0, True), (0.6, 1.0, 1.2, False), (0.6, 1.2, 1.2, True), (1.0, 1.0, 1.0, False)],
)
def test_a_fit_counts_where_it_helps_and_leaves_no_channel_worse_than_with_parameters_only(
    monkeypatch: pytest.MonkeyPatch, better: float, worst_before: float, worst_after: float, kept: bool
) -> None:
    base, before, after = "base", "before", "after"
    monkeypatch.setattr(free_fit, "_far", lambda case, at: True)
    monkeypatch.setattr(free_fit, "fitted_to_free_runs", lambda case, at, bags, select: base if at is base else after)
    monkeypatch.setattr(free_fit, "worsening", lambda case, old, new: 1.0 if old is base else better)
    monkeypatch.setattr(free_fit, "worst_channel", lambda case, old, new: worst_after if new is after else worst_before)
    case: Any = SimpleNamespace(trained=[base, before], bags=[], training=[], select=[], final=None, taken=[None])

    free_fit.fit_to_free_runs(case)

    assert case.trained == [base, after if kept else before]
