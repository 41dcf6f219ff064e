"""When a fit to free runs counts."""

from types import SimpleNamespace
from typing import Any

import pytest

from boom_diagnosis import free_fit
from boom_diagnosis.case import Case


@pytest.mark.parametrize(
    ("better", "worst_before", "worst_after", "kept"),
    [(0.6, 1.0, 1.0, True), (0.6, 1.0, 1.2, False), (0.6, 1.2, 1.2, True), (1.0, 1.0, 1.0, False)],
)
def test_a_fit_counts_where_it_helps_and_leaves_no_channel_worse_than_with_parameters_only(
    monkeypatch: pytest.MonkeyPatch, better: float, worst_before: float, worst_after: float, kept: bool
) -> None:
    base, before, after = "base", "before", "after"
    monkeypatch.setattr(free_fit, "far_from_noise", lambda case, at: True)
    monkeypatch.setattr(free_fit, "fitted_to_free_runs", lambda case, at, bags, select: base if at is base else after)
    monkeypatch.setattr(free_fit, "worsening", lambda case, old, new: 1.0 if old is base else better)
    monkeypatch.setattr(free_fit, "worst_channel", lambda case, old, new: worst_after if new is after else worst_before)
    case: Any = SimpleNamespace(trained=[base, before], bags=[], training=[], select=[], final=None, taken=[None])

    free_fit.fit_to_free_runs(case)

    assert case.trained == [base, after if kept else before]


@pytest.mark.parametrize(("rest", "kept"), [(0.0, False), (0.5, True)])
def test_what_leaves_nothing_in_one_step_errors_and_runs_freely_near_the_noise_keeps_its_numbers(
    monkeypatch: pytest.MonkeyPatch, rest: float, kept: bool
) -> None:
    monkeypatch.setattr(free_fit, "far_from_noise", lambda case, at: at == "base")
    monkeypatch.setattr(free_fit, "fitted_to_free_runs", lambda case, at, bags, select: f"{at}, run")
    monkeypatch.setattr(free_fit, "worsening", lambda case, old, new: 0.5)
    monkeypatch.setattr(free_fit, "worst_channel", lambda case, old, new: 1.0)
    case: Any = SimpleNamespace(
        trained=["base", "found"],
        bags=[],
        training=[],
        select=[],
        final=None,
        taken=[None],
        last="found",
        rest=lambda at: rest,
    )

    free_fit.fit_to_free_runs(case)

    assert case.trained == ["base, run", "found, run" if kept else "found"]


@pytest.mark.parametrize("better", [False, True])
def test_where_nothing_was_found_the_likeliest_observers_numbers_are_handed_out_if_free_runs_err_less_with_them(
    monkeypatch: pytest.MonkeyPatch, better: bool
) -> None:
    """A sound crane's numbers, bent by the observer that sees most, ran at 24 times the noise."""
    nothing: Any = None
    case = Case(nothing, nothing, [], [], [], [], [], (), 0, trained=["tight"], likeliest=("whole", "loose"))  # type: ignore[list-item, arg-type]
    case.spared[0] = "sharp"  # type: ignore[assignment]
    monkeypatch.setattr(free_fit, "far_from_noise", lambda case, at: False)
    monkeypatch.setattr(free_fit, "worsening", lambda case, old, new, fitted: 0.5 if better and fitted else 1.5)

    free_fit.fit_to_free_runs(case)

    assert (case.trained, case.last) == ((["loose"], "whole") if better else (["tight"], "sharp"))
    assert case.sharpest == ("sharp" if better else None)


@pytest.mark.parametrize("proving", [False, True])
def test_parameters_only_that_are_fitted_to_free_runs_are_what_is_handed_out(
    monkeypatch: pytest.MonkeyPatch, proving: bool
) -> None:
    """The proof showed 16 % where the machine file that came with it had 22."""
    nothing: Any = None
    bag: Any = "bag"
    case = Case(nothing, nothing, [], [bag] if proving else [], [], [], [], (), 0, trained=["base"])  # type: ignore[list-item]
    case.spared[0] = "sharp"  # type: ignore[assignment]
    monkeypatch.setattr(free_fit, "far_from_noise", lambda case, at: True)
    monkeypatch.setattr(free_fit, "fitted_to_free_runs", lambda case, at, bags, select: f"{at}, run")
    monkeypatch.setattr(free_fit, "worsening", lambda case, old, new: 0.5)

    free_fit.fit_to_free_runs(case)

    assert case.trained == ["base, run"]
    assert (case.last, case.sharpest) == ("base, run" if proving else "sharp, run", "sharp")
