"""The next recording: of a few ways to drive the boom, the one in which the remaining hypotheses differ most."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.document import Experiment
from boom_diagnosis.fitting import Point
from boom_diagnosis.hypotheses import effects_of
from boom_estimation.free_run import plant_for
from boom_model.errors import SimulationError
from boom_model.structure import CURRENTS

if TYPE_CHECKING:
    from boom_diagnosis.case import Case
    from boom_diagnosis.weighed_case import WeighedCase

Array = NDArray[np.float64]

LENGTH, PERIOD, REST = 40.0, 0.01, 1.0
CLEAR = 5.0
"""Standard deviations of sensor noise, in the mean, from which on two hypotheses count as told apart."""


def profiles() -> dict[str, Array]:
    """Name -> currents (n, 2) [A], retract and extend, of LENGTH s; each begins and ends at rest."""
    time = np.arange(round(LENGTH / PERIOD)) * PERIOD

    def blocks(*parts: tuple[float, float, float, float]) -> Array:
        u = np.zeros((len(time), 2))
        for start, end, retract, extend in parts:
            inside = (time >= start) & (time < end)
            u[inside] = retract, extend
        return u

    slow = blocks((2, 9, 0.0, 0.34), (11, 18, 0.34, 0.0), (20, 27, 0.0, 0.38), (29, 36, 0.38, 0.0))
    fast = blocks(
        (2, 4.5, 0.0, 0.55), (6, 8.5, 0.55, 0.0), (11, 13.5, 0.0, 0.5), (15, 17.5, 0.5, 0.0),
        (20, 22.5, 0.0, 0.55), (22.5, 25.0, 0.55, 0.0), (28, 30, 0.0, 0.45), (32, 34, 0.45, 0.0),
    )  # fmt: skip
    taps = blocks(
        *((2 + 3 * k, 2.5 + 3 * k, 0.0, 0.45) for k in range(6)),
        *((20 + 3 * k, 20.5 + 3 * k, 0.45, 0.0) for k in range(6)),
    )
    still = blocks((2, 5, 0.0, 0.5), (30, 33, 0.5, 0.0))
    ramp = np.zeros((len(time), 2))
    up = (time > 2) & (time < 18)
    down = (time > 20) & (time < 36)
    ramp[up, 1] = 0.28 + 0.22 * np.sin(np.pi * (time[up] - 2) / 16) ** 2
    ramp[down, 0] = 0.28 + 0.22 * np.sin(np.pi * (time[down] - 20) / 16) ** 2
    return {
        "slow movement both ways at two small currents": slow,
        "fast movement both ways with hard stops and one reversal": fast,
        "short taps with rests between them": taps,
        "one lift, 25 s of standstill, one lowering": still,
        "slow rise and fall of the current through the dead zone, both ways": ramp,
    }


def propose(case: Case | WeighedCase, points: Sequence[tuple[str, Point]]) -> Experiment | None:
    """The profile that separates the two likeliest hypotheses best, with the separations it would bring.

    points: hypotheses with what they are fitted to, the likeliest first.
    """
    if len(points) < 2:
        return None
    bag = case.bags[0]
    start = bag.start
    tried: list[tuple[str, Array, Array, list[float]]] = []
    driven = []
    for _, point in points:
        values = case.values(point.z, point.effects)
        plant = plant_for(bag.recording, case.machine.with_effects(effects_of(values)), "full")
        p = plant.p.copy()
        for key, value in values.items():
            if key in plant.parameter_names:
                p[plant.parameter_names.index(key)] = value
        driven.append((plant, p, plant.rest_state(0.35, start["hose_pressure"], start["rod_pressure"], p)))
    for name, currents in profiles().items():
        time = np.arange(len(currents)) * PERIOD
        outputs = []
        for plant, p, x0 in driven:
            try:
                locked = np.zeros((len(currents), len(plant.machine.structure.inputs) - len(CURRENTS)))
                outputs.append(plant.run(time, np.hstack((currents, locked)), time, x0, parameters=p).outputs)
            except SimulationError:
                break
        if len(outputs) == len(points):
            noise = np.array(case.problem(points[0][1].z, {}, 1.0).predictor.noise())
            apart = [float(np.sqrt(np.mean(((outputs[0] - o) / noise) ** 2))) for o in outputs[1:]]
            tried.append((name, currents, outputs[0], apart))
    if not tried:
        return None
    name, currents, expected, apart = max(tried, key=lambda t: t[3][0])
    now = [float(np.sqrt(2.0 * abs(a.loss - points[0][1].loss) / int(a.used.sum()))) for _, a in points[1:]]
    separation = tuple((points[0][0], other[0], n, a) for other, n, a in zip(points[1:], now, apart, strict=True))
    text = (
        f"Record {LENGTH:.0f} s of {name}: {points[0][0]} and {points[1][0]} would then differ by {apart[0]:.1f} standard "
        f"deviations of the sensors' noise in the mean."
    )
    lasting = np.asarray(np.arange(len(currents)) * PERIOD, dtype=np.float64)
    return Experiment(text, lasting, currents, expected, separation)
