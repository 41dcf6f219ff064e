"""The bridge without ROS: connects codec, receiver, watchdog, gate and sender. The node is a thin layer around it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from boom_can_bridge.python_can import can
from boom_node.commands import CLOSED_A

from .codec import Codec
from .command_gate import CommandGate, GatedCommand
from .connection import BusSettings, open_bus
from .ecu_state import EcuState
from .errors import CanConfigurationError
from .frame_log import FrameLog
from .lockstep import BusLockstep
from .mapping import SENSOR_FIELDS
from .receiver import FrameChecker, Reading, Receiver
from .sender import CommandSender, Pace
from .watchdog import Watchdog

ECU_FAULT_MODE = 3.0


@dataclass(frozen=True)
class BridgeSettings:
    """Settings of the bridge; units as in the parameters of the node."""

    bus: BusSettings
    dbc: str = "tz17"
    mapping: str = ""
    log: str = ""
    proof: int = 5
    watchdog: float = 0.05
    largest_current: float = 0.7
    rise_rate: float = 20.0
    command_timeout: float = 0.05
    revoke_after: float = 1.0
    lockstep: bool = False
    filter_foreign: bool = False


@dataclass(frozen=True)
class Report:
    """State of the bridge: `level` 0 good, 1 warning, 2 error; one line; numbers with their unit in the key."""

    level: int
    message: str
    values: dict[str, object] = field(default_factory=dict)


class Bridge:
    """The bridge between one bus and the consumer of the readings.

    Args:
        settings: of the bridge
        publish: called in the receive thread with every reading while the bridge is active
        tell: called when the connection changes, with a line for the user and whether it is up
        bus_factory: opens the bus; for tests
        on_cycle: in lockstep, called in the receive thread with the time [s] from which the next command acts

    Raises:
        CanConfigurationError: DBC, mapping or log file cannot be used
    """

    def __init__(
        self,
        settings: BridgeSettings,
        publish: Callable[[Reading], None],
        tell: Callable[[bool, str], None] = lambda up, text: None,
        bus_factory: Callable[[BusSettings], Any] = open_bus,
        on_cycle: Callable[[float], None] = lambda now: None,
    ) -> None:
        self.settings = settings
        self.codec = Codec.load(settings.dbc, settings.mapping or None)
        self.active = False
        self.conflict = ""
        self.connection = f"{settings.bus} is not open"
        self._up = False
        self._tell = tell
        self._publish = publish
        self._status: dict[str, float] = {}
        limits = self.codec.command.fields
        largest = min(settings.largest_current, limits["retract_current"].maximum, limits["extend_current"].maximum)
        self.gate = CommandGate(largest, settings.rise_rate, settings.command_timeout, settings.revoke_after)
        self.watchdog = Watchdog(SENSOR_FIELDS, settings.watchdog)
        self._ecu = EcuState(self.codec)
        self.lockstep = BusLockstep(self.codec, self._is_idle) if settings.lockstep else None
        self.checker = FrameChecker(self.codec, settings.proof, self.lockstep)
        pace = self.lockstep or Pace()
        self._clock = pace.clock
        self._on_cycle = on_cycle
        self._begun: float | None = None
        self._filters = settings.filter_foreign and not settings.log  # a log shows the whole bus
        self.log = FrameLog(Path(settings.log)) if settings.log else None
        raw = self.log.write if self.log else None
        known = tuple(dict.fromkeys((frame.arbitration_id, frame.is_extended) for frame in self.codec.frames.values()))
        bus = replace(settings.bus, wanted=known) if self._filters else settings.bus
        self.receiver = Receiver(bus, self.checker, self._on_reading, self._on_state, raw, bus_factory, self._clock)
        self.sender = CommandSender(
            self.codec,
            self.gate,
            lambda: self.receiver.bus if self._up else None,
            self.receiver.fail,
            self._judge,
            raw,
            pace,
        )
        self._rate_base = (time.monotonic(), dict.fromkeys(self.codec.frames, 0))

    def open(self, *, wait: bool) -> None:
        """Open the bus and start both threads.

        Args:
            wait: True: wait for a bus that is not there yet

        Raises:
            CanConfigurationError: it cannot open with these settings
            BusUnavailableError: it cannot be opened now, and `wait` is False
        """
        if not wait:
            self.receiver.open()
        else:
            # Unknown interfaces are wrong whatever comes later.
            if self.settings.bus.interface not in can.VALID_INTERFACES:
                known = ", ".join(sorted(can.VALID_INTERFACES))
                raise CanConfigurationError(
                    f"no CAN interface '{self.settings.bus.interface}': set interface to one of {known}"
                )
        self.receiver.start()
        self.sender.start()

    def close(self) -> None:
        """Send zero current once more, end the threads, close bus and log."""
        self.active = False
        self.sender.stop()
        self.receiver.stop()
        if self.log is not None:
            self.log.close()

    def activate(self, active: bool) -> None:
        """Start or stop passing on readings and (enabled) commands."""
        self.active = active
        with self.sender.lock:
            self._judge(self._clock())

    def command(self, retract: float, extend: float, age: float) -> bool:
        """Accept a command [A] of this age by its stamp [s]; False = refused."""
        return self.sender.command(retract, extend, age)

    @property
    def simulated_time(self) -> float | None:
        """In lockstep, the time from which the next command acts [s]: 0 for the first one that may move the boom; None before."""
        return None if self._begun is None else self._clock() - self._begun

    def enable(self, wanted: bool) -> tuple[bool, str]:
        """Enable or disable motion; returns success and a line for the user."""
        with self.sender.lock:
            self._judge(self._clock())
            return self.gate.enable(wanted)

    def emergency_stop(self, wanted: bool) -> None:
        """Set the state of the emergency stop."""
        with self.sender.lock:
            self.gate.emergency_stop(wanted)

    def stop(self, reason: str) -> None:
        """Send zero current from the next frame until motion is enabled again."""
        with self.sender.lock:
            self.gate.revoke(reason)
        self.sender.wake()

    @property
    def output(self) -> GatedCommand:
        """The output that was sent last."""
        return self.sender.last

    def _is_idle(self) -> bool:
        return self.checker.proving or (self._begun is None and not self.gate.enabled)

    def _on_reading(self, reading: Reading) -> None:
        sent = self.sender.last
        if not sent.enable or max(sent.retract, sent.extend) <= CLOSED_A:
            self._ecu.released()
        if "mode" in reading.values or "faults" in reading.values:
            self._status = reading.values
            if said := self._ecu.seen(reading.values, reading.received):
                self.stop(said)
        self.watchdog.seen(reading.values, reading.received)
        if self.lockstep is None:
            if self.active:
                self._publish(reading)
            return
        # Nothing else is on its way while the first command is: the next cycle is the one that it has made.
        if self._begun is None and self.sender.last.enable and self.lockstep.is_sensor(reading.frame):
            self._begun = reading.steady
        if self._begun is not None and self.active:
            self._publish(replace(reading, steady=reading.steady - self._begun))
        if self.lockstep.is_sensor(reading.frame) and self.lockstep.complete:
            if self._begun is not None:
                self._on_cycle(self._clock() - self._begun)
            self.sender.wake()

    def _on_state(self, up: bool, text: str) -> None:
        changed = up != self._up or text != self.connection
        self._up, self.connection = up, text
        self.watchdog.reset()
        self._ecu.reset(self._clock())
        self._status = {}
        if changed:
            self._tell(up, text)

    def _judge(self, now: float) -> None:
        self.gate.problem(self._problem(now))

    def _problem(self, now: float) -> str:
        if not self.active:
            return "the bridge is not active"
        if not self._up:
            return self.connection
        # In lockstep frames come as fast as both can, and how many are due is not known.
        crowded = self.conflict or (self.checker.crowd.conflict(now) if self.lockstep is None else "")
        if crowded:
            return crowded
        if self.checker.proving:
            return "waiting for good frames of all sensors"
        silent = self.watchdog.silent(now)
        if silent:
            names = ", ".join(sorted(silent))
            return f"no good {names} for {1e3 * self.settings.watchdog:.0f} ms"
        if self.lockstep is None and (missed := self._ecu.silent(now)):
            return missed
        if self._status.get("mode") == ECU_FAULT_MODE:
            return f"the ECU is in fault mode, faults {int(self._status.get('faults', 0)):#06x}"
        return ""

    def report(self) -> Report:
        """State and numbers; rates are since the last call."""
        now = time.monotonic()
        counts, checker = self.checker.counts, self.checker
        since, before = self._rate_base
        good = {name: counts.good[name] for name in self.codec.frames}
        self._rate_base = (now, good)
        elapsed = max(now - since, 1e-3)
        values: dict[str, object] = {"bus": self.connection}
        for name in (spec.name for spec in self.codec.incoming):
            values[f"{name} [frames/s]"] = f"{(good[name] - before[name]) / elapsed:.1f}"
            values[f"{name} lost"] = counts.lost[name]
        values |= {f"bad frames, {reason}": number for reason, number in sorted(counts.bad.items())}
        values["bad frames, last"] = counts.last_bad or "none"
        unknown = ", ".join(f"{i:#x}: {n}" for i, n in sorted(counts.unknown.items())[:8])
        values["unknown ids"] = unknown or ("kept back (filter_foreign)" if self._filters else "none")
        values |= _percentiles("frame to topic", list(self.receiver.latencies))
        values |= _percentiles("command to frame", list(self.sender.latencies))
        values["connections"] = counts.connects
        values["frames discarded as old"] = counts.discarded
        values["commands sent"] = self.sender.sent
        values["commands dropped"] = self.sender.dropped
        values["commands refused"] = self.gate.refused
        values["commands clamped"] = self.gate.clamped
        values["clock jumps"] = checker.clock.jumps
        values |= {
            f"failures, {name}": n for name, n in sorted((self.receiver.failures + self.sender.failures).items())
        }
        values |= {f"ECU {name}": f"{value:g}" for name, value in self._status.items()}
        output = self.output
        values["currents sent [A]"] = f"retract {output.retract:.4f}, extend {output.extend:.4f}"
        values["motion"] = "enabled" if output.enable else output.reason
        if self.log is not None:
            values["log"] = self.log.state
        problem = self._problem(self._clock())
        level = 0
        message = "active, motion enabled" if output.enable else f"active, zero current: {output.reason}"
        if problem:
            level, message = (2 if self.active else 0), problem if self.active else "not active"
        elif faults := int(self._status.get("faults", 0)):
            level, message = 1, f"{message}; the ECU reports faults {faults:#06x}"
        elif self.gate.revoked or (self.log is not None and self.log.failed):
            level = 1
            message = self.log.state if self.log is not None and self.log.failed else message
        return Report(level, message, values)


def _percentiles(label: str, samples: list[float]) -> dict[str, object]:
    if not samples:
        return {}
    median, high = np.percentile(np.array(samples), [50, 99])
    return {f"{label}, p50 [ms]": f"{1e3 * median:.2f}", f"{label}, p99 [ms]": f"{1e3 * high:.2f}"}
