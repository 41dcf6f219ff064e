"""Records topics into an MCAP bag: ``python -m boom_recording.recorder_node --ros-args -p output:=FOLDER``.

Messages are stored as they came over the wire, without decoding. Received messages survive a kill -9, except those of
the last half second. The bag is complete (index, metadata.yaml) after SIGINT or SIGTERM. Topics, parameters and
conditions: README.md of the package.
"""

# ruff: noqa: I001
from boom_node import early  # noqa: F401  (first: signals and environment)

import functools
import sys
import time
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.validate_topic_name import validate_topic_name
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from std_msgs.msg import Bool

from boom_input.channels import SENSOR_TOPICS
from boom_input.shown import quoted
from boom_node import qos, shell
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.errors import StartError
from boom_node.node import Node
from boom_node.input_watch import InputWatch
from boom_node.parameters import ParameterSpec, declare
from boom_recording import definitions, recorder
from boom_recording.bag_writer import CHUNK_BYTES, BagWriter, OfferedQos
from boom_recording.errors import RecordingError

PARAMETERS = (
    ParameterSpec("output", "", "folder of the new bag; an existing one is never overwritten", read_only=True),
    ParameterSpec(
        "topics",
        list(recorder.DEFAULT_TOPICS),
        'topics to record, including those that appear later; "*" = all',
        read_only=True,
    ),
    ParameterSpec(
        "required_topics", list(SENSOR_TOPICS), "~/ready turns true once each of these has a publisher", read_only=True
    ),
    ParameterSpec(
        "chunk_bytes", CHUNK_BYTES, "size of a chunk before compression", "byte", 1_000, 16_000_000, read_only=True
    ),
    ParameterSpec(
        "flush_period",
        recorder.FLUSH_PERIOD_S,
        "longest time that a message stays in memory only",
        "s",
        0.05,
        10.0,
        read_only=True,
    ),
)
_SCAN_PERIOD_S = 0.05
_SILENCE_PERIOD_S = 0.5
_RECHECK_PERIOD_S = 2.0


class RecorderNode(Node):
    """The recorder as a ROS node: from subscriptions to a `BagWriter`."""

    def __init__(self) -> None:
        super().__init__("boom_recorder")
        values = declare(self, PARAMETERS)
        if not values.output:
            raise StartError("boom_recorder needs the parameter 'output', e.g. -p output:=my_recording")
        if not values.topics:
            raise StartError("boom_recorder has nothing to record: list at least one topic in the parameter 'topics'")
        required = tuple(self._resolved(topic) for topic in values.required_topics)
        self._asked = [topic if topic == recorder.EVERYTHING else self._resolved(topic) for topic in values.topics]
        unasked = [topic for topic in required if topic not in self._asked]
        if unasked and recorder.EVERYTHING not in self._asked:
            raise StartError(
                f"required_topics names {unasked[0]}, which is not among 'topics': add it there or remove it here"
            )
        try:
            self._bag = BagWriter(Path(values.output), chunk_bytes=values.chunk_bytes)
        except RecordingError as error:
            raise StartError(str(error)) from None
        try:
            self._begin(values, required)
        except BaseException as ended:
            self._bag.discard()
            if not isinstance(ended, Exception):  # a Ctrl-C
                print("boom: stopped before anything was recorded", file=sys.stderr, flush=True)
            raise

    def _begin(self, values: Any, required: tuple[str, ...]) -> None:
        self._subscribed: dict[str, tuple[Any, OfferedQos]] = {}
        self._numbers: dict[str, int] = {}
        self._publisher_counts: dict[str, int] = {}
        self._traffic: dict[str, recorder.Traffic] = {}
        self._refused: dict[str, str] = {}
        self._types: dict[str, str] = {}
        self._readiness = recorder.Readiness(required)
        self._required = required
        self._watches: dict[str, InputWatch] = {}
        self._counted: dict[str, int] = {}
        self._ready = False
        self._failure = ""
        self._ready_publisher = self.create_publisher(Bool, "~/ready", qos.LATCHED)
        self._ready_publisher.publish(Bool(data=False))
        self._diagnostics = DiagnosticsPublisher(self, self._health)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_SCAN_PERIOD_S, self._scan, clock=steady)
        self.create_timer(values.flush_period, self._flush, clock=steady)
        # A publisher that was exchanged for another leaves the count as it was.
        self.create_timer(_RECHECK_PERIOD_S, self._publisher_counts.clear, clock=steady)
        self.create_timer(_SILENCE_PERIOD_S, self._watch_required, clock=steady)
        self._scan()

    def _resolved(self, topic: str) -> str:
        """The full name of a topic. Raises StartError: no topic can have this name."""
        try:
            validate_topic_name(topic)
            return str(self.resolve_topic_name(topic))
        except Exception:  # rclpy has an error class for each kind of wrong name, and RCLError for the rest
            raise StartError(f"{quoted(topic)} is no name of a topic: give one as in 'ros2 topic list'") from None

    def _watch_required(self) -> None:
        """Warn about a required topic that has fallen silent."""
        now = time.monotonic()
        for topic in self._required:
            count = self._traffic[topic].messages if topic in self._traffic else 0
            if count != self._counted.get(topic, 0):
                self._counted[topic] = count
                text = f"{topic} has been silent for {{age}} s: its publisher has stopped or died"
                self._watches.setdefault(topic, InputWatch(text, now)).seen(now)
            elif topic in self._watches:
                warning = self._watches[topic].warning(now)
                if warning:
                    self.get_logger().warning(warning)

    def close(self) -> None:
        """Complete the bag and print its content.

        Raises:
            StartError: it could not be completed; the process ends with its status.
        """
        try:
            self._bag.close()
        except RecordingError as error:
            if self._failure:  # told already
                return
            raise StartError(str(error)) from None
        for line in recorder.summary(str(self._bag.path), self._traffic, self._asked):
            print(line, flush=True)

    def _scan(self) -> None:
        """Subscribe to new topics; check whether the required topics are matched."""
        seen = (name for name, _ in self.get_topic_names_and_types()) if recorder.EVERYTHING in self._asked else ()
        for topic in recorder.wanted_topics(self._asked, seen):
            count = self.count_publishers(topic)
            if not count or count == self._publisher_counts.get(topic):
                continue  # asking for their QoS is what costs
            self._publisher_counts[topic] = count
            current = self._subscribed.get(topic)
            found = [_publisher(info) for info in self.get_publishers_info_by_topic(topic)]
            publishers, wrong = recorder.offered(topic, found, self._types.get(topic, ""))
            if publishers and _message_type(publishers[0].type) is None:
                wrong = f"{topic} cannot be recorded: its type {quoted(publishers[0].type)} is not installed"
                publishers = []
            self._refuse(topic, wrong)
            if not publishers:
                continue
            if current is None:
                self._subscribe(topic, publishers)
            elif recorder.must_renew(current[1], publishers):
                self.destroy_subscription(current[0])
                self._subscribe(topic, publishers)
        matched = [
            topic for topic, (subscription, _) in self._subscribed.items() if subscription.get_publisher_count() > 0
        ]
        ready = self._readiness.update(matched, time.monotonic())
        if ready != self._ready:
            self._ready = ready
            self._ready_publisher.publish(Bool(data=ready))
            self._diagnostics.update()

    def _refuse(self, topic: str, wrong: str) -> None:
        """Report at once a publisher that is not recorded; it stays on /diagnostics for as long as it exists."""
        if self._refused.get(topic, "") == wrong:
            return
        self._refused.pop(topic, None)
        if wrong:
            self._refused[topic] = wrong
            self.get_logger().error(wrong)
        self._diagnostics.update()

    def _subscribe(self, topic: str, publishers: list[recorder.Publisher]) -> None:
        kind = publishers[0]
        self._types[topic] = kind.type
        wanted = recorder.request(publishers)
        profile = QoSProfile(
            depth=wanted.depth,
            reliability=QoSReliabilityPolicy.RELIABLE if wanted.reliable else QoSReliabilityPolicy.BEST_EFFORT,
            durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if wanted.latched else QoSDurabilityPolicy.VOLATILE,
        )
        traffic = self._traffic.setdefault(topic, recorder.Traffic())
        if topic not in self._numbers:
            self._numbers[topic] = self._declare(topic, kind)
        receive = _Receiver(self, self._numbers[topic], traffic)
        events = SubscriptionEventCallbacks(message_lost=partial(_count_lost, traffic), use_default_callbacks=False)
        subscription = self.create_subscription(
            _message_type(kind.type), topic, receive.message, profile, event_callbacks=events, raw=True
        )
        self._subscribed[topic] = (subscription, wanted)

    def _declare(self, topic: str, kind: recorder.Publisher) -> int:
        try:
            text, type_hash = definitions.definition(kind.type)
        except RecordingError as error:
            self.get_logger().warning(f"{error}; {topic} is recorded without it")
            text, type_hash = "", kind.type_hash
        return self._bag.add_topic(topic, kind.type, text, kind.type_hash or type_hash, kind.qos)

    def store(self, number: int, data: bytes, received_ns: int) -> None:
        """Write one message; a full disk ends the recording and keeps what was written."""
        if self._failure:
            return
        try:
            self._bag.write(number, data, received_ns, received_ns)
        except RecordingError as error:
            self._fail(str(error))

    def _flush(self) -> None:
        if self._failure:
            return
        try:
            self._bag.flush()
        except RecordingError as error:
            self._fail(str(error))

    def _fail(self, reason: str) -> None:
        self._failure = reason
        self._diagnostics.update()
        shell.finish(2, reason)

    def _health(self) -> Health:
        now = time.monotonic()
        values: dict[str, object] = {}
        for topic, traffic in self._traffic.items():
            values[f"{topic} messages"] = traffic.messages
            values[f"{topic} rate [1/s]"] = f"{traffic.rate(now):.1f}"
            values[f"{topic} lost"] = traffic.lost
        missing = self._readiness.missing(now)
        if self._failure:
            return Health(Level.ERROR, self._failure, values)
        if self._refused:
            return Health(Level.ERROR, "; ".join(self._refused.values()), values)
        if missing:
            return Health(Level.WARN, f"recording; no publisher of {', '.join(missing)}", values)
        return Health(Level.OK, f"recording to {self._bag.path}", values)


class _Receiver:
    """Callback of one subscription.

    The time of reception is that of the node's clock (ROS time if simulated, else system time). The time of sending is part of
    the message information, but in rclpy 7.1.6 the EventsExecutor fails on callbacks that request it (SystemError), and the
    other executor takes twice the processor time and loses messages at 5 kHz; our messages carry their own stamps anyway.
    """

    def __init__(self, node: RecorderNode, number: int, traffic: recorder.Traffic) -> None:
        self._node = node
        self._number = number
        self._traffic = traffic
        self._clock = node.get_clock()

    def message(self, data: bytes) -> None:
        self._traffic.add(len(data))
        self._node.store(self._number, data, self._clock.now().nanoseconds)


@functools.cache
def _message_type(name: str) -> Any | None:
    """The class of a message type ("pkg/msg/Type"), None if it is not installed."""
    package, group, short = name.split("/")
    try:
        return getattr(import_module(f"{package}.{group}"), short)
    except Exception:  # whatever a module of that name does when it is loaded
        return None


def _count_lost(traffic: recorder.Traffic, status: Any) -> None:
    traffic.lost += status.total_count_change


def _publisher(information: Any) -> recorder.Publisher:
    profile = information.qos_profile
    deadline = profile.deadline.nanoseconds
    offered = OfferedQos(
        reliable=profile.reliability == QoSReliabilityPolicy.RELIABLE,
        latched=profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL,
        depth=profile.depth or 1,  # the graph does not tell the depth
        deadline_ns=deadline if 0 < deadline < 2**62 else None,
    )
    return recorder.Publisher(information.topic_type, str(information.topic_type_hash), offered)


def main() -> int:
    """Run the recorder until SIGINT or SIGTERM. Returns the exit status."""
    return shell.run(RecorderNode)


if __name__ == "__main__":
    raise SystemExit(main())
