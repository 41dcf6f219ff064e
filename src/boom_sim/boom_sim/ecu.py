"""The crane's electronic control unit on the CAN bus: sensors and state out, current command in. No ROS, no bus, no clock.

Every 10 ms ``tick`` returns the frames of one cycle; ``receive`` accepts frames from the bus. A cycle shows angle, rate and
pressures as measured at its beginning, and the currents that flow from then on.

The ECU closes the valve by itself when

- the command is not enabled,
- the command has been silent for 85 to 95 ms, at the tick in between, so that the current is zero before 100 ms have passed,
- the counter of the command stands still for ``FROZEN_FRAMES`` frames,
- the ECU has just started.

After silence or a frozen counter it stays closed until one command without motion (not enabled, or both currents zero): a stream
that breaks off during a motion does not continue that motion.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from enum import IntEnum, IntFlag

from boom_can_bridge.codec import CanConfigurationError, Codec, CounterCheck, FrameError
from boom_model.errors import SimulationError
from boom_node.commands import LONGEST_SILENCE_S
from boom_sim.ecu_faults import Frame
from boom_sim.simulated_crane import LARGEST_CURRENT, PERIOD, SimulatedCrane

FROZEN_FRAMES = 3
"""Command frames in a row with the same counter that close the valve."""
_MARGIN = 0.005
"""s. A tick may come a little late."""


class Mode(IntEnum):
    """Mode in the status frame."""

    START = 0
    READY = 1
    ACTIVE = 2
    FAULT = 3


class Fault(IntFlag):
    """Fault bits in the status frame."""

    SILENCE = 1
    FROZEN = 2
    CHECKSUM = 4
    RANGE = 8
    SENSOR = 16


class Ecu:
    """A simulated crane behind a codec.

    Args:
        crane: the crane that it moves and measures.
        codec: codec of the frames in both directions.
        lockstep: True: only command frames advance time, and silence does not close the valve.

    Attributes:
        frozen_counter: True: its frames repeat their counters (a fault to be injected).
        refused: number of command frames that were not followed, by reason.
        accepted: number of command frames that were followed.
        failure: why the simulation stopped, or "".
        asked_again: in lockstep, the last command was that of the previous cycle, whose answer was lost.
        answer: frames of the last cycle.

    Raises:
        CanConfigurationError: a frame carries an unknown field.
    """

    def __init__(self, crane: SimulatedCrane, codec: Codec, *, lockstep: bool = False) -> None:
        self.crane = crane
        self.frozen_counter = False
        self.lockstep = lockstep
        self._codec = codec
        self.refused: Counter[str] = Counter()
        self.accepted = 0
        self.failure = ""
        self.start(0.0)
        self._command = codec.command
        self._sent = codec.incoming
        known = set(self._values(crane.sample.retract_current, crane.sample.extend_current, 0.0))
        for frame in self._sent:
            unknown = sorted(set(frame.fields) - known)
            if unknown:
                raise CanConfigurationError(
                    f"frame {frame.name} carries {', '.join(unknown)}, which the ECU stand-in does not know: "
                    f"it knows {', '.join(sorted(known))}"
                )

    def start(self, now: float) -> None:
        """Switch on at ``now`` [s]: counters at zero, valve closed. The crane keeps its state."""
        self._started = now
        self._counter_check = CounterCheck(self._codec)
        self._counters: Counter[str] = Counter()
        self._cycle = 0
        self._last_good = -math.inf
        self._repeated = 0
        self._last_counter: int | None = None
        self.asked_again = False
        self.answer: list[Frame] = []
        self._acting = (0.0, 0.0)
        self._armed = True
        self._enabled = False
        self._faults = Fault(0)

    def reset(self, now: float, crane: SimulatedCrane | None = None) -> None:
        """Restart crane and ECU at ``now`` [s], with a new crane if given (making one takes many periods)."""
        if crane is None:
            self.crane.reset()
        else:
            self.crane = crane
        self.failure = ""
        self.start(now)

    @property
    def mode(self) -> Mode:
        """The mode in the status frame."""
        if not self._armed:
            return Mode.FAULT
        if self._cycle == 0:
            return Mode.START
        return Mode.ACTIVE if self._enabled else Mode.READY

    @property
    def faults(self) -> Fault:
        """The faults in the status frame; a fault stays until a command is followed again."""
        return self._faults | (Fault.SENSOR if self.failure else Fault(0))

    @property
    def currents(self) -> tuple[float, float]:
        """Retract and extend current that the ECU drives now [A]."""
        return self._acting

    # ------------------------------------------------------------------------------------------------------- commands

    def receive(self, frame: Frame, now: float) -> bool:
        """Accept a frame that arrived at ``now`` [s]. Returns whether it is a command for this ECU, good or bad.

        A frame that is damaged, repeated or impossible is counted in ``refused`` and not followed. In lockstep a damaged
        one counts as lost (False), and a repeated one requests the answer again.
        """
        spec = self._command
        if frame.arbitration_id != spec.arbitration_id or frame.extended != spec.is_extended:
            return False
        try:
            decoded = self._codec.decode(frame.arbitration_id, frame.data, extended=frame.extended)
            if decoded.frame != spec.name:
                return False
            stands = decoded.counter is not None and decoded.counter == self._last_counter
            self._last_counter = decoded.counter
            self.asked_again = stands and self.lockstep
            if self.asked_again:
                return True
            self._repeated = self._repeated + 1 if stands else 0
            self._counter_check.accept(spec.name, decoded.counter, now)
            self._follow(decoded.values, now)
        except FrameError as error:
            self._refuse(error.reason)
            return not self.lockstep or error.reason not in ("crc", "length")
        return True

    def _follow(self, values: Mapping[str, float], now: float) -> None:
        retract, extend = values["retract_current"], values["extend_current"]
        enabled = values.get("enable", 1.0) >= 0.5
        if not (0.0 <= retract <= LARGEST_CURRENT and 0.0 <= extend <= LARGEST_CURRENT):
            self._refuse("range")
            return
        self.accepted += 1
        self._last_good = now
        if not enabled or (retract == 0.0 and extend == 0.0):
            self._armed = True
        if self._armed:
            self._faults = Fault(0)
        self._enabled = enabled and self._armed
        self._acting = (retract, extend) if self._enabled else (0.0, 0.0)

    def _refuse(self, reason: str) -> None:
        self.refused[reason] += 1
        if reason != "counter":
            self._faults |= Fault.CHECKSUM if reason == "crc" else Fault.RANGE
            return
        if self._repeated >= FROZEN_FRAMES:
            self._close(Fault.FROZEN)

    def stop(self) -> None:
        """Close the valve until one command without motion."""
        self._close(Fault.RANGE)

    def _close(self, fault: Fault) -> None:
        if self._enabled:
            self._armed = False
        self._enabled = False
        self._acting = (0.0, 0.0)
        self._faults |= fault

    # ---------------------------------------------------------------------------------------------------------- cycle

    def tick(self, now: float) -> list[Frame]:
        """One cycle of 10 ms that begins at ``now`` [s]. Returns the frames to send."""
        if not self.lockstep and self._enabled and now + PERIOD - self._last_good > LONGEST_SILENCE_S - _MARGIN:
            self._close(Fault.SILENCE)
        shown = self.crane.sample
        values = {}
        if not self.failure:
            self.crane.command(*self._acting)
            try:
                ahead = self.crane.advance()
            except SimulationError as error:
                self.failure = str(error)
            else:
                values = self._values(ahead.retract_current, ahead.extend_current, now)
                values |= shown.outputs
        if not values:  # what stands still is not measured: the status alone says so
            values = {"mode": float(self.mode), "faults": float(self.faults), "uptime_s": now - self._started}
        result = []
        for frame in self._sent:
            every = max(1, round(frame.period_s / PERIOD))
            if self._cycle % every or not set(frame.fields) <= set(values):
                continue
            try:
                identifier, data = self._codec.encode(frame.name, values, self._counters[frame.name])
            except FrameError as error:
                self.refused[f"not sent: {frame.name}, {error.reason}"] += 1
                continue
            if not self.frozen_counter:
                self._counters[frame.name] += 1
            result.append(Frame(identifier, frame.is_extended, data))
        self._cycle += 1
        self.answer = result
        return result

    def _values(self, retract: float, extend: float, now: float) -> dict[str, float]:
        sample, pose = self.crane.sample, self.crane.pose
        return {
            **sample.outputs, "retract_current": retract, "extend_current": extend,
            "mode": float(self.mode), "faults": float(self.faults), "uptime_s": now - self._started,
            "outer_boom_angle": pose.outer_boom_angle, "telescope_length": pose.telescope_length, "load_mass": pose.load,
        }  # fmt: skip
