"""The four channels as tables and reports show them: label, symbol, units for people, and what judges them."""

from __future__ import annotations

from dataclasses import dataclass

from boom_estimation.free_run import Metrics
from boom_identification.validation import NOISE_FACTOR, BagValidation


@dataclass(frozen=True)
class ShownChannel:
    """One channel in words.

    Attributes:
        name: of the signal in a recording.
        label, symbol: for people; the symbol as HTML.
        unit, scale: in which it is shown, and how many of them one SI unit is.
        error_unit, error_scale: the same for its errors.
        metric: the member of `Metrics` that judges it.
        statistic: what that member is, in a word.
    """

    name: str
    label: str
    symbol: str
    unit: str
    scale: float
    error_unit: str
    error_scale: float
    metric: str
    statistic: str

    def error(self, metrics: Metrics) -> float | None:
        """Error [SI] of this channel; None where nothing could be compared."""
        value: float | None = getattr(metrics, self.metric)
        return value

    def error_text(self, value: float | None) -> str:
        """An error [SI] with unit and statistic: "0.25 mrad mean"."""
        if value is None:
            return "not compared"
        return f"{number(value * self.error_scale)} {self.error_unit} {self.statistic}"


CHANNELS = (
    ShownChannel("angle", "angle", "q<sub>2</sub>", "rad", 1.0, "mrad", 1e3, "angle_mae_rad", "mean"),
    ShownChannel("rate", "rate", "dq<sub>2</sub>/dt", "rad/s", 1.0, "mrad/s", 1e3, "rate_rmse_rad_s", "rms"),
    ShownChannel(
        "hose_pressure", "hose pressure", "p<sub>h</sub>", "bar", 1e-5, "bar", 1e-5, "hose_pressure_rmse_pa", "rms"
    ),
    ShownChannel(
        "rod_pressure", "rod pressure", "p<sub>b</sub>", "bar", 1e-5, "bar", 1e-5, "rod_pressure_rmse_pa", "rms"
    ),
)


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits at least, never in powers of ten between 1e-4 and 1e6."""
    if value == 0:
        return "0"
    size = abs(value)
    if not 1e-4 <= size < 1e6:
        return f"{value:.{digits}g}"
    decimals = 0
    while size < 10 ** (digits - 1) and decimals < 8:
        size *= 10
        decimals += 1
    return f"{value:.{decimals}f}"


def ratio(channel: ShownChannel, bag: BagValidation) -> float | None:
    """Error of the full model over its limit: above 1 noise does not explain it. None where it was not compared."""
    value, limit = channel.error(bag.full.metrics), channel.error(bag.limits)
    if value is None or limit is None:
        return None
    return value / limit if limit > 0 else (float("inf") if value > 0 else 0.0)


def limits_text(limits: Metrics) -> str:
    """One sentence on what counts as right."""
    parts = [f"{c.label} {c.error_text(c.error(limits))}" for c in CHANNELS if c.error(limits) is not None]
    return (
        f"Limits, up to which noise explains an error: {', '.join(parts)} (rate and pressures: {NOISE_FACTOR:g} times "
        "the sensors' noise; angle: what the noise of the measured currents adds up to)."
    )
