"""A message that is serialised once; before each publication only stamp and numbers are written into its bytes.

rclpy converts a message field by field on every ``publish``; at 400 messages a second that is most of the cost of
a message on its way to the middleware. The bytes are those that rclpy itself makes (CDR, in this computer's byte order).
"""

import struct
from collections.abc import Callable
from typing import Any

_STAMP_AT = 4  # behind the encapsulation header, every message with a std_msgs/Header first begins with its stamp
_STAMP = struct.Struct("=iI")
_NUMBER = struct.Struct("=d")
_MARK = -7.301938475629e201


class PreparedMessage:
    """Bytes of one message with places for a stamp and float64 numbers.

    Args:
        message: a message with a ``std_msgs/Header`` as first field; fields not in ``places`` stay as they are.
        places: path of every number to be written, e.g. ``"fluid_pressure"`` or ``"position.0"``, in the order of :meth:`fill`.
        serialise: makes the bytes of a message (``rclpy.serialization.serialize_message``).

    Raises:
        ValueError: a path does not lead to a float64.
    """

    def __init__(self, message: Any, places: tuple[str, ...], serialise: Callable[[Any], bytes]) -> None:
        self._bytes = bytearray(serialise(message))
        self._at = []
        for place in places:
            owner, key = _owner(message, place)
            before = _get(owner, key)
            _set(owner, key, _MARK)
            marked = bytes(serialise(message))
            _set(owner, key, before)
            at = marked.find(_NUMBER.pack(_MARK))
            if at < 0 or len(marked) != len(self._bytes):
                raise ValueError(f"{place} is no float64 of {type(message).__name__}")
            self._at.append(at)

    def fill(self, stamp_ns: int, *numbers: float) -> bytes:
        """The message with this stamp [ns] and these numbers, for ``Publisher.publish``."""
        seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
        _STAMP.pack_into(self._bytes, _STAMP_AT, seconds, nanoseconds)
        for at, number in zip(self._at, numbers, strict=True):
            _NUMBER.pack_into(self._bytes, at, number)
        return bytes(self._bytes)


def _owner(message: Any, place: str) -> tuple[Any, str]:
    *path, last = place.split(".")
    for name in path:
        message = _get(message, name)
    return message, last


def _get(owner: Any, key: str) -> Any:
    return owner[int(key)] if key.isdigit() else getattr(owner, key)


def _set(owner: Any, key: str, value: float) -> None:
    if key.isdigit():
        owner[int(key)] = value
    else:
        setattr(owner, key, value)
