"""The ECU stand-in without bus and clock: what it sends, what it follows, and when it closes the valve by itself."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from boom_can_bridge.codec import Codec
from boom_node.commands import LONGEST_SILENCE_S
from boom_sim import settings
from boom_sim.ecu import FROZEN_FRAMES, Ecu, Fault, Mode
from boom_sim.ecu_faults import Frame

EXTEND = {"retract_current": 0.0, "extend_current": 0.4, "enable": 1.0}
NOTHING = {"retract_current": 0.0, "extend_current": 0.0, "enable": 1.0}


class Partner:
    """Sends commands to an ECU and reads its frames; time goes by in periods of 10 ms."""

    def __init__(self, machine: str = "tz17", *, lockstep: bool = False, **changed: object) -> None:
        values = {spec.name: spec.default for spec in settings.PARAMETERS} | {"sensors": "ideal"} | changed
        self.codec = Codec.load(machine)
        self.crane = settings.make_crane(SimpleNamespace(**values))
        self.ecu = Ecu(self.crane, self.codec, lockstep=lockstep)
        self.now = 100.0
        self.ecu.start(self.now)
        self.counter = 0
        self.shown: dict[str, float] = {}

    def frame(self, command: dict[str, float], *, counts: bool = True) -> Frame:
        self.counter += counts
        identifier, data = self.codec.encode(self.codec.command.name, command, self.counter)
        return Frame(identifier, self.codec.command.is_extended, data)

    def send(self, command: dict[str, float], *, counts: bool = True) -> bool:
        return self.ecu.receive(self.frame(command, counts=counts), self.now)

    def tick(self) -> list[str]:
        names = []
        for frame in self.ecu.tick(self.now):
            decoded = self.codec.decode(frame.arbitration_id, frame.data, extended=frame.extended)
            names.append(decoded.frame)
            self.shown |= {f"{decoded.frame}.{name}": value for name, value in decoded.values.items()}
        self.now += 0.01
        return names

    def drive(self, command: dict[str, float], periods: int) -> None:
        for _ in range(periods):
            self.send(command)
            self.tick()


@pytest.mark.parametrize("machine", ["tz17", "other_machine"])
def test_boom_moves_as_commanded_and_the_frames_show_it(machine: str) -> None:
    partner = Partner(machine)
    partner.drive(NOTHING, 3)
    rest = partner.shown["imu.angle"]
    partner.drive(EXTEND, 150)
    assert rest == pytest.approx(0.3, abs=1e-5)
    assert partner.shown["imu.angle"] > 0.33
    assert partner.shown["imu.rate"] > 0.02
    assert partner.shown["currents.extend_current"] == pytest.approx(0.4, abs=1e-4)
    assert partner.shown["pressures.hose_pressure"] > 5e6
    assert partner.shown["status.mode"] == Mode.ACTIVE
    assert partner.shown["status.faults"] == 0


def test_every_frame_is_sent_every_period_with_a_counter_that_counts() -> None:
    partner = Partner()
    counters: dict[str, list[int]] = {}
    for _ in range(300):
        for frame in partner.ecu.tick(partner.now):
            decoded = partner.codec.decode(frame.arbitration_id, frame.data)
            assert decoded.counter is not None
            counters.setdefault(decoded.frame, []).append(decoded.counter)
        partner.now += 0.01
    assert set(counters) == {spec.name for spec in partner.codec.incoming}
    assert all(seen == [k % 256 for k in range(300)] for seen in counters.values())


def test_sensors_show_the_beginning_of_a_cycle_and_currents_what_flows_from_then_on() -> None:
    partner = Partner()
    partner.drive(NOTHING, 2)
    partner.send(EXTEND)
    before = partner.crane.sample.angle
    partner.tick()
    assert partner.shown["imu.angle"] == pytest.approx(before, abs=2e-7)
    assert partner.shown["currents.extend_current"] == pytest.approx(0.4, abs=1e-6)


def test_same_commands_give_the_same_frames_bit_by_bit() -> None:
    def run() -> list[Frame]:
        partner = Partner(sensors="thesis", seed=3)
        frames = []
        for k in range(60):
            partner.send(EXTEND if k > 5 else NOTHING)
            frames += partner.ecu.tick(partner.now)
            partner.now += 0.01
        return frames

    assert run() == run()


def test_silence_closes_the_valve_before_100_ms_have_passed() -> None:
    partner = Partner()
    partner.drive(NOTHING, 2)
    for phase in (0.0, 0.001, 0.005, 0.0099):
        partner.drive(NOTHING, 1)
        partner.drive(EXTEND, 5)
        partner.ecu.receive(partner.frame(EXTEND), partner.now - phase)
        last = partner.now - phase
        partner.tick()
        while partner.ecu.currents[1] > 0:
            assert partner.now <= last + LONGEST_SILENCE_S
            partner.tick()
        assert partner.now - 0.01 - last > 0.08
        assert partner.shown["currents.extend_current"] == 0.0
        assert partner.ecu.faults == Fault.SILENCE


def test_after_silence_it_stays_closed_until_nothing_is_asked_for() -> None:
    partner = Partner()
    partner.drive(NOTHING, 2)
    partner.drive(EXTEND, 5)
    for _ in range(12):
        partner.tick()
    partner.drive(EXTEND, 20)
    assert partner.ecu.mode == Mode.FAULT
    assert partner.ecu.currents == (0.0, 0.0)
    partner.drive(NOTHING, 1)
    partner.drive(EXTEND, 1)
    assert partner.ecu.mode == Mode.ACTIVE
    assert partner.ecu.currents == pytest.approx((0.0, 0.4))
    assert partner.ecu.faults == 0


def test_frozen_counter_closes_the_valve() -> None:
    partner = Partner()
    partner.drive(NOTHING, 2)
    partner.drive(EXTEND, 5)
    for _ in range(FROZEN_FRAMES):
        assert partner.ecu.currents[1] > 0
        partner.send(EXTEND, counts=False)
        partner.tick()
    assert partner.ecu.currents == (0.0, 0.0)
    assert partner.ecu.faults == Fault.FROZEN
    assert partner.ecu.refused["counter"] == FROZEN_FRAMES
    partner.drive(EXTEND, 5)
    assert partner.ecu.currents == (0.0, 0.0)


def test_command_without_enable_closes_at_once_and_needs_nothing_to_go_on() -> None:
    partner = Partner()
    partner.drive(EXTEND, 5)
    partner.drive(EXTEND | {"enable": 0.0}, 1)
    assert partner.ecu.currents == (0.0, 0.0)
    assert partner.ecu.mode == Mode.READY
    partner.drive(EXTEND, 1)
    assert partner.ecu.currents == pytest.approx((0.0, 0.4))


@pytest.mark.parametrize(("byte", "reason", "fault"), [(0, "crc", Fault.CHECKSUM), (3, "crc", Fault.CHECKSUM)])
def test_damaged_command_is_not_followed_but_counted(byte: int, reason: str, fault: Fault) -> None:
    partner = Partner()
    partner.drive(NOTHING, 2)
    good = partner.frame(EXTEND)
    data = bytearray(good.data)
    data[byte] ^= 0x20
    assert partner.ecu.receive(Frame(good.arbitration_id, good.extended, bytes(data)), partner.now)
    assert partner.ecu.currents == (0.0, 0.0)
    assert partner.ecu.refused[reason] == 1
    assert partner.ecu.faults == fault


def test_short_command_is_not_followed() -> None:
    partner = Partner()
    good = partner.frame(EXTEND)
    partner.ecu.receive(Frame(good.arbitration_id, good.extended, good.data[:5]), partner.now)
    assert partner.ecu.currents == (0.0, 0.0)
    assert partner.ecu.refused["length"] == 1


def test_frames_of_others_are_none_of_its_business() -> None:
    partner = Partner()
    good = partner.frame(EXTEND)
    assert not partner.ecu.receive(Frame(0x123, False, good.data), partner.now)
    assert not partner.ecu.receive(Frame(good.arbitration_id, True, good.data), partner.now)
    assert not partner.ecu.refused


def test_restarted_ecu_is_closed_counts_from_zero_and_leaves_the_crane_alone() -> None:
    partner = Partner()
    partner.drive(EXTEND, 100)
    angle = partner.crane.sample.angle
    partner.ecu.start(partner.now)
    assert partner.ecu.currents == (0.0, 0.0)
    (frame,) = (
        f for f in partner.ecu.tick(partner.now) if f.arbitration_id == partner.codec.frames["status"].arbitration_id
    )
    decoded = partner.codec.decode(frame.arbitration_id, frame.data)
    assert decoded.counter == 0
    assert decoded.values == {"mode": Mode.START, "faults": 0, "uptime_s": 0}
    assert partner.crane.sample.angle == pytest.approx(angle, abs=1e-2)


def test_counters_stand_still_where_the_fault_asks_for_it() -> None:
    partner = Partner()
    partner.tick()
    partner.ecu.frozen_counter = True
    first = [f.data[1] for f in partner.ecu.tick(partner.now)]
    assert [f.data[1] for f in partner.ecu.tick(partner.now + 0.01)] == first


def test_crane_that_left_its_range_is_told_by_the_status_alone() -> None:
    partner = Partner(initial_angle=1.55)
    for _ in range(400):
        partner.send(EXTEND | {"extend_current": 0.55})
        names = partner.tick()
        if partner.ecu.failure:
            break
    assert partner.ecu.failure
    assert names == ["status"]
    partner.tick()
    assert int(partner.shown["status.faults"]) & Fault.SENSOR
    partner.ecu.reset(partner.now)
    assert len(partner.tick()) == 4


def test_in_lockstep_silence_closes_nothing() -> None:
    partner = Partner(lockstep=True)
    partner.drive(EXTEND, 5)
    partner.now += 10.0
    partner.tick()
    assert partner.ecu.currents == pytest.approx((0.0, 0.4))


def test_in_lockstep_a_repeated_command_asks_for_the_answer_and_moves_nothing() -> None:
    partner = Partner(lockstep=True)
    partner.drive(EXTEND, 5)
    answer, refused = partner.ecu.answer, dict(partner.ecu.refused)
    assert partner.send(EXTEND, counts=False)
    assert partner.ecu.asked_again
    assert partner.ecu.answer == answer
    assert dict(partner.ecu.refused) == refused
    assert partner.send(EXTEND)
    assert not partner.ecu.asked_again


def test_in_lockstep_a_damaged_command_is_as_good_as_lost() -> None:
    partner = Partner(lockstep=True)
    partner.drive(EXTEND, 5)
    frame = partner.frame(EXTEND)
    damaged = Frame(frame.arbitration_id, frame.extended, bytes([frame.data[0] ^ 1, *frame.data[1:]]))
    assert not partner.ecu.receive(damaged, partner.now)
    assert partner.ecu.refused["crc"] == 1
