"""The measured channels as tables and charts show them: headings, units for people, errors in words."""

from __future__ import annotations

from boom_estimation.free_run import Metrics
from boom_identification.validation import NOISE_FACTOR, BagValidation
from boom_input.channels import PREDICTED, Sensor

STATISTICS = {"mae": "mean", "rmse": "rms"}
"""What a statistic of errors is, in a word."""


def statistic(sensor: Sensor) -> str:
    """What that error is, in a word."""
    return STATISTICS[sensor.statistics[0]]


def short(sensor: Sensor) -> str:
    """A heading where there is little room: pressures by their symbol."""
    return sensor.symbol if sensor.is_pressure else sensor.label


def error_text(sensor: Sensor, value: float | None) -> str:
    """An error [SI] with unit and statistic: "0.25 mrad mean"."""
    if value is None:
        return "not compared"
    return f"{number(value * sensor.error.scale)} {sensor.error.name} {statistic(sensor)}"


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


def ratio(sensor: Sensor, bag: BagValidation) -> float | None:
    """Error of the full model over its limit: above 1 noise does not explain it. None where it was not compared."""
    value, limit = bag.full.metrics[sensor.judging], bag.limits[sensor.judging]
    if value is None or limit is None or bag.scarce(sensor.name) is not None:
        return None
    return value / limit if limit > 0 else (float("inf") if value > 0 else 0.0)


def off(sensor: Sensor, bag: BagValidation) -> bool:
    """Whether the full model's error is more than noise, or cannot be told though the channel is judged."""
    times = ratio(sensor, bag)
    return (
        times > 1 if times is not None else bag.limits[sensor.judging] is not None and bag.scarce(sensor.name) is None
    )


def limits_text(limits: Metrics) -> str:
    """One sentence on what counts as right."""
    known = [(sensor, limits[sensor.judging]) for sensor in PREDICTED]
    parts = [f"{sensor.label} {error_text(sensor, limit)}" for sensor, limit in known if limit is not None]
    return (
        f"Limits, up to which noise explains an error: {', '.join(parts)} ({NOISE_FACTOR:g} times the "
        "sensors' noise; of the angle at least what the noise of the measured currents adds up to)."
    )


def probability(value: float) -> str:
    """A probability with two digits that never reads as certainty."""
    if value > 0.995:
        return "> 0.99"
    return "< 0.01" if 0 < value < 0.005 else f"{value:.2f}"
