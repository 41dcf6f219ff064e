"""The QoS of every topic of the contract, in one table."""

from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy

from boom_input.channels import MEASURED_TOPICS

COMMAND_DEADLINE_S = 0.05


def _profile(depth: int, *, reliable: bool, latched: bool = False, deadline_s: float | None = None) -> QoSProfile:
    profile = QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT,
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
    )
    if deadline_s is not None:
        profile.deadline = Duration(nanoseconds=round(deadline_s * 1e9))
    return profile


SENSOR_DATA = _profile(5, reliable=False)
COMMAND = _profile(1, reliable=True, deadline_s=COMMAND_DEADLINE_S)
LATEST = _profile(1, reliable=True)  # the newest counts, none may be lost silently
EVENTS = _profile(10, reliable=True)  # on demand or on change
JOINT_STATES = _profile(10, reliable=True)  # serves best-effort readers, too
LATCHED = _profile(1, reliable=True, latched=True)  # late joiners get the last one
EVERY_CHANGE = _profile(100, reliable=True, latched=True)
"""To subscribe to what is latched with, where a value that is replaced at once must not be lost: a press on a stop is one."""
UNLATCHED = (_profile(100, reliable=True), _profile(100, reliable=False))
"""To hear, beside what is latched, those that do not latch: as surely as they offer it."""
QUIETLY = SubscriptionEventCallbacks(use_default_callbacks=False)
"""For subscriptions beside which others hear what their QoS does not match: else rclpy logs that it is not heard."""
EVERY_SAMPLE = _profile(1000, reliable=True)
"""Sensor topics in lockstep: no sample may be lost, however slow a recorder is; subscribers with sensor data QoS still match."""
EVERY_SENSOR_SAMPLE = _profile(1000, reliable=False)
"""For subscribers to both kinds of sensor topics that must not miss samples while they are busy."""
FRAMES = _profile(100, reliable=True)  # /tf as tf2 publishes it
CLOCK = _profile(10, reliable=True)  # to publish with: it serves subscribers of either kind, and lockstep loses no tick

BY_TOPIC: dict[str, QoSProfile] = {
    **dict.fromkeys(MEASURED_TOPICS, SENSOR_DATA),
    "/joint_states": JOINT_STATES,
    "/tf": FRAMES,
    "/tf_static": LATCHED,
    "/boom/controller_state": SENSOR_DATA,
    "/boom/current_command": COMMAND,
    "/boom/machine_configuration": LATCHED,
    "/boom/reference": LATEST,
    "/boom/joint_trajectory": EVENTS,
    "/boom/emergency_stop": LATCHED,
    "/boom/pilot_valve/oscilloscope": EVENTS,
    "/robot_description": LATCHED,
    "/diagnostics": EVENTS,
    "/clock": CLOCK,
}
"""As publishers offer it."""


def latches(offered: QoSProfile) -> bool:
    """Whether late joiners get the last message of a publisher with this QoS."""
    return bool(
        offered.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
        and offered.reliability == QoSReliabilityPolicy.RELIABLE
    )


def requested(topic: str) -> QoSProfile:
    """The QoS to subscribe with: sensors as best effort, because other publishers of theirs offer no more."""
    if topic == "/boom/emergency_stop":
        return EVERY_CHANGE
    return SENSOR_DATA if topic in MEASURED_TOPICS else BY_TOPIC[topic]
