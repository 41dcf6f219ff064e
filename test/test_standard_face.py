"""Crane and controller as programs that know nothing of this project see them: standard messages, default QoS, standard readers."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from mcap.reader import make_reader
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from boom_bringup.environment import private_domain
from boom_description.shipped import robot_description

pytestmark = pytest.mark.process
PATIENCE = 60.0
PATIENT = {"sensor_timeout": 0.5, "longest_cycle": 1.0, "most_missed": 100, "current_timeout": 2.0, "persistence": 0.0}
"""Of the controller: a computer that stands still for a moment does not stop the boom."""
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TYPE_HASHES = {  # of the packages in ROS 2 Jazzy
    "tf2_msgs/msg/TFMessage": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "control_msgs/msg/JointTolerance": "RIHS01_c254f9cece0f3b733017b6990fd46d1326e25242d6b8844398c97d9a88e7d648",
    "control_msgs/action/FollowJointTrajectory": "RIHS01_738ebcb7a2d7cfa42f9f1001cc99ce3a4383d1cfe508015d9be8485e4b1c66f6",
}


def given(**parameters: object) -> list[str]:
    return ["--ros-args", *(word for name, value in parameters.items() for word in ("-p", f"{name}:={value}"))]


class Client:
    """A program of somebody else, beside the crane and a recorder."""

    def __init__(self, bag: Path, domain: str) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(domain))
        self.node = rclpy.create_node("somebody", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.states: list[JointState] = []
        self.late: list[JointState] = []
        self.moving: list[TFMessage] = []
        self.fixed: list[TFMessage] = []
        self.poses: list[PoseStamped] = []
        self.urdf: list[String] = []
        self.told: dict[str, str] = {}
        subscribe = self.node.create_subscription
        subscribe(JointState, "/joint_states", self.states.append, 10)
        subscribe(JointState, "/joint_states", self.late.append, qos_profile_sensor_data)
        subscribe(TFMessage, "/tf", self.moving.append, QoSProfile(depth=100))
        subscribe(TFMessage, "/tf_static", self.fixed.append, LATCHED)
        subscribe(PoseStamped, "/boom/tip_pose", self.poses.append, qos_profile_sensor_data)
        subscribe(String, "/robot_description", self.urdf.append, LATCHED)
        subscribe(DiagnosticArray, "/diagnostics", self.tell, 10)
        self.action = ActionClient(self.node, FollowJointTrajectory, "/boom_controller/follow_joint_trajectory")
        self.environment = dict(os.environ, ROS_DOMAIN_ID=domain)
        self.recorder = self.start("boom_recording.recorder_node", *given(output=str(bag)))
        self.bag = bag
        self.crane = [
            self.start("boom_sim.simulation_node", *given(robot_description=robot_description("tz17"))),
            self.start("boom_description.tip_pose_node", *given(publish_tf="true")),
            self.start("boom_controller.controller_node", *given(**PATIENT)),
        ]

    def start(self, module: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", module, *words]
        shown = subprocess.PIPE if module.endswith("reach_log_node") else None
        return subprocess.Popen(command, env=self.environment, stdout=shown)

    def tell(self, message: DiagnosticArray) -> None:
        self.told |= {value.key: value.value for status in message.status for value in status.values}

    def recorded(self, topic: str) -> bool:
        """What the recorder has of a topic; it may have found it later than this program."""
        return self.told.get(f"{topic} messages", "0") != "0"

    def until(self, done: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, "nothing came"
            self.executor.spin_once(timeout_sec=0.05)

    def goal(self, trajectory: JointTrajectory, **more: Any) -> Any:
        """As MoveIt does: sent when the server is there, the answer awaited; the result with its status."""
        self.until(self.action.server_is_ready)
        sent = self.action.send_goal_async(FollowJointTrajectory.Goal(trajectory=trajectory, **more))
        self.until(sent.done)
        assert sent.result().accepted
        answer = sent.result().get_result_async()
        self.until(answer.done)
        return answer.result()

    def end(self, process: subprocess.Popen[bytes]) -> int:
        process.send_signal(signal.SIGINT)
        return process.wait(PATIENCE)

    def close(self) -> None:
        for process in (*self.crane, self.recorder):
            if process.poll() is None:
                self.end(process)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with private_domain() as domain:
        made = Client(tmp_path_factory.mktemp("face") / "bag", domain)
        try:
            yield made
        finally:
            made.close()


def joints_of(urdf: str) -> set[str]:
    return {
        joint.attrib["name"] for joint in ET.fromstring(urdf).iter("joint") if joint.get("type") not in (None, "fixed")
    }


def test_the_interfaces_without_a_wheel_have_the_type_hashes_of_ros() -> None:
    share = Path(sys.prefix) / "share"
    for name, expected in TYPE_HASHES.items():
        described = json.loads((share / name).with_suffix(".json").read_text(encoding="utf-8"))
        assert {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}[name] == expected


def test_a_default_subscriber_hears_all_joints_of_the_description_at_100_hz(client: Client) -> None:
    def gap() -> float:
        """Mean of the last 100 [s]; while the processes start, a queue of ten loses some."""
        stamps = [s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in client.states[-101:]]
        return (stamps[-1] - stamps[0]) / 100 if len(stamps) == 101 else np.inf

    client.until(lambda: client.urdf and client.late and gap() == pytest.approx(0.01, abs=1e-3))
    assert set(client.states[-1].name) == joints_of(client.urdf[0].data)
    last = client.states[-1]
    assert len(last.position) == len(last.velocity) == len(last.name)


def test_the_frames_are_those_of_the_description_at_the_joints_that_are_told(client: Client) -> None:
    def both() -> tuple[Any, Any] | None:
        """Frames and the joints that they are of; the first of either may come before the other one is subscribed to."""
        states = {(s.header.stamp.sec, s.header.stamp.nanosec): s for s in client.states}
        stamped = ((frames, frames.transforms[0].header.stamp) for frames in reversed(client.moving))
        return next(((f, states[t.sec, t.nanosec]) for f, t in stamped if (t.sec, t.nanosec) in states), None)

    client.until(lambda: client.urdf and client.fixed and client.poses and both())
    found = both()
    assert found
    moving, state = found
    model = pinocchio.buildModelFromXML(client.urdf[0].data)
    values = dict(zip(state.name, state.position, strict=True))
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, np.array([values[name] for name in list(model.names)[1:]]))
    edges = {}
    for transform in (*moving.transforms, *client.fixed[-1].transforms):
        place, turn = transform.transform.translation, transform.transform.rotation
        pose = pinocchio.XYZQUATToSE3(np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]))
        edges[transform.child_frame_id] = (transform.header.frame_id, pose)
    links = {link.attrib["name"] for link in ET.fromstring(client.urdf[0].data).iter("link")}
    assert links - set(edges) == {"base_link"}
    for link in edges:
        pose, at = pinocchio.SE3.Identity(), link
        while at != "base_link":
            at, step = edges[at]
            pose = step * pose
        assert pose.isApprox(data.oMf[model.getFrameId(link)], 1e-6), link


def test_a_planners_client_moves_the_boom_and_is_told_why_it_cannot(client: Client) -> None:
    client.until(lambda: client.states)
    here = client.states[-1].position[client.states[-1].name.index("inner_boom_joint")]
    points = [
        JointTrajectoryPoint(positions=[here], velocities=[0.0], accelerations=[0.0]),
        JointTrajectoryPoint(
            positions=[here + 0.03], velocities=[0.0], accelerations=[0.0], time_from_start=Duration(sec=1)
        ),
    ]
    planned = JointTrajectory(joint_names=["inner_boom_joint"], points=points)
    answer = client.goal(planned, goal_time_tolerance=Duration(sec=10))
    assert (answer.status, answer.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), answer.result.error_string
    client.until(lambda: client.states[-1].position[0] == pytest.approx(here + 0.03, abs=0.01))
    other = JointTrajectory(joint_names=["outer_boom_joint"], points=points)
    answer = client.goal(other)
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.error_code == FollowJointTrajectory.Result.INVALID_JOINTS


def test_a_stack_finds_the_log_lifts_it_and_learns_its_weight(client: Client) -> None:
    client.until(client.action.server_is_ready)
    scene = client.start("boom_description.perception.log_scene_node")
    stack = client.start("boom_description.perception.reach_log_node", "--rate", "0.3", "--acceleration", "0.5")
    try:
        assert stack.wait(PATIENCE) == 0
    finally:
        for process in (stack, scene):
            if process.poll() is None:
                client.end(process)
    assert stack.stdout is not None
    weighed = re.search(r"the controller estimates (\d+) kg", stack.stdout.read().decode())
    assert weighed
    assert int(weighed[1]) == pytest.approx(205.0, abs=15.0)


def test_standard_readers_find_joints_and_description_in_the_bag(client: Client) -> None:
    client.until(lambda: client.recorded("/joint_states") and client.recorded("/robot_description"))
    assert client.end(client.recorder) == 0
    path = client.bag
    with next(path.glob("*.mcap")).open("rb") as file:
        channels = [channel.topic for _, channel, _ in make_reader(file, validate_crcs=True).iter_messages()]
    assert channels.count("/robot_description") == 1
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(path) as reader:
        found = {
            c.topic: store.deserialize_cdr(raw, c.msgtype) for c, _, raw in reader.messages() if "boom/" not in c.topic
        }
        latched = next(c for c in reader.connections if c.topic == "/robot_description").ext.offered_qos_profiles
    assert joints_of(found["/robot_description"].data) == set(found["/joint_states"].name)
    assert "TRANSIENT_LOCAL" in str(latched[0].durability)
