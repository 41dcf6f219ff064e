"""Bags of the first measurement campaign: one pilot valve on an oscilloscope, as blocks of equally spaced samples.

Topic ``/boom/pilot_valve/oscilloscope``, message ``boom_interfaces/OscilloscopeTrace``. The stamp of a block is the time
of its first sample; blocks that follow each other without a gap are one stretch. Pressures on this topic are gauge.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_input.shown import quoted
from boom_recording import bag_folder, definitions
from boom_recording.bag_writer import BagWriter, OfferedQos
from boom_recording.channels import OSCILLOSCOPE
from boom_recording.errors import RecordingError
from boom_recording.mcap_file import McapFile, opened_mcap
from boom_recording.writing import START_NS

Floats = NDArray[np.float64]

TYPE = "boom_interfaces/msg/OscilloscopeTrace"
VALVES = ("retract", "extend")
_QOS = OfferedQos(reliable=True, depth=5)


@dataclass(frozen=True)
class Stretch:
    """Samples without a gap.

    Attributes:
        start: time of the first one since the start of the trace [s].
        voltage: (n,) PWM voltage u [V].
        current: (n,) solenoid current i with its ripple [A].
        pressure: (n,) pilot control pressure p [Pa gauge].
    """

    start: float
    voltage: Floats
    current: Floats
    pressure: Floats


@dataclass(frozen=True)
class OscilloscopeTrace:
    """One valve over time.

    Attributes:
        name: of the bag. path: of the bag.
        valve: ``retract`` or ``extend``.
        period: sampling period [s].
        stretches: in order of time; several where blocks are missing or samples are no numbers.
        lost: samples that are missing between the stretches, or no numbers.
        warnings: what of the file could not be read, one sentence each.
    """

    name: str
    path: Path
    valve: str
    period: float
    stretches: tuple[Stretch, ...]
    lost: int = 0
    warnings: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """[s] from the first to the last sample."""
        last = self.stretches[-1]
        return last.start + (len(last.current) - 1) * self.period


@dataclass(frozen=True)
class _Block:
    stamp: int
    valve: str
    period: float
    columns: tuple[Floats, Floats, Floats]


def load_traces(path: str | Path) -> list[OscilloscopeTrace]:
    """The traces of the bag at ``path``, one for each valve in it; an empty list where it holds none.

    Raises:
        RecordingError: no bag, not readable, or blocks that contradict each other (period, lengths, valve).
    """
    path = Path(path)
    bag = bag_folder.find(path)
    blocks: list[_Block] = []
    warnings = list(bag.warnings)
    for file in bag.files:
        try:
            with opened_mcap(file) as mcap:
                blocks += _blocks(mcap, warnings)
        except RecordingError as error:
            raise RecordingError(f"{path}: {error}") from None
    return [_trace(bag.name, path, [b for b in blocks if b.valve == valve], tuple(warnings))
            for valve in VALVES if any(b.valve == valve for b in blocks)]  # fmt: skip


def write_trace(path: str | Path, trace: OscilloscopeTrace, *, block: float = 1.0, start_ns: int = START_NS) -> None:
    """Write a trace as a new bag: blocks of ``block`` [s], each logged when it is complete.

    Raises:
        RecordingError: the folder exists, cannot be made, or the disk is full.
    """
    text, type_hash = definitions.definition(TYPE)
    store = definitions.typestore()
    message, header, stamp_type = (
        store.types[name] for name in (TYPE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    size = max(1, round(block / trace.period))
    with BagWriter(Path(path)) as bag:
        number = bag.add_topic(OSCILLOSCOPE, TYPE, text, type_hash, _QOS)
        for stretch in trace.stretches:
            for first in range(0, len(stretch.current), size):
                part = slice(first, first + size)
                at = start_ns + round((stretch.start + first * trace.period) * 1e9)
                data = store.serialize_cdr(
                    message(
                        header=header(stamp=stamp_type(sec=at // 10**9, nanosec=at % 10**9), frame_id=""),
                        valve=trace.valve,
                        sample_period=trace.period,
                        voltage=stretch.voltage[part].astype(np.float32),
                        current=stretch.current[part].astype(np.float32),
                        pressure=stretch.pressure[part].astype(np.float32),
                    ),
                    TYPE,
                )
                log = at + round(len(stretch.current[part]) * trace.period * 1e9)
                bag.write(number, bytes(data), log, log)


def _blocks(file: McapFile, warnings: list[str]) -> list[_Block]:
    definitions.ensure(TYPE)
    store = definitions.typestore()
    found: list[_Block] = []
    unreadable = 0
    for data in _messages(file):
        try:
            found.append(_block(store.deserialize_cdr(data, TYPE)))
        except Exception:  # whatever the generated decoder stumbles over in bytes that are no such message
            unreadable += 1
    for block in found:
        if block.valve not in VALVES:
            raise RecordingError(
                f"{OSCILLOSCOPE} names the valve '{quoted(block.valve)}': it has to be {' or '.join(VALVES)}"
            )
    warnings += [damage.what + (": the messages in it are lost" if damage.loss else "") for damage in file.damages]
    if not file.complete:
        warnings.append(
            "the file was not closed (copied only in part, or its writer was killed): what followed is lost"
        )
    elif file.promised is not None and file.promised > file.messages:
        warnings.append(
            f"{file.promised - file.messages} of the {file.promised} messages that the file counts are lost"
        )
    if unreadable:
        warnings.append(f"{unreadable} messages of {OSCILLOSCOPE} cannot be read and are left out")
    return found


def _messages(file: McapFile) -> Iterator[bytes]:
    for batch in file.batches():
        for i in range(len(batch.offset)):
            topic = file.topics.get(int(batch.channel[i]))
            if topic is None or topic.topic != OSCILLOSCOPE:
                continue
            if topic.type != TYPE:
                raise RecordingError(
                    f"{OSCILLOSCOPE} is of type {quoted(topic.type) or 'unknown'}: it has to be {TYPE}"
                )
            yield batch.message(i)


def _block(message: Any) -> _Block:
    stamp = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
    columns = tuple(np.asarray(getattr(message, name), float) for name in ("voltage", "current", "pressure"))
    return _Block(stamp, str(message.valve), float(message.sample_period), (columns[0], columns[1], columns[2]))


def _trace(name: str, path: Path, blocks: Sequence[_Block], warnings: tuple[str, ...]) -> OscilloscopeTrace:
    blocks = sorted(blocks, key=lambda b: b.stamp)
    period = blocks[0].period
    if not 1e-9 <= period <= 1.0:
        raise RecordingError(f"{path}: the sample period of the oscilloscope is {period} s: it has to be positive")
    for block in blocks:
        if block.period != period:
            raise RecordingError(f"{path}: blocks of {period} s and {block.period} s sample period: split the bag")
        if len({len(column) for column in block.columns}) != 1:
            raise RecordingError(f"{path}: a block has voltage, current and pressure of different lengths")
    pieces, lost = _joined(path, blocks)
    stretches: list[Stretch] = []
    for start, table in pieces:
        good = np.isfinite(table).all(axis=0)  # what is no number cuts a stretch like a gap
        lost += int((~good).sum())
        edges = np.flatnonzero(np.diff(np.concatenate(([False], good, [False])).astype(np.int8)))
        for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            stretches.append(Stretch(start + a * period, table[0, a:b], table[1, a:b], table[2, a:b]))
    if not stretches:
        raise RecordingError(f"{path}: the oscilloscope blocks hold no samples: record again")
    return OscilloscopeTrace(name, path, blocks[0].valve, period, tuple(stretches), lost, warnings)


def _joined(path: Path, blocks: Sequence[_Block]) -> tuple[list[tuple[float, Floats]], int]:
    """Start [s] and samples (3, n) of the blocks that follow each other without a gap; how many samples lie in the gaps."""
    period = blocks[0].period
    pieces: list[tuple[float, Floats]] = []
    lost = 0
    end = 0.0
    for block in blocks:
        start = (block.stamp - blocks[0].stamp) / 1e9
        table = np.stack(block.columns)
        if pieces and abs(start - end) <= 0.5 * period:
            pieces[-1] = (pieces[-1][0], np.concatenate((pieces[-1][1], table), axis=1))
        elif pieces and start < end:
            raise RecordingError(f"{path}: blocks overlap at {start:.3f} s: two recordings in one bag, split it")
        else:
            lost += round((start - end) / period)
            pieces.append((start, table))
        end = start + table.shape[1] * period
    return pieces, lost
