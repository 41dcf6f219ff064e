"""Breaks the CAN chain in every way, once each, while the boom moves, and measures what happens. Run it alone.

    python benchmarks/can_faults.py [--only loss,kill_bridge] [--json F]

The chain: commands -> bridge -> bus server -> ECU stand-in with the simulated crane -> bus server -> bridge -> topics, each a
process of its own. In every case the boom is driven with 0.4 A first. Columns of the table, all in milliseconds:

- current zero: from the fault to the valve's current being zero; "stays" where the fault is one that motion survives, "gone"
  where what drives it is the process that was killed
- longest gap: the longest time without /joint_states after the fault
- sensors back: from the end of the fault (or the restart of the killed process) to the next /joint_states
- motion again: "by itself" while the same command goes on, "when enabled" where motion has to be enabled again

Exit status 1 where a current was not zero within 100 ms although it had to be, or motion came back by itself where it must not.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

CURRENT = 0.4
LARGEST_DELAY_MS = 100.0
PATIENCE = 20.0
_SHOWN_PERIOD = 0.01


@dataclass(frozen=True)
class Case:
    """One fault.

    closes    True: the current has to be zero within 100 ms; False: it has to flow on; None: either
    resumes   True: motion may come back by itself (short loss of frames); False: it must not
    """

    name: str
    title: str
    begin: Callable[[Chain], None]
    end: Callable[[Chain], None]
    closes: bool | None
    resumes: bool


@dataclass
class Result:
    """What was measured [ms]; None = did not happen."""

    name: str
    title: str
    current_zero_ms: float | None
    longest_gap_ms: float
    sensors_back_ms: float | None
    motion_again: str
    ok: bool


class Chain:
    """The processes, and a node that commands and looks on."""

    def __init__(self, folder: Path) -> None:
        import rclpy
        from rcl_interfaces.srv import SetParameters
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import JointState
        from std_srvs.srv import SetBool, Trigger

        from boom_interfaces.msg import GroundTruth, SolenoidCurrents
        from boom_node import qos

        self._folder = folder
        self.wanted = 0.0
        self.joints: list[float] = []
        self.currents: list[tuple[float, float]] = []
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        rclpy.init()
        self.node = rclpy.create_node("can_faults")
        self._commands = self.node.create_publisher(
            SolenoidCurrents, "/boom/current_command", qos.BY_TOPIC["/boom/current_command"]
        )
        self.node.create_subscription(
            JointState, "/joint_states", lambda _: self.joints.append(time.monotonic()), qos.SENSOR_DATA
        )
        self.node.create_subscription(GroundTruth, "/boom/ground_truth", self._on_truth, qos.SENSOR_DATA)
        self._set = self.node.create_client(SetParameters, "/boom_ecu/set_parameters")
        self._reset = self.node.create_client(Trigger, "/boom_ecu/reset")
        self._enable = self.node.create_client(SetBool, "/boom_can_bridge/enable")
        self.commanding = True
        self._timer = self.node.create_timer(0.01, self._command)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._ending = False
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        port = self.start("server", "boom_can_bridge.bus_server", ["--port", "0"])
        self.port = int(port.rstrip("/").rsplit(":", 1)[1])
        self.start_ecu()
        self.start_bridge()

    def _spin(self) -> None:
        while not self._ending:
            self._executor.spin_once(timeout_sec=0.1)

    def _on_truth(self, message: Any) -> None:
        self.currents.append((time.monotonic(), float(message.values[-1])))

    def _command(self) -> None:
        from boom_interfaces.msg import SolenoidCurrents

        if self.commanding:
            message = SolenoidCurrents(extend=self.wanted)
            message.header.stamp = self.node.get_clock().now().to_msg()
            self._commands.publish(message)

    # ------------------------------------------------------------------------------------------------------ processes

    def start(self, name: str, module: str, arguments: list[str]) -> str:
        """Starts a process; returns the channel where it is the server, which says when it is ready."""
        log = (self._folder / f"{name}.log").open("ab")
        out = subprocess.PIPE if name == "server" else log
        self.processes[name] = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdout=out,
            stderr=log,
            env=dict(os.environ, PYTHONUNBUFFERED="1"),
        )
        if name != "server":
            return ""
        pipe = self.processes[name].stdout
        found = re.search(rb"ws://\S+", pipe.readline() if pipe else b"")
        if not found:
            raise SystemExit("the bus server did not start")
        return found[0].decode()

    def _parameters(self, **values: object) -> list[str]:
        values = {"interface": "remote", "channel": f"ws://127.0.0.1:{self.port}/", **values}
        return [
            "--ros-args",
            *(word for k, v in values.items() for word in ("-p", f"{k}:={str(v) if v is not True else 'true'}")),
        ]

    def start_server(self) -> None:
        """Again, on the same port."""
        self.start("server", "boom_can_bridge.bus_server", ["--port", str(self.port)])

    def start_ecu(self) -> None:
        """The ECU stand-in, which shows the currents that it drives."""
        self.start("ecu", "boom_sim.ecu_node", self._parameters(ground_truth=True))

    def start_bridge(self) -> None:
        """The bridge, active at once."""
        self.start("bridge", "boom_can_bridge.bridge_node", self._parameters(autostart=True))

    def kill(self, name: str) -> None:
        """kill -9."""
        self.processes[name].kill()
        self.processes[name].wait()

    def signal(self, name: str, number: int) -> None:
        """For pausing and going on."""
        self.processes[name].send_signal(number)

    def close(self) -> None:
        """Ends all."""
        import rclpy

        for process in self.processes.values():
            process.send_signal(signal.SIGCONT)
            process.terminate()
        for process in self.processes.values():
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._ending = True
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()

    # ------------------------------------------------------------------------------------------------------- services

    def call(self, client: Any, request: Any) -> Any:
        """Waits for the service and its answer; None where neither comes in time."""
        if not client.wait_for_service(PATIENCE):
            return None
        future = client.call_async(request)
        end = time.monotonic() + PATIENCE
        while not future.done() and time.monotonic() < end:
            time.sleep(0.001)
        return future.result() if future.done() else None

    def faults(self, **values: object) -> None:
        """Parameters ``fault_NAME`` of the ECU stand-in."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        request = SetParameters.Request()
        request.parameters = [Parameter(f"fault_{k}", value=v).to_parameter_msg() for k, v in values.items()]
        answer = self.call(self._set, request)
        if answer is None or not all(r.successful for r in answer.results):
            raise SystemExit(f"the ECU stand-in did not take the fault {values}: {answer}")

    def neutral(self) -> None:
        """No faults."""
        self.faults(loss=0.0, burst=0.0, bit_flip=0.0, delay=0.0, jitter=0.0, reorder=0.0, frozen_counter=False)
        self.faults(bus_off=0.0, restart=0.0)

    def enable(self, on: bool) -> bool:
        """Asks the bridge for motion, or takes it away."""
        from std_srvs.srv import SetBool

        answer = self.call(self._enable, SetBool.Request(data=on))
        return answer is not None and bool(answer.success)

    # -------------------------------------------------------------------------------------------------------- looking

    def current(self) -> float:
        """That the ECU drives now [A]; 0 where nothing is shown."""
        if not self.currents or time.monotonic() - self.currents[-1][0] > 0.5:
            return 0.0
        return self.currents[-1][1]

    def until(self, what: str, done: Callable[[], bool], patience: float = PATIENCE) -> float:
        """Waits; returns how long it took [s]. Ends the program with status 3 where it does not happen."""
        begin = time.monotonic()
        while not done():
            if time.monotonic() - begin > patience:
                logs = "".join(f"\n{p.stem}: ...{p.read_text()[-600:]}" for p in sorted(self._folder.glob("*.log")))
                print(f"can_faults: {what} did not happen within {patience:g} s{logs}", file=sys.stderr)
                raise SystemExit(3)
            time.sleep(0.002)
        return time.monotonic() - begin

    def flowing(self) -> bool:
        """Whether sensor samples have come at 100 Hz lately."""
        return len([t for t in self.joints[-60:] if time.monotonic() - t < 0.3]) > 20

    def ask_for_motion(self) -> None:
        """Enables motion and waits for the current; again where the bridge takes the enabling back."""
        end = time.monotonic() + PATIENCE
        while self.current() < 0.99 * CURRENT:
            if time.monotonic() > end:
                self.until("current in the valve", lambda: False, 0.0)
            self.wanted = 0.0
            self.until("sensors on the topics", self.flowing)
            self.enable(False)
            self.until("motion being enabled", lambda: self.enable(True))
            time.sleep(0.1)
            self.wanted = CURRENT
            patience = time.monotonic() + 2.0
            while self.current() < 0.99 * CURRENT and time.monotonic() < patience:
                time.sleep(0.005)

    def drive(self) -> None:
        """From whatever state: crane reset, motion enabled, current flowing."""
        from std_srvs.srv import Trigger

        self.wanted = 0.0
        self.until("sensors on the topics", self.flowing)
        if self.call(self._reset, Trigger.Request()) is None:
            self.until("an answer of the ECU stand-in", lambda: False, 0.0)
        time.sleep(0.5)
        self.until("sensors on the topics", self.flowing)
        self.ask_for_motion()
        time.sleep(0.3)


def silent(chain: Chain) -> None:
    """The source of the commands is gone."""
    chain.commanding = False


def speaking(chain: Chain) -> None:
    """The source of the commands is there again."""
    chain.commanding = True


def _fault(**values: object) -> Callable[[Chain], None]:
    return lambda chain: chain.faults(**values)


def _kill(name: str) -> Callable[[Chain], None]:
    return lambda chain: chain.kill(name)


def _signal(name: str, number: int) -> Callable[[Chain], None]:
    return lambda chain: chain.signal(name, number)


_STOP, _GO = signal.SIGSTOP, signal.SIGCONT
_MEND = Chain.neutral
CASES = (
    Case("loss", "10 % of the frames lost, both ways", _fault(loss=0.1), _MEND, None, True),
    Case("burst", "bursts of 30 ms without frames", _fault(burst=0.01, burst_duration=0.03), _MEND, None, True),
    Case("bit_flip", "a flipped bit in 10 % of the frames", _fault(bit_flip=0.1), _MEND, None, True),
    Case("reorder", "10 % of the frames overtaken", _fault(reorder=0.1), _MEND, None, True),
    Case("delay", "all frames 20 to 40 ms late", _fault(delay=0.02, jitter=0.02), _MEND, None, True),
    Case("frozen_ecu", "counters of the ECU's frames stand still", _fault(frozen_counter=True), _MEND, True, False),
    Case("bus_off", "ECU bus-off for 1 s", _fault(bus_off=1.0), _MEND, True, False),
    Case("restart", "ECU restarts, silent for 0.5 s", _fault(restart=0.5), _MEND, True, False),
    Case("commands_end", "commands end for 1 s", silent, speaking, True, True),
    Case("kill_bridge", "kill -9 of the bridge", _kill("bridge"), Chain.start_bridge, True, False),
    Case("kill_server", "kill -9 of the bus server", _kill("server"), Chain.start_server, True, False),
    Case("kill_ecu", "kill -9 of the ECU stand-in", _kill("ecu"), Chain.start_ecu, None, False),
    Case("pause_bridge", "bridge stands still for 1 s", _signal("bridge", _STOP), _signal("bridge", _GO), True, False),
    Case(
        "pause_server", "bus server stands still for 1 s", _signal("server", _STOP), _signal("server", _GO), True, False
    ),
)


def measure(chain: Chain, case: Case, brief: bool) -> Result:
    """Drives, breaks, looks, mends, looks again."""
    chain.drive()
    begin = time.monotonic()
    case.begin(chain)
    time.sleep(0.6 if brief else 1.0)
    zero = next((t for t, amps in list(chain.currents) if t > begin and amps == 0.0), None)
    mended = time.monotonic()
    case.end(chain)
    moved_by_itself = False
    end = time.monotonic() + (1.0 if brief else 2.0)
    while time.monotonic() < end and not (moved_by_itself and chain.flowing()):
        moved_by_itself |= chain.current() > 0.5 * CURRENT
        time.sleep(0.005)
    chain.until("sensors on the topics again", chain.flowing)
    times = [begin, *(t for t in list(chain.joints) if t > begin)]
    gap = max(b - a for a, b in itertools.pairwise(times))
    first = next((t for t in times[1:] if t > mended), None)
    if zero is None and chain.current() > 0.5 * CURRENT:
        motion = "never stopped"
    elif moved_by_itself:
        motion = "by itself"
    else:
        chain.ask_for_motion()
        motion = "when enabled"
    zero_ms = None if zero is None else 1e3 * (zero - begin)
    ok = case.closes is None or (zero_ms is not None and zero_ms <= LARGEST_DELAY_MS + 1e3 * _SHOWN_PERIOD)
    ok = ok and (case.resumes or motion == "when enabled")
    back = None if gap < 0.05 or first is None else 1e3 * (first - mended)
    return Result(case.name, case.title, zero_ms, 1e3 * gap, back, motion, ok)


def main() -> int:
    """Runs the cases and prints the table."""
    from boom_node import early

    early.settle()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    names = [case.name for case in CASES]
    parser.add_argument("--only", metavar="NAMES", help=f"comma-separated, of: {', '.join(names)}")
    parser.add_argument("--brief", action="store_true", help="look on half as long; does the same")
    parser.add_argument("--json", metavar="F", help="write the results as JSON")
    options = parser.parse_args()
    chosen = options.only.split(",") if options.only else names
    unknown = sorted(set(chosen) - set(names))
    if unknown:
        print(f"can_faults: no case {', '.join(unknown)}: there are {', '.join(names)}", file=sys.stderr)
        return 2
    results = []
    with tempfile.TemporaryDirectory() as folder:
        chain = Chain(Path(folder))
        try:
            print("| fault | current zero [ms] | longest gap of the sensors [ms] | sensors back [ms] | motion again |")
            print("|---|---|---|---|---|")
            for case in CASES:
                if case.name in chosen:
                    result = measure(chain, case, options.brief)
                    results.append(result)
                    stays = "gone" if case.name == "kill_ecu" else "stays"
                    zero = stays if result.current_zero_ms is None else f"{result.current_zero_ms:.0f}"
                    back = "-" if result.sensors_back_ms is None else f"{result.sensors_back_ms:.0f}"
                    mark = "" if result.ok else " NOT AS IT MUST BE"
                    print(
                        f"| {case.title} | {zero} | {result.longest_gap_ms:.0f} | {back} | {result.motion_again}{mark} |",
                        flush=True,
                    )
        finally:
            chain.close()
    print(f"load of the computer {os.getloadavg()[0]:.1f}")
    if options.json:
        Path(options.json).write_text(json.dumps([asdict(result) for result in results], indent=2) + "\n")
    return int(not all(result.ok for result in results))


if __name__ == "__main__":
    raise SystemExit(main())
