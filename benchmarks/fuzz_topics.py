"""Hostile messages over all topics, services and actions of all nodes, as processes. What must not be is counted.

    ./boom python benchmarks/fuzz_topics.py --messages 10000 --seed 1

Two systems one after the other, each in a ROS domain of its own on the loopback: simulation, controller, watch, recorder,
tip pose and a replay of the recorded angle; then bus, ECU stand-in, bridge, enable and a replay of the recorded currents.
Between the messages an operator sets things right and moves the boom, so that something is at stake. A message is one
publication, request or goal:

    built       fields of the right type with values at which something turns over: stamps, NaN, texts, lengths, orders
    near        a good message with one field changed
    damaged     the bytes of a good message, damaged
    other type  another type on the same topic
    burst       one of these 50 times (counts as 50)

Counted: nodes dead; internal errors (a callback raised: a controlled stop, but a mistake of ours); other tracebacks; nodes that
do not answer within 5 s; processes above 1.5 GB; currents that flow 100 ms after the last command (20 ms more for measuring).
Exit status 1 where anything was counted. The same seed sends the same messages; what the nodes do is up to the computer, too.
"""

from __future__ import annotations

import argparse
import array
import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

sys.path.insert(0, str(Path(__file__).parent))
from fuzzing import FLOATS, MEMORY_BYTES, NUMBERS, SECONDS, TEXTS, mutate

from boom_bringup import environment
from boom_bringup.demo_processes import free_bus
from boom_interfaces.msg import ControllerState, MachineConfiguration, SolenoidCurrents
from boom_interfaces.srv import SetPayload
from boom_node import qos
from boom_node.motion_action import NAME, MotionAction
from boom_node.stamps import to_ns

ROOT = Path(__file__).parents[1]
BAG = str(ROOT / "bags/healthy/extended")
JOINT = "inner_boom_joint"
SHARED = "/boom/current_command,/joint_states,/boom/hose_pressure,/boom/rod_pressure,/boom/solenoid_currents"
TOPICS: dict[str, Any] = {
    "/joint_states": JointState, "/boom/hose_pressure": FluidPressure, "/boom/rod_pressure": FluidPressure,
    "/boom/solenoid_currents": SolenoidCurrents, "/boom/current_command": SolenoidCurrents, "/boom/reference": JointState,
    "/boom/machine_configuration": MachineConfiguration, "/boom/joint_trajectory": JointTrajectory,
    "/boom/emergency_stop": Bool, "/robot_description": String, "/clock": Clock, "/diagnostics": DiagnosticArray,
    "/boom/controller_state": ControllerState, "/boom_can_bridge/motion_enabled": Bool, "/boom_recorder/ready": Bool,
}  # fmt: skip
OTHER_TYPES = (String, Float64, Bool)
PARAMETER_SERVICES = {
    "set_parameters": SetParameters, "get_parameters": GetParameters, "describe_parameters": DescribeParameters,
    "list_parameters": ListParameters,
}  # fmt: skip
PARAMETERS = (
    "mode", "current_ramp", "force_pole", "feedback_pole", "blend", "feedback_rate", "machine", "fault_loss", "fault_burst",
    "fault_direction", "fault_restart", "seed", "rate", "joint_name", "threshold", "start_type_description_service",
)  # fmt: skip
BURST, LOOK_EVERY, HEAL_EVERY = 50, 100, 40
ALLOWED_S = 0.12
"""100 ms, and 20 ms for what is measured over topics."""
READY_S = 60.0
FAILURES = ("dead", "internal errors", "tracebacks", "not answering", "over 1.5 GB", "current after 100 ms")
_INTERNAL = re.compile(r"internal error, (.*)")


def node(module: str, *parameters: str) -> list[str]:
    """Command line of a node."""
    return [sys.executable, "-m", module, "--ros-args", *(word for p in parameters for word in ("-p", p))]


# ----------------------------------------------------------------------------------------------------------- messages


def hostile(random: Random, kind: str, depth: int = 0) -> Any:
    """A value for a field of the type `kind`, as rclpy writes types."""
    if match := re.fullmatch(r"(?:sequence<(.*?)(?:, \d+)?>|(.*)\[(\d+)\])", kind):
        inner = match[1] or match[2]
        size = int(match[3]) if match[3] else random.choice((0, 0, 1, 1, 2, 3, 17, 500 if depth == 0 else 3))
        if not match[3] and depth == 0 and random.random() < 0.02 and "/" not in inner:
            size = 20_000
        first = [hostile(random, inner, depth + 1) for _ in range(min(size, 20))]
        values = (first * (size // max(len(first), 1) + 1))[:size]
        return array.array(_CODES[inner], values) if inner in _CODES else values
    if kind in ("float", "double"):
        value = random.choice((*FLOATS, 0.3, -0.3, 1e5, 1e7))
        return value if kind == "double" or abs(value) < 3e38 or value != value else 0.0
    if kind == "boolean":
        return random.random() < 0.5
    if kind in ("octet", "byte"):
        return bytes([random.randrange(256)])
    if "int" in kind and "/" not in kind:
        bits = int(re.sub(r"\D", "", kind))
        value = random.choice(NUMBERS) % 2**bits
        return value if kind.startswith("u") or value < 2 ** (bits - 1) else value - 2**bits
    if kind.startswith("string"):
        return random.choice((*TEXTS, JOINT, "tz17", "outer_boom_joint"))
    package, name = kind.split("/")
    return filled(random, getattr(import_module(f"{package}.msg"), name), depth)


_CODES = {"double": "d", "float": "f", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
          "int64": "q", "uint64": "Q"}  # fmt: skip


def filled(random: Random, kind: Any, depth: int = 0) -> Any:
    """A message (or a request, or a goal) of hostile values."""
    message = kind()
    for field, type_ in kind.get_fields_and_field_types().items():
        if random.random() < 0.8:
            with contextlib.suppress(AssertionError):  # rclpy refuses what the wire cannot hold
                setattr(message, field, hostile(random, type_, depth))
    if depth == 0 and hasattr(message, "header") and random.random() < 0.5:
        stamp(message, time.time())
    return message


def stamp(message: Any, now: float) -> Any:
    """The message with the stamp `now` [s]."""
    message.header.stamp.sec, message.header.stamp.nanosec = int(now), int(now % 1 * 1e9)
    return message


def good(random: Random, topic: str) -> Any:
    """A message such as the topic has every day; it may move the boom."""
    kind = TOPICS[topic]
    message = kind()
    if kind is JointState:
        message = JointState(name=[JOINT], position=[random.uniform(0.25, 0.5)], velocity=[0.0])
    elif kind is FluidPressure:
        message = FluidPressure(fluid_pressure=random.uniform(1e6, 1e7))
    elif kind is SolenoidCurrents:
        message = SolenoidCurrents(retract=0.0, extend=random.choice((0.0, 0.4)))
    elif kind is MachineConfiguration:
        message = MachineConfiguration(machine="tz17", outer_boom_angle=0.28, telescope_length=2.2)
    elif kind is JointTrajectory:
        message = path([(random.uniform(2.0, 6.0), random.uniform(0.25, 0.6))])
    elif kind is String:
        message = String(data=(ROOT / "src/boom_description/boom_description/urdf/epsilon_tz17.urdf").read_text())
    return stamp(message, time.time()) if hasattr(message, "header") and kind is not JointTrajectory else message


def path(points: list[tuple[float, float]]) -> JointTrajectory:
    """A trajectory from rest to rest."""
    message = JointTrajectory(joint_names=[JOINT])
    for when, angle in points:
        point = JointTrajectoryPoint(positions=[angle], velocities=[0.0], accelerations=[0.0])
        point.time_from_start.sec, point.time_from_start.nanosec = int(when), int(when % 1 * 1e9)
        message.points.append(point)
    return message


def near(random: Random, message: Any) -> Any:
    """The message with one field, somewhere in it, exchanged for a hostile one."""
    place, types = message, message.get_fields_and_field_types()
    while True:
        field = random.choice(list(types))
        inner = getattr(place, field)
        if hasattr(inner, "get_fields_and_field_types") and random.random() < 0.8:
            place, types = inner, inner.get_fields_and_field_types()
            continue
        if (
            isinstance(inner, list)
            and inner
            and hasattr(inner[0], "get_fields_and_field_types")
            and random.random() < 0.8
        ):
            place = random.choice(inner)
            types = place.get_fields_and_field_types()
            continue
        with contextlib.suppress(AssertionError):
            setattr(place, field, hostile(random, types[field], 0 if isinstance(inner, list | array.array) else 1))
        return message


# ------------------------------------------------------------------------------------------------------------ systems


class System:
    """Processes in a domain of their own, an operator and an attacker in this one.

    Args:
        programs: command lines by name of the node.
        services: of the nodes, by name.
        topics: on which messages are sent.
        folder: for their output.
    """

    def __init__(
        self, programs: dict[str, list[str]], services: dict[str, Any], topics: list[str], folder: Path
    ) -> None:
        self.counts: Counter[str] = Counter()
        self.failures: Counter[str] = Counter()
        self.currents: Counter[str] = Counter()
        self._stack = contextlib.ExitStack()
        domain = self._stack.enter_context(environment.private_domain())
        variables = environment.for_processes(os.environ | {"BOOM_NETWORK": "loopback"}) | {"ROS_DOMAIN_ID": domain}
        self._folder, self._variables = folder, variables | {"PYTHONFAULTHANDLER": "1"}  # SIGABRT shows where it hangs
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(domain))
        self.node = rclpy.create_node("attacker", context=self.context)
        self._topics = topics
        self._sent_to = {name: self._publisher(TOPICS[name], name) for name in topics}
        # one participant cannot offer two types on one topic
        self._others: dict[tuple[str, Any], Any] = {}
        self._other_nodes = []
        for kind in OTHER_TYPES:
            context = rclpy.Context()
            rclpy.init(context=context, domain_id=int(domain))
            other = rclpy.create_node(f"attacker_{kind.__name__.lower()}", context=context)
            self._other_nodes.append(other)
            self._others |= {
                (name, kind): other.create_publisher(kind, name, 10) for name in topics[:4] if TOPICS[name] is not kind
            }
        self._services = {
            **services,
            **{f"/{n}/{s}": k for n in programs if not n.startswith("_") for s, k in PARAMETER_SERVICES.items()},
        }
        self._clients = {name: self.node.create_client(kind, name) for name, kind in self._services.items()}
        self._action = ActionClient(self.node, MotionAction, f"/boom_controller/{NAME}")
        self._commanded = self._faked_until = 0.0
        self._watch()
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self._running = True
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        for name, command in programs.items():
            self._start(name, command)
        self.peak = 0.0
        self.slowest = 0.0

    def _publisher(self, kind: Any, topic: str) -> Any:
        latched = (
            topic in ("/boom/machine_configuration", "/robot_description", "/boom/emergency_stop") or "enabled" in topic
        )
        durability = QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE
        profile = QoSProfile(depth=100, reliability=QoSReliabilityPolicy.RELIABLE, durability=durability)
        if topic == "/boom/current_command":
            profile = qos.BY_TOPIC[topic]
        return self.node.create_publisher(kind, topic, profile)

    def _start(self, name: str, command: list[str]) -> None:
        log = (self._folder / f"{name}.log").open("ab")
        self.processes[name] = subprocess.Popen(
            command, env=self._variables, stdout=log, stderr=subprocess.STDOUT, cwd=self._folder
        )
        log.close()
        if name == "_bus":
            time.sleep(1.0)

    def _spin(self) -> None:
        while self._running:
            with contextlib.suppress(Exception):  # answers that we no longer wait for
                self.executor.spin_once(timeout_sec=0.02)

    # ------------------------------------------------------------------------------------------------- what is at stake

    def _watch(self) -> None:
        """Currents that flow although nobody has commanded any for 100 ms. Only stamps of good messages are looked at."""
        best = QoSProfile(depth=50, reliability=QoSReliabilityPolicy.BEST_EFFORT)
        self.node.create_subscription(SolenoidCurrents, "/boom/current_command", self._on_command, best)
        self.node.create_subscription(SolenoidCurrents, "/boom/solenoid_currents", self._on_current, best)

    def _on_command(self, message: SolenoidCurrents) -> None:
        self._commanded = time.time()

    def _on_current(self, message: SolenoidCurrents) -> None:
        self.currents["seen"] += 1
        if message.header.frame_id or not (message.retract > 0.02 or message.extend > 0.02):
            return
        self.currents["flowing"] += 1
        acted = to_ns(message.header.stamp) * 1e-9
        if not 0.0 < time.time() - acted < 1.0 or not self._commanded or time.monotonic() < self._faked_until:
            return
        late = acted - self._commanded
        self.slowest = max(self.slowest, late)
        if late > ALLOWED_S:
            self.failures[f"current after 100 ms: {1e3 * late:.0f} ms"] += 1
            self.counts["current after 100 ms"] += 1

    # ---------------------------------------------------------------------------------------------------------- attacker

    def send(self, random: Random) -> tuple[str, int]:
        """One hostile message: what it was, and how many it counts for."""
        way = random.choices(
            ("built", "near", "damaged", "other type", "burst", "service", "action"), (25, 30, 10, 4, 2, 22, 7)
        )[0]
        if way == "service":
            name = random.choice(list(self._clients))
            client, kind = self._clients[name], self._services[name]
            if client.service_is_ready():
                request = filled(random, kind.Request)
                if kind is SetParameters and random.random() < 0.7:
                    request = SetParameters.Request(parameters=[filled(random, Parameter, 1)])
                    request.parameters[0].name = random.choice(PARAMETERS)
                    request.parameters[0].value.type = random.randrange(10)
                future = client.call_async(request)
                future.add_done_callback(lambda f: f.exception())
            return f"service {name.split('/')[-1]}", 1
        if way == "action":
            goal = MotionAction.Goal() if random.random() < 0.3 else filled(random, MotionAction.Goal)
            if random.random() < 0.5:
                goal.trajectory = near(random, good(random, "/boom/joint_trajectory"))
            if self._action.server_is_ready():
                future = self._action.send_goal_async(goal)
                if random.random() < 0.3:
                    future.add_done_callback(self._cancel)
            return "action", 1
        topic = random.choice(self._topics)
        if way == "other type":
            (name, kind) = random.choice(list(self._others))
            self._others[name, kind].publish(filled(random, kind))
            return "other type", 1
        message: Any
        if way == "damaged":
            message = mutate(random, serialize_message(good(random, topic)))[1] or b"\0"
        elif way == "near" or (way == "burst" and random.random() < 0.5):
            message = near(random, good(random, topic))
        else:
            message = filled(random, TOPICS[topic])
        count = BURST if way == "burst" else 1
        for _ in range(count):
            if (
                topic == "/boom/solenoid_currents"
            ):  # what shows currents that nobody measured must not count as currents
                self._faked_until = time.monotonic() + 0.3
            self._sent_to[topic].publish(message)
        return way, count

    @staticmethod
    def _cancel(future: Any) -> None:
        with contextlib.suppress(Exception):
            if future.result().accepted:
                future.result().cancel_goal_async()

    # ---------------------------------------------------------------------------------------------------------- operator

    def heal(self, random: Random) -> None:
        """What an operator does: clears the stop, configures, resumes, moves."""
        self._sent_to["/boom/emergency_stop"].publish(Bool(data=False))
        for topic in ("/boom/machine_configuration", "/robot_description"):
            if topic in self._sent_to:
                self._sent_to[topic].publish(good(random, topic))
        for name, request in (
            ("/boom_simulation/pause", SetBool.Request(data=False)), ("/boom_simulation/set_payload", SetPayload.Request(mass=0.0)),
            ("/boom_simulation/reset", Trigger.Request()), ("/boom_ecu/reset", Trigger.Request()),
            ("/boom_controller/resume", Trigger.Request()),
            ("/boom_can_bridge/enable", SetBool.Request(data=True)),
        ):  # fmt: skip
            if name in self._clients:
                for transition in (1, 3):  # configure, activate
                    changed = ChangeState.Request()
                    changed.transition.id = transition
                    owner = name.rsplit("/", 1)[0] + "/change_state"
                    if owner in self._clients:
                        self._ask(owner, changed)
                self._ask(name, request)
        if "/boom/joint_trajectory" in self._sent_to:
            time.sleep(0.15)
            self._sent_to["/boom/joint_trajectory"].publish(path([(3.0, random.uniform(0.35, 0.55))]))
            time.sleep(0.1)

    def _ask(self, name: str, request: Any, patience: float = SECONDS) -> bool:
        client = self._clients[name]
        if not client.wait_for_service(timeout_sec=patience):
            return False
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        done = answered.wait(patience)
        if not done:
            client.remove_pending_request(future)
        return done

    def look(self) -> None:
        """Who has died, does not answer, takes too much memory, or has something in its log."""
        for name, process in list(self.processes.items()):
            if process.poll() is not None:
                if name == "_enable" and process.returncode == 0:
                    continue
                self._fail("dead", f"{name}, status {process.returncode}")
                del self.processes[name]
                continue
            peak = [
                line
                for line in Path(f"/proc/{process.pid}/status").read_text().splitlines()
                if line.startswith("VmHWM")
            ]
            memory = 1024.0 * int(peak[0].split()[1]) if peak else 0.0  # none where it is just ending
            self.peak = max(self.peak, memory)
            if memory > MEMORY_BYTES:
                self._fail("over 1.5 GB", name)
            if not name.startswith("_") and not self._ask(f"/{name}/list_parameters", ListParameters.Request()):
                self._fail("not answering", name)

    def _fail(self, column: str, what: str) -> None:
        self.counts[column] += 1
        self.failures[f"{column}: {what}"] += 1

    def ready(self) -> None:
        """Wait until every node answers."""
        for name in self.processes:
            if not name.startswith("_") and not self._ask(
                f"/{name}/list_parameters", ListParameters.Request(), READY_S
            ):
                raise SystemExit(f"{name} does not begin: {(self._folder / f'{name}.log').read_text()[-500:]}")

    def close(self) -> None:
        """End all, and read their logs."""
        for process in self.processes.values():
            process.send_signal(signal.SIGTERM)
        for name, process in self.processes.items():
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                self._fail("not answering", f"{name} to SIGTERM")
                process.send_signal(signal.SIGABRT)
                process.wait(20.0)
                print((self._folder / f"{name}.log").read_text(errors="replace")[-3000:])
        self._running = False
        self._thread.join()
        # Our own node stays: to take away a writer that has sent damaged bytes is a segmentation fault in Fast DDS 2.14.
        self._stack.close()
        for log in sorted(self._folder.glob("*.log")):
            text = log.read_text(errors="replace")
            if "Timeout (0:00:" in text:  # `boom_node.shell`: not counted, as it did end
                print(f"{log.stem} had done all it had to, and the middleware did not let go of it:\n{text[-3000:]}")
            own = _INTERNAL.findall(text)
            for line in own:
                self._fail("internal errors", f"{log.stem}: {line[:150]}")
            for _ in range(text.count("Traceback (most recent call last)") - _chained(text, len(own))):
                self._fail("tracebacks", log.stem)


def _chained(text: str, own: int) -> int:
    """Tracebacks that belong to internal errors: one each, and those that they came from."""
    return (
        own + sum(text.count(words) for words in ("During handling of the above", "direct cause of the following"))
        if own
        else 0
    )


def over_topics(folder: Path) -> System:
    """Simulation and controller, and all who listen to them."""
    programs = {
        "boom_simulation": node("boom_sim.simulation_node", "sensors:=ideal", f"shared_topics:={SHARED}"),
        "boom_controller": node("boom_controller.controller_node", f"shared_topics:={SHARED}", "longest_cycle:=0.2"),
        "boom_diagnosis_watch": node("boom_monitor.watch_node"),
        "boom_tip_pose": node("boom_description.tip_pose_node"),
        "boom_recorder": node(
            "boom_recording.recorder_node", f"output:={folder / 'bag'}", 'topics:=["*"]', "required_topics:=[/joint_states]"
        ),
        "boom_replay": node("boom_recording.replay_node", f"bag:={BAG}", "what:=reference", "loop:=true", "wait_timeout:=3600.0"),
    }  # fmt: skip
    services = {
        "/boom_simulation/reset": Trigger, "/boom_simulation/pause": SetBool, "/boom_simulation/set_payload": SetPayload,
        "/boom_controller/resume": Trigger, "/boom_controller/emergency_stop": Trigger,
        "/boom_controller/change_state": ChangeState, "/boom_replay/pause": SetBool,
    }  # fmt: skip
    return System(programs, services, [t for t in TOPICS if "bridge" not in t], folder)


def over_can(folder: Path) -> System:
    """The bridge between topics and an ECU stand-in on a bus."""
    bus = free_bus()
    given = [f"{name}:={value}" for name, value in bus.items()]
    port = bus["channel"].rstrip("/").rpartition(":")[2]
    programs = {
        "_bus": [sys.executable, "-m", "boom_can_bridge.bus_server", "--port", port],
        "boom_ecu": node("boom_sim.ecu_node", "sensors:=ideal", *given),
        "boom_can_bridge": node("boom_can_bridge.bridge_node", "wait_for_bus:=true", f"shared_topics:={SHARED}", *given),
        "_enable": node("boom_can_bridge.enable_node", "wait_timeout:=3600.0"),
        "boom_replay": node("boom_recording.replay_node", f"bag:={BAG}", "loop:=true", "wait_for_motion:=true"),
    }  # fmt: skip
    services = {
        "/boom_ecu/reset": Trigger, "/boom_ecu/set_payload": SetPayload, "/boom_can_bridge/enable": SetBool,
        "/boom_can_bridge/change_state": ChangeState, "/boom_replay/pause": SetBool,
    }  # fmt: skip
    topics = [
        "/boom/current_command",
        "/boom/emergency_stop",
        "/boom_can_bridge/motion_enabled",
        "/clock",
        "/boom/solenoid_currents",
    ]
    return System(programs, services, topics, folder)


SYSTEMS: dict[str, tuple[Callable[[Path], System], float]] = {"topics": (over_topics, 0.7), "can": (over_can, 0.3)}
"""How each is made, and its share of the messages."""


def run(messages: int, seed: int, chosen: list[str]) -> int:
    """Send them all; print the table. Returns how much was counted."""
    total, begin = 0, time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fuzz-topics-") as temporary:
        for label in chosen:
            make, share = SYSTEMS[label]
            folder = Path(temporary) / label
            folder.mkdir()
            random, kinds = Random(f"{seed}:{label}"), Counter[str]()
            system = make(folder)
            try:
                system.ready()
                sent = since_look = since_heal = 0
                system.heal(random)
                while sent < share * messages:
                    try:
                        kind, count = system.send(random)
                    except Exception as error:  # what our own middleware refuses to send
                        kind, count = f"not sent ({type(error).__name__})", 0
                    kinds[kind] += count
                    sent, since_look, since_heal = sent + count, since_look + 1, since_heal + 1
                    time.sleep(random.choice((0.0, 0.0, 0.002, 0.01)))
                    if since_look >= LOOK_EVERY:
                        since_look = 0
                        system.look()
                    if since_heal >= HEAL_EVERY:
                        since_heal = 0
                        system.heal(random)
                system.look()
            finally:
                system.close()
            print(f"{label}: {sent} messages: " + ", ".join(f"{k} {n}" for k, n in sorted(kinds.items())))
            print("  " + ", ".join(f"{name} {system.counts[name]}" for name in FAILURES))
            print(
                f"  largest process {system.peak / 1e6:.0f} MB; current at most {1e3 * system.slowest:.0f} ms after a command"
            )
            for what, number in system.failures.most_common(20):
                print(f"  {number:5}  {what}")
            share_flowing = system.currents["flowing"] / max(system.currents["seen"], 1)
            print(f"  currents flowed in {100 * share_flowing:.0f} % of {system.currents['seen']} samples")
            total += sum(system.counts.values())
    print(f"seed {seed}, {time.monotonic() - begin:.0f} s: {total or 'nothing'} counted that must not be")
    return total


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=10_000, help="how many (default: %(default)s)")
    parser.add_argument("--only", choices=SYSTEMS, action="append", help="this system alone")
    parser.add_argument("--seed", type=int, default=0, help="the same seed sends the same messages (default: 0)")
    options = parser.parse_args()
    counted = run(options.messages, options.seed, options.only or list(SYSTEMS))
    sys.stdout.flush()
    os._exit(int(counted > 0))  # see `System.close`


if __name__ == "__main__":
    raise SystemExit(main())
