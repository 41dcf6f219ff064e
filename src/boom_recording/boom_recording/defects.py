"""Finds what is wrong with the samples of a recording and masks it. Arrays in, events and masks out; no files.

The order matters: first the stamps (which samples can be placed in time at all), then what is missing between them,
then the values.
"""

from bisect import bisect_left
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import MEASURED_TOPICS, PREDICTED, Channel
from boom_recording.channels import FaultKind
from boom_recording.recording import Event, Flags, Floats, Stamps

_SECOND = 1e9


@dataclass(frozen=True)
class Thresholds:
    """When something counts as a fault. Times in seconds.

    gap                 the contract's definition of a gap
    clock_jump          a stamp may be off against the log time by what a busy network delays (some 10 ms), not by more
    late                a message that arrives this much later than its neighbours: its stamp cannot be trusted, a bus
                        queue was stuck
    comparable          log time and stamps run equally fast within this factor; otherwise (simulated faster than real
                        time) they are not compared
    stuck               shortest time for which repeated values are looked at
    stuck_factor        a noisy sensor is stuck when it repeats this many times longer than chance would let it in the
                        whole recording
    noisy               share of reversals among successive changes above which a signal is noise on top of motion
                        (white noise 2/3, smooth motion 0)
    moving_rate         [rad/s] boom surely moves: above any gyro's bias (5 mrad/s), 26 steps of the angle sensor in
                        half a second
    moving_angle        [rad] change of angle with which a pressure must change by several of its steps (about 0.5 bar
                        per 10 mrad)
    longest             no recording is longer than a week
    merge               two things that begin and end within this of each other happen together
    """

    gap: float = 0.05
    clock_jump: float = 0.05
    late: float = 0.5
    comparable: float = 1.25
    stuck: float = 0.5
    stuck_factor: float = 5.0
    noisy: float = 0.25
    moving_rate: float = 0.02
    moving_angle: float = 0.05
    longest: float = 7 * 86_400.0
    merge: float = 0.1


THRESHOLDS = Thresholds()


@dataclass
class TopicSamples:
    """Samples of one topic in recorded order: stamps and log times [ns], SI values per signal, and what is kept."""

    topic: str
    channels: tuple[Channel, ...]
    stamps_ns: Stamps
    log_ns: Stamps
    values: dict[str, Floats]
    timed: Flags
    valid: dict[str, Flags]


@dataclass(frozen=True)
class _Raw:
    """An event in absolute stamps [ns]."""

    kind: FaultKind
    start_ns: float
    end_ns: float
    count: int
    detail: str


# ---- stamps ----------------------------------------------------------------------------------------------------------


def check_far(samples: TopicSamples, middle_ns: float, limits: Thresholds = THRESHOLDS) -> list[_Raw]:
    """Mask stamps that lie days from the others of the recording, where the topic has any that do not.

    middle_ns: a stamp [ns] in the middle of the recording.
    """
    stamps = samples.stamps_ns
    far = np.abs(stamps - middle_ns) > limits.longest * _SECOND
    if not far.any() or far.all():
        return []
    samples.timed[far] = False
    kept = stamps[~far]
    count = int(far.sum())
    detail = f"{count} {'stamp lies' if count == 1 else 'stamps lie'} days from all others"
    return [_Raw("clock_jump", float(kept.min()), float(kept.max()), count, detail)]


def check_stamps(samples: TopicSamples, limits: Thresholds = THRESHOLDS) -> list[_Raw]:
    """Mask in `samples.timed` what cannot be placed in time; afterwards the stamps of the rest increase strictly."""
    events: list[_Raw] = []
    stamps, log = samples.stamps_ns[samples.timed], samples.log_ns[samples.timed]
    if len(stamps) < 2:
        return events
    events += _repeated(samples)
    if _comparable(stamps, log, limits):
        events += _jumps(samples, limits)
        events += _late(samples, limits)
    events += unordered(samples)
    return events


def _comparable(stamps: Stamps, log: Stamps, limits: Thresholds) -> bool:
    ds, dl = np.diff(stamps).astype(float), np.diff(log).astype(float)
    usual = float(np.median(ds[ds > 0])) if (ds > 0).any() else 0.0
    if usual <= 0:
        return False
    # Clipped, so that one jump or pause does not decide; summed, so that bursts of log times do not either.
    ratio = float(np.clip(dl, 0, 10 * usual).sum() / np.clip(ds, 0, 10 * usual).sum())
    return 1 / limits.comparable < ratio < limits.comparable


def _repeated(samples: TopicSamples) -> list[_Raw]:
    """Messages with the stamp of the one before: the sender repeats itself, nothing new was measured."""
    stamps = samples.stamps_ns
    repeated = np.concatenate([[False], np.diff(stamps) == 0])
    samples.timed[repeated] = False
    events = []
    for a, b in _runs(repeated, reach=5):
        count = int(repeated[a : b + 1].sum())
        end = float(stamps[min(b + 1, len(stamps) - 1)])
        start = float(stamps[a])
        events.append(_Raw("stale", start, max(start, end), count, f"{count} messages repeat the stamp before them"))
    return events


def _jumps(samples: TopicSamples, limits: Thresholds) -> list[_Raw]:
    """Stamps on another line against the log time than most: the clock was set, or the sender started again."""
    index = np.flatnonzero(samples.timed)
    stamps, log = samples.stamps_ns[index], samples.log_ns[index]
    ds, dl = np.diff(stamps).astype(float), np.diff(log).astype(float)
    limit = limits.clock_jump * _SECOND
    usual = float(np.median(ds[ds > 0]))
    # A pause of the log alone (stamps go on as usual) is none of the stamps' faults.
    jump = (np.abs(ds - dl) > limit) & ((ds < 0) | (ds > max(limits.gap * _SECOND, 3 * usual)))
    if not jump.any():
        return []
    shift = np.concatenate([[0.0], np.cumsum(_settled_jumps(stamps - log, np.flatnonzero(jump)))])
    levels, sizes = np.unique(np.round(shift / limit).astype(np.int64), return_counts=True)
    main = float(np.median(shift[np.round(shift / limit).astype(np.int64) == levels[sizes.argmax()]]))
    off = np.abs(shift - main) > limit
    samples.timed[index[off]] = False
    on_line = stamps - log
    offset = float(np.median(on_line[~off])) if (~off).any() else 0.0
    events = []
    for first, last in _runs(off, reach=1):
        by = (shift[first] - main) / _SECOND
        start, end = float(log[first]) + offset, float(log[last]) + offset
        detail = f"the stamps jump by {by:+.3f} s against the time of arrival; {last - first + 1} samples masked"
        events.append(_Raw("clock_jump", start, end, last - first + 1, detail))
    return events


def _settled_jumps(on_line: Stamps, where: NDArray[np.intp]) -> Floats:
    """By how much [ns] the stamps jump at the steps `where`, judged by several samples on both sides.

    One message that came late after a gap looks like a jump by itself, and is none. on_line: stamp minus log time (n,).
    Returns (n - 1,), zero elsewhere.
    """
    jumps = np.zeros(len(on_line) - 1)
    edges = [0, *(where + 1).tolist(), len(on_line)]
    for k, step in enumerate(where.tolist()):
        before = on_line[max(edges[k], step - 99) : step + 1]
        after = on_line[step + 1 : min(edges[k + 2], step + 101)]
        jumps[step] = float(np.median(after) - np.median(before))
    return jumps


def _late(samples: TopicSamples, limits: Thresholds) -> list[_Raw]:
    """Messages that arrive long after their stamp while those before and after do not."""
    delay = (samples.log_ns - samples.stamps_ns).astype(float) / _SECOND
    index = np.flatnonzero(samples.timed)
    if len(index) < 3 or np.ptp(delay[index]) < limits.late:
        return []
    block = 200
    medians = np.array([np.median(delay[index[k : k + block]]) for k in range(0, len(index), block)])
    place = np.arange(len(index)) // block
    before = medians[np.maximum(place - 2, 0)]
    after = medians[np.minimum(place + 2, len(medians) - 1)]
    late = np.zeros(len(delay), bool)
    late[index] = delay[index] - np.maximum(before, after) > limits.late
    if len(medians) < 3:
        late[index] = delay[index] - np.median(delay[index]) > limits.late
    samples.timed[late] = False
    return [
        _Raw(
            "stale", float(samples.stamps_ns[a]), float(samples.stamps_ns[b]), b - a + 1,
            f"{b - a + 1} messages arrived up to {delay[a : b + 1].max():.2f} s after their stamp",
        )
        for a, b in _runs(late, reach=5)
    ]  # fmt: skip


def unordered(samples: TopicSamples) -> list[_Raw]:
    """Stamps that repeat or go back: the fewest samples are masked with which the rest increases strictly."""
    index = np.flatnonzero(samples.timed)
    stamps = samples.stamps_ns[index]
    if len(stamps) < 2 or (np.diff(stamps) > 0).all():
        return []
    keep = _longest_increasing(stamps)
    kept = stamps[keep]
    dropped = ~keep
    samples.timed[index[dropped]] = False
    before = np.maximum.accumulate(np.where(keep, np.arange(len(stamps)), -1))
    repeated = dropped & (before >= 0) & (stamps == stamps[np.maximum(before, 0)])
    events = []
    for kind, which in (("stale", repeated), ("clock_jump", dropped & ~repeated)):
        for a, b in _runs(which, reach=5):
            left = float(stamps[before[a]]) if before[a] >= 0 else float(kept[0])
            position = int(np.searchsorted(kept, stamps[before[b]] if before[b] >= 0 else kept[0], side="right"))
            right = float(kept[min(position, len(kept) - 1)])
            count = int(which[a : b + 1].sum())
            if kind == "stale":
                events.append(
                    _Raw("stale", left, max(left, right), count, f"{count} messages repeat the stamp before them")
                )
            else:
                by = float(np.ptp(np.append(stamps[a : b + 1][which[a : b + 1]], left))) / _SECOND
                detail = f"{count} stamps are out of order by up to {by:.3f} s"
                events.append(_Raw("clock_jump", left, max(left, right), count, detail))
    return events


def _longest_increasing(stamps: Stamps) -> Flags:
    """Which elements form a longest strictly increasing subsequence (patience sorting); of equal ones the first."""
    tails: list[int] = []
    tail_index: list[int] = []
    previous = np.full(len(stamps), -1, np.int64)
    for i, stamp in enumerate(stamps.tolist()):
        k = bisect_left(tails, stamp)
        if k < len(tails) and tails[k] == stamp:
            continue
        if k:
            previous[i] = tail_index[k - 1]
        if k == len(tails):
            tails.append(stamp)
            tail_index.append(i)
        else:
            tails[k] = stamp
            tail_index[k] = i
    keep = np.zeros(len(stamps), bool)
    i = tail_index[-1]
    while i >= 0:
        keep[i] = True
        i = int(previous[i])
    return keep


# ---- what is missing -------------------------------------------------------------------------------------------------


def check_missing(
    samples: TopicSamples, start_ns: float, end_ns: float, jumps: list[_Raw], limits: Thresholds = THRESHOLDS
) -> list[_Raw]:
    """Gaps (longer than `limits.gap` without a sample, also at the ends) and lost samples in between."""
    stamps = samples.stamps_ns[samples.timed].astype(np.int64)
    if len(stamps) < 2:
        return [_Raw("gap", start_ns, end_ns, 0, "hardly any sample")] if end_ns > start_ns else []
    steps = np.diff(stamps).astype(float)
    period = float(np.median(steps))
    limit = limits.gap * _SECOND
    edges = np.concatenate([[start_ns], stamps.astype(float), [end_ns]])
    open_steps = np.diff(edges)
    events: list[_Raw] = []
    gaps = open_steps > limit
    # Masked stamps leave a hole that was already reported; it is a gap all the same unless the jump covers it.
    for first, last in _runs(gaps, reach=1):
        a, b = float(edges[first]), float(edges[last + 1])
        if any(jump.kind == "clock_jump" and jump.start_ns - limit <= a and b <= jump.end_ns + limit for jump in jumps):
            continue
        missing = max(1, round((b - a) / period) - (last - first + 1))
        text = (
            f"no sample for {(b - a) / _SECOND:.2f} s"
            if first == last
            else f"a sample only every {(b - a) / (last - first + 1) / 1e6:.0f} ms"
        )
        events.append(_Raw("gap", a, b, missing, text))
    short = np.flatnonzero(steps <= limit)
    lost = _missing(steps, period)[short]
    if lost.any():
        where = short[lost > 0]
        count, expected = int(lost.sum()), int(lost.sum()) + len(stamps)
        share = f"{100 * count / expected:.1f} %"
        detail = f"{count} of {expected} samples ({share}) are missing, {int(lost.max())} at most in a row"
        events.append(_Raw("loss", float(stamps[where[0]]), float(stamps[where[-1] + 1]), count, detail))
    return events


def _missing(steps: Floats, period: float) -> NDArray[np.int64]:
    """Samples missing in each step. A late sample that later ones make up for is jitter, not loss."""
    late = np.concatenate([[0.0], np.cumsum(steps - period)])
    ahead = 10  # samples within which a late one is made up for; a lost one never is
    padded = np.concatenate([late, np.full(ahead, np.inf)])
    settled = np.lib.stride_tricks.sliding_window_view(padded, ahead + 1).min(axis=1)
    return np.asarray(np.maximum(np.rint(np.diff(settled) / period), 0), np.int64)


# ---- values ----------------------------------------------------------------------------------------------------------


def check_values(samples: TopicSamples, limits: Thresholds = THRESHOLDS) -> list[_Raw]:
    """Mask NaN and infinite values and those outside the channel's plausible range."""
    events: list[_Raw] = []
    for channel in samples.channels:
        values, valid = samples.values[channel.name], samples.valid[channel.name]
        unusable = ~np.isfinite(values)
        with np.errstate(invalid="ignore"):
            outside = ~unusable & ((values < channel.low) | (values > channel.high))
        for kind, bad in (("nan", unusable), ("out_of_range", outside)):
            bad = bad & samples.timed
            valid &= ~bad
            for a, b in _runs(bad, reach=10):
                count = int(bad[a : b + 1].sum())
                detail = f"{channel.name} is not a number in {count} samples"
                if kind == "out_of_range":
                    worst = values[a : b + 1][bad[a : b + 1]]
                    far = float(worst[np.argmax(np.abs(worst))])
                    plausible = f"plausible: {channel.low:.4g} to {channel.high:.4g}"
                    detail = f"{channel.name} reads {far:.4g} {channel.unit} ({plausible}) in {count} samples"
                times = samples.stamps_ns
                events.append(
                    _Raw("nan" if kind == "nan" else "out_of_range", float(times[a]), float(times[b]), count, detail)
                )
    return events


def check_stuck(topics: dict[str, TopicSamples], limits: Thresholds = THRESHOLDS) -> dict[str, list[_Raw]]:
    """Mask values that repeat for longer than noise and quantisation, or the motion of the boom, make believable.

    A quantised angle at rest may be constant for minutes and an idle current is clipped at zero: neither is stuck. The
    angle is judged by the rate, the pressures also by the angle, and each noisy signal by itself.
    """
    found: dict[str, list[_Raw]] = {topic: [] for topic in topics}
    witness = _Motion(topics)
    stuck_rate: list[tuple[float, float]] = []
    # The rate first: it tells of the angle, and when the IMU hangs both repeat.
    names = [name for samples in topics.values() if samples.topic in MEASURED_TOPICS for name in samples.values]
    names.sort(key=lambda name: name != "rate")
    for name in names:
        samples = next(s for s in topics.values() if name in s.values)
        index = np.flatnonzero(samples.valid[name] & samples.timed)
        if len(index) < 3:
            continue
        values, times = samples.values[name][index], samples.stamps_ns[index].astype(float)
        longest = _believable(values, name.endswith("current"), limits)
        for a, b in _runs_of_equal(values):
            span = (times[b] - times[a]) / _SECOND
            if span < limits.stuck or (name.endswith("current") and values[a] <= 0):
                continue
            start = times[a]
            if not (longest is not None and b - a + 1 > longest):
                moved = witness.contradicts(name, float(values[a]), times[a], times[b], limits)
                hangs = name == "angle" and any(_same_span(other, (times[a], times[b]), limits) for other in stuck_rate)
                if moved is None and not hangs:
                    continue
                start = start if moved is None else max(start, moved)
            first = int(np.searchsorted(times, start))
            samples.valid[name][index[first : b + 1]] = False
            if name == "rate":
                stuck_rate.append((start, times[b]))
            unit = next(channel.unit for channel in samples.channels if channel.name == name)
            detail = f"{name} repeats {values[a]:.6g} {unit} for {(times[b] - start) / _SECOND:.2f} s"
            found[samples.topic].append(_Raw("stuck", float(start), float(times[b]), b - first + 1, detail))
    return found


def _believable(values: Floats, clipped: bool, limits: Thresholds) -> float | None:
    """Longest run of equal values that this signal's noise may make, times the factor; None without noise."""
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
    reversals = float(np.mean(np.sign(changes[1:]) != np.sign(changes[:-1])))
    if reversals < limits.noisy:
        return None
    repeats = min(max(float(np.mean(steps[ordinary] == 0)), 1e-3), 0.99)
    return max(limits.stuck_factor * float(np.log(max(len(values), 2)) / -np.log(repeats)), 20.0)


_FOLLOW = {sensor.name for sensor in PREDICTED if sensor.is_pressure}
"""Pressures of the cylinder: they cannot stay as they are while the boom moves; that of a pump can."""


class _Motion:
    """What the IMU says of the boom's motion, to judge the other signals by."""

    def __init__(self, topics: dict[str, TopicSamples]) -> None:
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

    def contradicts(self, name: str, value: float, start: float, end: float, limits: Thresholds) -> float | None:
        """From when on [ns] the boom's motion says that signal `name` left `value`; None where it may have stayed."""
        if name == "angle":
            return _first_motion(*self._during("rate", start, end), limits)
        times, angles = self._during("angle", start, end)
        if len(angles) < 2:
            return None
        if name == "rate":
            drift = angles - angles[0] - value * (times - times[0]) / _SECOND
            return start if float(np.abs(drift).max()) > limits.moving_rate else None
        if name in _FOLLOW:
            return start if float(np.ptp(angles)) > limits.moving_angle else None
        return None


def _first_motion(times: Floats, rates: Floats, limits: Thresholds) -> float | None:
    """When the mean rate over a window of `limits.stuck` first says that the boom moves, None where it never does."""
    if len(rates) < 2:
        return None
    window = max(2, round(limits.stuck * _SECOND / float(np.median(np.diff(times)))))
    if len(rates) < window:
        return None
    total = np.concatenate([[0.0], np.cumsum(rates)])
    means = np.abs(total[window:] - total[:-window]) / window
    moving = np.flatnonzero(means > limits.moving_rate)
    return float(times[moving[0]]) if len(moving) else None


def _same_span(one: tuple[float, float], other: tuple[float, float], limits: Thresholds) -> bool:
    """True where two spans [ns] begin and end together; an angle that repeats for longer than the rate is at rest."""
    return all(abs(a - b) < limits.merge * _SECOND for a, b in zip(one, other, strict=True))


# ---- helpers ---------------------------------------------------------------------------------------------------------


def _runs(flags: Flags, reach: int) -> list[tuple[int, int]]:
    """First and last index of each run of True; runs with fewer than `reach` False between them are one."""
    index = np.flatnonzero(flags)
    if len(index) == 0:
        return []
    cut = np.flatnonzero(np.diff(index) > reach)
    firsts, lasts = index[np.concatenate([[0], cut + 1])], index[np.concatenate([cut, [len(index) - 1]])]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def _runs_of_equal(values: NDArray[np.float64]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0, [True]]))
    return [(a, b - 1) for a, b in pairwise(edges.tolist()) if b - a > 1]


def in_seconds(topic: str, raw: list[_Raw], start_ns: int) -> list[Event]:
    """Events with times in seconds since `start_ns`."""
    return [
        Event(e.kind, topic, (e.start_ns - start_ns) / _SECOND, (e.end_ns - start_ns) / _SECOND, e.count, e.detail)
        for e in raw
    ]
