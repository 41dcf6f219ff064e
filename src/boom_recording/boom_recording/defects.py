"""Finds what is wrong with the samples of a recording and masks it. Arrays in, events and masks out; no files.

The order matters: first the stamps (`defects_stamps`: which samples can be placed in time at all), then what is missing
between them, then the values, at last those that are stuck (`defects_stuck`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_input.channels import Channel
from boom_recording.channels import FaultKind
from boom_recording.recording import Event, Flags, Floats, Stamps

SECOND = 1e9


@dataclass(frozen=True)
class Thresholds:
    """When something counts as a fault. Times in seconds.

    gap                 the contract's definition of a gap; of a logger of 20 Hz and less, one and a half periods
    clock_jump          a stamp may be off against the log time by what a busy network delays (some 10 ms), not by more
    late                a message that arrives this much later than its neighbours: its stamp cannot be trusted, a bus
                        queue was stuck
    comparable          log time and stamps run equally fast within this factor; otherwise (simulated faster than real
                        time) they are not compared
    stuck               shortest time for which repeated values are looked at
    stuck_factor        a noisy sensor is stuck when it repeats this many times longer than chance would let it in the
                        whole recording
    usual               so many runs of a length make it one that a signal has, as between two steps of a coarse sensor
    jump                steps by which a pressure that was stuck while the boom moved is elsewhere afterwards
    noisy               share of reversals among successive changes above which a signal is noise on top of motion
                        (white noise 2/3, smooth motion 0)
    moving_rate         [rad/s] boom surely moves: above any gyro's bias (5 mrad/s), 26 steps of the angle sensor in
                        half a second
    further             share of reversals over more than one step of a sensor below which its noise is smaller than the step
                        (0.3 steps of noise: 1 %)
    moving_angle        [rad] change of angle with which a pressure must change
    moving_steps        by this many of its steps, where they are coarse
    pressure_slope      [Pa/rad] how much it changes: about 0.5 bar per 10 mrad
    silence             behind one that is as long, and longer than all that was recorded, there is another recording
    merge               two things that begin and end within this of each other happen together
    """

    gap: float = 0.05
    clock_jump: float = 0.05
    late: float = 0.5
    comparable: float = 1.25
    stuck: float = 0.5
    stuck_factor: float = 5.0
    usual: int = 5
    jump: float = 3.0
    noisy: float = 0.25
    moving_rate: float = 0.02
    further: float = 0.01
    moving_angle: float = 0.05
    moving_steps: float = 5.0
    pressure_slope: float = 5.0e6
    silence: float = 2 * 3600.0
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
class StampedEvent:
    """An event in absolute stamps [ns]."""

    kind: FaultKind
    start_ns: float
    end_ns: float
    count: int
    detail: str


def check_missing(
    samples: TopicSamples, start_ns: float, end_ns: float, jumps: list[StampedEvent], limits: Thresholds = THRESHOLDS
) -> list[StampedEvent]:
    """Gaps (no sample for `limits.gap`, or one and a half periods, also at the ends) and lost samples in between."""
    stamps = samples.stamps_ns[samples.timed].astype(np.int64)
    if len(stamps) < 2:
        return [StampedEvent("gap", start_ns, end_ns, 0, "hardly any sample")] if end_ns > start_ns else []
    steps = np.diff(stamps).astype(float)
    period = float(np.median(steps))
    limit = max(limits.gap * SECOND, 1.5 * period)
    edges = np.concatenate([[start_ns], stamps.astype(float), [end_ns]])
    open_steps = np.diff(edges)
    events: list[StampedEvent] = []
    gaps = open_steps > limit
    # Masked stamps leave a hole that was already reported; it is a gap all the same unless the jump covers it.
    for first, last in runs(gaps, reach=1):
        a, b = float(edges[first]), float(edges[last + 1])
        if any(jump.kind == "clock_jump" and jump.start_ns - limit <= a and b <= jump.end_ns + limit for jump in jumps):
            continue
        missing = max(1, round((b - a) / period) - (last - first + 1))
        text = (
            f"no sample for {(b - a) / SECOND:.2f} s"
            if first == last
            else f"a sample only every {(b - a) / (last - first + 1) / 1e6:.0f} ms"
        )
        events.append(StampedEvent("gap", a, b, missing, text))
    return events + _lost(stamps, steps, period, limit)


def _lost(stamps: Stamps, steps: Floats, period: float, limit: float) -> list[StampedEvent]:
    """Single samples that are missing in steps of at most `limit` [ns]."""
    short = np.flatnonzero(steps <= limit)
    lost = _missing(steps, period)[short]
    if not lost.any():
        return []
    where = short[lost > 0]
    count, expected = int(lost.sum()), int(lost.sum()) + len(stamps)
    share = f"{100 * count / expected:.1f} %"
    detail = f"{count} of {expected} samples ({share}) are missing, {int(lost.max())} at most in a row"
    return [StampedEvent("loss", float(stamps[where[0]]), float(stamps[where[-1] + 1]), count, detail)]


def _missing(steps: Floats, period: float) -> NDArray[np.int64]:
    """Samples missing in each step. A late sample that later ones make up for is jitter, not loss."""
    late = np.concatenate([[0.0], np.cumsum(steps - period)])
    ahead = 10  # samples within which a late one is made up for; a lost one never is
    padded = np.concatenate([late, np.full(ahead, np.inf)])
    settled = np.lib.stride_tricks.sliding_window_view(padded, ahead + 1).min(axis=1)
    return np.asarray(np.maximum(np.rint(np.diff(settled) / period), 0), np.int64)


def check_values(samples: TopicSamples) -> list[StampedEvent]:
    """Mask NaN and infinite values and those outside the channel's plausible range."""
    events: list[StampedEvent] = []
    for channel in samples.channels:
        values, valid = samples.values[channel.name], samples.valid[channel.name]
        unusable = ~np.isfinite(values)
        with np.errstate(invalid="ignore"):
            outside = ~unusable & ((values < channel.low) | (values > channel.high))
        found: tuple[tuple[FaultKind, Flags], ...] = (("nan", unusable), ("out_of_range", outside))
        for kind, bad in found:
            bad = bad & samples.timed
            valid &= ~bad
            for a, b in runs(bad, reach=10):
                count = int(bad[a : b + 1].sum())
                detail = f"{channel.name} is not a number in {count} samples"
                if kind == "out_of_range":
                    worst = values[a : b + 1][bad[a : b + 1]]
                    far = float(worst[np.argmax(np.abs(worst))])
                    plausible = f"plausible: {channel.low:.4g} to {channel.high:.4g}"
                    detail = f"{channel.name} reads {far:.4g} {channel.unit} ({plausible}) in {count} samples"
                times = samples.stamps_ns
                events.append(StampedEvent(kind, float(times[a]), float(times[b]), count, detail))
    return events


def runs(flags: Flags, reach: int) -> list[tuple[int, int]]:
    """First and last index of each run of True; runs with fewer than `reach` False between them are one."""
    index = np.flatnonzero(flags)
    if len(index) == 0:
        return []
    cut = np.flatnonzero(np.diff(index) > reach)
    firsts, lasts = index[np.concatenate([[0], cut + 1])], index[np.concatenate([cut, [len(index) - 1]])]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def in_seconds(topic: str, raw: list[StampedEvent], start_ns: int) -> list[Event]:
    """Events with times in seconds since `start_ns`."""
    return [
        Event(e.kind, topic, (e.start_ns - start_ns) / SECOND, (e.end_ns - start_ns) / SECOND, e.count, e.detail)
        for e in raw
    ]
