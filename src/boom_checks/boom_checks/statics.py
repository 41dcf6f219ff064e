"""Levels before any search: the hose pressure against the pressure that the boom needs, at rest, lifting and lowering.

    gap = p_h - p_need,   p_need = ((D q_2'' + g(q_2)) / J(q_2) + p_b A_b) / A_a + losses        (3.12), (3.15)

needs the measured motion and the rod pressure, the linkage and the masses; of losses only what the machine file knows (friction, a
valve at the cylinder), no main valve, no oil. What is left is split by
least squares into parts that a cause each may have,

    gap = c + s sign(q_2') + l b(q_2),   b = |tip| cos(.) / J scaled to its mean

c does not change (transducer, area), s turns with the motion (friction; a valve between hose and cylinder), l goes with the
lever of a load at the tip. Where the level jumps for good, something was taken or put down, or the boom came to rest on something.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_checks.check import IntervalValue
from boom_checks.even_series import PERIOD, EvenSeries, even_series
from boom_checks.mechanics import ACCELERATION, MOVING, RESTING, Mechanics, mechanics
from boom_checks.readings import PRIOR, mean_measure
from boom_model.machine import Machine
from boom_recording.recording import Recording

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_SECONDS = 0.5
MORE = 1.2
"""Times the load that was told that may be put down."""
STEP_FLOOR = 2.0e5
"""Pa. Scatter of the gap within one level: sensors, geometry, friction that is not quite constant."""
CONSTANT, TURNING_PART, LEVER = "constant", "with the motion's direction", "with the lever of a load"
CAUSES = {
    CONSTANT: "as a transducer or an area would", TURNING_PART: "as friction or a valve between hose and cylinder would",
    LEVER: "as a load at the tip would",
}  # fmt: skip
"""What a part of the gap looks like."""
BLOCK = 50
"""Samples of the grid that make one level of half a second."""
GRAVITY = 9.81


@dataclass(frozen=True)
class RegimeLevel:
    """The gap in one regime: mean with interval [Pa], mean need [Pa], how far that may be off by the file's tolerances [Pa]."""

    regime: str
    gap: IntervalValue
    need: float
    tolerance: float
    seconds: float

    @property
    def sentence(self) -> str:
        """For an engineer."""
        value, low, high = (1e-5 * v for v in (self.gap.value, *self.gap.interval_90))
        need = f"the {1e-5 * self.need:.0f} bar that the boom needs"
        masses = f"the file's masses leave {1e-5 * self.tolerance:.0f} bar open"
        if low * high <= 0.0:
            return f"{self.regime} the hose pressure is {need}, within {max(-low, high):.1f} bar ({masses})"
        nearest, farthest = sorted((abs(low), abs(high)))
        way = "higher" if value > 0 else "lower"
        ends = f"{nearest:.1f} to {farthest:.1f}"
        return f"{self.regime} the hose pressure is {abs(value):.1f} bar {way} than {need} ({ends}; {masses})"


@dataclass(frozen=True)
class LevelStep:
    """A lasting change of the gap at rest.

    Attributes:
        time: by when [s]. change: [Pa]. standing: the boom stood while it came. level: gap behind it [Pa].
        mass: at the tip that would do it [kg]. told: what hangs there by the recording's configuration [kg].
    """

    time: float
    change: IntervalValue
    standing: bool
    level: float
    mass: float | None
    told: float = 0.0

    @property
    def sentence(self) -> str:
        """For an engineer."""
        size, kilograms = (
            1e-5 * abs(self.change.value),
            "" if self.mass is None else f", {abs(self.mass):.0f} kg at the tip",
        )
        when = (
            f"by {self.time:.1f} s{', while the boom stands,' if self.standing else ''} the hose carries {size:.0f} bar"
        )
        lacks = f", {-1e-5 * self.level:.0f} bar less than the boom needs" if self.level < -STEP_FLOOR else ""
        if self.change.value < 0.0:
            hung = self.mass is not None and -self.mass < MORE * self.told
            causes = [f"a load was put down{kilograms}"] if hung or not lacks else []
            causes += ["the boom rests on something, or a valve shuts the hose off"] if lacks else []
            cause = ", or ".join(causes)
            return f"{when} less at rest than before{lacks}: {cause}"
        cause = f"a load was picked up{kilograms}" if self.level > STEP_FLOOR else "it carries the boom again"
        return f"{when} more at rest than before{lacks}: {cause}"


@dataclass(frozen=True)
class Statics:
    """Levels, parts and steps of one recording.

    Attributes:
        time, gap: (n,) [s], [Pa]; NaN where it is not known.
        need: (n,) [Pa]. levels, parts, steps: see above; the parts by their name in ``CAUSES``.
    """

    time: Array
    gap: Array
    need: Array
    levels: tuple[RegimeLevel, ...]
    parts: tuple[IntervalValue, ...]
    steps: tuple[LevelStep, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """All that there is to say, in words."""
        parts = [
            f"{part.text} ({CAUSES[part.name]})" for part in self.parts if part.interval_90[0] * part.interval_90[1] > 0
        ]
        split = (f"of all this {'; '.join(parts)}",) if parts else ()
        return (*(level.sentence for level in self.levels), *split, *(step.sentence for step in self.steps))

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "levels": [
                {"regime": v.regime, "gap": v.gap.document(), "need_pa": v.need, "tolerance_pa": v.tolerance, "seconds": v.seconds}
                for v in self.levels
            ],
            "parts": [part.document() for part in self.parts],
            "steps": [
                {"time_s": s.time, "change": s.change.document(), "standing": s.standing, "mass_kg": s.mass} for s in self.steps
            ],
            "sentences": list(self.sentences),
        }  # fmt: skip


def statics(recording: Recording, machine: Machine) -> Statics:
    """The statics of a recording of a machine; empty where motion and pressures are hardly known.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    series = even_series(recording)
    if not series.known("angle", "rate", "hose_pressure", "rod_pressure"):
        nothing = np.full(len(series.time), np.nan)
        return Statics(series.time, nothing, nothing, (), (), ())
    return statics_of(series, mechanics(machine, recording))


def statics_of(series: EvenSeries, boom: Mechanics, pressure: str = "hose_pressure") -> Statics:
    """The same from prepared series; ``pressure``: that of the hose, or ``head_pressure`` where the cylinder's own is measured."""
    angle, rate, acceleration = series.smooth("angle"), series.smooth("rate"), series.smooth("rate", 1)
    need = boom.need(series.time, angle, rate, acceleration, series.smooth("rod_pressure"))
    if pressure == "hose_pressure":
        need = need + boom.known_losses(angle, rate)
    gap = series.smooth(pressure) - need
    with np.errstate(invalid="ignore"):
        steady = np.isfinite(gap) & (np.abs(acceleration) < ACCELERATION)
        regimes = {
            "at rest": steady & (np.abs(rate) < RESTING) & ~series.leaning,
            "while lifting": steady & (rate > MOVING),
            "while lowering": steady & (rate < -MOVING),
        }
    levels = []
    for name, chosen in regimes.items():
        seconds = float(chosen.sum()) * PERIOD
        if seconds >= LEAST_SECONDS:
            spread = boom.tolerance * float(np.mean(np.abs(boom.static_need(angle[chosen]))))
            gaps = mean_measure(f"gap {name}", "Pa", gap[chosen])
            levels.append(RegimeLevel(name, gaps, float(np.mean(need[chosen])), spread, seconds))
    used = np.logical_or.reduce(list(regimes.values()))
    direction = np.select([regimes["while lifting"], regimes["while lowering"]], [1.0, -1.0], 0.0)
    lever = boom.load_lever(angle)
    parts = _fitted(gap, direction, lever, used)
    return Statics(
        series.time, gap, need, tuple(levels), parts, _steps(series.time, gap, lever, regimes["at rest"], boom.load)
    )


def _fitted(gap: Array, direction: Array, lever: Array, used: Flags) -> tuple[IntervalValue, ...]:
    """The parts of the gap with intervals."""
    if used.sum() * PERIOD < 5.0:
        return ()
    columns = {CONSTANT: np.ones(int(used.sum())), TURNING_PART: direction[used]}
    middle, spread = float(np.mean(lever[used])), float(np.std(lever[used]))
    if spread > 0.02 * abs(middle):  # else a load and a constant are one
        columns[LEVER] = lever[used] / middle
    kept = [name for name, column in columns.items() if np.any(column)]
    x, y = np.column_stack([columns[name] for name in kept]), gap[used]
    values = np.linalg.lstsq(x, y, rcond=None)[0]
    seconds = len(y) * PERIOD
    variance = float(np.mean((y - x @ values) ** 2)) * np.linalg.inv(x.T @ x / len(y)) / seconds
    half = 1.645 * np.sqrt(np.diag(variance))
    return tuple(
        IntervalValue(name, float(v), "Pa", (float(v - h), float(v + h)))
        for name, v, h in zip(kept, values, half, strict=True)
    )


def _steps(time: Array, gap: Array, lever: Array, resting: Flags, told: float) -> tuple[LevelStep, ...]:
    """Lasting jumps of the gap at rest (n,) [Pa], by binary segmentation of half-second blocks."""
    blocks = len(gap) // BLOCK
    shaped = [a[: blocks * BLOCK].reshape(blocks, BLOCK) for a in (np.where(resting, gap, np.nan), time, lever)]
    known = np.isfinite(shaped[0]).sum(axis=1) > BLOCK // 2
    if known.sum() < 4:
        return ()
    middle, when, arm = (np.nanmedian(a[known], axis=1) for a in shaped)
    index = np.flatnonzero(known)
    steps = []
    edges = [0, *sorted(_cuts(middle, 0, len(middle))), len(middle)]
    for before, cut, after in zip(edges, edges[1:], edges[2:], strict=False):
        change = float(np.mean(middle[cut:after]) - np.mean(middle[before:cut]))
        half = 1.645 * STEP_FLOOR * math.sqrt(1.0 / (cut - before) + 1.0 / (after - cut))
        mass = change / (GRAVITY * arm[cut]) if arm[cut] > 0.0 else None
        found = IntervalValue("step of the level at rest", change, "Pa", (change - half, change + half))
        level = float(np.mean(middle[cut:after]))
        steps.append(LevelStep(float(when[cut]), found, bool(index[cut] == index[cut - 1] + 1), level, mass, told))
    return tuple(steps)


def _cuts(values: Array, first: int, end: int) -> list[int]:
    """Where the mean of values[first:end] changes: log odds against one mean above those of the prior."""
    part = values[first:end]
    n = len(part)
    if n < 4:
        return []
    k = np.arange(2, n - 1)
    total = np.cumsum(part)
    left, right = total[k - 1] / k, (total[-1] - total[k - 1]) / (n - k)
    gain = 0.5 * k * (n - k) / n * (left - right) ** 2 / max(STEP_FLOOR**2, _within(part))
    best = int(np.argmax(gain))
    if gain[best] * 0.5 + PRIOR <= 0.0:  # blocks of half a second: two are one piece of evidence
        return []
    cut = first + int(k[best])
    return [*_cuts(values, first, cut), cut, *_cuts(values, cut, end)]


def _within(part: Array) -> float:
    """Scatter of a level [Pa^2] from neighbour to neighbour."""
    return float(np.median(np.diff(part) ** 2)) / 0.91
