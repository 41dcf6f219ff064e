"""Decisions and counts of the recorder, without ROS: the QoS to request, when it is ready, what it reports."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from boom_input.channels import MEASURED_TOPICS
from boom_input.shown import quoted
from boom_recording.bag_writer import OfferedQos
from boom_recording.channels import CURRENT_COMMAND, MACHINE_CONFIGURATION, OTHER_TYPES, ROBOT_DESCRIPTION, TYPES

DEFAULT_TOPICS = (*MEASURED_TOPICS, MACHINE_CONFIGURATION, ROBOT_DESCRIPTION, CURRENT_COMMAND)
QUEUE_DEPTH = 1000  # samples; a second of 1 kHz while the disk is busy
FLUSH_PERIOD_S = 0.4  # a killed recorder loses what came since
SETTLE_S = 0.2  # the two ends of a connection learn of each other one after the other
EVERYTHING = "*"
KNOWN_TYPES = TYPES | OTHER_TYPES
_TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")
_HOUSEKEEPING = ("/rosout", "/parameter_events")


@dataclass(frozen=True)
class Publisher:
    """One publisher in the ROS graph: message type ("pkg/msg/Type"), type hash (RIHS01), QoS it offers."""

    type: str
    type_hash: str
    qos: OfferedQos


def request(publishers: Sequence[Publisher]) -> OfferedQos:
    """The QoS to subscribe with: the strongest that all `publishers` (at least one) offer, so that none is refused."""
    return OfferedQos(
        reliable=all(publisher.qos.reliable for publisher in publishers),
        latched=all(publisher.qos.latched for publisher in publishers),
        depth=QUEUE_DEPTH,
    )


def offered(topic: str, publishers: Sequence[Publisher], current: str = "") -> tuple[list[Publisher], str]:
    """The publishers of `topic` that can be recorded, and what is wrong with the others, or "".

    A known topic has a fixed type; another one has that of the subscription (`current`), or the type offered first.
    """
    wanted = KNOWN_TYPES.get(topic) or current or next((p.type for p in publishers if _TYPE.fullmatch(p.type)), "")
    good = [publisher for publisher in publishers if wanted and publisher.type == wanted]
    odd = sorted({publisher.type or "nothing" for publisher in publishers if publisher not in good})
    if not odd:
        return good, ""
    listed = quoted(", ".join(odd))
    return good, f"{topic} is offered as {listed}, which is not recorded: it has to be {wanted or 'package/msg/Type'}"


def must_renew(current: OfferedQos, publishers: Sequence[Publisher]) -> bool:
    """True if a new publisher offers less than the subscription requests, so that it would not be received."""
    wanted = request(publishers)
    return (current.reliable and not wanted.reliable) or (current.latched and not wanted.latched)


def wanted_topics(asked: Sequence[str], seen: Iterable[str]) -> list[str]:
    """Topics to record: the requested ones, or with "*" all that were seen except ROS's internal ones."""
    if EVERYTHING not in asked:
        return list(asked)
    found = [topic for topic in sorted(seen) if topic not in _HOUSEKEEPING and "/_" not in topic]
    return [topic for topic in asked if topic != EVERYTHING] + [topic for topic in found if topic not in asked]


@dataclass
class Readiness:
    """Ready once every required topic has been matched without interruption for `SETTLE_S`."""

    required: tuple[str, ...]
    since_s: dict[str, float] = field(default_factory=dict)

    def update(self, matched: Iterable[str], now_s: float) -> bool:
        """Update with the topics matched at `now_s` (monotonic) [s]; returns whether the recorder is ready."""
        matched = set(matched)
        self.since_s = {topic: self.since_s.get(topic, now_s) for topic in self.required if topic in matched}
        return not self.missing(now_s)

    def missing(self, now_s: float) -> list[str]:
        """Required topics without a publisher, or with one for too short a time."""
        return [topic for topic in self.required if now_s - self.since_s.get(topic, now_s) < SETTLE_S]


@dataclass
class Traffic:
    """Counts of one topic: messages, bytes, lost by the middleware, and the rate since the last report."""

    messages: int = 0
    bytes: int = 0
    lost: int = 0
    _reported: int = 0
    _reported_at_s: float | None = None

    def add(self, size: int) -> None:
        """Count one message of `size` bytes."""
        self.messages += 1
        self.bytes += size

    def rate(self, now_s: float) -> float:
        """Messages per second [1/s] since the last call."""
        before, self._reported_at_s = self._reported_at_s, now_s
        count, self._reported = self.messages - self._reported, self.messages
        return count / (now_s - before) if before is not None and now_s > before else 0.0


def summary(path: str, traffic: dict[str, Traffic], asked: Sequence[str]) -> list[str]:
    """Lines to print at the end: the path of the bag, and its content by topic."""
    total = sum(counts.messages for counts in traffic.values())
    lines = [f"{path}: {total} messages"]
    for topic in sorted(set(traffic) | {topic for topic in asked if topic != EVERYTHING}):
        counts = traffic.get(topic, Traffic())
        lost = f", {counts.lost} lost in transit" if counts.lost else ""
        lines.append(
            f"  {topic}: {counts.messages} messages{lost}" if counts.messages else f"  {topic}: no message was received"
        )
    return lines
