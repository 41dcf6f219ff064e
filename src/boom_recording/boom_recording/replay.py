"""What a replay sends, when and in which order, without ROS.

Lockstep with the simulation
----------------------------
In lockstep the simulation owns /clock and is at t_n = start + n * 0.01 s. It publishes the samples of t_n, then
/clock = t_n, and waits. One command advances it by exactly one period, to t_(n+1). The command's ``header.stamp``
(simulated time) determines when it acts: inside (t_n, t_(n+1)) from that time, otherwise at once. The replay answers each
tick t_n with one command: the recorded current that belongs to it, with exactly its stamp, counted from the start of
the recording (t_n, if the stamp lies before). Recorded stamps jitter, and their mean phase phi within a period is that of
the sender; so the current of tick n is the last one with a stamp in [t_n + phi - T/2, t_n + phi + T/2), T = 0.01 s.
Windows that began at t_n would sometimes hold two currents and sometimes none if phi is near zero. Without a current in
the window the previous value continues, stamped t_n, or zero inside a gap. The first command, for t_0, is sent without waiting for
a tick as soon as the simulation listens. So the run depends only on the recording and is as fast as both allow. A reference is
replayed in the same way: the controller, which commands the simulation, waits for the reference of its tick.

Over CAN a command acts from its tick on: the bus does not carry stamps. There phi counts from -T/2 to T/2, and the currents
of a recording act up to 5 ms earlier or later than in the recording.

Gaps
----
Masked samples are not replayed. Where the currents are unknown for more than 50 ms, commands go to zero (the valve
closes) until they are known again. A reference is held.
"""

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from boom_recording.defects import THRESHOLDS
from boom_recording.errors import RecordingError
from boom_recording.recording import Recording

PERIOD_NS = 10_000_000
COMMANDS = "commands"
REFERENCE = "reference"
CONTENTS = (COMMANDS, REFERENCE)
RETURN = 0.1
"""rad/s. Cranes follow that in all poses."""


@dataclass(frozen=True)
class ReplaySample:
    """One message to send.

    stamp_ns   [ns] since the start of the recording, or of the part that is replayed
    values     commands: retract and extend current [A]; reference: angle [rad]
    gap        True: inserted because the currents are unknown from here on
    """

    stamp_ns: int
    values: tuple[float, ...]
    gap: bool = False


def samples(recording: Recording, what: str) -> list[ReplaySample]:
    """All messages of a recording by time. Raises RecordingError if `recording` has nothing valid of that kind."""
    if what not in CONTENTS:
        raise RecordingError(f"'{what}' cannot be replayed: choose one of {', '.join(CONTENTS)}")
    names = ("retract_current", "extend_current") if what == COMMANDS else ("angle",)
    signals = [recording.signals[name] for name in names if name in recording.signals]
    valid = (
        np.logical_and.reduce([signal.valid for signal in signals]) if len(signals) == len(names) else np.zeros(0, bool)
    )
    if not valid.any():
        raise RecordingError(
            f"{recording.path}: it holds nothing valid to replay as {what}: "
            f"record {' and '.join(names)}, or give another bag"
        )
    stamps = (signals[0].stamps_ns[valid] - recording.start_ns).tolist()
    columns = [signal.values[valid].tolist() for signal in signals]
    measured = [ReplaySample(stamp, values) for stamp, values in zip(stamps, zip(*columns, strict=True), strict=True)]
    return _with_gaps(measured) if what == COMMANDS else measured


def _with_gaps(measured: list[ReplaySample]) -> list[ReplaySample]:
    limit = round(THRESHOLDS.gap * 1e9)
    result: list[ReplaySample] = []
    for sample in measured:
        if result and sample.stamp_ns - result[-1].stamp_ns > limit:
            result.append(ReplaySample(result[-1].stamp_ns + limit, (0.0, 0.0), gap=True))
        result.append(sample)
    return result


def part(everything: list[ReplaySample], start_s: float, duration_s: float) -> list[ReplaySample]:
    """The samples from `start_s` on for `duration_s` (0 = to the end), stamped from the start of that part.

    The first sample is the one that acts at `start_s`. Raises RecordingError if nothing is left.
    """
    start = round(start_s * 1e9)
    end = start + round(duration_s * 1e9) if duration_s > 0 else None
    first = bisect_left(everything, start, key=lambda sample: sample.stamp_ns)
    chosen = [
        ReplaySample(s.stamp_ns - start, s.values, s.gap) for s in everything[first:] if end is None or s.stamp_ns < end
    ]
    if first > 0 and (not chosen or chosen[0].stamp_ns > 0) and first < len(everything):
        before = everything[first - 1]
        chosen.insert(0, ReplaySample(0, before.values, before.gap))
    if not chosen:
        last = everything[-1].stamp_ns / 1e9
        raise RecordingError(
            f"nothing to replay from {start_s:g} s on: the recording ends at {last:.1f} s; lower 'start'"
        )
    return chosen


def with_way_back(chosen: list[ReplaySample]) -> list[ReplaySample]:
    """A reference with a way from its end to its beginning behind it, at ``RETURN`` at most: repeated it does not jump."""
    (begin,), (end,) = chosen[0].values, chosen[-1].values
    count = math.ceil(0.5 * math.pi * abs(begin - end) / RETURN * 1e9 / PERIOD_NS)
    turned = [0.5 - 0.5 * math.cos(math.pi * k / count) for k in range(1, count)]
    return chosen + [
        ReplaySample(chosen[-1].stamp_ns + (k + 1) * PERIOD_NS, (end + share * (begin - end),))
        for k, share in enumerate(turned)
    ]


def apart(chosen: list[ReplaySample]) -> float:
    """Median time [s] between samples; 0 of a single one."""
    return float(np.median(np.diff([sample.stamp_ns for sample in chosen]))) / 1e9 if len(chosen) > 1 else 0.0


@dataclass
class ReplayLockstep:
    """Answers the ticks of the simulation; see the docstring of the module.

    start_ns   simulated time of the first sample [ns]
    what       `COMMANDS`: zero acts before the first sample; `REFERENCE`: the first angle
    on_ticks   True: commands act from their tick on, whatever their stamp (over CAN); each tick gets the current nearest to it
    """

    chosen: list[ReplaySample]
    start_ns: int = 0
    period_ns: int = PERIOD_NS
    what: str = COMMANDS
    on_ticks: bool = False
    _next: int = 0
    _answered: int = -1
    _acting: tuple[float, ...] = (0.0, 0.0)
    _acting_from: int = 0

    def __post_init__(self) -> None:
        if self.what == REFERENCE:
            self._acting = self.chosen[0].values
        stamps = np.array([sample.stamp_ns for sample in self.chosen])
        turn = 2 * np.pi / self.period_ns
        mean = np.angle(np.exp(1j * turn * (stamps % self.period_ns)).sum()) / turn
        self._phase_ns = round(float(mean) if self.on_ticks else float(mean) % self.period_ns)

    def first(self) -> ReplaySample:
        """The command for t_0, to be sent without a tick."""
        answer = self.answer(self.start_ns)
        assert answer is not None  # nothing was answered before
        return answer

    def answer(self, clock_ns: int) -> ReplaySample | None:
        """The command for tick `clock_ns` (stamped in simulated time), or None if that tick was answered already."""
        tick = round((clock_ns - self.start_ns) / self.period_ns)
        if tick <= self._answered:
            return None
        self._answered = tick
        begin = tick * self.period_ns
        end = begin + self._phase_ns + self.period_ns // 2
        stamp, gap = max(begin, self._acting_from), False
        while self._next < len(self.chosen) and self.chosen[self._next].stamp_ns < end:
            sample = self.chosen[self._next]
            self._next += 1
            self._acting, stamp, gap = sample.values, max(sample.stamp_ns, begin), sample.gap
        self._acting_from = stamp
        return ReplaySample(self.start_ns + stamp, self._acting, gap)

    @property
    def next_tick_ns(self) -> int:
        """Simulated time [ns] from which the next command will act."""
        return self.start_ns + (self._answered + 1) * self.period_ns

    @property
    def finished(self) -> bool:
        """True once the last sample has been sent."""
        return self._next >= len(self.chosen)


def endless(chosen: list[ReplaySample], loop: bool) -> Iterator[ReplaySample]:
    """The samples once, or repeated with stamps that continue to increase by the length of the part."""
    yield from chosen
    offset = 0
    length = chosen[-1].stamp_ns + PERIOD_NS
    while loop:
        offset += length
        for sample in chosen:
            yield ReplaySample(sample.stamp_ns + offset, sample.values, sample.gap)
