"""Signals that repeat a value for longer than noise, steps and motion make believable, or that drop to one again and again."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import BY_NAME, MEASURED_TOPICS, PREDICTED
from boom_recording.defects import SECOND, THRESHOLDS, StampedEvent, Thresholds, TopicSamples, runs
from boom_recording.recording import Floats

_FOLLOW = {sensor.name for sensor in PREDICTED if sensor.is_pressure}
"""Pressures of the cylinder: they cannot stay as they are while the boom moves; that of a pump can."""

DROPS, ISOLATED, LONGEST = 3, 4.0, 1.0
"""Samples that a signal must spend at a value to which it drops, how many of its usual changes all others are away from it, and s
that a visit takes at most: what stays longer is judged as what repeats."""


def check_stuck(topics: dict[str, TopicSamples], limits: Thresholds = THRESHOLDS) -> dict[str, list[StampedEvent]]:
    """Mask values that repeat for longer than noise and quantisation, or the motion of the boom, make believable.

    A quantised angle at rest may be constant for minutes, its derivative is then zero, and an idle current is clipped at zero: none
    of them is stuck. The
    angle is judged by the rate, the pressures also by the angle, and each noisy signal by itself.
    """
    found: dict[str, list[StampedEvent]] = {topic: [] for topic in topics}
    witness = _Motion(topics, limits)
    # The rate first: it tells of the angle, and when the IMU hangs both repeat.
    names = [name for samples in topics.values() if samples.topic in MEASURED_TOPICS for name in samples.values]
    names = [
        name for name in names if not BY_NAME[name].joint
    ]  # another joint may stay where it is, and nothing speaks against it
    for name in sorted(names, key=lambda name: name != "rate"):
        samples = next(s for s in topics.values() if name in s.values)
        found[samples.topic] += _dropped(samples, name)
        found[samples.topic] += _stuck(samples, name, witness, limits)
    return found


def _dropped(samples: TopicSamples, name: str) -> list[StampedEvent]:
    """Mask what jumps to the least or the largest value of a signal and back, within a sample: a loose plug, a code for "lost".

    What is real passes what lies between, in some of its visits at least. Here nothing else is near that value, and most of
    the jumps are larger than all but a hundredth of the other changes.
    """
    index = np.flatnonzero(samples.valid[name] & samples.timed)
    values, times, events = samples.values[name][index], samples.stamps_ns[index].astype(float), list[StampedEvent]()
    if len(values) < 2 or name not in {sensor.name for sensor in PREDICTED}:  # a pump may be switched
        return []
    unit = next(channel.unit for channel in samples.channels if channel.name == name)
    for level in {float(np.min(values)), float(np.max(values))}:
        at = values == level
        if not DROPS <= at.sum() <= 0.5 * len(values):
            continue
        steps, jumps = np.abs(np.diff(values)), at[1:] != at[:-1]
        others = steps[~at[1:] & ~at[:-1]]
        noise = float(np.median(others[others > 0])) if (others > 0).any() else _step(values)
        apart = float(np.abs(values[~at] - level).min())
        if apart <= ISOLATED * noise or float(np.median(steps[jumps])) <= float(np.quantile(others, 0.99)):
            continue
        visits = runs(at, reach=1)
        if max(times[b] - times[a] for a, b in visits) > LONGEST * SECOND:
            continue
        samples.valid[name][index[at]] = False
        detail = f"{name} jumps to {_said(level, unit)} and back {len(visits)} times, {at.sum()} samples in all, as of a loose plug"
        events += [StampedEvent("stuck", float(times[a]), float(times[b]), b - a + 1, detail) for a, b in visits]
    return events


def _stuck(samples: TopicSamples, name: str, witness: "_Motion", limits: Thresholds) -> list[StampedEvent]:
    index = np.flatnonzero(samples.valid[name] & samples.timed)
    if len(index) < 3:
        return []
    values, times = samples.values[name][index], samples.stamps_ns[index].astype(float)
    clipped = name.endswith("current")
    longest, step = _believable(values, clipped, limits), _step(values)
    unit = next(channel.unit for channel in samples.channels if channel.name == name)
    events = []
    for a, b in _runs_of_equal(values):
        if (times[b] - times[a]) / SECOND < limits.stuck or (clipped and values[a] <= 0):
            continue
        if (
            name == "rate" and values[a] == 0.0
        ):  # no gyro is that quiet: it is the derivative of an angle that does not change
            continue
        start = times[a]
        if longest is None or b - a + 1 <= longest:
            since = witness.stuck_since(name, float(values[a]), times[a], times[b], step)
            creeps = name in _FOLLOW and b + 1 < len(values) and abs(values[b + 1] - values[a]) < limits.jump * step
            if since is None or creeps:
                continue
            start = since
        first = int(np.searchsorted(times, start))
        samples.valid[name][index[first : b + 1]] = False
        if name == "rate":
            witness.stuck_rates.append((start, times[b]))
        detail = f"{name} repeats {_said(float(values[a]), unit)} for {(times[b] - start) / SECOND:.2f} s"
        events.append(StampedEvent("stuck", float(start), float(times[b]), b - first + 1, detail))
    return events


def _said(value: float, unit: str) -> str:
    return f"{value / 1e5:.6g} bar" if unit == "Pa" else f"{value:.6g} {unit}"


def _step(values: Floats) -> float:
    """The smallest change of a signal: its resolution, where it is coarse."""
    changes = np.abs(np.diff(values))
    return float(changes[changes > 0].min(initial=np.inf))


def _believable(values: Floats, clipped: bool, limits: Thresholds) -> float | None:
    """Longest run of equal values that this signal's noise may make, times the factor; None without noise.

    Noise that never goes further than one step and back is smaller than the step: between two steps it does not show.
    """
    if clipped:
        values = values[values > 0]
    steps = np.diff(values)
    if len(steps) < 100:
        return None
    # Long runs are what is to be judged: they must not count among the evidence.
    lengths = np.diff(np.flatnonzero(np.concatenate([[True], steps != 0, [True]])))
    ordinary = np.repeat(lengths, lengths)[:-1] < 50
    changes = steps[(steps != 0)]
    if len(changes) < 20 or not ordinary.any():
        return None
    turns = np.sign(changes[1:]) != np.sign(changes[:-1])
    further = np.abs(changes[1:][turns]) > 1.5 * _step(values)
    if np.mean(turns) < limits.noisy or np.mean(further) < limits.further:
        return None
    repeats = min(max(float(np.mean(steps[ordinary] == 0)), 1e-3), 0.99)
    by_chance = float(np.log(max(len(values), 2)) / -np.log(repeats))
    usual = float(np.sort(lengths)[-limits.usual :][0])
    return max(limits.stuck_factor * max(by_chance, usual), 20.0)


class _Motion:
    """What the IMU says of the boom's motion, to judge the other signals by.

    Attributes:
        stuck_rates: spans [ns] in which the rate was found stuck.
    """

    def __init__(self, topics: dict[str, TopicSamples], limits: Thresholds) -> None:
        self._limits = limits
        self.stuck_rates: list[tuple[float, float]] = []
        self._tracks: dict[str, tuple[Floats, Floats]] = {}
        for name in ("angle", "rate"):
            samples = next((s for s in topics.values() if name in s.values), None)
            if samples is not None:
                good = samples.valid[name] & samples.timed
                self._tracks[name] = (samples.stamps_ns[good].astype(float), samples.values[name][good])

    def _during(self, name: str, start: float, end: float) -> tuple[Floats, Floats]:
        times, values = self._tracks.get(name, (np.zeros(0), np.zeros(0)))
        a, b = np.searchsorted(times, [start, end])
        return times[a:b], values[a:b]

    def stuck_since(self, name: str, value: float, start: float, end: float, step: float) -> float | None:
        """From when on [ns] signal `name`, which repeats `value` between two times, is stuck; None where it need not be.

        step: its resolution.
        """
        moved = self._contradicts(name, value, start, end, step)
        if moved is not None:
            return max(start, moved)
        hangs = name == "angle" and any(_same_span(other, (start, end), self._limits) for other in self.stuck_rates)
        return start if hangs else None

    def _contradicts(self, name: str, value: float, start: float, end: float, step: float) -> float | None:
        """From when on [ns] the boom's motion says that signal `name` left `value`; None where it may have stayed."""
        limits = self._limits
        if name == "angle":
            return _first_motion(*self._during("rate", start, end), limits)
        times, angles = self._during("angle", start, end)
        if len(angles) < 2:
            return None
        if name == "rate":
            drift = angles - angles[0] - value * (times - times[0]) / SECOND
            return start if float(np.abs(drift).max()) > limits.moving_rate else None
        if name in _FOLLOW:
            several = limits.moving_steps * step / limits.pressure_slope if np.isfinite(step) else 0.0
            return start if float(np.ptp(angles)) > max(limits.moving_angle, several) else None
        return None


def _first_motion(times: Floats, rates: Floats, limits: Thresholds) -> float | None:
    """When the mean rate over a window of `limits.stuck` first says that the boom moves, None where it never does."""
    if len(rates) < 2:
        return None
    window = max(2, round(limits.stuck * SECOND / float(np.median(np.diff(times)))))
    if len(rates) < window:
        return None
    total = np.concatenate([[0.0], np.cumsum(rates)])
    means = np.abs(total[window:] - total[:-window]) / window
    moving = np.flatnonzero(means > limits.moving_rate)
    return float(times[moving[0]]) if len(moving) else None


def _same_span(one: tuple[float, float], other: tuple[float, float], limits: Thresholds) -> bool:
    """True where two spans [ns] begin and end together; an angle that repeats for longer than the rate is at rest."""
    return all(abs(a - b) < limits.merge * SECOND for a, b in zip(one, other, strict=True))


def _runs_of_equal(values: NDArray[np.float64]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0, [True]]))
    return [(a, b - 1) for a, b in pairwise(edges.tolist()) if b - a > 1]
