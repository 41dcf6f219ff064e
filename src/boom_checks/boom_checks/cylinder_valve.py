"""What opens the valve between hose and cylinder: its flow, known from the motion, against each pressure.

Law fitted, with dp = p_h - p_a:

    A_a w_p = k_1 d^(1/2) + k_2 d + k_3 gate(x) sgn(dp) |dp|^(1/2) - k_4 dp_a/dt,    k >= 0
    d = max(dp - p_c, 0),    gate(x) = min(max(x - x_0, 0), l)

k_1, k_2, p_c are a check valve's, k_3 the gate's, k_4 = V_a / beta the oil's between valve and piston, on which a load bounces.
x is the pressure that may open it, behind a play; a gate that is always 1 is the static curve of an orifice. The hose pressure
is tried as well, but while a boom is lowered it is the flow's drop over the main valve: a law by it follows the flow and opens
nothing. p_c, x_0, l, the play and the ratio R of x = p_a + R p_b are searched on a grid, the k follow by least squares. Fitted
on one part, judged on another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATIOS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 6.0, 8.0)
"""Pilot ratios R tried."""
PLAYS = (0.0, 1.0e5, 2.0e5, 3.0e5, 4.0e5)
"""Pa. Half plays tried."""
OPENINGS, LIMITS = 30, (0.05, 0.1, 0.2, 0.4, 1.0)
"""Opening pressures tried between the smallest and the largest x; limits of the gate as shares of that range."""
CHECKS = (0.0, 0.5e5, 1.0e5, 1.5e5, 2.0e5, 3.0e5)
"""Pa. Opening pressures of the check valve tried."""
THINNED = 1200
"""Samples that a search looks at."""


@dataclass(frozen=True)
class ValveData:
    """What the piston displaces, A_a w_p (n,) [m^3/s], the pressures beside the valve (n,) [Pa gauge], dp_a/dt (n,) [Pa/s]."""

    flow: Array
    hose: Array
    head: Array
    rod: Array
    head_rate: Array

    def where(self, chosen: NDArray[Any]) -> ValveData:
        """A selection of the samples."""
        return ValveData(*(getattr(self, part.name)[chosen] for part in fields(self)))


FOLLOWS = "hose pressure"
"""It follows the flow: it does not open the valve."""
GATES: dict[str, Callable[[ValveData, float], Array]] = {
    FOLLOWS: lambda d, _: d.hose,
    "cylinder pressure": lambda d, _: d.head,
    "rod pressure": lambda d, _: d.rod,
    "rod pressure and load": lambda d, ratio: d.head + ratio * d.rod,
}


@dataclass(frozen=True)
class ValveLaw:
    """A law that was fitted.

    Attributes:
        opened_by: the pressure, "" for none: a static curve.
        opening: x_0 [Pa]. limit: of x - x_0 [Pa]. play: [Pa], both ways together. ratio: R, 0 without.
        check: p_c [Pa]. gains: k_1 .. k_4 [SI].
        fitted, held_out: NRMSE of the flow, rms error / standard deviation.
    """

    opened_by: str
    opening: float
    limit: float
    play: float
    ratio: float
    check: float = 0.0
    gains: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    fitted: float = np.nan
    held_out: float = np.nan

    def flow(self, data: ValveData) -> Array:
        """A_a w_p (n,) [m^3/s] as the law has it."""
        return np.asarray(self._columns(data) @ np.array(self.gains))

    def _gate(self, data: ValveData) -> Array:
        if not self.opened_by:
            return np.ones(len(data.flow))
        x = behind_play(GATES[self.opened_by](data, self.ratio), self.play / 2)
        return np.clip(x - self.opening, 0.0, self.limit)

    def _columns(self, data: ValveData) -> Array:
        drop = data.hose - data.head
        forward = np.maximum(drop - self.check, 0.0)
        back = self._gate(data) * np.sign(drop) * np.sqrt(np.abs(drop))
        return np.column_stack((np.sqrt(forward), forward, back, -data.head_rate))

    @property
    def words(self) -> str:
        """What the law says, for an engineer."""
        if not self.opened_by:
            return "a static curve q(dp)"
        if self.opened_by == FOLLOWS:
            return "the hose pressure, which follows from the flow and opens nothing"
        opening = f"from {1e-5 * self.opening:.0f} bar"
        play = f", play {1e-5 * self.play:.0f} bar" if self.play else ""
        if self.ratio:
            return f"opened by p_a + {self.ratio:g} p_b {opening}{play}"
        return f"opened by the {self.opened_by} {opening}{play}"

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "opened_by": self.opened_by or None, "opening_pa": self.opening, "limit_pa": self.limit, "play_pa": self.play,
            "ratio": self.ratio, "check_pa": self.check,
            "gains": list(self.gains), "nrmse_fitted": self.fitted, "nrmse_held_out": self.held_out,
        }  # fmt: skip


def joined(parts: Sequence[ValveData]) -> ValveData:
    """The samples of several recordings one behind the other."""
    return ValveData(*(np.concatenate([getattr(part, row.name) for part in parts]) for row in fields(ValveData)))


def valve_laws(fit: ValveData, held_out: ValveData) -> list[ValveLaw]:
    """The best law for each pressure and the static curve: the best on ``held_out`` first, the hose's last; none without flow."""
    fit, held_out = (
        part.where(np.isfinite(part.flow + part.hose + part.head + part.rod + part.head_rate))
        for part in (fit, held_out)
    )
    if min(len(fit.flow), len(held_out.flow)) < 100 or np.std(fit.flow) == 0.0 or np.std(held_out.flow) == 0.0:
        return []
    laws = [_best(_static(), fit), *(_best(_gated(name, fit), fit) for name in GATES)]
    judged = [replace(law, fitted=nrmse(law, fit), held_out=nrmse(law, held_out)) for law in laws]
    return sorted(judged, key=lambda law: (law.opened_by == FOLLOWS, law.held_out))


def nrmse(law: ValveLaw, data: ValveData) -> float:
    """Rms error of the flow over its standard deviation."""
    return float(np.sqrt(np.mean((law.flow(data) - data.flow) ** 2)) / np.std(data.flow))


def behind_play(values: Array, half: float) -> Array:
    """What follows the values (n,) with a play of +- ``half``."""
    if half == 0.0:
        return values
    result = np.empty(len(values))
    last = float(values[0])
    for k, value in enumerate(values.tolist()):
        last = min(max(last, value - half), value + half)
        result[k] = last
    return result


def _static() -> Iterator[ValveLaw]:
    yield ValveLaw("", 0.0, np.inf, 0.0, 0.0)


def _gated(name: str, data: ValveData) -> Iterator[ValveLaw]:
    for ratio in RATIOS if name == "rod pressure and load" else (0.0,):
        x = GATES[name](data, ratio)
        low, high = np.quantile(x, [0.0, 0.98])
        for opening in np.linspace(low, high, OPENINGS, endpoint=False):
            for share in LIMITS:
                yield ValveLaw(name, float(opening), float(share * (high - low)), 0.0, ratio)


def _best(laws: Iterator[ValveLaw], data: ValveData) -> ValveLaw:
    """The law with the smallest error of those tried; the play is searched behind the rest, as it is a detail."""
    thin = data.where(np.arange(0, len(data.flow), max(1, len(data.flow) // THINNED)))
    best = min((_solved(law, thin) for law in laws), key=lambda pair: pair[0])[1]
    best = min((_solved(replace(best, check=check), data) for check in CHECKS), key=lambda pair: pair[0])[1]
    if not best.opened_by:
        return best
    plays = [
        replace(best, play=2 * half, opening=best.opening + shift) for half in PLAYS for shift in (-half, 0.0, half)
    ]
    return min((_solved(law, data) for law in plays), key=lambda pair: pair[0])[1]


def _solved(law: ValveLaw, data: ValveData) -> tuple[float, ValveLaw]:
    """Mean square error and the law with its best gains, none negative."""
    columns = law._columns(data)
    scale = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    scaled = columns / scale
    used = np.array([bool(np.any(column)) for column in scaled.T])
    values = np.zeros(columns.shape[1])
    while used.any():
        values[:] = 0.0
        values[used] = np.linalg.lstsq(scaled[:, used], data.flow, rcond=None)[0]
        if (values >= 0.0).all():
            break
        used &= values > 0.0
    values = np.where(used, values, 0.0)
    error = float(np.mean((data.flow - scaled @ values) ** 2))
    return error, replace(law, gains=tuple(float(v) for v in values / scale))
