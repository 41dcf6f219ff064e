"""The ECU stand-in on buses: its thread on python-can's virtual bus, and the node as a process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import can
import pytest

from boom_can_bridge.codec import Codec
from boom_sim import settings
from boom_sim.ecu import Ecu
from boom_sim.ecu_faults import FaultSettings
from boom_sim.ecu_loop import EcuLoop

PATIENCE = 20.0
EXTEND = {"retract_current": 0.0, "extend_current": 0.4, "enable": 1.0}


def until(done: Callable[[], Any]) -> None:
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, "what was waited for did not happen"
        time.sleep(0.002)


class Bench:
    """An ECU in its thread on a virtual bus, and a partner at the other end."""

    def __init__(self, channel: str, *, lockstep: bool = False) -> None:
        self.codec = Codec.load("tz17")
        values = {spec.name: spec.default for spec in settings.PARAMETERS} | {"sensors": "ideal"}
        self.ecu = Ecu(settings.make_crane(SimpleNamespace(**values)), self.codec, lockstep=lockstep)
        self.channel = channel
        self.absent = threading.Event()
        self.loop = EcuLoop(self.ecu, self.open)
        self.partner = can.Bus(interface="virtual", channel=channel)
        self.counter = 0

    def open(self) -> can.BusABC:
        if self.absent.is_set():
            raise OSError("there is no bus")
        return can.Bus(interface="virtual", channel=self.channel)

    def send(self, command: dict[str, float]) -> None:
        self.counter += 1
        identifier, data = self.codec.encode("command", command, self.counter)
        self.partner.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data))

    def receive(self) -> str:
        message = self.partner.recv(PATIENCE)
        assert message is not None
        return self.codec.decode(message.arbitration_id, bytes(message.data)).frame

    def close(self) -> None:
        self.loop.end()
        self.partner.shutdown()


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(request.node.name, lockstep="lockstep" in request.node.name)
    yield made
    made.close()


def test_frames_come_in_their_order(bench: Bench) -> None:
    bench.loop.begin()
    names = [spec.name for spec in bench.codec.incoming]
    until(lambda: bench.receive() == names[-1])
    assert [bench.receive() for _ in range(12)] == names * 3


def test_lockstep_gives_one_period_per_command_and_waits(bench: Bench) -> None:
    bench.loop.begin()
    until(lambda: bench.loop.connection == "connected")
    for _ in range(200):
        bench.send(EXTEND)
        assert [bench.receive() for _ in range(4)] == [spec.name for spec in bench.codec.incoming]
    assert bench.ecu.crane.time == pytest.approx(2.0)
    assert bench.ecu.crane.sample.angle > 0.33
    assert bench.partner.recv(0.0) is None


def test_bus_that_appears_later_is_joined_and_the_cycle_runs_meanwhile(bench: Bench) -> None:
    bench.absent.set()
    bench.loop.begin()
    until(lambda: "there is no bus" in bench.loop.connection)
    until(lambda: bench.ecu.crane.time > 0.1)
    bench.absent.clear()
    bench.receive()
    assert bench.loop.connection == "connected"


def test_bus_that_breaks_is_opened_again(bench: Bench) -> None:
    bench.loop.begin()
    bench.receive()
    broken = bench.loop._bus
    assert broken is not None
    broken.shutdown()
    until(lambda: bench.loop._bus not in (None, broken))
    until(lambda: bench.loop.connection == "connected")


def test_bus_off_is_silent_and_ends_by_itself(bench: Bench) -> None:
    bench.loop.begin()
    bench.receive()
    bench.loop.bus_off(0.2)
    while bench.partner.recv(0.05) is not None:
        pass
    bench.send(EXTEND)
    bench.receive()
    assert bench.ecu.accepted == 0


def test_lost_frames_are_lost_in_the_direction_that_was_asked_for(bench: Bench) -> None:
    bench.loop.set_faults(FaultSettings(loss=1.0), "to_ecu")
    bench.loop.begin()
    bench.receive()
    bench.send(EXTEND)
    until(lambda: bench.loop.from_bus.counts.lost == 1)
    assert bench.ecu.accepted == 0
    bench.loop.set_faults(FaultSettings(), "both")
    bench.send(EXTEND)
    until(lambda: bench.ecu.accepted == 1)


def run_node(*parameters: str, **more: Any) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "boom_sim.ecu_node", "--ros-args"]
    command += [word for parameter in parameters for word in ("-p", parameter)]
    return subprocess.Popen(command, env=os.environ, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)


@pytest.mark.process
@pytest.mark.parametrize(
    ("parameter", "part"),
    [
        ("interface:=socketcam", "did you mean 'socketcan'?"),
        ("dbc:=tz71", "no DBC tz71"),
        ("mapping:=nowhere.yaml", "nowhere.yaml: no such mapping"),
        ("fault_loss:=1.5", "fault_loss"),
        ("fault_los:=0.5", "did you mean 'fault_loss'?"),
        ("machine:=tz71", "tz71"),
    ],
)
def test_wrong_parameter_is_one_line_and_status_2(parameter: str, part: str) -> None:
    process = run_node(parameter)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2, out + err
    assert len(err.strip().splitlines()) == 1, err
    assert part in err


@pytest.mark.process
def test_node_waits_for_its_bus_and_ends_on_a_signal() -> None:
    process = run_node("channel:='ws://127.0.0.1:9/'")
    assert process.stderr is not None
    assert any("no bus" in line for line in iter(process.stderr.readline, ""))
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert "Traceback" not in err
