"""Watches a running machine: detects when it leaves the tolerance of its model, and in which subsystem. No ROS.

Samples arrive as they are measured, each with its stamp; time advances in periods of 10 ms. The score is the mean squared
innovation, in units of its variance, that remains after allowing for the tolerances; 1 is noise.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boom_estimation.currents import GAP, gap_of
from boom_estimation.initial_state import CLOSED_CURRENT, RESTING_RATE, stationary_guess
from boom_input import channels
from boom_input.repeats import Repeats
from boom_model.errors import SimulationError
from boom_model.machine import Machine, Pose
from boom_model.sensors import OUTPUTS
from boom_monitor import naming
from boom_monitor.filter import Information, WatchFilter
from boom_monitor.model import Suspect, WatchModel
from boom_monitor.naming import Interval
from boom_monitor.status import Alarm, Status, WatchSettings

Array = NDArray[np.float64]

PERIOD = 0.01
CURRENTS = tuple(channel.name for channel in channels.CURRENTS)
CHANNELS = (*OUTPUTS, *CURRENTS)
"""All that a watch uses."""
NEEDED = ("angle", *CURRENTS)
"""Without the others it watches what can be watched."""
_JUDGED_EVERY = 0.1  # s
_SETTLING = 2.0  # s after a start, in which the guess of the initial state still shows: they count for nothing
_GATHERING = 0.5  # s behind that, until there is enough for a score
_DOUBTED = (
    6.0  # s after a start, in which the guess may still be what is wrong: a mismatch has to show in fresh samples
)
_BEFORE = 0.5  # s before the alarm from which on the cause is sought
_NAMED_AFTER = (
    0.5,
    1.5,
    3.0,
)  # s of an alarm, after which the cause is sought; later the mismatch itself bends the answer
_KEPT = 400  # periods that are kept for that
_LONGEST_SILENCE = 0.5  # s without a sensor, after which the state is guessed anew
_LONGEST_GAP = 0.15  # s without a current, after which it is, too
_BLIND = 1.0  # s behind a shorter gap in which a current changed: what the valve did meanwhile still shows
_SAME = 0.02  # A. Currents at both ends of a gap that differ by less did not change in it
_LATELY = 60.0  # s over which such times are summed up
_AT_REST = 1.0  # s that the valve has been closed: what a sensor does then is its noise
_START = 0.1  # s of samples from which a start is made
_ABSENT = 5.0  # s of the others, after which a channel that never came is not there
_PRIOR = 0.2  # information on a suspect's size before anything was measured: two of its units
_BUFFER = 1000  # samples of a channel that are kept at most
_EARLIER = 1e-9
_NO_CHANGE = {"angle": 1e-6, "rate": 1e-6, "hose_pressure": 10.0, "rod_pressure": 10.0}  # rad, rad/s, Pa


@dataclass
class _Evidence:
    """Times of an alarm [s]: its beginning, the last time the score exceeded the threshold, and the next naming."""

    begin: float
    last: float
    due: list[float]


class Watch:
    """A watch over one machine in one pose.

    Args:
        machine: the model; preferably the file that identification or diagnosis wrote.
        pose: locked joints and load.
        settings: of the watch.

    Raises:
        BuildError, MachineError, ModelError: the model cannot be built.
    """

    def __init__(self, machine: Machine, pose: Pose, settings: WatchSettings | None = None) -> None:
        self.settings = settings or WatchSettings()
        self._noise = machine.sensor_noise()
        self._model = WatchModel(machine, pose)
        self._samples: dict[str, deque[tuple[float, float]]] = {name: deque(maxlen=_BUFFER) for name in CHANNELS}
        self._last = dict.fromkeys(self._samples, -math.inf)
        self._filter: WatchFilter | None = None
        self._from = self._doubted = -math.inf
        self._gap = GAP
        self._judged = -math.inf
        self._guessed_again = self._too_seldom = False
        self._heard = 0.0
        self._score = math.nan
        self._evidence: _Evidence | None = None
        self._recent: deque[Interval] = deque(maxlen=_KEPT)
        self._alarm: Alarm | None = None
        self._alarms = 0
        self._newest = -math.inf
        self._since = math.nan
        self._absent: tuple[str, ...] = ()
        self._repeats = {name: Repeats(_NO_CHANGE[name]) for name in OUTPUTS}
        self._turning, self._turned = 0.0, math.nan
        self._stuck: tuple[str, ...] = ()
        self._closed_since = math.inf
        self._unknown: deque[tuple[float, float]] = deque()
        self._blind: deque[float] = deque(maxlen=round(_LATELY / PERIOD))

    def add(self, channel: str, time: float, value: float) -> bool:
        """One valid sample: channel of ``OUTPUTS`` or ``CURRENTS``, its stamp [s], its value [SI, gauge].

        Samples of one channel come in the order of their stamps, and of a sensor before the watch has passed their time; one
        that does not, or is not a number, is left out: False. With the first sample of a channel that was thought absent the
        watch starts anew.
        """
        passed = self._last[channel]
        if self._filter is not None and channel in OUTPUTS:
            passed = max(passed, self._filter.time)
        if not (math.isfinite(value) and passed < time < math.inf):
            return False
        if channel in CURRENTS:
            self._gap_closed(channel, time, value)
        self._samples[channel].append((time, value))
        self._last[channel] = time
        self._newest = max(self._newest, time)
        if channel in self._absent:
            self._absent = tuple(name for name in self._absent if name != channel)
            self._lose(time)
        return True

    def advance(self) -> Status:
        """Advance as far as the samples reach, less the delay; returns the status then."""
        until = self._newest - self.settings.delay
        if self._filter is None:
            self._start(until)
        while self._filter is not None and self._filter.time + PERIOD <= until:
            self._step(self._filter)
        return self.status

    @property
    def status(self) -> Status:
        """The present status."""
        time = self._filter.time if self._filter is not None else self._newest
        watching = self._filter is not None and self._filter.time >= self._from + _GATHERING
        missing = "" if self._filter is not None else ", ".join(self._awaited())
        if self._too_seldom:
            missing = "the currents at least every 30 ms: they may change unseen between those that come"
        lately = sum(at > time - _LATELY for at in self._blind) * PERIOD / _LATELY
        return Status(
            watching, time, self._score, self._alarm, self._alarms, missing, self._absent, self._stuck, lately
        )

    # ---------------------------------------------------------------------------------------------------------- running

    def _awaited(self) -> list[str]:
        """Channels without a sample that may still come."""
        return [name for name, samples in self._samples.items() if not samples and name not in self._absent]

    def _start(self, until: float) -> None:
        """A new filter from the first stretch in which all channels that are there were measured."""
        if not self._all_there(until):
            return
        begin = max(samples[0][0] for samples in self._samples.values() if samples)
        for samples in self._samples.values():
            while len(samples) > 1 and samples[1][0] <= begin:
                samples.popleft()
        end = begin + _START
        if end > until or self._currents_too_seldom():
            return
        means = self._means(end)
        if means is None:
            return
        current = self._acting(end)
        plant = self._model.plant
        moving = abs(means["rate"]) > RESTING_RATE or max(current[-1][1:]) > CLOSED_CURRENT
        if moving:
            state = stationary_guess(plant, means, (current[-1][1], current[-1][2]))
        else:
            state = plant.rest_state_measured(means["angle"], means["hose_pressure"], means["rod_pressure"])
        state = np.clip(state, plant.lowest(), plant.maximum)
        self._filter = WatchFilter(self._model, self._noise, state, end, moving=moving, memory=self.settings.memory)
        self._from = end + _SETTLING
        self._closed_since = end
        if not self._guessed_again:
            self._doubted = end + _DOUBTED
        self._heard = end
        for name in OUTPUTS:
            self._drop(name, end)

    def _all_there(self, until: float) -> bool:
        """Whether every channel has samples; one that did not come for ``_ABSENT`` while others did is not there."""
        awaited = self._awaited()
        if any(name in NEEDED for name in awaited):
            return False
        if math.isnan(self._since):
            self._since = self._newest
        if awaited and until < self._since + _ABSENT:
            return False
        self._absent += tuple(awaited)
        return True

    def _means(self, end: float) -> dict[str, float] | None:
        """Of the sensors until ``end`` [s], NaN of those that are not there; None where one has no sample that early."""
        means = dict.fromkeys(OUTPUTS, math.nan)
        for name in (name for name in OUTPUTS if name not in self._absent):
            values = [v for t, v in self._samples[name] if t <= end]
            if not values:
                self._samples[name].clear()
                return None
            means[name] = float(np.mean(values))
        if "rate" in self._absent:
            means["rate"] = _slope([(t, v) for t, v in self._samples["angle"] if t <= end])
        return means

    def _currents_too_seldom(self) -> bool:
        """Whether they may change unseen between two samples, which would look like physics; sets the length of a gap, too."""
        self._gap = gap_of(np.array([time for time, _ in self._samples[CURRENTS[0]]]))
        self._too_seldom = self._gap > GAP
        if self._too_seldom:
            for samples in self._samples.values():
                samples.clear()
        return self._too_seldom

    def _step(self, filter_: WatchFilter) -> None:
        begin, end = filter_.time, filter_.time + PERIOD
        currents = self._acting(begin, end)
        silent = begin - min(self._last[name] for name in CURRENTS)
        if silent > max(self._gap, _LONGEST_GAP):
            self._lose(end)
            return
        while self._unknown and self._unknown[0][1] + _BLIND < begin:
            self._unknown.popleft()
        blind = silent > self._gap or any(since < end for since, _ in self._unknown)
        if blind:
            self._blind.append(end)
        if blind or max(max(current[1:]) for current in currents) > CLOSED_CURRENT:
            self._closed_since = end
        measured, share = self._arrived(begin, end)
        if np.isfinite(measured).any():
            self._heard = end
        elif end - self._heard > _LONGEST_SILENCE:
            self._lose(end)
            return
        state = filter_.state.copy()
        try:
            filter_.advance(end, currents, measured, share, blind=blind)
        except SimulationError:  # the machine is so far from the model that it cannot be followed: from here anew
            self._lose(end)
            return
        self._recent.append(Interval(begin, end, state, currents, measured, share, filter_.gain, filter_.whitening))
        if begin < self._from <= end:
            filter_.forget()
        if end >= self._from + _GATHERING and end - self._judged >= _JUDGED_EVERY - _EARLIER:
            self._judged = end
            self._judge(filter_.information, end)

    def _gap_closed(self, channel: str, time: float, value: float) -> None:
        """Where a current changed in a gap that ends at ``time`` [s]: it is taken to have done so half-way."""
        samples, since = self._samples[channel], self._last[channel]
        if not samples or time - since <= self._gap or abs(value - samples[-1][1]) <= _SAME:
            return
        self._unknown.append((since, time))
        samples.append((0.5 * (since + time), value))

    def _arrived(self, begin: float, end: float) -> tuple[Array, Array]:
        """(NY,) what was measured between two times [s], NaN where nothing was, and when in the interval; tells who is stuck."""
        measured, share = np.full(len(OUTPUTS), np.nan), np.ones(len(OUTPUTS))
        at_rest = end - self._closed_since > _AT_REST
        for i, name in enumerate(OUTPUTS):
            samples = self._samples[name]
            while samples and samples[0][0] <= end:
                time, measured[i] = samples.popleft()
                share[i] = (time - begin) / PERIOD
                # the boom's rate carries its angle; of pressures nothing tells how far they went
                carried = self._turning * (time - self._turned) if name == "angle" else 0.0
                self._repeats[name].take(float(measured[i]), time, at_rest, carried)
                self._turned = time if name == "angle" else self._turned
                self._turning = float(measured[i]) if name == "rate" else self._turning
        self._stuck = tuple(name for name in OUTPUTS if self._repeats[name].stuck)
        return measured, share

    def _acting(self, begin: float, end: float | None = None) -> list[tuple[float, float, float]]:
        """(from when, retract, extend) of the currents that act from ``begin`` to ``end`` [s]; older ones are dropped."""
        end = begin if end is None else end
        both = [self._samples[name] for name in CURRENTS]
        for samples in both:
            while len(samples) > 1 and samples[1][0] <= begin:
                samples.popleft()
        retract, extend = both
        times = sorted({t for samples in both for t, _ in samples if begin < t < end})
        first = min(retract[0][0], extend[0][0])
        return [(t, _held(retract, max(t, begin)), _held(extend, max(t, begin))) for t in (first, *times)]

    def _drop(self, name: str, until: float) -> None:
        while self._samples[name] and self._samples[name][0][0] <= until:
            self._samples[name].popleft()

    def _lose(self, now: float, *, doubted: bool = False) -> None:
        """Drop old data because the state is unknown, or its guess ``doubted``, and start again with the next samples."""
        self._guessed_again = doubted
        self._filter = None
        self._recent.clear()
        self._score = math.nan
        for name in CHANNELS:
            self._drop(name, now)
        if not self._awaited():
            self._start(self._newest - self.settings.delay)

    # ---------------------------------------------------------------------------------------------------------- judging

    def _judge(self, info: Information, now: float) -> None:
        if self._stuck:
            self._evidence = self._alarm = None
            self._lose(now)
            return
        score, gains, sizes = judged(info, self._model.suspects)
        self._score = score
        beyond = score > self.settings.threshold
        if beyond and self._evidence is None and now < self._doubted and self._filter is not None:
            if self._guessed_again:
                self._filter.forget()
                self._from = now  # watching again once enough has been gathered
            else:  # a start within a step of the valve leaves a guess that no filter mends: another one, where it has settled
                self._lose(now, doubted=True)
            return
        if beyond and self._evidence is None:
            self._evidence = _Evidence(now, now, [now + after for after in _NAMED_AFTER])
            self._alarms += 1
            self._alarm = self._first_guess(now, gains, sizes)
        if self._evidence is None:
            return
        if beyond:
            self._evidence.last = now
        elif now - self._evidence.last > self.settings.hold:
            self._evidence = self._alarm = None
            return
        while self._evidence.due and now >= self._evidence.due[0]:
            self._evidence.due.pop(0)
            self._name(self._evidence.begin)

    def _first_guess(self, now: float, gains: Array, sizes: Array) -> Alarm:
        """The result of the filter's score test, until there is more data."""
        suspects = self._model.suspects
        best: dict[str, float] = {}
        for suspect, gain in zip(suspects, gains, strict=True):
            best[suspect.subsystem] = max(best.get(suspect.subsystem, 0.0), float(gain))
        total = sum(best.values()) or 1.0
        k = int(np.argmax(gains))
        share = {name: best[name] / total for name in sorted(best, key=lambda n: -best[n])}
        size = float(sizes[k]) * suspects[k].scale
        return Alarm(
            now, suspects[k].subsystem, suspects[k].effect, share, size, suspects[k].unit, suspects[k].parameter
        )

    def _name(self, begin: float) -> None:
        """Name the cause from shortly before the alarm; the previous name stays if nothing explains the mismatch."""
        intervals = [i for i in self._recent if i.begin >= begin - _BEFORE]
        named = naming.name(self._model, intervals) if intervals else None
        if named is not None:
            s = named.suspect
            self._alarm = Alarm(begin, s.subsystem, s.effect, named.share, named.size, s.unit, s.parameter)


def judged(info: Information, suspects: Sequence[Suspect]) -> tuple[float, Array, Array]:
    """Score, and for each suspect its share of the square sum and its size, in addition to the tolerated causes.

    A suspect's size stays inside its plausible range. J_0 = sum e^T S^-1 e - b_t^T (A_tt + I)^-1 b_t remains after
    the best tolerated change (prior: one tolerance).
    """
    a, b = info.matrix, info.vector
    tolerated = len(b) - len(suspects)
    t, s = slice(0, tolerated), slice(tolerated, None)
    solved = np.linalg.solve(a[t, t] + np.eye(tolerated), np.column_stack((b[t], a[t, s])))
    left = info.square - float(b[t] @ solved[:, 0])
    score = left / info.count if info.count > 0 else math.nan
    rest = b[s] - a[s, t] @ solved[:, 0]
    stiffness = np.diag(a[s, s]) - np.einsum("ij,ji->i", a[s, t], solved[:, 1:]) + _PRIOR
    size = np.clip(rest / stiffness, [x.low for x in suspects], [x.high for x in suspects])
    return score, size * (2.0 * rest - size * stiffness), size


def _slope(samples: Sequence[tuple[float, float]]) -> float:
    """Of (time, value) by a straight line; 0 of fewer than three."""
    if len(samples) < 3:
        return 0.0
    time, value = np.array(samples).T
    return float(np.polyfit(time, value, 1)[0])


def _held(samples: deque[tuple[float, float]], time: float) -> float:
    value = samples[0][1]
    for at, sample in samples:
        if at > time:
            break
        value = sample
    return value
