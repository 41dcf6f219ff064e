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
_MOST_ROWS = 12_000
_NAMES = (*(s.name for s in SENSORS), *(c.name for c in CURRENTS))
_DIGITS = {"rad": 6, "rad/s": 5, "A": 4, "Pa": 0}
_PLACES = [_DIGITS[c.unit] for c in (*SENSORS, *CURRENTS)]


class Feed:
    """Collects samples and hands them to the pages. Samples come from one thread, pages read from others."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.scene = ""
        self.state = "Waiting for the machine: start ./boom sim, or the crane."
        self.marks = "[]"
        self.rows: deque[list[float | None]] = deque(maxlen=_MOST_ROWS)
        self.count = 0  # rows ever taken in: where a page is up to
        self.run = 0  # counts the runs: a page begins anew with each
        self._twin: Twin | None = None
        self._samples: dict[str, deque[tuple[float, float]]] = {name: deque(maxlen=_MOST_ROWS) for name in _NAMES}
        self._waiting: deque[float] = deque()
        self._newest = -math.inf

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

    def say(self, state: str) -> None:
        """One line for people."""
        with self.changed:
            if state != self.state:
                self.state = state
                self.changed.notify_all()

    def add(self, time: float, **values: float) -> None:
        """Samples [SI, gauge] of one message, by channel, at their stamp [s]."""
        if not abs(time - self._newest) < JUMP and self._newest > -math.inf:
            with self.changed:
                self._begin()
        self._newest = max(self._newest, time)
        for name, value in values.items():
            self._samples[name].append((time, value))
        if "retract_current" in values and self._twin is not None:
            self._twin.current(time, values["retract_current"], values["extend_current"])
        if "angle" in values:
            self._waiting.append(time)

    def flush(self, age: float) -> None:
        """Hand the rows that are complete to the pages; ``age`` [s]: how long ago the last sample came."""
        rows = []
        while self._waiting and (self._waiting[0] < self._newest - DELAY or age > 10 * DELAY):
            rows.append(self._row(self._waiting.popleft()))
        if not rows and age < SILENT:
            return
        marks = json.dumps(list(self._twin.marks), allow_nan=False) if self._twin is not None else "[]"
        state = self._words(age)
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
        if self._twin is None:
            return self.state
        if age > SILENT:
            return f"No sample for {age:.0f} s: the machine or the simulation has ended. The last minute stays; a new run is shown."
        return f"Live; {self._twin.words}."

    def _begin(self) -> None:
        """Another run, or another machine: what was before is forgotten."""
        self.rows.clear()
        self._waiting.clear()
        for samples in self._samples.values():
            samples.clear()
        self._newest = -math.inf
        self.run += 1
        if self._twin is not None:
            self._twin.clear()
        self.changed.notify_all()


def _nearest(samples: deque[tuple[float, float]], time: float) -> float:
    """The sample that is nearest to a time [s], NaN where none is near; earlier ones are dropped."""
    while len(samples) > 1 and abs(samples[1][0] - time) <= abs(samples[0][0] - time):
        samples.popleft()
    return samples[0][1] if samples and abs(samples[0][0] - time) <= NEAR else math.nan
