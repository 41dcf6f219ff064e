"""The panels of one channel in the charts of a validation and of a diagnosis: measured, predicted, and what is left."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import Sensor
from boom_report.palette import MEASURED, QUIET, VEIL
from boom_report.panels import Json, Panels, line

Array = NDArray[np.float64]

SHAPES = 150  # more shaded stretches than that make a page slow and say nothing more
OUTER_GAP = 46
_HEIGHT, _INNER_GAP = 150, 12


@dataclass(frozen=True)
class Curve:
    """A prediction (n,) [SI] at the stamps of the channel; ``above``, ``below``: what else its traces in either panel have."""

    name: str
    colour: str
    width: float
    values: Array
    above: Json = field(default_factory=dict)
    below: Json = field(default_factory=dict)


def rest(sensor: Sensor) -> str:
    """The name of the panel with what is left: model minus measured."""
    return f"{sensor.name} rest"


def title(panels: Panels, panel: str, text: str) -> None:
    """The heading of a panel."""
    panels.write(panel, text, x=0, xanchor="left", yanchor="bottom", yshift=3, font={"size": 13})


def measured(panels: Panels, sensor: Sensor, time: Array, values: Array) -> list[Json]:
    """A channel as it was measured (n,) [SI], NaN where it is masked."""
    n = panels.add(sensor.name, _HEIGHT, OUTER_GAP)
    symbol = re.sub(r"_(\w)", r"<sub>\1</sub>", sensor.symbol)
    title(panels, sensor.name, f"<b>{sensor.label.capitalize()}</b> {symbol} [{sensor.shown.name}]")
    return [line(time, values * sensor.shown.scale, n, "measured", MEASURED, 2.6)]


def compared(
    panels: Panels, sensor: Sensor, time: Array, values: Array, curves: list[Curve], said: str, height: int,
    colour: str = QUIET,
) -> list[Json]:  # fmt: skip
    """Predictions in the panel of a measured channel, ``said`` above it, and what is left in a panel of this height below."""
    panels.write(
        sensor.name, said, x=1, xanchor="right", yanchor="bottom", yshift=3, font={"size": 11, "color": colour}, name="error"
    )  # fmt: skip
    upper, lower = panels.suffix(sensor.name), panels.add(rest(sensor), height, _INNER_GAP)
    panels.write(
        rest(sensor), f"model − measured [{sensor.error.name}]", x=0, xanchor="left", yanchor="top", xshift=4, yshift=-1,
        font={"size": 10, "color": QUIET}, bgcolor=VEIL,
    )  # fmt: skip
    traces = [line(time, c.values * sensor.shown.scale, upper, c.name, c.colour, c.width) | c.above for c in curves]
    scale = sensor.error.scale
    return traces + [line(time, (c.values - values) * scale, lower, c.name, c.colour, 0.9) | c.below for c in curves]
