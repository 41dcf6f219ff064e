"""Tables 5.1 and 5.2 of the report, and the numbers of one recording, as HTML."""

from __future__ import annotations

from markupsafe import Markup

from boom_estimation.free_run import FreeRun
from boom_identification.validation import BagValidation, Validation
from boom_input.channels import PREDICTED
from boom_report.channels import STATISTICS, limits_text, number, off, ratio, statistic
from boom_report.templates import render
from boom_report.validation.reference import REMARK, any_alike, beside
from boom_report.validation.verdict import verdict


def summary(validation: Validation) -> Markup:
    """Tables 5.1 and 5.2."""
    return render(
        "boom_report/validation/summary.html",
        bags=validation.bags,
        channels=PREDICTED,
        verdict=verdict,
        statistic=statistic,
        load_text=load_text,
        off=off,
        scaled=_scaled,
        rad=_rad,
        beside=_beside,
        limits=limits_text(validation.bags[0].limits) if validation.bags else "",
        told=any_alike(validation.machine, [bag.recording.configuration for bag in validation.bags]),
        remark=REMARK,
    )


def errors(bag: BagValidation) -> Markup:
    """The numbers of one recording: both models against the measurement, channel by channel."""
    return render(
        "boom_report/validation/errors.html",
        bag=bag,
        channels=PREDICTED,
        names=STATISTICS,
        ratio=ratio,
        off=off,
        scaled=_scaled,
    )


def load_text(mass: float) -> str:
    """A load [kg] without its unit; an unknown one counts as none, and says so."""
    return "unknown" if mass != mass else f"{mass:g}"


def _scaled(prediction: FreeRun, metric: str, scale: float) -> str:
    value = prediction.metrics[metric]
    return "–" if value is None else number(value * scale)


def _rad(value: float | None) -> str:
    return "–" if value is None else f"{value:.5f}"


def _beside(bag: BagValidation, table: str) -> str:
    return beside(bag.recording.configuration, table) or "none alike"
