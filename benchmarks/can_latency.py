"""Frames lost, latency and load of the CAN bridge: five frames at 100 Hz each way, and commands, over the embedded bus.

    python benchmarks/can_latency.py --seconds 600

Starts as processes: a bus server, the bridge, and the machine, which is the ECU (status and sensors: four frames, and one that
the mapping does not name) and another participant that sends five foreign frames. This process is the controller: it sends commands
and hears the topics. All times are those of the steady clock, which all processes share.

frame to topic     from before a frame is given to the bus to its message in the controller
command to frame   from before a command is published to its frame in the machine
CPU                of the bridge's process, user and system time, in percent of one core
"""

import argparse
import ctypes
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import can
import numpy as np
import psutil
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import FluidPressure, JointState
from std_srvs.srv import SetBool

from boom_can_bridge.codec import Codec, FrameError
from boom_interfaces.msg import SolenoidCurrents
from boom_node import qos

PERIOD_S = 0.01
# Values that name the frame they come from: the topic then tells which frame it was. Steps stay plausible.
CODES = 200
FOREIGN_IDS = (0x3A0, 0x3A1, 0x3A2, 0x3A3, 0x3A4)
PATIENCE_S = 30.0


class Ecu(threading.Thread):
    """Sends the frames of the ECU and the foreign ones, and hears the commands."""

    def __init__(self, channel: str, foreign: bool) -> None:
        super().__init__(daemon=True)
        self.foreign = FOREIGN_IDS if foreign else ()
        self.codec = Codec.load("tz17")
        self.bus = can.Bus(interface="remote", channel=channel)
        self.other = can.Bus(interface="remote", channel=channel)
        self.sent_at: dict[int, float] = {}
        self.commands: dict[int, float] = {}
        self.count = 0
        self.command_frames = 0
        self.bad_commands = 0
        self.lost_commands = 0
        self.wanted = False
        self.measuring = False
        self.start_at = 0
        self.running = True

    def values(self, k: int) -> dict[str, dict[str, float]]:
        """Values of one period; angle and pressure name it."""
        code = k % CODES
        triangle = min(code, CODES - code) + (0.25 if code > CODES // 2 else 0.0)
        return {
            "imu": {"angle": 1e-3 * triangle, "rate": 0.0},
            "pressures": {"hose_pressure": 1e6 + 1e3 * code, "rod_pressure": 1e6},
            "currents": {"retract_current": 0.0, "extend_current": 0.0},
            "status": {"mode": 1, "faults": 0, "uptime_s": 0.01 * k},
        }

    def run(self) -> None:
        """Send every 10 ms of the steady clock."""
        threading.Thread(target=self.listen, daemon=True).start()
        threading.Thread(target=self.swallow, daemon=True).start()
        due = time.monotonic()
        while self.running:
            due += PERIOD_S
            if self.wanted and not self.measuring:  # half way between two frames: none is on its way
                time.sleep(max(0.0, due - PERIOD_S / 2 - time.monotonic()))
                self.start_at = self.count
                self.measuring = True
            time.sleep(max(0.0, due - time.monotonic()))
            self.count += 1
            self.sent_at[self.count] = time.monotonic()
            for name, values in self.values(self.count).items():
                identifier, data = self.codec.encode(name, values, self.count)
                self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
            self.bus.send(can.Message(arbitration_id=0x390, data=bytes(8), is_extended_id=False))
            for identifier in self.foreign:
                self.other.send(can.Message(arbitration_id=identifier, data=bytes(8), is_extended_id=False))

    def swallow(self) -> None:
        """Keep the other participant's buffer empty."""
        while self.running:
            self.other.recv(0.5)

    def listen(self) -> None:
        """Take the command frames."""
        last = None
        while self.running:
            message = self.bus.recv(0.5)
            now = time.monotonic()
            if message is None or message.arbitration_id != self.codec.command.arbitration_id:
                continue
            try:
                decoded = self.codec.decode(message.arbitration_id, bytes(message.data))
            except FrameError:
                self.bad_commands += 1
                continue
            self.command_frames += 1
            if last is not None and decoded.counter is not None:
                self.lost_commands += (decoded.counter - last - 1) % 256
            last = decoded.counter
            if decoded.values["enable"]:
                self.commands.setdefault(round(decoded.values["retract_current"] * 1e5), now)


def machine(channel: str, foreign: bool, pipe: Any) -> None:
    """The machine's process: begins to count on the first word, ends on the second and hands over what it has seen."""
    ecu = Ecu(channel, foreign)
    ecu.start()
    pipe.recv()
    ecu.commands.clear()
    first = ecu.command_frames
    ecu.wanted = True
    pipe.recv()
    ecu.running = False
    ecu.join()
    time.sleep(0.3)
    pipe.send(
        {
            "sent_at": ecu.sent_at, "commands": ecu.commands, "count": ecu.count, "start_at": ecu.start_at,
            "command_frames": ecu.command_frames - first, "lost": ecu.lost_commands, "bad": ecu.bad_commands,
        }
    )  # fmt: skip
    pipe.recv()
    os._exit(0)  # the bus of python-can-remote waits for a server that may be gone


def die_with_us() -> None:
    """In a child: end with the benchmark, also where that is killed (prctl PR_SET_PDEATHSIG)."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)


def table(rows: list[tuple[str, str]]) -> str:
    """Two columns as a Markdown table."""
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])


def percentiles(values: list[float]) -> str:
    """Median, p99 and largest [ms]."""
    if not values:
        return "none"
    p50, p99 = np.percentile(values, [50, 99]) * 1e3
    return f"{p50:.2f} / {p99:.2f} / {max(values) * 1e3:.2f} ms"


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0, help="duration of the measurement [s] (default: 600)")
    parser.add_argument("--no-foreign", action="store_true", help="leave the other participant's frames out")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the numbers to this file too")
    options = parser.parse_args()
    python = sys.executable
    server = subprocess.Popen(
        [python, "-m", "boom_can_bridge.bus_server", "--port", "0"],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=die_with_us,
    )
    channel = server.stdout.readline().split()[-1]
    arguments = ["interface:=remote", f"channel:={channel}", "rise_rate:=1000.0"]
    command = [python, "-m", "boom_can_bridge.bridge_node", "--ros-args"]
    bridge = subprocess.Popen([*command, *(word for a in arguments for word in ("-p", a))], preexec_fn=die_with_us)
    context = multiprocessing.get_context("spawn")
    pipe, other_end = context.Pipe()
    other = context.Process(target=machine, args=(channel, not options.no_foreign, other_end), daemon=True)
    rclpy.init()
    node = rclpy.create_node("can_latency")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    heard: list[tuple[int, float]] = []
    topics = {"joint_states": 0, "hose_pressure": 0, "rod_pressure": 0, "solenoid_currents": 0}

    def on_hose(message: FluidPressure) -> None:
        now = time.monotonic()
        topics["hose_pressure"] += 1
        heard.append((round((message.fluid_pressure - 101325 - 1e6) / 1e3), now))

    def count(name: str) -> object:
        def callback(_message: object) -> None:
            topics[name] += 1

        return callback

    deep = qos.SENSOR_DATA
    node.create_subscription(FluidPressure, "/boom/hose_pressure", on_hose, deep)
    node.create_subscription(FluidPressure, "/boom/rod_pressure", count("rod_pressure"), deep)
    node.create_subscription(JointState, "/joint_states", count("joint_states"), deep)
    node.create_subscription(SolenoidCurrents, "/boom/solenoid_currents", count("solenoid_currents"), deep)
    publisher = node.create_publisher(SolenoidCurrents, "/boom/current_command", qos.COMMAND)
    published: list[tuple[int, float]] = []

    def on_timer() -> None:
        message = SolenoidCurrents()
        message.header.stamp = node.get_clock().now().to_msg()
        code = 10_000 + len(published) % 40_000  # 0.1 to 0.5 A in steps of 10 uA
        message.retract = code * 1e-5
        published.append((code, time.monotonic()))
        publisher.publish(message)

    node.create_timer(PERIOD_S, on_timer)
    client = node.create_client(SetBool, "/boom_can_bridge/enable")
    other.start()
    end = time.monotonic() + PATIENCE_S
    enabled = False
    while not enabled and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
        if client.service_is_ready():
            future = client.call_async(SetBool.Request(data=True))
            executor.spin_until_future_complete(future, timeout_sec=2.0)
            enabled = bool(future.done() and future.result().success)
            time.sleep(0.0 if enabled else 0.05)
    if not enabled:
        print("can_latency: the bridge did not come up", file=sys.stderr)
        return 2
    settle = time.monotonic() + 1.0
    while time.monotonic() < settle:
        executor.spin_once(timeout_sec=0.1)
    process = psutil.Process(bridge.pid)
    first, before = len(published), dict(topics)
    loads = os.getloadavg()[0]
    cpu, begin = sum(process.cpu_times()[:2]), time.monotonic()
    pipe.send("begin")
    # The machine begins half way between two frames, within 15 ms: until then what is heard does not count.
    while time.monotonic() - begin < options.seconds:
        executor.spin_once(timeout_sec=0.1)
    elapsed = time.monotonic() - begin
    used = sum(process.cpu_times()[:2]) - cpu
    last = len(published)
    memory = process.memory_info().rss
    pipe.send("end")
    tail = time.monotonic() + 0.5
    while time.monotonic() < tail:
        executor.spin_once(timeout_sec=0.1)
    seen = pipe.recv()
    pipe.send("bye")
    sent_at, start_at, sent_now = seen["sent_at"], seen["start_at"], seen["count"]
    frames = sent_now - start_at
    # In order: each message belongs to the next frame that carries its code, and came after it was sent.
    up: list[float] = []
    position = start_at
    for code, when in heard:
        if when < sent_at[start_at + 1]:
            continue
        k = position + 1
        while k <= sent_now and k % CODES != code:
            k += 1
        if k <= sent_now and when >= sent_at[k]:
            up.append(when - sent_at[k])
            position = k
    total = {name: number - before[name] for name, number in topics.items()}
    down = []
    for code, when in published[max(first, last - 39_000) : last]:
        arrived = seen["commands"].get(code)
        if arrived is not None and 0 <= arrived - when < 1:
            down.append(arrived - when)
    considered = last - max(first, last - 39_000)
    rows = [
        (
            "duration",
            f"{elapsed:.0f} s, load average {loads:.1f} to {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores",
        ),
        ("frames of the ECU and of others", f"{5 * frames} + {0 if options.no_foreign else 5 * frames}"),
        ("frames whose message did not arrive", f"{frames - len(up)} of {frames} (pressures)"),
        ("messages of each topic", ", ".join(f"{name} {number}" for name, number in total.items())),
        ("frame to topic, p50 / p99 / largest", percentiles(up)),
        ("command frames, lost, bad", f"{seen['command_frames']}, {seen['lost']}, {seen['bad']}"),
        ("commands published, not sent as a frame", f"{considered}, {considered - len(down)}"),
        ("command to frame, p50 / p99 / largest", percentiles(down)),
        ("CPU of the bridge", f"{100 * used / elapsed:.1f} %"),
        ("memory of the bridge", f"{memory / 1e6:.0f} MB"),
    ]
    print(table(rows))
    if options.json:
        options.json.write_text(json.dumps(dict(rows), indent=1) + "\n")
    bridge.terminate()
    bridge.wait(10)
    server.terminate()
    server.wait(10)
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    sys.stdout.flush()
    os._exit(0)  # the bus of python-can-remote waits for a server that is gone


if __name__ == "__main__":
    raise SystemExit(main())
