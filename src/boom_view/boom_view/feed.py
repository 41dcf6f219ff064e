"""What the page of a running machine is told: samples become rows on the joint's time, with the model beside them. No ROS."""

from __future__ import annotations

import json
import math
import threading
from collections import deque

from boom_input.channels import CURRENTS, SENSORS
from boom_model.machine import Machine, Pose
from boom_report.view.page import complete
from boom_report.view.scene import scene
from boom_view.twin import Twin

KEEP = 60.0
"""s of samples that a page that is opened later gets."""
DELAY = 0.06
"""s that a row waits for the samples of other topics."""
NEAR = 0.05
"""s between a row and a sample of it; a slower topic is not shown."""
SILENT = 2.0
"""s without a sample, after which the page says so."""
JUMP = 2.0
"""s between two stamps, beyond which another run has begun."""
FINEST = 0.004
"""s between two rows: a faster angle is thinned out, so that a minute of it stays."""
_MOST_ROWS = round(KEEP / FINEST)
_WAITING = "Waiting for the machine: start ./boom sim, or the crane."
_NO_MACHINE = "Samples arrive, but no /boom/machine_configuration: start ./boom view with --machine, --q3 and --q4."
_NAMES = (*(s.name for s in SENSORS), *(c.name for c in CURRENTS))
_DIGITS = {"rad": 6, "rad/s": 5, "A": 4, "Pa": 0}
_PLACES = [_DIGITS[c.unit] for c in (*SENSORS, *CURRENTS)]


class Feed:
    """Collects samples and hands them to the pages. Samples come from one thread, pages read from others."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.scene = ""
        self.state = _WAITING
        self.marks = "[]"
        self.rows: deque[list[float | None]] = deque(maxlen=_MOST_ROWS)
        self.count = 0  # rows ever taken in: where a page is up to
        self.run = 0  # counts the runs: a page begins anew with each
        self._twin: Twin | None = None
        self._samples: dict[str, deque[tuple[float, float]]] = {name: deque(maxlen=_MOST_ROWS) for name in _NAMES}
        self._waiting: deque[float] = deque()
        self._newest = self._latest = -math.inf  # stamps of the last sample and of the last row [s]
        self._sampled = self._shown = -math.inf  # when the last sample and the last row came, as flush counts
        self._arrived = False
        self._why = ""  # the last message that could not be shown, until a row could
        self._unshown = _WAITING  # why there is no machine

    def configure(self, machine: Machine, pose: Pose) -> None:
        """The machine is known: its drawing, and its model.

        Raises:
            ModelError: the machine cannot be drawn or run.
        """
        twin = Twin(machine, pose)
        drawing = json.dumps(complete(scene(machine, pose)) | {"keep": KEEP}, allow_nan=False)
        with self.changed:
            self._twin, self.scene = twin, drawing
            self._begin()

    def unknown(self, why: str) -> None:
        """The machine that runs cannot be shown; one line for people."""
        with self.changed:
            self._twin, self.scene, self._unshown, self.state = None, "", why, why
            self._begin()

    def refused(self, why: str) -> None:
        """A message came that cannot be shown; one line for people. It is told where nothing else comes."""
        self._why = why

    def add(self, time: float, **values: float) -> None:
        """Samples [SI, gauge] of one message, by channel, at their stamp [s]."""
        self._arrived = True
        jump = time - self._newest
        if not abs(jump) < JUMP and self._newest > -math.inf:
            self.refused(f"the stamps lie {abs(jump):.3g} s apart: let all topics take theirs from one clock")
            with self.changed:
                self._begin()
        self._newest = max(self._newest, time)
        for name, value in values.items():
            self._samples[name].append((time, value))
        if self._twin is not None and values.keys() >= {"retract_current", "extend_current"}:
            self._twin.current(time, values["retract_current"], values["extend_current"])
        if "angle" in values:
            self._wait(time)

    def _wait(self, time: float) -> None:
        """A row for a sample of the angle. Rows are in order and apart: a page searches them, and draws no more of them."""
        if time >= self._latest + FINEST:
            self._waiting.append(time)
            self._latest = time
        elif time <= self._latest:
            self.refused(
                "the stamps of /joint_states stand still or go back: set header.stamp to the time of measurement"
            )

    def flush(self, now: float) -> None:
        """Hand the rows that are complete to the pages; ``now`` [s]: of a clock that nobody sets."""
        if self._arrived:
            self._sampled, self._arrived = now, False
        age, rows = now - self._sampled, []
        while self._waiting and (self._waiting[0] < self._newest - DELAY or age > 10 * DELAY):
            rows.append(self._row(self._waiting.popleft()))
        if rows:
            self._shown, self._why = now, ""
        elif now - self._shown < SILENT:
            return
        marks = json.dumps(list(self._twin.marks), allow_nan=False) if self._twin is not None else "[]"
        state = self._words(now - self._shown)
        with self.changed:
            self.rows.extend(rows)
            self.count += len(rows)
            while self.rows and (self.rows[0][0] or 0.0) < (self.rows[-1][0] or 0.0) - KEEP:
                self.rows.popleft()
            if rows or marks != self.marks or state != self.state:
                self.marks, self.state = marks, state
                self.changed.notify_all()

    def _row(self, time: float) -> list[float | None]:
        measured = {name: _nearest(samples, time) for name, samples in self._samples.items()}
        model = self._twin.advance(time, measured) if self._twin is not None else {}
        columns = [measured[name] for name in _NAMES] + [model.get(name, math.nan) for name in _NAMES]
        places = _PLACES * 2
        shown = [round(v, n) if math.isfinite(v) else None for v, n in zip(columns, places, strict=True)]
        return [round(time, 4), *shown]

    def _words(self, age: float) -> str:
        if age > SILENT and self._why:
            return f"Nothing can be shown: {self._why}."
        if self._twin is None:
            return _NO_MACHINE if self.rows and self._unshown is _WAITING else self._unshown
        if age == math.inf:
            return _WAITING
        if age > SILENT:
            return f"No angle for {age:.0f} s: the machine or the simulation has ended. The last minute stays; a new run is shown."
        return f"Live; {self._twin.words}."

    def _begin(self) -> None:
        """Another run, or another machine: what was before is forgotten."""
        self.rows.clear()
        self._waiting.clear()
        for samples in self._samples.values():
            samples.clear()
        self._newest = self._latest = -math.inf
        self.run += 1
        if self._twin is not None:
            self._twin.clear()
        self.changed.notify_all()


def _nearest(samples: deque[tuple[float, float]], time: float) -> float:
    """The sample that is nearest to a time [s], NaN where none is near; earlier ones are dropped."""
    while len(samples) > 1 and abs(samples[1][0] - time) <= abs(samples[0][0] - time):
        samples.popleft()
    return samples[0][1] if samples and abs(samples[0][0] - time) <= NEAR else math.nan
