"""The screen of one recording: its one-step predictions expanded to second order in the machine's numbers.

The model predicts from sample to sample (``boom_model.observer``); w: its whitened innovations, unit variance where model and noise
are right. With D = dw/dz of all numbers z (``boom_fleet.numbers``), at a point z0,

    log L(z) = b' z - z' A z / 2 + const,    A = sum D' D,   b = sum D' (D z0 - w)

z0 is where the machine's tolerated numbers were in its reference recording (:func:`reference`), the same for all its recordings.
A and b are all that the comparison with other recordings needs (``boom_fleet.evidence``): 60 000 samples become one small matrix.
Recordings are worked off in blocks, so that memory does not grow with their length; of long ones the liveliest, until one more says
little. Differences D reach across the corner at which an accumulator runs empty (``Numbers.steps``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from boom_estimation.design import knowledge, sharpens
from boom_estimation.experiment import PreparedRecording, prepare
from boom_estimation.problem import EstimationProblem
from boom_fleet.evidence import NumberKinds, spreads
from boom_fleet.habits import UNKNOWN
from boom_fleet.numbers import Numbers, numbers_of, present
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS
from boom_recording.recording import SHORTEST_BLOCK, Recording, blocks

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TOLERANCE = 1e-5
"""Of the integrator; side by side, so that differences are good derivatives."""
LARGEST = 4.0
"""Standard deviations from which on an innovation counts with its size, not its square (Huber 1964)."""
SETTLING = 1.5
"""s after a start in motion in which the guess of the initial state still shows."""
MOVING = 0.02
"""rad/s."""
REGIMES = ("standing", "extending", "retracting")
FURTHEST = 2.5
"""Standard deviations of its prior by which a number is moved at most in a reference."""
FITTED, MOST_STEPS, ENOUGH, LEAST_DAMPING = 1, 9, 20.0, 0.1
"""Blocks that a reference is fitted to, most steps, the gain [nats] below which a step was none, and where damping ends."""
LEVEL = 2.0
"""Noise of currents and model, in units of what ``boom_estimation.whitening`` assumes. With it the innovations of a crane that is
another than the model, though healthy, are white (measured: their correlation from sample to sample falls from 0.36 to 0.11)."""


class ScreenError(ValueError):
    """A recording that cannot be screened; one line that says why."""

    exit_status = 2


@dataclass(frozen=True)
class Screening:
    """What the screen keeps of one recording.

    Attributes:
        names: (k,) of the numbers.
        matrix: (k, k) A. vector: (k,) b.
        squares: (NY, regimes) sum of the squared whitened innovations at the expansion point, large ones by Huber's function.
        counts: (NY, regimes) of samples.
        seconds: [s] screened. moving: [s] of them in motion.
    """

    names: tuple[str, ...]
    matrix: Array
    vector: Array
    squares: Array
    counts: Array
    seconds: float
    moving: float

    def columns(self) -> dict[str, float | None]:
        """For the table: nats per innovation beyond white noise, by channel and regime; None: not measured."""
        result: dict[str, float | None] = {"screened_s": self.seconds, "moving_s": self.moving}
        for i, channel in enumerate(OUTPUTS):
            for r, regime in enumerate(REGIMES):
                n = float(self.counts[i, r])
                result[f"nats_{channel}_{regime}"] = 0.5 * (float(self.squares[i, r]) / n - 1.0) if n else None
        return result


def reference(recording: Recording, machine: Machine) -> tuple[tuple[str, ...], Array]:
    """Names and z (k,) of the machine's numbers as a recording has them: those with a tolerance are fitted, the effects' are zero.

    Damped Gauss-Newton steps on the blocks in which the boom moves most.

    Raises:
        ScreenError: no stretch of it can be predicted.
        MachineError: a pose or load that the machine cannot have.
    """
    found = [one for one in (_PreparedBlock.of(block, machine) for block in blocks(recording)) if one is not None]
    moving = sorted(found, key=lambda one: -_travel(one.prepared.recording))[:FITTED]
    if not moving:
        raise _nothing(recording)
    n = moving[0].numbers.tolerated
    z = np.zeros(len(moving[0].numbers.names))
    low, high = np.clip(np.array([u.bounds for u in moving[0].numbers.unknowns[:n]]).T, -FURTHEST, FURTHEST)
    best, least, damping = z, np.inf, 1.0
    for _ in range(MOST_STEPS):
        cost = float(0.5 * sum(one.expanded(z, 0).squares.sum() for one in moving) + 0.5 * z @ z)
        if cost < least - ENOUGH:
            best, least, damping = z, cost, min(1.0, 2.0 * damping)
            at = reduce(_joined, (one.expanded(z, n) for one in moving))
        elif damping < LEAST_DAMPING:
            break
        else:
            damping *= 0.4
        wanted = np.linalg.solve(at.matrix + np.eye(n), at.vector)
        z = best.copy()
        z[:n] += damping * (np.clip(wanted, low, high) - best[:n])
    return moving[0].numbers.names, best


def screened(recording: Recording, machine: Machine, at: Mapping[str, float]) -> Screening:
    """Screen a recording: of a long one minutes in the order of how far the boom travels in them, until a further one tells little.

    That is where it sharpens the numbers, on the mean, by less than ``boom_estimation.design.SHARPER``, from what is known of them
    beforehand. The order knows nothing of how well the model predicts: minutes that were chosen because they fit badly would make
    a sound machine look changed.

    at: where the numbers are expanded, by name.

    Raises:
        ScreenError: no stretch of it can be predicted.
        MachineError: a pose or load that the machine cannot have.
    """
    total, known = None, 0.0
    for block in sorted(blocks(recording), key=_travel, reverse=True):
        one = _PreparedBlock.of(block, machine)
        if one is None:
            continue
        expanded = one.expanded(np.array([at.get(name, 0.0) for name in one.numbers.names]))
        total, before = expanded if total is None else _joined(total, expanded), known
        effects = (np.arange(len(total.names)) >= one.numbers.tolerated).astype(np.float64)
        spread, _ = spreads(NumberKinds(effects, one.numbers.own, 0.0 * effects), *UNKNOWN)
        known = knowledge(spread[:, None] * total.matrix * spread)
        if before and not sharpens(before, known, len(total.names)):
            break
    if total is None:
        raise _nothing(recording)
    return total


def _nothing(recording: Recording) -> ScreenError:
    return ScreenError(
        f"{recording.name}: no stretch of {SHORTEST_BLOCK:g} s with all sensors and both currents: nothing to screen"
    )


def _travel(recording: Recording) -> float:
    """Of the boom, there and back [rad]."""
    angle = recording.signals["angle"]
    return float(np.abs(np.diff(angle.values[angle.valid])).sum())


@dataclass(frozen=True)
class _PreparedBlock:
    """A part of a recording, ready to be predicted."""

    prepared: PreparedRecording
    numbers: Numbers
    problem: EstimationProblem

    @classmethod
    def of(cls, block: Recording, machine: Machine) -> _PreparedBlock | None:
        if any(not block.signals[name].valid.any() for name in OUTPUTS):
            return None
        prepared = prepare(block, present(machine))
        if not prepared.segments:
            return None
        numbers = numbers_of(machine, prepared.plant.pose, prepared.plant)
        return cls(prepared, numbers, EstimationProblem([prepared], numbers.unknowns))

    def expanded(self, z: Array, count: int | None = None) -> Screening:
        """The expansion at z (k,), by the first ``count`` numbers; by all by default."""
        problem, k = self.problem, len(z) if count is None else count
        at = z[: len(problem.unknowns)]
        gains = problem.gains(at, problem.first_gains(), level=LEVEL)
        own = range(min(k, len(at)))
        innovations, derivatives = problem.sensitivities(at, gains, own, steps=self.numbers.steps, tolerance=TOLERANCE)
        changes = [[d] for d in derivatives]
        far = self.numbers.far[: k - len(own)]
        seen = problem.observed_with([point.values for point in far], at, gains, tolerance=TOLERANCE)
        for point, there in zip(far, seen, strict=True):
            for columns, o, e in zip(changes, there, innovations, strict=True):
                columns.append(np.nan_to_num((o.innovations - e) / point.z)[:, :, None])
        derivatives = [np.concatenate(columns, axis=2) for columns in changes]
        shape = (len(OUTPUTS), len(REGIMES))
        a, b, sums, counts = np.zeros((k, k)), np.zeros(k), np.zeros(shape), np.zeros(shape)
        moving = seconds = 0.0
        for (_, segment), gain, e, d in zip(problem.segments, gains, innovations, derivatives, strict=True):
            used = gain.used & np.isfinite(e)
            if segment.rest is None:
                used[segment.nodes[1:] < segment.start + SETTLING] = False
            gain = replace(gain, used=used)
            w, dw = gain.whiten(e[:, :, None])[:, :, 0], gain.whiten(d)
            w, dw = np.where(used, w, 0.0), np.where(used[:, :, None], dw, 0.0)
            weight = np.minimum(1.0, LARGEST / np.maximum(np.abs(w), 1e-9))
            rows, left = (dw * np.sqrt(weight)[:, :, None]).reshape(w.size, k), (w * np.sqrt(weight)).reshape(-1)
            a += rows.T @ rows
            b -= rows.T @ left
            regime = _regime(segment.measured[1:, OUTPUTS.index("rate")])
            for r in range(len(REGIMES)):
                inside = used & (regime == r)[:, None]
                sums[:, r] += np.sum(np.where(inside, weight * w**2, 0.0), axis=0)
                counts[:, r] += inside.sum(axis=0)
            moving += float((regime > 0).sum()) * self.prepared.period
            seconds += segment.end - segment.start
        return Screening(self.numbers.names[:k], a, b + a @ z[:k], sums, counts, seconds, moving)


def _regime(rate: Array) -> NDArray[np.int64]:
    """Index into ``REGIMES`` of each interval, by the measured rate [rad/s]: a rising angle extends the cylinder."""
    known = np.nan_to_num(rate)
    return np.where(known > MOVING, 1, np.where(known < -MOVING, 2, 0))


def _joined(one: Screening, other: Screening) -> Screening:
    return Screening(
        one.names, one.matrix + other.matrix, one.vector + other.vector, one.squares + other.squares,
        one.counts + other.counts, one.seconds + other.seconds, one.moving + other.moving,
    )  # fmt: skip
