"""Static curve and linear part of the pilot valves together: one output-error fit of the whole Wiener model to all traces.

    p = h(nu),  nu = G i,  G(0) = 1:  minimises |p_k - h((b_0 z + b_1) / (z + a) i_k)|

over a, b_0, (b_1 = 1 + a - b_0), h_0, h_1, h_2 and one initial state a stretch. The two steps of ch. 5.1 give the start. Without
the joint fit a remaining error of h would bias the pole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from boom_identification import estimate
from boom_identification.pilot_dynamics import GROUP, FirstOrder
from boom_identification.pilot_static import Averaged, StaticCurve
from boom_model.components import pilot_valve
from boom_model.components.pilot_valve import BAR

Array = NDArray[np.float64]

SHARE_OF_WINDOW = 4
"""Samples compared per window of the moving average: more of them would carry the same noise."""


def joint_fit(
    parts: Sequence[Averaged], window: float, curve: StaticCurve, model: FirstOrder
) -> tuple[StaticCurve, FirstOrder]:
    """The whole model fitted to stretches of one sampling period; ``window`` [samples] of their average.

    Raises:
        ValueError: the fit finds no stable pole, or the traces do not separate the unknowns.
    """
    period = model.period
    step = max(1, round(window / SHARE_OF_WINDOW))
    compared = [part.pressure[::step] / BAR for part in parts]
    target = np.concatenate(compared)
    a, b0, _ = model.discrete
    states = [float(curve.inverse(part.pressure[:1])[0] - b0 * part.current[0]) for part in parts]
    # the time constant in periods, so that all unknowns are of size one
    start = np.array([1.0 / (1.0 + a) / 100.0, 100.0 * b0, curve.h[0] / 100.0, curve.h[1], curve.h[2], *states])

    def simulated(x: Array) -> Array:
        pole, feed, rest = _discrete(x)
        h = _curve(x)
        outputs = []
        for part, z in zip(parts, x[5:], strict=True):
            nu = lfilter([feed, rest], [1.0, pole], part.current, zi=[z])[0][::step]
            outputs.append(np.asarray(pilot_valve.static_pressure(nu, h), float) / BAR)
        return np.concatenate(outputs)

    scale = np.array([0.1, 1.0, 0.1, 1.0, 0.1, *[0.1] * len(states)])

    def residuals(x: Array) -> Array:
        return simulated(x) - target

    fit = least_squares(residuals, start, x_scale=scale)
    discrete = _discrete(fit.x)
    h = _curve(fit.x)
    if not -1.0 < discrete[0] < 1.0 or not h[0] > 0.0:
        raise ValueError("the fit of the whole model found no stable pole")
    size = max(1, round(GROUP / period / step))
    groups, first = [], 0
    for part in compared:
        groups.append(np.arange(len(part)) // size + first)
        first = int(groups[-1][-1]) + 1
    residual = np.asarray(fit.fun)
    covariance = estimate.cluster_covariance(np.asarray(fit.jac), residual, np.concatenate(groups))
    forward = np.array([estimate.gradient(partial(_entry, k), fit.x) for k in range(3)])
    to_h = np.diag([100.0, 1.0, 1.0])
    found = FirstOrder(discrete, period, forward @ covariance @ forward.T, float(np.sqrt(np.mean(residual**2))) * BAR)
    return replace(curve, h=h, covariance=to_h @ covariance[2:5, 2:5] @ to_h, residual=found.residual), found


def _discrete(x: Array) -> tuple[float, float, float]:
    """(a, b_0, b_1) with G(0) = 1."""
    a = 1.0 / (100.0 * float(x[0])) - 1.0
    b0 = float(x[1]) / 100.0
    return a, b0, 1.0 + a - b0


def _entry(k: int, x: Array) -> float:
    return _discrete(x)[k]


def _curve(x: Array) -> tuple[float, float, float]:
    return 100.0 * float(x[2]), float(x[3]), float(x[4])
