"""The model beside the running machine: driven by the measured currents, restarted where the boom rests. No ROS.

A free run drifts, because it accumulates the noise of the currents, so it begins anew from what the sensors show whenever the boom
has rested for a while; what is seen is how each motion departs. It does not cross a gap in the currents.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_estimation.initial_state import REST_WINDOW, RESTING_RATE
from boom_model.catalogue.terms import Terms
from boom_model.equations import namespace
from boom_model.errors import SimulationError
from boom_model.machine import Machine, Pose
from boom_model.plant import Plant, Stepper
from boom_model.sensors import OUTPUTS
from boom_report.validation.verdict import WINDOW
from boom_report.view.series import limits

Array = NDArray[np.float64]

GAP = 0.05
"""s without a current, after which the model is not driven on (contract)."""
AGAIN = 3.0
"""s of rest after which the model begins anew from the machine."""
MOST_MARKS = 200
CLOSED = 0.5
"""Share of its overlap within which the spool keeps the boom at rest: a controller that holds it drives both solenoids."""


@dataclass
class Parting:
    """Where the model has parted from the machine in one channel, over a running second."""

    limit: float
    errors: deque[tuple[float, float]] = field(default_factory=deque)
    total: float = 0.0
    mark: dict[str, Any] | None = None

    def add(self, time: float, error: float) -> None:
        """One more difference [SI] at a time [s]."""
        self.errors.append((time, error * error))
        self.total += error * error
        while self.errors[0][0] < time - WINDOW:
            self.total -= self.errors.popleft()[1]

    @property
    def apart(self) -> bool:
        """Whether the rms difference is beyond the limit; not said before half a second has been seen."""
        count = len(self.errors)
        long_enough = count > 1 and self.errors[-1][0] - self.errors[0][0] > WINDOW / 2
        return long_enough and max(self.total, 0.0) / count > self.limit**2


class Twin:
    """A free run of the full model beside a machine.

    Args:
        machine: its model.
        pose: locked joints and load.

    Attributes:
        marks: where they parted, newest last: channel, start and end [s], largest difference [SI].
        words: what the model does at present, for people.

    Raises:
        ModelError: the machine cannot be run.
    """

    def __init__(self, machine: Machine, pose: Pose) -> None:
        self._plant = Plant(machine, pose)
        self._limits = limits(machine)
        self._structure, self._e = machine.structure, Terms(machine.effects)
        self._p = namespace(machine.values(pose))
        self.marks: deque[dict[str, Any]] = deque(maxlen=MOST_MARKS)
        self.clear()

    def clear(self) -> None:
        """Forget everything: the clock was set, or another run has begun."""
        self._stepper: Stepper | None = None
        self._at = 0.0
        self._currents: deque[tuple[float, float, float]] = deque()
        self._resting: deque[tuple[float, Mapping[str, float]]] = deque()
        self._partings = {name: Parting(limit) for name, limit in self._limits.items()}
        self.marks.clear()
        self.words = f"the model begins when the boom has rested for {REST_WINDOW:.0f} s"

    def current(self, time: float, retract: float, extend: float) -> None:
        """Measured currents [A] that act from a time [s] on."""
        if self._currents and time - self._currents[-1][0] > GAP:
            self._stop("a gap in the currents")
        self._currents.append((time + self._plant.command_delay, retract, extend))

    def advance(self, time: float, measured: Mapping[str, float]) -> dict[str, float]:
        """The model's outputs [SI] at a time [s] at which the sensors show ``measured``; {} where it does not run."""
        self._follow(time)
        self._look_for_rest(time, measured)
        if self._stepper is None:
            return {}
        shown = dict(zip(OUTPUTS, self._plant.outputs(self._stepper.state).tolist(), strict=True))
        self._compare(time, shown, measured)
        return shown

    def _follow(self, time: float) -> None:
        """Drive the model to a time with the currents that act until then."""
        while self._currents:
            begin, retract, extend = self._currents[0]
            following = self._currents[1][0] if len(self._currents) > 1 else np.inf
            until = min(time, following)
            if self._stepper is not None and until > max(self._at, begin):
                self._step(retract, extend, until - self._at)
            self._at = max(self._at, until)
            if following > time:
                break
            self._currents.popleft()
        self._at = max(self._at, time)

    def _step(self, retract: float, extend: float, duration: float) -> None:
        assert self._stepper is not None
        try:
            self._stepper.step(retract, extend, duration)
        except SimulationError as error:
            self._stop(str(error))

    def _stop(self, why: str) -> None:
        if self._stepper is not None:
            self.words = f"the model stopped ({why}); it begins again when the boom rests"
        self._stepper = None
        self._resting.clear()

    def _look_for_rest(self, time: float, measured: Mapping[str, float]) -> None:
        if not self._closed() or abs(measured["rate"]) > 4 * RESTING_RATE:
            self._resting.clear()
            return
        self._resting.append((time, measured))
        needed = REST_WINDOW if self._stepper is None else AGAIN
        if time - self._resting[0][0] < needed:
            return
        last = list(islice(reversed(self._resting), round(REST_WINDOW * 100)))
        means = {name: float(np.mean([m[name] for _, m in last])) for name in OUTPUTS}
        self._resting.clear()
        if abs(means["rate"]) > RESTING_RATE:
            return
        state = self._plant.rest_state_measured(means["angle"], means["hose_pressure"], means["rod_pressure"])
        self._stepper, self._at = self._plant.stepper(state), time
        self._partings = {name: Parting(limit, mark=self._partings[name].mark) for name, limit in self._limits.items()}
        self.words = "the model follows the measured currents and begins anew where the boom rests"

    def _closed(self) -> bool:
        """Whether the currents hold the spool within its overlap."""
        if not self._currents:
            return False
        _, retract, extend = self._currents[0]
        s, stroke = self._structure, self._p.main_valve_spool.s_max
        position = float(s.spool.position(np.array([retract]), np.array([extend]), self._p, s.pilot_valves)[0])
        return bool(abs(position) <= CLOSED * stroke * float(s.metering.overlap(position, self._p, self._e)))

    def _compare(self, time: float, shown: Mapping[str, float], measured: Mapping[str, float]) -> None:
        for name, parting in self._partings.items():
            error = abs(shown[name] - measured[name])
            if not np.isfinite(error):
                continue
            parting.add(time, error)
            if not parting.apart:
                parting.mark = None
                continue
            if parting.mark is None:
                parting.mark = {"channel": name, "start": time, "end": time, "largest": error}
                self.marks.append(parting.mark)
            parting.mark["end"] = time
            parting.mark["largest"] = max(parting.mark["largest"], error)
