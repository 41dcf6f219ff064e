"""The controller and the simulated crane as processes in real time: every reason to stop, the action, parameters in motion.

What is timed is counted in cycles of the controller, so that a busy computer cannot fail a test. Limits of time are wide for the
same reason; what they are by default is held by the tests of the core.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from boom_bringup.environment import private_domain
from boom_controller.supervision.reasons import REASONS
from boom_interfaces.msg import ControllerState, MachineConfiguration, SolenoidCurrents
from boom_interfaces.srv import SetPayload
from boom_node import qos
from boom_node.stamps import seconds_to_ns, set_ns, to_ns

pytestmark = pytest.mark.process
PATIENCE = 60.0
JOINT = "inner_boom_joint"
WIDE = {
    "sensor_timeout": 0.5, "longest_cycle": 1.0, "most_missed": 100, "reference_timeout": 5.0, "current_timeout": 2.0,
    "start_tolerance": 0.5, "persistence": 0.0, "largest_pressure": 6.0e7, "current_ramp": 0.1,
}  # fmt: skip
SENSORS = "/joint_states,/boom/hose_pressure,/boom/rod_pressure,/boom/solenoid_currents"
CONTROLLER = """
from boom_controller.controller_node import ControllerNode, shell
from boom_controller.node.trajectory_requests import TrajectoryRequests

received = TrajectoryRequests._on_message

def with_a_mistake(self, message):
    if list(message.joint_names) == ["a mistake"]:
        raise ZeroDivisionError("planted")
    received(self, message)

TrajectoryRequests._on_message = with_a_mistake
raise SystemExit(shell.run(ControllerNode))
"""
WAITING = qos.SENSOR_DATA.depth
MANY = QoSProfile(depth=2000, reliability=QoSReliabilityPolicy.BEST_EFFORT)


class Rig:
    """Both processes, and a partner that watches and disturbs."""

    def __init__(self, mode: str = "baseline", effects: str = "", machine: str = "") -> None:
        self.closing = contextlib.ExitStack()
        domain = self.closing.enter_context(private_domain())  # the worker may run two rigs
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(domain))
        self.node = rclpy.create_node("operator", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.states: list[ControllerState] = []
        self.command = SolenoidCurrents()
        self.commands: deque[SolenoidCurrents] = deque(maxlen=200)
        subscribe, publish = self.node.create_subscription, self.node.create_publisher
        subscribe(ControllerState, "/boom/controller_state", self.states.append, MANY)
        subscribe(SolenoidCurrents, "/boom/current_command", self._on_command, 10)
        self.joints = publish(JointState, "/joint_states", qos.SENSOR_DATA)
        self.hose = publish(FluidPressure, "/boom/hose_pressure", qos.SENSOR_DATA)
        self.rod = publish(FluidPressure, "/boom/rod_pressure", qos.SENSOR_DATA)
        self.currents = publish(SolenoidCurrents, "/boom/solenoid_currents", qos.SENSOR_DATA)
        self.configuration = publish(MachineConfiguration, "/boom/machine_configuration", qos.LATCHED)
        self.stop = publish(Bool, "/boom/emergency_stop", qos.LATCHED)
        self.trajectory = publish(JointTrajectory, "/boom/joint_trajectory", qos.EVENTS)
        self.reference = publish(JointState, "/boom/reference", qos.LATEST)
        self.action = ActionClient(self.node, FollowJointTrajectory, "/boom_controller/follow_joint_trajectory")
        self.clients: dict[str, Any] = {}
        self.shown: dict[str, float] | None = None
        self.node.create_timer(0.01, self._show)
        self.environment = environment = dict(os.environ, ROS_DOMAIN_ID=str(domain))
        parameters = {**WIDE, "mode": mode, "shared_topics": SENSORS, **({"machine": machine} if machine else {})}
        given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        shared = ["-p", "sensors:=ideal", "-p", f"shared_topics:={SENSORS}"]
        shared += ["-p", f"machine:={machine}"] if machine else []
        programs = (
            [
                "-m",
                "boom_sim.simulation_node",
                "--ros-args",
                *shared,
                *(["-p", f"effects:={effects}"] if effects else []),
            ],
            ["-c", CONTROLLER, "--ros-args", *given],
        )
        self.second: Any = None
        self.health: dict[str, Any] = {}
        subscribe(DiagnosticArray, "/diagnostics", self._on_health, qos.EVENTS)
        self.processes = [subprocess.Popen([sys.executable, *words], env=environment) for words in programs]
        self.until(lambda: self.states and self.states[-1].status == ("warning" if machine else "ok"))

    def _on_health(self, message: DiagnosticArray) -> None:
        self.health |= {status.name: status for status in message.status}

    def another(self) -> None:
        """A second commander joins; it commands nothing."""
        self.second = self.node.create_publisher(SolenoidCurrents, "/boom/current_command", qos.COMMAND)

    def _on_command(self, message: SolenoidCurrents) -> None:
        self.command = message
        self.commands.append(message)

    def _show(self) -> None:
        """In place of the paused simulation: sensors that show what the test wants."""
        if self.shown is None:
            return
        now = self.node.get_clock().now().to_msg()
        self.shown["angle"] += 0.01 * self.shown.get("slope", 0.0)
        joint = JointState(name=[JOINT], position=[self.shown["angle"]], velocity=[self.shown["rate"]])
        joint.header.stamp = now
        self.joints.publish(joint)
        for topic, name in ((self.hose, "hose"), (self.rod, "rod")):
            pressure = FluidPressure(fluid_pressure=self.shown[name] + 101_325.0)
            pressure.header.stamp = now
            topic.publish(pressure)
        currents = SolenoidCurrents()
        currents.header.stamp = now
        self.currents.publish(currents)

    def until(self, done: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, f"did not happen; last state: {self.states[-1:]}"
            self.executor.spin_once(timeout_sec=0.02)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.clients.get(name) or self.clients.setdefault(name, self.node.create_client(kind, name))
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def set(self, **parameters: Any) -> list[Any]:
        kinds = {
            bool: (1, "bool_value"),
            int: (2, "integer_value"),
            float: (3, "double_value"),
            str: (4, "string_value"),
        }
        request = SetParameters.Request()
        for name, value in parameters.items():
            kind, field = kinds[type(value)]
            request.parameters.append(Parameter(name=name, value=ParameterValue(type=kind, **{field: value})))
        return list(self.call(SetParameters, "/boom_controller/set_parameters", request).results)

    def pause(self, wanted: bool) -> None:
        assert self.call(SetBool, "/boom_simulation/pause", SetBool.Request(data=wanted)).success

    def show(self, **changed: float) -> None:
        """The simulation pauses; its last values go on, but for what is changed."""
        last = self.states[-1]
        self.pause(True)
        self.shown = {
            "angle": last.angle, "rate": last.rate, "hose": last.hose_pressure, "rod": last.rod_pressure, **changed
        }  # fmt: skip

    def heal(self) -> None:
        """All as it was at the beginning, at rest, ready."""
        self.shown = None
        if self.second is not None:
            self.node.destroy_publisher(self.second)
            self.second = None
        self.set(largest_rate=0.6, largest_angle_error=0.2, highest_angle=3.2, **WIDE)
        self.configuration.publish(
            MachineConfiguration(machine="tz17", outer_boom_angle=0.28, telescope_length=2.2, load_mass=0.0)
        )
        self.stop.publish(Bool(data=False))
        self.call(SetPayload, "/boom_simulation/set_payload", SetPayload.Request(mass=0.0))
        self.trajectory.publish(JointTrajectory(joint_names=[JOINT]))  # no points: hold
        self.call(Trigger, "/boom_controller/emergency_stop", Trigger.Request())
        self.pause(False)
        assert self.call(Trigger, "/boom_simulation/reset", Trigger.Request()).success
        self.until(lambda: self.call(Trigger, "/boom_controller/resume", Trigger.Request()).success)
        self.until(lambda: self.states[-1].mode == "idle" and self.states[-1].status == "ok")
        self.until(lambda: abs(self.states[-1].angle - 0.3) < 0.01)

    def lift(self) -> None:
        """Slowly upwards, far enough for any test."""
        self.trajectory.publish(path([(4.0, self.states[-1].angle + 0.5)]))
        self.until(lambda: self.states[-1].mode == "track" and self.states[-1].rate > 0.03)
        self.states.clear()
        self.until(lambda: self.states)

    def processor_time(self) -> float:
        """Of the controller since its start [s], all threads."""
        words = Path(f"/proc/{self.processes[1].pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")

    def stopped(self, reason: str) -> None:
        """Waits for the stop; checks its reason and how many cycles it took until the currents were zero."""
        self.until(lambda: self.states[-1].mode == "stopped" and self.command.extend == 0.0)
        stopping = [s for s in self.states if s.mode == "stopping"]
        longest = 1.5 + 0.1 if REASONS[reason].reaction == "reference" else 0.05 if reason == "internal_error" else 0.1
        # what has stood still finds up to WAITING sets of samples, and takes them faster than they came
        assert len(stopping) <= longest / 0.01 + 3 + WAITING
        last = self.states[-1]
        assert last.status == "stopped"
        assert last.reason.startswith(f"{reason}: ")
        assert (last.current_retract, last.current_extend) == (0.0, 0.0)
        # the ramp is bounded: no step of more than what was there, spread over the ramp, and some late cycles
        currents = [s.current_extend + s.current_retract for s in stopping]
        if len(currents) > 6:
            assert min(currents) < 0.6 * max(currents)

    def close(self) -> None:
        for process in reversed(self.processes):
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait(PATIENCE)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()
        self.closing.close()


def path(points: list[tuple[float, float]], joint: str = JOINT) -> JointTrajectory:
    message = JointTrajectory(joint_names=[joint])
    for when, angle in points:
        point = JointTrajectoryPoint(positions=[angle], velocities=[0.0], accelerations=[0.0])
        set_ns(point.time_from_start, seconds_to_ns(when))
        message.points.append(point)
    return message


def test_a_load_that_the_supply_cannot_hold_stops_the_boom_and_says_so() -> None:
    weak = Rig("improved", "'{pump_flow_limit: {inverse_q_max: 60000.0}}'")
    try:
        weak.set(largest_angle_error=1.0)
        weak.trajectory.publish(path([(6.0, 0.8)]))
        weak.stopped("load_not_held")
        assert "cannot be held" in weak.states[-1].reason
    finally:
        weak.close()


def test_a_machine_whose_physics_the_law_does_not_use_is_moved_by_topic_and_action_all_the_same(tmp_path: Path) -> None:
    """What a diagnosis writes; topic and action had waited for a controller that has nothing to say."""
    told = tmp_path / "drifting.yaml"
    told.write_text(
        files("boom_model").joinpath("machines/tz17.yaml").read_text("utf-8")
        + "\neffects: {friction_drift: {r: 1.5, T: 10.0}}\n",
        "utf-8",
    )
    drifting = Rig("improved", machine=str(told))
    try:
        drifting.until(lambda: "friction drift, which the control law does not use" in drifting.states[-1].reason)
        drifting.until(drifting.action.server_is_ready)
        drifting.trajectory.publish(path([(2.0, 0.35)]))
        drifting.until(lambda: drifting.states[-1].mode == "track")
        drifting.until(lambda: drifting.states[-1].mode == "hold" and abs(drifting.states[-1].angle - 0.35) < 0.01)
    finally:
        drifting.close()


@pytest.fixture(scope="module")
def running() -> Iterator[Rig]:
    made = Rig()
    yield made
    made.close()


@pytest.fixture
def rig(running: Rig) -> Rig:
    running.heal()
    return running


def reconfigure(rig: Rig) -> None:
    rig.configuration.publish(
        MachineConfiguration(machine="tz17", outer_boom_angle=0.28, telescope_length=2.8, load_mass=0.0)
    )


def stand_still(rig: Rig) -> None:
    rig.set(longest_cycle=0.2)
    controller = rig.processes[1]
    controller.send_signal(signal.SIGSTOP)
    begin = time.monotonic()
    rig.until(lambda: time.monotonic() - begin > 0.3)
    controller.send_signal(signal.SIGCONT)


def overload(rig: Rig) -> None:
    rig.set(largest_angle_error=0.01)
    rig.call(SetPayload, "/boom_simulation/set_payload", SetPayload.Request(mass=2000.0))


FAULTS: dict[str, Callable[[Rig], Any]] = {
    "emergency_stop": lambda rig: rig.stop.publish(Bool(data=True)),
    "emergency_stop by service": lambda rig: rig.call(Trigger, "/boom_controller/emergency_stop", Trigger.Request()),
    "sensor_old": lambda rig: rig.pause(True),
    "sensor_not_a_number": lambda rig: rig.show(hose=math.nan),
    "sensor_out_of_range": lambda rig: rig.show(angle=4.0),
    "sensors_disagree": lambda rig: rig.show(rate=0.4, slope=0.03),  # an angle that stands is stuck
    "angle_limit": lambda rig: rig.set(highest_angle=rig.states[-1].angle),
    "speed_limit": lambda rig: rig.set(largest_rate=0.05),
    "pressure_limit": lambda rig: rig.set(largest_pressure=1.0e6),
    "missed_deadlines": stand_still,
    "divergence": overload,
    "currents_not_followed": lambda rig: (rig.set(current_timeout=0.05), rig.show(rate=0.0)),
    "configuration_changed": reconfigure,
    "two_publishers": Rig.another,
    "internal_error": lambda rig: rig.trajectory.publish(JointTrajectory(joint_names=["a mistake"])),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_reason_stops_a_moving_boom_and_only_resume_lets_it_go_on(rig: Rig, fault: str) -> None:
    rig.lift()
    FAULTS[fault](rig)
    rig.stopped(fault.split()[0])
    rig.trajectory.publish(path([(2.0, 0.35)]))
    count = len(rig.states)
    rig.until(lambda: len(rig.states) > count + 20)
    assert rig.states[-1].mode == "stopped"


def test_a_controller_that_was_frozen_commands_no_current_to_a_valve_that_was_closed_meanwhile(rig: Rig) -> None:
    rig.set(longest_cycle=0.05, current_ramp=0.5)
    rig.lift()
    controller = rig.processes[1]
    rig.health.clear()
    controller.send_signal(signal.SIGSTOP)
    closed = "running, no command: valve closed"
    rig.until(lambda: "boom_simulation" in rig.health and rig.health["boom_simulation"].message == closed)
    rig.commands.clear()
    controller.send_signal(signal.SIGCONT)
    rig.until(lambda: rig.states[-1].mode == "stopped" and len(rig.commands) > 50)
    assert rig.states[-1].reason.startswith("missed_deadlines: ")
    # the first may have been on its way when the process was frozen
    assert max(max(command.retract, command.extend) for command in list(rig.commands)[1:]) == 0.0


def stamped(rig: Rig, seconds: int) -> None:
    message = JointState(name=[JOINT], position=[0.3], velocity=[0.0])
    message.header.stamp.sec = seconds
    rig.joints.publish(message)


def reference(angle: float, sec: int) -> JointState:
    message = JointState(name=[JOINT], position=[angle])
    message.header.stamp.sec = sec
    return message


HOSTILE: dict[str, tuple[Callable[[Rig], Any], str]] = {
    "the last stamp": (lambda rig: stamped(rig, 2**31 - 1), "/joint_states, stamp far from now"),
    "no stamp": (lambda rig: stamped(rig, 0), "/joint_states, stamp far from now"),
    "a reference of another day": (
        lambda rig: rig.reference.publish(reference(0.9, sec=86_400)), "/boom/reference, stamp far from now"
    ),
    "10 000 joints": (lambda rig: rig.joints.publish(JointState(name=["x"] * 10_000)), "/joint_states, larger than 65 kB"),
    "10 000 points": (
        lambda rig: rig.trajectory.publish(path([(0.01 * k, 0.3) for k in range(1, 10_001)])),
        "/boom/joint_trajectory, larger than 80 kB",
    ),
}  # fmt: skip


@pytest.mark.parametrize("message", HOSTILE)
def test_a_hostile_message_is_refused_and_counted_and_the_motion_goes_on(rig: Rig, message: str) -> None:
    send, counted = HOSTILE[message]
    rig.lift()
    send(rig)
    key = f"messages refused, {counted}"
    rig.health.clear()
    rig.until(lambda: "boom_controller" in rig.health and key in {v.key for v in rig.health["boom_controller"].values})
    assert {s.mode for s in rig.states} == {"track"}


@pytest.mark.parametrize("name", ["x" * 5000, "/dev/zero", "../../../dev/zero", ""])
def test_a_machine_named_by_a_topic_is_never_opened_as_a_path(rig: Rig, name: str) -> None:
    rig.configuration.publish(MachineConfiguration(machine=name, outer_boom_angle=0.28, telescope_length=2.2))
    key = "messages refused, /boom/machine_configuration, cannot be used"
    rig.health.clear()
    rig.until(lambda: "boom_controller" in rig.health and key in {v.key for v in rig.health["boom_controller"].values})
    assert rig.processes[1].poll() is None
    rig.until(lambda: "the last /boom/machine_configuration cannot be used" in rig.states[-1].reason)
    assert rig.states[-1].status == "warning"
    rig.trajectory.publish(path([(4.0, 0.5)]))
    rig.states.clear()
    rig.until(lambda: len(rig.states) > 20)
    assert {s.mode for s in rig.states} == {"idle"}
    rig.heal()  # with one that can
    rig.lift()


def test_two_commanders_are_an_error_and_nothing_resumes_until_one_has_gone(rig: Rig) -> None:
    rig.call(Trigger, "/boom_controller/emergency_stop", Trigger.Request())
    rig.another()
    said = ("2 publish /boom/current_command", "operator")
    rig.until(lambda: all(word in rig.health["boom_controller"].message for word in said))
    assert rig.health["boom_controller"].level == b"\x02"
    rig.until(lambda: "valve closed: 2 publish" in rig.health["boom_simulation"].message)
    answer = rig.call(Trigger, "/boom_controller/resume", Trigger.Request())
    assert not answer.success
    assert "2 publish" in answer.message
    rig.node.destroy_publisher(rig.second)
    rig.second = None
    rig.until(lambda: rig.call(Trigger, "/boom_controller/resume", Trigger.Request()).success)


def goal(
    rig: Rig, message: JointTrajectory, *, way: float = 0.0, end: float = 0.0, late: int = 0
) -> tuple[Any, list[Any]]:
    """Sends a goal with tolerances on the way and at the end [rad] and in time [s]; returns its handle and the feedback to come."""
    rig.until(rig.action.server_is_ready)
    feedback: list[Any] = []
    request = FollowJointTrajectory.Goal(
        trajectory=message,
        path_tolerance=[JointTolerance(name=JOINT, position=way)],
        goal_tolerance=[JointTolerance(name=JOINT, position=end)],
        goal_time_tolerance=Duration(sec=late),
    )
    future = rig.action.send_goal_async(request, feedback_callback=lambda m: feedback.append(m.feedback))
    rig.until(future.done)
    return future.result(), feedback


def ended(rig: Rig, handle: Any) -> Any:
    future = handle.get_result_async()
    rig.until(future.done)
    return future.result().result


def test_a_goal_is_tracked_with_feedback_and_succeeds_within_its_tolerances(rig: Rig) -> None:
    handle, feedback = goal(rig, path([(1.0, 0.35)]), way=0.1, end=0.01, late=20)
    result = ended(rig, handle)
    assert (result.error_code, result.error_string) == (result.SUCCESSFUL, "")
    assert feedback
    last = feedback[-1]
    assert last.joint_names == [JOINT]
    assert last.error.positions[0] == pytest.approx(last.desired.positions[0] - last.actual.positions[0])
    rig.until(lambda: rig.states[-1].mode == "hold")
    assert rig.states[-1].reference_angle == pytest.approx(0.35)


def test_a_goal_on_its_way_costs_no_more_processor_time_than_a_trajectory(rig: Rig) -> None:
    def cost(begin: Callable[[], Any], angle: float) -> float:
        """Processor time [s] of the controller over the same motion: rclpy's executor turned a goal's task without end."""
        before = rig.processor_time()
        begin()
        rig.until(lambda: rig.states[-1].mode == "track")
        rig.until(lambda: rig.states[-1].mode == "hold" and rig.states[-1].reference_angle == pytest.approx(angle))
        return rig.processor_time() - before

    by_topic = cost(lambda: rig.trajectory.publish(path([(0.8, 0.33)])), 0.33)
    by_action = cost(lambda: goal(rig, path([(0.8, 0.36)]), way=-1.0, end=-1.0), 0.36)
    assert by_action < 1.5 * by_topic + 0.1


def test_a_cancelled_goal_comes_to_rest_and_is_held(rig: Rig) -> None:
    handle, _ = goal(rig, path([(6.0, 0.8)]))
    rig.until(lambda: rig.states[-1].rate > 0.03)
    future = handle.cancel_goal_async()
    rig.until(future.done)
    assert "cancelled" in ended(rig, handle).error_string
    rig.until(lambda: rig.states[-1].mode == "hold" and rig.states[-1].reference_rate == 0.0)
    assert rig.states[-1].reference_angle < 0.8


@pytest.mark.parametrize("way", ["topic", "action"])
def test_a_program_that_is_interrupted_while_the_boom_moves_brings_it_to_rest(rig: Rig, way: str) -> None:
    words = [sys.executable, "-m", "boom_node.move_node", "0.8", "--seconds", "6", "--by", way]
    program = subprocess.Popen(words, env=rig.environment, stderr=subprocess.PIPE, text=True)
    rig.until(lambda: rig.states[-1].rate > 0.03)
    program.send_signal(signal.SIGINT)
    rig.until(lambda: program.poll() is not None)
    _, said = program.communicate()
    assert (program.returncode, said) == (130, "move: stopped; the boom comes to rest\n")
    rig.until(lambda: rig.states[-1].mode == "hold" and rig.states[-1].reference_rate == 0.0)
    assert rig.states[-1].reference_angle < 0.8


def test_a_new_goal_replaces_the_old_one(rig: Rig) -> None:
    first, _ = goal(rig, path([(6.0, 0.8)]))
    rig.until(lambda: rig.states[-1].rate > 0.03)
    second, _ = goal(rig, path([(1.0, 0.4)]), way=-1.0, end=0.01, late=20)
    assert "replaced" in ended(rig, first).error_string
    assert ended(rig, second).error_code == 0


def test_goals_that_come_in_the_same_instant_are_all_answered_and_the_last_one_is_tracked(rig: Rig) -> None:
    many = QoSProfile(depth=100)
    clients = [
        ActionClient(
            rig.node, FollowJointTrajectory, "/boom_controller/follow_joint_trajectory", goal_service_qos_profile=many
        )
        for _ in range(2)
    ]
    try:
        rig.until(lambda: all(client.server_is_ready() for client in clients))
        asked = [
            clients[k % 2].send_goal_async(FollowJointTrajectory.Goal(trajectory=path([(2.0, 0.4)]))) for k in range(60)
        ]
        rig.until(lambda: all(future.done() for future in asked))
        assert all(future.result().accepted for future in asked)
        rig.until(lambda: rig.states[-1].mode == "hold" and abs(rig.states[-1].angle - 0.4) < 0.01)
    finally:
        for client in clients:
            client.destroy()


def test_a_goal_that_leaves_its_path_is_aborted_and_the_boom_held(rig: Rig) -> None:
    handle, _ = goal(rig, path([(6.0, 0.8)]), way=0.02)
    rig.until(lambda: rig.states[-1].rate > 0.03)
    rig.call(SetPayload, "/boom_simulation/set_payload", SetPayload.Request(mass=2000.0))
    result = ended(rig, handle)
    assert result.error_code == result.PATH_TOLERANCE_VIOLATED
    assert "away from the path" in result.error_string
    rig.until(lambda: rig.states[-1].mode in ("hold", "stopped"))


@pytest.mark.parametrize(
    ("message", "code", "words"),
    [
        (path([(2.0, 0.4)], joint="telescope_joint"), "INVALID_JOINTS", "moves inner_boom_joint alone"),
        (path([]), "INVALID_GOAL", "no points"),
        (path([(0.1, 0.9)]), "INVALID_GOAL", "rad/s"),
    ],
)
def test_a_goal_that_cannot_be_tracked_is_answered_with_code_and_reason(
    rig: Rig, message: JointTrajectory, code: str, words: str
) -> None:
    handle, _ = goal(rig, message)
    result = ended(rig, handle)
    assert result.error_code == getattr(result, code)
    assert words in result.error_string
    assert rig.states[-1].mode == "idle"


def test_a_stream_of_references_is_followed_smoothly(rig: Rig) -> None:
    def send() -> bool:
        rig.reference.publish(JointState(name=[JOINT], position=[0.35]))
        return rig.states[-1].mode == "track" and abs(rig.states[-1].angle - 0.35) < 0.005

    rig.until(send)
    rates = [s.reference_rate for s in rig.states if s.mode == "track"]
    assert 0.05 < max(rates) <= 0.6


def test_two_streams_of_references_are_told(rig: Rig) -> None:
    other = rig.node.create_publisher(JointState, "/boom/reference", qos.LATEST)

    def send() -> bool:
        for publisher in (rig.reference, other):
            publisher.publish(JointState(name=[JOINT], position=[0.32]))
        status = rig.health.get("boom_controller")
        return status is not None and "2 publish /boom/reference" in status.message

    rig.until(send)


def test_a_parameter_changed_in_motion_makes_no_jump_and_an_impossible_one_is_refused(rig: Rig) -> None:
    rig.lift()
    rig.until(lambda: len(rig.states) > 60)
    count = len(rig.states)
    assert all(r.successful for r in rig.set(force_pole=-8.0, neutral_pressure=5.5e5))
    changed = len(rig.states)
    rig.until(lambda: len(rig.states) > changed + 60)
    states = list(rig.states)
    current = [s.current_extend for s in states]
    # on a busy computer a cycle comes late or a state is lost: what counts is the change within one cycle of 10 ms
    cycles = [max(1.0, (to_ns(b.header.stamp) - to_ns(a.header.stamp)) / 1e7) for a, b in pairwise(states)]
    jumps = [abs(b - a) / n for (a, b), n in zip(pairwise(current), cycles, strict=True)]
    usual = max(jumps[: count - 1])
    steady = abs(sum(current[-20:]) / 20 - sum(current[count - 20 : count]) / 20)
    # of the cycles around the change: later ones tell how a busy computer's samples come
    assert max(jumps[count - 1 : changed + 10]) <= usual + steady + 0.01
    (refused,) = rig.set(force_pole=5.0)
    assert not refused.successful
    assert "force_pole" in refused.reason
    (refused,) = rig.set(use_sim_time=True)
    assert not refused.successful
    assert "use_sim_time cannot change while the controller runs" in refused.reason
    (refused,) = rig.set(sample_time=0.02)
    assert not refused.successful
    assert all(r.successful for r in rig.set(force_pole=-11.0, neutral_pressure=5.0e5))
