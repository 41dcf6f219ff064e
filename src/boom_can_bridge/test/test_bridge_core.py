"""Checks, clocks, gate and threads of the bridge, without ROS and without waiting for clocks where times are handed in."""

import math
import queue
import random
import threading
from pathlib import Path

import can
import pytest

from boom_can_bridge.bridge import Bridge, BridgeSettings
from boom_can_bridge.clock_map import ClockMap
from boom_can_bridge.codec import Codec
from boom_can_bridge.command_gate import CommandGate
from boom_can_bridge.connection import BackOff, BusSettings, BusUnavailableError, open_bus
from boom_can_bridge.ecu_state import EcuState
from boom_can_bridge.errors import CanConfigurationError
from boom_can_bridge.frame_log import FrameLog
from boom_can_bridge.fuzz import fuzz
from boom_can_bridge.receiver import FrameChecker
from boom_can_bridge.settings import PARAMETERS
from boom_can_bridge.watchdog import Watchdog

CODEC = Codec.load("tz17")
REST = {
    "status": {"mode": 1, "faults": 0, "uptime_s": 1},
    "imu": {"angle": 0.3, "rate": 0.0},
    "pressures": {"hose_pressure": 8e6, "rod_pressure": 1e6},
    "currents": {"retract_current": 0.0, "extend_current": 0.0},
}
PATIENCE = 20.0


def message(frame, counter, values=None, **changes):
    identifier, data = CODEC.encode(frame, values or REST[frame], counter)
    return can.Message(**{"arbitration_id": identifier, "data": data, "is_extended_id": False, **changes})


def proven(checker, start=0):
    k = start
    while checker.proving:
        for frame in REST:
            assert checker.check(message(frame, k), 0.01 * k) is None
        k += 1
    return k


@pytest.mark.parametrize("behind", [0, 1, 5, 9, 15])
def test_two_ecus_contradict_each_other_and_are_told_until_one_has_gone(behind):
    checker = FrameChecker(CODEC)
    now = 0.0
    for k in range(120):
        now = 0.01 * k
        for frame in REST:
            checker.check(message(frame, k), now)
            checker.check(message(frame, k + behind), now + 0.004)
    assert "two nodes send" in checker.crowd.conflict(now)
    for k in range(120, 240):
        now = 0.01 * k
        for frame in REST:
            checker.check(message(frame, k), now)
    assert checker.crowd.conflict(now) == ""


@pytest.mark.parametrize("fault", ["none", "frozen counter", "every tenth overtaken", "late, then all at once"])
def test_one_ecu_with_a_fault_is_not_taken_for_two(fault):
    checker = FrameChecker(CODEC)
    for k in range(300):
        counter = 7 if fault == "frozen counter" else k
        if fault == "every tenth overtaken":
            counter = k + {0: 1, 1: -1}.get(k % 10, 0)
        now = 0.01 * k
        if fault == "late, then all at once" and 100 <= k < 118:
            now = 1.18
        for frame in REST:
            checker.check(message(frame, counter), now)
        assert checker.crowd.conflict(now) == ""


def test_commands_of_another_on_the_bus_are_told_for_a_second():
    checker = FrameChecker(CODEC)
    checker.check(message("command", 1, {"retract_current": 0.0, "extend_current": 0.0, "enable": 0.0}), 1.0)
    assert "another node sends commands" in checker.crowd.conflict(1.5)
    assert checker.crowd.conflict(2.5) == ""


def test_nothing_is_handed_on_before_enough_good_frames():
    checker = FrameChecker(CODEC, proof=5)
    k = proven(checker)
    assert k == 5
    reading = checker.check(message("imu", k), 0.01 * k)
    assert reading.values["angle"] == pytest.approx(0.3)
    checker.restart()
    assert checker.check(message("imu", k + 1), 0.01 * k + 0.01) is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"is_error_frame": True, "arbitration_id": 0x101}, "error"),
        ({"is_error_frame": True, "arbitration_id": 0x40}, "bus_off"),
        ({"is_error_frame": True, "arbitration_id": 0x04, "data": bytes([0, 1, 0, 0, 0, 0, 0, 0])}, "overrun"),
        ({"is_remote_frame": True}, "remote"),
        ({"is_fd": True}, "fd"),
        ({"arbitration_id": 0x7AB}, "unknown_id"),
        ({"data": b"\x00\x01"}, "length"),
        ({"data": bytes(8)}, "crc"),
    ],
)
def test_a_bad_frame_is_dropped_and_counted_by_its_reason(changes, reason):
    checker = FrameChecker(CODEC)
    k = proven(checker)
    assert checker.check(message("imu", k, **changes), 0.01 * k) is None
    assert checker.counts.bad == {reason: 1}


def test_a_repeated_frame_is_dropped_and_a_lost_one_counted():
    checker = FrameChecker(CODEC)
    k = proven(checker)
    assert checker.check(message("imu", k), 0.01 * k)
    assert checker.check(message("imu", k), 0.01 * k + 0.01) is None
    assert checker.check(message("imu", k + 3), 0.01 * k + 0.03)
    assert (checker.counts.bad["counter"], checker.counts.lost["imu"]) == (1, 2)


@pytest.mark.parametrize(
    ("frames", "said"),
    [
        ([(2, 1.0), (2, 1.1), (2, 1.2)], ""),
        ([(1, 1.0), (2, 1.1), (2, 1.2), (2, 1.3)], ""),  # it follows the enabling
        ([(2, 1.0), (2, 1.1), (0, 0.0)], "restarted"),
        ([(2, 1.0), (2, 1.1), (1, 1.2), (2, 1.3), (1, 1.4)], ""),  # it has missed a command
        ([(2, 1.0), (2, 1.1), (0, 1.2), (0, 1.3)], "from mode 2 to 0 by itself"),
        ([(7, 1.0), (7, 1.1), (4, 1.2), (4, 1.3)], "from mode 7 to 4 by itself"),  # of a machine that counts otherwise
    ],
)
def test_an_ecu_that_restarts_or_leaves_the_mode_in_which_it_drives_is_told(frames, said):
    state = EcuState(CODEC)
    told = [state.seen({"mode": mode, "uptime_s": up, "faults": 0}, 0.1 * k) for k, (mode, up) in enumerate(frames)]
    assert not any(told[:-1])
    assert said in told[-1] if said else told[-1] == ""


def test_an_ecu_may_change_its_mode_while_nothing_is_enabled_and_may_not_fall_silent():
    state = EcuState(CODEC)
    state.reset(0.0)
    for k, mode in enumerate((2, 2)):
        state.seen({"mode": mode, "uptime_s": k}, 0.1 * k)
    state.released()
    assert state.seen({"mode": 1, "uptime_s": 3}, 0.3) == ""
    assert state.silent(0.7) == "" and "no good status for 0.5 s" in state.silent(0.9)


def test_our_own_commands_are_not_readings():
    checker = FrameChecker(CODEC)
    proven(checker)
    values = {"retract_current": 0.1, "extend_current": 0.0, "enable": 1}
    assert checker.check(message("command", 1, values), 1.0) is None


@pytest.mark.parametrize("machine", ["tz17", "other_machine"])
def test_no_random_mutated_or_truncated_frame_raises_or_becomes_a_bad_value(machine):
    result = fuzz(Codec.load(machine), 20_000, seed=1)
    assert result.frames == 20_000
    assert result.escaped == 0
    assert result.bad_values == 0
    assert result.readings > 0


def test_stamps_stay_evenly_spaced_when_frames_are_delayed():
    clock = ClockMap()
    delays = [0.001, 0.004, 0.0002, 0.003, 0.0002, 0.01]
    times = [clock.to_steady(1000 + 0.01 * k, 5 + 0.01 * k + d) for k, d in enumerate(delays)]
    assert max(abs(t - (5 + 0.01 * k + 0.0002)) for k, t in enumerate(times) if k >= 2) < 1e-4


@pytest.mark.parametrize("jump", [-3600.0, 3600.0])
def test_a_jump_of_the_bus_clock_does_not_show_in_the_stamps(jump):
    clock = ClockMap()
    for k in range(200):
        bus = 1e6 + 0.01 * k + (jump if k >= 100 else 0)
        assert clock.to_steady(bus, 5 + 0.01 * k) == pytest.approx(5 + 0.01 * k, abs=1e-3)
    assert clock.jumps == 1


def test_without_stamps_the_time_of_reception_counts():
    assert ClockMap().to_steady(0.0, 7.0) == 7.0


def test_a_short_step_of_ros_time_is_ignored_and_a_lasting_one_followed():
    clock = ClockMap()
    ros = [10**18 + int(1e7) * k for k in range(400)]
    for k in range(150, 200):
        ros[k] += 10**9
    for k in range(250, 400):
        ros[k] += 10**9
    stamps = [clock.to_ros_ns(0.01 * k, 0.01 * k, ros[k]) for k in range(400)]
    assert all(abs(stamps[k] - (10**18 + int(1e7) * k)) < 1e6 for k in range(340))
    assert abs(stamps[399] - ros[399]) < 1e6


def test_a_signal_counts_as_missing_after_its_time():
    dog = Watchdog(("angle", "rate"), 0.05)
    assert set(dog.silent(0.0)) == {"angle", "rate"}
    dog.seen(["angle", "rate", "other"], 1.0)
    assert not dog.silent(1.049)
    dog.seen(["angle"], 1.04)
    assert set(dog.silent(1.06)) == {"rate"}


def ready_gate(**options):
    gate = CommandGate(**options)
    gate.problem("")
    assert gate.enable(True)[0]
    gate.output(0.0)
    return gate


def test_currents_pass_only_when_enabled_and_healthy():
    gate = CommandGate()
    assert not gate.enable(True)[0]
    gate.problem("")
    gate.command(0.3, 0.0, 0.0, 0.01)
    output = gate.output(0.02)
    assert not output.enable
    assert "enable" in output.reason
    assert gate.enable(True)[0]
    assert gate.output(0.03).retract > 0


def test_currents_are_clamped_and_rise_no_faster_than_allowed():
    gate = ready_gate(largest=0.5, rise_rate=10.0)
    sent = []
    for k in range(1, 11):
        gate.command(0.9, -0.2, 0.0, 0.01 * k)
        sent.append(gate.output(0.01 * k))
    assert [round(o.retract, 6) for o in sent[:6]] == [0.1, 0.2, 0.3, 0.4, 0.5, 0.5]
    assert all(o.extend == 0 for o in sent)
    assert gate.clamped == 10
    gate.command(0.0, 0.0, 0.0, 0.11)
    assert gate.output(0.11).retract == 0


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_means_zero(value):
    gate = ready_gate()
    gate.command(0.3, 0.0, 0.0, 0.01)
    assert gate.output(0.01).retract > 0
    assert not gate.command(value, 0.0, 0.0, 0.02)
    output = gate.output(0.02)
    assert (output.retract, output.enable) == (0, False)
    assert "finite" in output.reason


@pytest.mark.parametrize("age", [0.06, -0.06])
def test_an_old_or_future_command_means_zero(age):
    gate = ready_gate()
    assert not gate.command(0.3, 0.0, age, 0.01)
    assert not gate.output(0.02).enable


def test_silence_means_zero_and_a_long_one_takes_the_enabling_back():
    gate = ready_gate(revoke_after=0.5)
    gate.command(0.3, 0.0, 0.0, 0.01)
    for k in range(1, 60):
        output = gate.output(0.01 * k)
        assert output.enable == (k <= 6)
        assert gate.enabled == (0.01 * k <= 0.51)
    gate.command(0.3, 0.0, 0.0, 0.6)
    assert "enable again" in gate.output(0.6).reason


@pytest.mark.parametrize("fault", ["problem", "stop", "standstill"])
def test_motion_is_never_enabled_again_by_itself(fault):
    gate = ready_gate()
    gate.command(0.3, 0.0, 0.0, 0.01)
    now = 0.02
    if fault == "problem":
        gate.problem("bus lost")
        gate.problem("")
    elif fault == "stop":
        gate.emergency_stop(True)
        assert not gate.enable(True)[0]
        gate.emergency_stop(False)
    else:
        now = 0.5
    gate.command(0.3, 0.0, 0.0, now)
    assert gate.output(now).retract == 0
    assert gate.enable(True)[0]
    gate.command(0.3, 0.0, 0.0, now + 0.01)
    assert gate.output(now + 0.01).retract > 0


def test_waiting_times_double_up_to_two_seconds():
    back_off = BackOff()
    waits = [back_off.wait() for _ in range(7)]
    assert waits == [0.1, 0.2, 0.4, 0.8, 1.6, 2.0, 2.0]
    back_off.reset()
    assert back_off.wait() == 0.1


def test_a_busy_channel_is_told_with_what_to_do(monkeypatch):
    def busy(**_options):
        raise can.CanInitializationError("[Errno 16] Device or resource busy")

    monkeypatch.setattr(can, "Bus", busy)
    with pytest.raises(BusUnavailableError, match="another program has the channel: end it, or choose another channel"):
        open_bus(BusSettings("slcan", "/dev/ttyACM0"))


class FakeBus:
    """A bus whose frames and failures the test decides; an ECU answers every command with one frame of each kind."""

    def __init__(self):
        self.waiting = queue.Queue()
        self.sent = queue.Queue()
        self.counter = random.randrange(256)
        self.broken = None

    def recv(self, timeout):
        if self.broken:
            raise self.broken
        try:
            return self.waiting.get(timeout=0.01) if timeout else self.waiting.get_nowait()
        except queue.Empty:
            return None

    def send(self, frame, timeout=None):
        if self.broken:
            raise self.broken
        self.sent.put(frame)
        self.counter += 1
        for name in REST:
            self.waiting.put(message(name, self.counter))

    def fileno(self):
        return -1

    def shutdown(self):
        pass


class Rig:
    def __init__(self):
        self.buses = []
        self.readings = queue.Queue()
        self.states = queue.Queue()
        self.refuse = 0
        settings = BridgeSettings(BusSettings("virtual", "x"), revoke_after=60.0, command_timeout=0.1)
        tell = lambda up, text: self.states.put((up, text))  # noqa: E731
        self.bridge = Bridge(settings, self.readings.put, tell, self.make)
        self.bridge.gate.standstill = self.bridge.watchdog.timeout = 30.0  # the computer of a test may stand still
        self.bridge.open(wait=False)
        self.bridge.activate(True)

    def make(self, _settings):
        if self.buses and self.refuse:
            self.refuse -= 1
            raise BusUnavailableError("away")
        self.buses.append(FakeBus())
        return self.buses[-1]

    def state(self, up):
        while self.states.get(timeout=PATIENCE)[0] != up:
            pass

    def until_enabled(self):
        pause = threading.Event()
        for _ in range(1000):
            if self.bridge.enable(True)[0]:
                return
            pause.wait(0.01)
        raise AssertionError(self.bridge.enable(True)[1])

    def sent_current(self):
        frame = self.buses[-1].sent.get(timeout=PATIENCE)
        return CODEC.decode(frame.arbitration_id, frame.data).values


@pytest.fixture
def rig():
    made = Rig()
    yield made
    made.bridge.close()


def test_commands_reach_the_bus_and_readings_come_back(rig):
    rig.until_enabled()
    assert rig.readings.get(timeout=PATIENCE).frame in REST
    while rig.sent_current()["retract_current"] < 0.19:
        rig.bridge.command(0.2, 0.0, 0.0)
    assert rig.bridge.report().level == 0


@pytest.mark.parametrize(
    "error",
    [ConnectionResetError("gone"), can.CanOperationError("bus off"), OSError("unplugged"), RuntimeError("driver")],
)
def test_a_broken_bus_is_opened_again_and_motion_stays_disabled(rig, error):
    rig.until_enabled()
    rig.refuse = 2
    rig.buses[-1].broken = error
    rig.state(False)
    rig.state(True)
    rig.bridge.command(0.2, 0.0, 0.0)
    assert all(rig.sent_current()["retract_current"] == 0 for _ in range(10))
    while not rig.readings.empty():
        rig.readings.get_nowait()
    assert rig.readings.get(timeout=PATIENCE)
    rig.until_enabled()


def test_a_bus_off_frame_opens_the_bus_again(rig):
    rig.until_enabled()
    rig.buses[-1].waiting.put(can.Message(is_error_frame=True, arbitration_id=0x40, data=bytes(8)))
    rig.state(False)
    rig.state(True)
    assert not rig.bridge.gate.enabled


def test_an_exception_of_the_publisher_does_not_end_the_receive_thread(rig):
    seen = threading.Event()
    calls = []

    def bad(reading):
        calls.append(reading)
        if len(calls) > 3:
            seen.set()
        raise RuntimeError("publisher")

    rig.bridge._publish = bad
    assert seen.wait(PATIENCE)
    assert rig.bridge.receiver.failures["publishing: RuntimeError"] >= 3


def test_closing_sends_zero_current_last(rig):
    rig.until_enabled()
    rig.bridge.command(0.2, 0.0, 0.0)
    rig.bridge.close()
    frames = list(rig.buses[-1].sent.queue)
    last = CODEC.decode(frames[-1].arbitration_id, frames[-1].data).values
    assert last == {"retract_current": 0.0, "extend_current": 0.0, "enable": 0.0}


def test_the_log_holds_what_was_received_and_sent(tmp_path):
    log = FrameLog(tmp_path / "frames.blf")
    frames = [message("imu", k, timestamp=1e9 + k) for k in range(10)]
    for frame in frames:
        log.write(frame)
    log.close()
    log.write(frames[0])
    read = list(can.LogReader(tmp_path / "frames.blf"))
    assert [bytes(f.data) for f in read] == [bytes(f.data) for f in frames]


@pytest.mark.parametrize("name", ["frames.xyz", "no/folder/frames.blf"])
def test_a_log_that_cannot_be_written_is_refused_in_one_line(tmp_path, name):
    with pytest.raises(CanConfigurationError, match="log "):
        FrameLog(tmp_path / name)


def test_the_readme_names_every_parameter():
    text = (Path(__file__).parents[1] / "README.md").read_text()
    assert [p.name for p in PARAMETERS if f"| `{p.name}` |" not in text or p.description not in text] == []


@pytest.mark.parametrize(
    ("options", "wanted", "told"),
    [
        ({"filter_foreign": True}, {0x101, 0x102, 0x103, 0x104, 0x200}, "kept back"),
        ({"filter_foreign": False}, set(), "none"),
        ({"filter_foreign": True, "log": "all.blf"}, set(), "none"),
    ],
)
def test_the_bus_may_keep_back_foreign_frames_unless_somebody_looks_at_them(tmp_path, options, wanted, told):
    if "log" in options:
        options = {**options, "log": str(tmp_path / options["log"])}
    opened = []

    def make(settings):
        opened.append(settings)
        return FakeBus()

    bridge = Bridge(BridgeSettings(BusSettings("virtual", "x"), **options), lambda reading: None, bus_factory=make)
    bridge.open(wait=False)
    try:
        assert {identifier for identifier, _ in opened[0].wanted} == wanted
        assert told in bridge.report().values["unknown ids"]
    finally:
        bridge.close()
