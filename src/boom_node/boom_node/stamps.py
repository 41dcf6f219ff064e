"""ROS stamps and nanoseconds as integers, because a float resolves a stamp of today to 256 ns only."""

from typing import Protocol, TypeVar

SECOND_NS = 1_000_000_000
FAR_NS = 10 * SECOND_NS
"""A sample stamped further from now than this is refused."""


class Stamp(Protocol):
    """builtin_interfaces/Time, or anything with the same fields."""

    sec: int
    nanosec: int


StampT = TypeVar("StampT", bound=Stamp)


def to_ns(stamp: Stamp) -> int:
    """Nanoseconds since the epoch of the stamp's clock."""
    return int(stamp.sec) * SECOND_NS + int(stamp.nanosec)


def set_ns(stamp: StampT, nanoseconds: int) -> StampT:
    """Write `nanoseconds` into `stamp` and return it. Raises ValueError beyond int32 seconds."""
    sec, nanosec = divmod(int(nanoseconds), SECOND_NS)
    if not -(2**31) <= sec < 2**31:
        raise ValueError(f"{nanoseconds} ns does not fit a ROS stamp: its seconds are an int32")
    stamp.sec, stamp.nanosec = sec, nanosec
    return stamp


def seconds_to_ns(seconds: float) -> int:
    """Seconds [s] as whole nanoseconds, rounded."""
    return round(seconds * SECOND_NS)


def ns_to_seconds(nanoseconds: int) -> float:
    """Nanoseconds as seconds [s]; for differences, not for stamps of today."""
    return nanoseconds / SECOND_NS


def far(stamp_ns: int, now_ns: int) -> str:
    """How far the stamp is from now, in words, if that is too far; else ""."""
    ahead = stamp_ns - now_ns
    if abs(ahead) <= FAR_NS:
        return ""
    return f"{abs(ahead) / SECOND_NS:.0f} s {'ahead of' if ahead > 0 else 'behind'} the clock here"
