"""The findings of a fleet as ``/diagnostics`` messages in a bag: for tools that read the health of machines from topics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from boom_fleet.table import Row
from boom_recording import definitions
from boom_recording.bag_writer import BagWriter, OfferedQos
from boom_report.fleet import words

TOPIC, TYPE, STATUS, VALUE = (
    "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "diagnostic_msgs/msg/DiagnosticStatus",
    "diagnostic_msgs/msg/KeyValue",
)  # fmt: skip
OK, WARN, ERROR = 0, 1, 2
_QOS = OfferedQos(reliable=True, depth=10)


def publish(path: Path, rows: Sequence[Row]) -> int:
    """Write a message for each recording of which the time is known, at that time; returns how many.

    Raises:
        RecordingError: the bag exists, or cannot be written.
    """
    definitions.ensure(TYPE)
    text, type_hash = definitions.definition(TYPE)
    known = sorted((row for row in rows if row.get("time") is not None), key=lambda row: (row["time"], row["machine"]))
    with BagWriter(path) as bag:
        topic = bag.add_topic(TOPIC, TYPE, text, type_hash, _QOS)
        for k, row in enumerate(known):
            nanoseconds = int(row["time"].timestamp() * 1e6) * 1000
            bag.write(topic, _message(row, nanoseconds), nanoseconds, nanoseconds, k)
    return len(known)


def _message(row: Row, nanoseconds: int) -> bytes:
    store = definitions.typestore()
    types = store.types
    level, said = _health(row)
    values = {
        "recording": row["recording"], "P(nothing changed)": row.get("unchanged"), "raised": row.get("raised"),
        "verdict": row.get("verdict"), "effect": row.get("effect"),
    }  # fmt: skip
    pairs = [types[VALUE](key=key, value=str(value)) for key, value in values.items() if value is not None]
    status: Any = types[STATUS](
        level=level, name=f"fleet: {row['machine']}", message=said, hardware_id=row["machine"], values=pairs
    )
    stamp = types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    return bytes(store.serialize_cdr(types[TYPE](header=header, status=[status]), TYPE))


def _health(row: Row) -> tuple[int, str]:
    if row.get("failure"):
        return ERROR, row["failure"]
    if row.get("refused"):
        return ERROR, row["refused"]
    changes = row.get("changes") or []
    if changes:
        return WARN, "; ".join(words.change_sentence(change) for change in changes)
    return OK, "as in its recordings before"
