"""Converts time stamps of the bus to ROS time, evenly spaced whatever the clocks do. Pure: all times are arguments.

A frame arrives late, never early: the smallest difference between the steady clock at reception and the stamp of the bus is the
offset of the two clocks, and any excess is the delay of the frame. The offset rises slowly, to follow a drifting clock. The
difference between ROS time and the steady clock is read repeatedly; small changes are followed slowly, a step once it has lasted.
"""

MOST = 1e11  # s; three thousand years


class ClockMap:
    """Stamps of one bus.

    DRIFT        rise of the offset that is followed [s/s]
    LOOK_S       time between two readings of the ROS clock [s]
    JUMP_S       difference that counts as a jump of a clock [s]
    SETTLE_S     how long a step of ROS time must last before it is followed [s]
    """

    DRIFT = 2e-4
    LOOK_S = 0.05
    JUMP_S = 0.01
    SETTLE_S = 1.0

    def __init__(self) -> None:
        self.jumps = 0
        self._offset: float | None = None
        self._last_bus = 0.0
        self._last_steady = 0.0
        self._ros_minus_steady_ns: int | None = None
        self._apart_since: float | None = None
        self._last_ros_look = 0.0

    def reset(self) -> None:
        """Start again after the bus was reopened: its clock may be another one."""
        self._offset = None

    def to_steady(self, bus_time: float, steady: float) -> float:
        """Time at which a frame was on the bus, on the steady clock [s].

        Args:
            bus_time: stamp of the interface [s]; 0 or negative = none
            steady: steady clock at reception [s]
        """
        if not 0.0 < bus_time < MOST:  # also what is no number
            return steady
        sample = steady - bus_time
        if self._offset is None:
            self._offset = sample
        elif bus_time < self._last_bus - self.JUMP_S:
            self.jumps += 1
            self._offset = sample
        elif sample < self._offset:
            self.jumps += self._offset - sample > self.JUMP_S
            self._offset = sample
        else:
            self._offset += self.DRIFT * max(steady - self._last_steady, 0.0)
            self._offset = min(self._offset, sample)
        self._last_bus, self._last_steady = bus_time, steady
        return min(bus_time + self._offset, steady)

    def ros_clock_due(self, steady: float) -> bool:
        """Whether to read the ROS clock again, which costs more than everything else here."""
        return self._ros_minus_steady_ns is None or not 0.0 <= steady - self._last_ros_look < self.LOOK_S

    def last_ros_ns(self, when: float) -> int:
        """ROS time [ns] of a moment on the steady clock [s], from the last reading of the ROS clock."""
        return round(when * 1e9) + (self._ros_minus_steady_ns or 0)

    def to_ros_ns(self, when: float, steady: float, ros_now_ns: int) -> int:
        """ROS time [ns] of a moment on the steady clock.

        Args:
            when: the moment [s]
            steady: the steady clock [s]
            ros_now_ns: ROS time [ns], read together with it
        """
        seen = ros_now_ns - round(steady * 1e9)
        if self._ros_minus_steady_ns is None:
            self._ros_minus_steady_ns = seen
        difference = seen - self._ros_minus_steady_ns
        elapsed = max(steady - self._last_ros_look, 0.0)
        self._last_ros_look = steady
        if abs(difference) <= self.JUMP_S * 1e9:
            self._apart_since = None
            most = round(self.DRIFT * elapsed * 1e9)
            self._ros_minus_steady_ns += min(max(difference, -most), most)
        elif self._apart_since is None:
            self._apart_since = steady
        elif steady - self._apart_since >= self.SETTLE_S:
            self.jumps += 1
            self._apart_since = None
            self._ros_minus_steady_ns = seen
        return self.last_ros_ns(when)
