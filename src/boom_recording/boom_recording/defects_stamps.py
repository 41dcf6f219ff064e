"""Samples that cannot be placed in time: stamps that repeat, jump, go back, or whose message came late."""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from boom_recording.defects import SECOND, THRESHOLDS, StampedEvent, Thresholds, TopicSamples, runs
from boom_recording.recording import Flags, Floats, Stamps


def together(stamps: Stamps, limits: Thresholds = THRESHOLDS) -> tuple[int, int]:
    """From which to which stamp [ns] what belongs together in all of them lies, in any order.

    Behind a silence of hours that is longer than all that was recorded there is another recording, or a clock that was set.
    """
    ordered = np.sort(stamps)
    steps = np.diff(ordered).astype(float)
    recorded = steps[steps <= limits.silence * SECOND].sum()
    cuts = np.flatnonzero(steps > max(limits.silence * SECOND, recorded)) + 1
    part = max(np.split(ordered, cuts), key=len)
    near = int(limits.silence * SECOND)  # topics do not begin and end at once
    return int(part[0]) - near, int(part[-1]) + near


def check_far(samples: TopicSamples, first_ns: int, last_ns: int) -> list[StampedEvent]:
    """Mask stamps that do not belong to those from ``first_ns`` to ``last_ns``, where the topic has any that do."""
    stamps = samples.stamps_ns
    far = (stamps < first_ns) | (stamps > last_ns)
    if not far.any() or far.all():
        return []
    samples.timed[far] = False
    kept = stamps[~far]
    count = int(far.sum())
    away = float(np.maximum(kept.min() - stamps[far], stamps[far] - kept.max()).min()) / SECOND
    lie = f"{count} {'stamp lies' if count == 1 else 'stamps lie'} {_long(away)} from all others"
    detail = f"{lie}: another recording, or a clock that was set"
    return [StampedEvent("clock_jump", float(kept.min()), float(kept.max()), count, detail)]


def _long(seconds: float) -> str:
    return f"{seconds / 86400:.3g} days" if seconds > 172800 else f"{seconds / 3600:.3g} h"


def check_stamps(samples: TopicSamples, limits: Thresholds = THRESHOLDS) -> list[StampedEvent]:
    """Mask in `samples.timed` what cannot be placed in time; afterwards the stamps of the rest increase strictly."""
    events: list[StampedEvent] = []
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


def _repeated(samples: TopicSamples) -> list[StampedEvent]:
    """Messages with the stamp of the one before: the sender repeats itself, nothing new was measured."""
    stamps = samples.stamps_ns
    repeated = np.concatenate([[False], np.diff(stamps) == 0])
    samples.timed[repeated] = False
    events = []
    for a, b in runs(repeated, reach=5):
        count = int(repeated[a : b + 1].sum())
        end = float(stamps[min(b + 1, len(stamps) - 1)])
        start = float(stamps[a])
        events.append(
            StampedEvent("stale", start, max(start, end), count, f"{count} messages repeat the stamp before them")
        )
    return events


def _jumps(samples: TopicSamples, limits: Thresholds) -> list[StampedEvent]:
    """Stamps on another line against the log time than most: the clock was set, or the sender started again."""
    index = np.flatnonzero(samples.timed)
    stamps, log = samples.stamps_ns[index], samples.log_ns[index]
    ds, dl = np.diff(stamps).astype(float), np.diff(log).astype(float)
    limit = limits.clock_jump * SECOND
    usual = float(np.median(ds[ds > 0]))
    # A pause of the log alone (stamps go on as usual) is none of the stamps' faults.
    jump = (np.abs(ds - dl) > limit) & ((ds < 0) | (ds > max(limits.gap * SECOND, 3 * usual)))
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
    for first, last in runs(off, reach=1):
        by = (shift[first] - main) / SECOND
        start, end = float(log[first]) + offset, float(log[last]) + offset
        detail = f"the stamps jump by {by:+.3f} s against the time of arrival; {last - first + 1} samples masked"
        events.append(StampedEvent("clock_jump", start, end, last - first + 1, detail))
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


def _late(samples: TopicSamples, limits: Thresholds) -> list[StampedEvent]:
    """Messages that arrive long after their stamp while those before and after do not."""
    delay = (samples.log_ns - samples.stamps_ns).astype(float) / SECOND
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
        StampedEvent(
            "stale", float(samples.stamps_ns[a]), float(samples.stamps_ns[b]), b - a + 1,
            f"{b - a + 1} messages arrived up to {delay[a : b + 1].max():.2f} s after their stamp",
        )
        for a, b in runs(late, reach=5)
    ]  # fmt: skip


def unordered(samples: TopicSamples) -> list[StampedEvent]:
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
        for a, b in runs(which, reach=5):
            left = float(stamps[before[a]]) if before[a] >= 0 else float(kept[0])
            position = int(np.searchsorted(kept, stamps[before[b]] if before[b] >= 0 else kept[0], side="right"))
            right = float(kept[min(position, len(kept) - 1)])
            count = int(which[a : b + 1].sum())
            if kind == "stale":
                events.append(
                    StampedEvent(
                        "stale", left, max(left, right), count, f"{count} messages repeat the stamp before them"
                    )
                )
            else:
                by = float(np.ptp(np.append(stamps[a : b + 1][which[a : b + 1]], left))) / SECOND
                detail = f"{count} stamps are out of order by up to {by:.3f} s"
                events.append(StampedEvent("clock_jump", left, max(left, right), count, detail))
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
