"""The bridge as a process between a real bus server and topics; the machine is a small ECU in this process.

On a computer that stands still for a while the bridge takes motion away, and is right: see Rig.moving.
"""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from boom_can_bridge.codec import Codec, FrameError
from boom_can_bridge.connection import close_bus
from boom_interfaces.msg import MachineConfiguration, SolenoidCurrents
from boom_node import qos

pytestmark = pytest.mark.process
PATIENCE = 120.0
STALLS = ("stood still", "no good", "no current command")  # what the bridge says where processes did not get their time
CODEC = Codec.load("tz17")
REST = {
    "imu": {"angle": 0.3, "rate": 0.0},
    "pressures": {"hose_pressure": 8e6, "rod_pressure": 1e6},
    "currents": {"retract_current": 0.0, "extend_current": 0.0},
    "status": {"mode": 1, "faults": 0, "uptime_s": 1},
}


class Ecu(threading.Thread):
    """Sends all frames every 10 ms, keeps the last command."""

    def __init__(self, channel: str) -> None:
        super().__init__(daemon=True)
        self.bus = can.Bus(interface="remote", channel=channel)
        self.last: dict[str, float] = {}
        self.sending = True
        self.running = True

    def run(self) -> None:
        counter = 0
        with contextlib.suppress(Exception):
            while self.running:
                counter += 1
                if self.sending:
                    for name, values in REST.items():
                        identifier, data = CODEC.encode(name, values, counter)
                        self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
                end = time.monotonic() + 0.01
                while (left := end - time.monotonic()) > 0:
                    message = self.bus.recv(left)
                    if message is not None:
                        with contextlib.suppress(FrameError):
                            frame = CODEC.decode(message.arbitration_id, bytes(message.data))
                            if frame.frame not in REST:  # those are another ECU's
                                self.last = frame.values
        close_bus(self.bus)


class Rig:
    """Server, bridge, ECU and a partner on the topics."""

    def __init__(self) -> None:
        self.processes: list[subprocess.Popen[str]] = []
        self.ecus: list[Ecu] = []
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("partner", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {}
        for kind, topic in (
            (JointState, "/joint_states"), (FluidPressure, "/boom/hose_pressure"), (FluidPressure, "/boom/rod_pressure"),
            (SolenoidCurrents, "/boom/solenoid_currents"), (MachineConfiguration, "/boom/machine_configuration"),
            (DiagnosticArray, "/diagnostics"),
        ):  # fmt: skip
            self.heard[topic] = []
            self.node.create_subscription(kind, topic, self.heard[topic].append, qos.BY_TOPIC[topic])
        self.commands = self.node.create_publisher(SolenoidCurrents, "/boom/current_command", qos.COMMAND)
        self.stop = self.node.create_publisher(Bool, "/boom/emergency_stop", qos.LATCHED)
        self.clients: dict[str, Any] = {}
        self.wanted = 0.0
        self.node.create_timer(0.01, self.send)
        self.port = "0"

    def send(self) -> None:
        message = SolenoidCurrents(retract=self.wanted)
        message.header.stamp = self.node.get_clock().now().to_msg()
        self.commands.publish(message)

    def serve(self) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "boom_can_bridge.bus_server", "--port", self.port]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self.processes.append(server)
        assert server.stdout is not None
        self.channel = server.stdout.readline().split()[-1]
        self.port = self.channel.rstrip("/").rsplit(":", 1)[1]
        return server

    def join(self) -> Ecu:
        ecu = Ecu(self.channel)
        ecu.start()
        self.ecus.append(ecu)
        return ecu

    def bridge(self, *parameters: str) -> subprocess.Popen[str]:
        arguments = [
            "interface:=remote",
            f"channel:={self.channel}",
            "watchdog:=0.5",
            "command_timeout:=0.1",
            *parameters,
        ]
        command = [sys.executable, "-m", "boom_can_bridge.bridge_node", "--ros-args"]
        command += [word for argument in arguments for word in ("-p", argument)]
        self.processes.append(subprocess.Popen(command))
        return self.processes[-1]

    def until(self, done: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, "what was waited for did not happen"
            self.executor.spin_once(timeout_sec=0.02)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, f"/boom_can_bridge/{name}")
        client = self.clients[name]
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def enable(self) -> None:
        self.until(lambda: self.call(SetBool, "enable", SetBool.Request(data=True)).success)

    def moving(self, ecu: Ecu) -> None:
        """The ECU gets the current. Enabled, and again after each stall that the bridge itself tells as its reason to disable."""

        def flows() -> bool:
            if any("enable again" in said and any(stall in said for stall in STALLS) for said in self.said()):
                self.forget()
                self.enable()
            return ecu.last.get("retract_current") == pytest.approx(0.3)

        self.forget()
        self.enable()
        self.until(flows)

    def said(self) -> list[str]:
        """What ``/diagnostics`` has said."""
        return [s.message for a in self.heard["/diagnostics"] for s in a.status]

    def told(self, *reasons: str) -> bool:
        """Whether ``/diagnostics`` has given one of these reasons."""
        return any(reason in message for message in self.said() for reason in reasons)

    def forget(self) -> None:
        for messages in self.heard.values():
            messages.clear()

    def close(self) -> None:
        for ecu in self.ecus:
            ecu.running = False
            ecu.join(PATIENCE)
        for process in reversed(self.processes):
            process.kill()
            process.wait(PATIENCE)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    made.serve()
    yield made
    made.close()


def test_frames_become_topics_in_si_units(rig: Rig) -> None:
    rig.join()
    rig.bridge("machine:=tz17", "load_mass:=250.0")
    rig.until(lambda: all(rig.heard.values()))
    joints = rig.heard["/joint_states"][-1]
    assert joints.name == ["inner_boom_joint", "outer_boom_joint", "telescope_joint"]
    assert joints.position[0] == pytest.approx(0.3)
    assert rig.heard["/boom/hose_pressure"][-1].fluid_pressure == pytest.approx(8e6 + 101_325)
    assert rig.heard["/boom/rod_pressure"][-1].fluid_pressure == pytest.approx(1e6 + 101_325)
    assert rig.heard["/boom/machine_configuration"][-1].load_mass == 250.0


def test_commands_reach_the_machine_only_after_enabling_and_end_with_an_emergency_stop(rig: Rig) -> None:
    ecu = rig.join()
    rig.bridge()
    rig.wanted = 0.3
    rig.until(lambda: ecu.last and rig.heard["/joint_states"])
    assert ecu.last["retract_current"] == 0
    rig.moving(ecu)
    rig.stop.publish(Bool(data=True))
    rig.until(lambda: rig.told("emergency stop") and ecu.last["retract_current"] == 0)
    rig.stop.publish(Bool(data=False))
    rig.moving(ecu)


def test_a_second_commander_or_ecu_takes_the_motion_away_and_blocks_enabling_until_it_has_gone(rig: Rig) -> None:
    ecu = rig.join()
    rig.bridge()
    rig.wanted = 0.3
    rig.moving(ecu)
    second = rig.node.create_publisher(SolenoidCurrents, "/boom/current_command", qos.COMMAND)
    rig.until(lambda: rig.told("2 publish /boom/current_command") and ecu.last["retract_current"] == 0)
    refused = rig.call(SetBool, "enable", SetBool.Request(data=True))
    assert not refused.success
    assert "end all but one" in refused.message
    rig.node.destroy_publisher(second)
    rig.moving(ecu)
    other = rig.join()
    rig.until(lambda: rig.told("on the bus, by its counters") and ecu.last["retract_current"] == 0)
    # The ECUs are threads of this process: where it is held up, there are for a moment no more frames than one of them sends.
    rig.until(lambda: "two nodes send" in rig.call(SetBool, "enable", SetBool.Request(data=True)).message)
    other.running = False
    rig.enable()


def test_silent_sensors_stop_the_motion_until_it_is_enabled_again(rig: Rig) -> None:
    ecu = rig.join()
    rig.bridge()
    rig.wanted = 0.3
    rig.moving(ecu)
    rig.forget()
    ecu.sending = False
    rig.until(lambda: rig.told("no good") and ecu.last["retract_current"] == 0)
    ecu.sending = True
    rig.forget()
    rig.until(lambda: rig.heard["/joint_states"])
    rig.until(lambda: len(rig.heard["/joint_states"]) > 20)
    assert ecu.last["retract_current"] == 0
    rig.moving(ecu)


def test_a_killed_bus_server_that_comes_back_is_joined_again_without_motion(rig: Rig) -> None:
    rig.join()
    bridge = rig.bridge()
    rig.wanted = 0.3
    rig.enable()
    rig.processes[0].send_signal(signal.SIGKILL)
    rig.processes[0].wait(PATIENCE)
    rig.until(lambda: rig.told("lost", "cannot be opened"))
    rig.serve()
    ecu = rig.join()
    rig.forget()
    rig.until(lambda: len(rig.heard["/joint_states"]) > 20 and ecu.last)
    assert ecu.last["retract_current"] == 0
    assert bridge.poll() is None
    rig.moving(ecu)


def test_the_lifecycle_decides_whether_anything_is_published(rig: Rig) -> None:
    ecu = rig.join()
    bridge = rig.bridge("autostart:=false")

    def change(transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return bool(rig.call(ChangeState, "change_state", request).success)

    assert change(Transition.TRANSITION_CONFIGURE)
    rig.until(lambda: ecu.last)
    assert not rig.heard["/joint_states"]
    assert change(Transition.TRANSITION_ACTIVATE)
    rig.until(lambda: rig.heard["/joint_states"])
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert not rig.call(SetBool, "enable", SetBool.Request(data=True)).success
    assert change(Transition.TRANSITION_CLEANUP)
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    rig.forget()
    rig.until(lambda: rig.heard["/joint_states"])
    bridge.send_signal(signal.SIGINT)
    assert bridge.wait(PATIENCE) == 0


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (["interface:=nope"], "no CAN interface 'nope'"),
        (["interface:=remote", "channel:=ws://127.0.0.1:9/"], "start the bus server"),
        (["dbc:=nowhere"], "no DBC nowhere"),
        (["mapping:=nowhere.yaml"], "no such mapping file"),
        (["interface:=virtual", "channel:=x", "log:=frames.nope"], "must end in one of"),
        (["interfaze:=virtual"], "did you mean 'interface'?"),
    ],
)
def test_a_wrong_setting_ends_with_one_line_and_status_2(parameters: list[str], words: str) -> None:
    command = [sys.executable, "-m", "boom_can_bridge.bridge_node", "--ros-args"]
    command += [word for parameter in parameters for word in ("-p", parameter)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert result.returncode == 2
    assert words in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
