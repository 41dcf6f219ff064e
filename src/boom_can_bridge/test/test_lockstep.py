"""Lockstep: the bridge takes its time from the cycles of a simulated ECU; all checks of frames and commands stay."""

import queue
import threading

import can
import pytest

from boom_can_bridge.bridge import Bridge, BridgeSettings
from boom_can_bridge.codec import Codec
from boom_can_bridge.connection import BusSettings
from boom_can_bridge.errors import CanConfigurationError
from boom_can_bridge.lockstep import BusLockstep

CODEC = Codec.load("tz17")
SENSORS = ("imu", "pressures", "currents")
PATIENCE = 20.0


def cycle(lockstep, lost=0):
    return [lockstep.frame_time(name, lost) for name in SENSORS]


def test_a_cycle_of_frames_is_one_period():
    lockstep = BusLockstep(CODEC)
    assert lockstep.clock() == 0.0
    assert cycle(lockstep) == [0.0, 0.0, 0.0]
    assert lockstep.complete
    assert lockstep.clock() == pytest.approx(0.01)
    lockstep.frame_time("imu", 0)
    assert not lockstep.complete
    assert lockstep.frame_time("status", 0) == pytest.approx(0.01)


def test_lost_frames_count_so_that_time_stays_right():
    lockstep = BusLockstep(CODEC)
    cycle(lockstep)
    lockstep.frame_time("imu", 0)  # the others of this cycle are lost
    assert not lockstep.complete
    assert lockstep.frame_time("imu", 0) == pytest.approx(0.02)
    assert [lockstep.frame_time(name, 1) for name in SENSORS[1:]] == pytest.approx([0.02, 0.02])
    assert lockstep.complete


def test_the_next_command_waits_for_the_cycle_that_answers_the_last():
    lockstep = BusLockstep(CODEC)
    assert lockstep.until(5.0, 5.0) == float("-inf")
    lockstep.sent(True)
    assert lockstep.until(5.0, 5.0) > 5.1
    cycle(lockstep)
    assert lockstep.until(5.0, 5.0) == float("-inf")


def test_frames_without_a_counter_cannot_tell_the_time():
    with pytest.raises(CanConfigurationError, match="needs a counter"):
        BusLockstep(Codec.load("other_machine"))


class SimulatedEcu:
    """A bus with an ECU that answers a new command with one cycle and a repeated one with the same frames again.

    Its angle tells the number of the enabled cycles.
    """

    def __init__(self):
        self.waiting = queue.Queue()
        self.counter = 0
        self.moves = 0
        self.lose = set()
        self.deaf = 0
        self.answered = None
        self.answer = {}

    def recv(self, timeout):
        try:
            return self.waiting.get(timeout=0.01) if timeout else self.waiting.get_nowait()
        except queue.Empty:
            return None

    def send(self, frame, timeout=None):
        if self.deaf:
            self.deaf -= 1
            return
        decoded = CODEC.decode(frame.arbitration_id, bytes(frame.data))
        if decoded.counter != self.answered:
            self.answered = decoded.counter
            self.go_on(decoded.values)
        for name, message in self.answer.items():
            if name not in self.lose:
                self.waiting.put(message)
        self.lose = set()

    def go_on(self, command):
        values = {
            "imu": {"angle": 1e-3 * self.moves, "rate": 0.0},
            "pressures": {"hose_pressure": 8e6, "rod_pressure": 1e6},
            "currents": {name: command[name] for name in ("retract_current", "extend_current")},
            "status": {"mode": 1, "faults": 0, "uptime_s": 0.0},
        }
        for name, content in values.items():
            identifier, data = CODEC.encode(name, content, self.counter)
            self.answer[name] = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        self.counter += 1
        self.moves += bool(command["enable"])

    def fileno(self):
        return -1

    def shutdown(self):
        pass


@pytest.fixture
def rig():
    ecu, readings, ticks = SimulatedEcu(), queue.Queue(), queue.Queue()
    settings = BridgeSettings(BusSettings("virtual", "x"), rise_rate=1000.0, lockstep=True)
    bridge = Bridge(settings, readings.put, bus_factory=lambda _: ecu, on_cycle=ticks.put)
    bridge.open(wait=False)
    bridge.activate(True)
    pause = threading.Event()
    for _ in range(1000):
        if bridge.enable(True)[0]:
            break
        pause.wait(0.01)
    yield ecu, bridge, readings, ticks
    bridge.close()


def drive(bridge, ticks, count):
    found = []
    for k in range(count):
        assert bridge.command(0.01 * (k + 1), 0.0, 0.0)
        found.append(ticks.get(timeout=PATIENCE))
    return found


def test_each_command_makes_one_period_and_nothing_is_published_before_the_first(rig):
    _, bridge, readings, ticks = rig
    assert bridge.simulated_time is None
    assert readings.empty()
    assert drive(bridge, ticks, 10) == pytest.approx([0.01 * k for k in range(1, 11)])
    seen = [readings.get(timeout=PATIENCE) for _ in range(30)]
    angles = [(r.steady, r.values["angle"]) for r in seen if r.frame == "imu"]
    assert [t for t, _ in angles] == pytest.approx([0.01 * k for k in range(len(angles))])
    assert [a for _, a in angles] == pytest.approx([1e-3 * k for k in range(len(angles))], abs=1e-6)
    currents = [r.values["retract_current"] for r in seen if r.frame == "currents"]
    assert currents == pytest.approx([0.01 * (k + 1) for k in range(len(currents))], abs=1e-6)


@pytest.mark.parametrize("lost", [{"pressures"}, {"imu", "currents"}, set(SENSORS)])
def test_lost_frames_are_sent_again_and_cost_neither_a_sample_nor_a_period(rig, lost):
    ecu, bridge, readings, ticks = rig
    drive(bridge, ticks, 3)
    ecu.lose = lost
    assert drive(bridge, ticks, 1) == pytest.approx([0.04])
    assert drive(bridge, ticks, 1) == pytest.approx([0.05])
    assert sum(bridge.checker.counts.lost.values()) == 0
    currents = [r.values["retract_current"] for r in list(readings.queue) if r.frame == "currents"]
    assert currents == pytest.approx([0.01, 0.02, 0.03, 0.01, 0.01][: len(currents)], abs=1e-6)


def test_a_lost_command_is_sent_again_and_moves_the_boom_once(rig):
    ecu, bridge, _, ticks = rig
    drive(bridge, ticks, 3)
    before = ecu.moves
    ecu.deaf = 2
    assert drive(bridge, ticks, 1) == pytest.approx([0.04])
    assert ecu.moves == before + 1


def test_an_old_command_is_refused_in_simulated_time_too(rig):
    _, bridge, _, ticks = rig
    drive(bridge, ticks, 2)
    assert not bridge.command(0.1, 0.0, 0.2)
