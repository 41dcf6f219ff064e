"""The table of a fleet: one row a recording, one Parquet file a machine; any tool reads the folder as one dataset."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from boom_fleet import __version__
from boom_fleet.judging import SAME_TIME, Judgement
from boom_fleet.numbers import TrackedQuantity
from boom_fleet.run import FleetRun
from boom_fleet.screen import REGIMES
from boom_fleet.store import Store
from boom_input.channels import PREDICTED
from boom_input.shown import printable
from boom_recording.writing import START_NS

FOLDER = "recordings"
EQUAL_TIME = (
    "another recording of the machine has the same time, so its clock tells nothing: they are compared in the order of their "
    "names, as if a month had passed"
)
DAY_NS = 86_400 * 10**9
NO_DATE = (
    "it begins on the fixed day of bags without a clock, as of a simulation or of a file without a date: its place among the "
    "machine's recordings is that day's, and may be wrong"
)
_PLAIN = re.compile(r"[A-Za-z0-9][\w.-]{0,99}", re.ASCII)
Row = dict[str, Any]


def rows(run: FleetRun) -> list[Row]:
    """One row a recording, machine by machine in the order of time."""
    result = []
    begun: dict[str, list[float]] = {}
    for key, columns in run.columns.items():
        if columns.get("time_ns"):
            begun.setdefault(run.tasks[key].bag.machine, []).append(columns["time_ns"] / 1e9)
    for key, task in run.tasks.items():
        columns, bag = run.columns[key], task.bag
        row: Row = {
            "machine": bag.machine, "recording": bag.recording, "url": bag.url, "key": key, "version": __version__,
            "machine_file_sha256": hashlib.sha256(task.text).hexdigest() if task.text else "",
            "time": _time(columns["time_ns"] / 1e9) if columns.get("time_ns") else None,
        }  # fmt: skip
        row |= {name: value for name, value in columns.items() if name not in ("time_ns", "pose")}
        if row["time"] and sum(abs(t - columns["time_ns"] / 1e9) < SAME_TIME for t in begun[bag.machine]) > 1:
            row["warnings"] = [*row.get("warnings", []), EQUAL_TIME]
        elif row["time"] and 0 <= columns["time_ns"] - START_NS < DAY_NS:
            row["warnings"] = [*row.get("warnings", []), NO_DATE]
        judgement = run.judgements.get(bag.machine)
        if judgement is not None and key in judgement.keys:
            row |= _compared(key, judgement, run.quantities[bag.machine])
        result.append(row)
    return result


def _compared(key: str, judgement: Judgement, quantities: Mapping[str, TrackedQuantity]) -> Row:
    """What the comparison with the machine's own past said after a recording."""
    k = judgement.keys.index(key)
    history = judgement.histories[k]
    row: Row = {"raised": key in judgement.raised, "unchanged": history.unchanged, "log_odds_changed": history.odds}
    row["changes"] = [
        {
            "quantity": c.quantity, "shape": c.shape, "since_earliest": _time(c.since[0]), "since_latest": _time(c.since[1]),
            "change": quantities[c.quantity].scale * c.size, "change_low": quantities[c.quantity].scale * c.interval[0],
            "change_high": quantities[c.quantity].scale * c.interval[1], "unit": quantities[c.quantity].unit,
            "probability": c.probability, "alternatives": [{"quantity": n, "probability": p} for n, p in c.alternatives],
        }
        for c in history.changes
    ]  # fmt: skip
    row["levels"] = [
        {"quantity": name, "level": levels[k].value, "level_low": levels[k].low, "level_high": levels[k].high,
         "unit": quantities[name].unit}
        for name, levels in judgement.levels.items()
    ]  # fmt: skip
    return row


def write(store: Store, table: Sequence[Row]) -> None:
    """Write the dataset: a file for each machine.

    Raises:
        StoreError: it cannot be written.
    """
    import pyarrow
    from pyarrow import parquet

    by_machine: dict[str, list[Row]] = {}
    for row in table:
        by_machine.setdefault(row["machine"], []).append(row)
    for machine, own in by_machine.items():
        buffer = io.BytesIO()
        shown = [{k: printable(v) if isinstance(v, str) else v for k, v in row.items()} for row in own]
        parquet.write_table(pyarrow.Table.from_pylist(shown, schema=schema()), buffer)
        store.write(file_of(machine), buffer.getvalue())


def file_of(machine: str) -> str:
    """The file of a machine: a name that every file system and reader takes; many skip those that begin with ``_`` or ``.``."""
    name = machine
    if not _PLAIN.fullmatch(machine):
        digest = hashlib.sha256(machine.encode("utf-8", "surrogateescape")).hexdigest()
        name = f"{re.sub(r'[^A-Za-z0-9]+', '-', machine).strip('-')[:80] or 'machine'}-{digest[:8]}"
    return f"{FOLDER}/{name}.parquet"


def schema() -> Any:
    """Columns of the dataset with their types; SI units, gauge pressures."""
    import pyarrow as pa

    text, number, when = pa.string(), pa.float64(), pa.timestamp("us", tz="UTC")
    check = pa.struct({"kind": text, "sentence": text})
    change = pa.struct({
        "quantity": text, "shape": text, "since_earliest": when, "since_latest": when, "change": number, "change_low": number,
        "change_high": number, "unit": text, "probability": number,
        "alternatives": pa.list_(pa.struct({"quantity": text, "probability": number})),
    })  # fmt: skip
    level = pa.struct(
        {"quantity": text, "level": number, "level_low": number, "level_high": number, "unit": text}
    )  # fmt: skip
    screen = {f"nats_{c.name}_{r}": number for c in PREDICTED for r in REGIMES}
    return pa.schema({
        "machine": text, "time": when, "recording": text, "url": text, "key": text, "version": text, "model": text,
        "machine_file_sha256": text, "duration_s": number, "screened_s": number, "moving_s": number, "defects": pa.int64(),
        "warnings": pa.list_(text), "checks": pa.list_(check), "refused": text, "failure": text, **screen,
        "unchanged": number, "log_odds_changed": number, "raised": pa.bool_(), "changes": pa.list_(change),
        "levels": pa.list_(level), "verdict": text, "effect": text, "subsystem": text, "confidence": number, "evidence": text,
        "parameter": text, "size": number, "size_low": number, "size_high": number, "unit": text,
        "alternatives": pa.list_(pa.struct({"effect": text, "confidence": number})), "next_experiment": text,
        "diagnosis_failure": text, "screen_processor_s": number, "diagnosis_processor_s": number,
    })  # fmt: skip


def _time(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)
