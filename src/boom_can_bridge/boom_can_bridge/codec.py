"""Converts frames to values and back, singly for the live bus and in bulk for logs, with the same arithmetic.

The DBC file says where the bits are, the mapping beside it what they mean to the bridge. All values are SI, pressures above
ambient (gauge). Field names: the measured channels and the currents of ``boom_input.channels``, mode, faults (bit field),
uptime_s [s]; of the command retract_current, extend_current [A], enable (0, 1).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import crc
from . import mapping as mapping_file
from .errors import CanConfigurationError, FrameError, Reason
from .layout import FieldSpec
from .mapping import FrameSpec

__all__ = [
    "REASONS",
    "Bulk",
    "BulkFrame",
    "CanConfigurationError",
    "Codec",
    "CounterCheck",
    "Decoded",
    "FieldSpec",
    "FrameError",
    "FrameSpec",
]

# Codes of `Bulk.verdicts`: 0 is a good frame, then the reasons in the order of the checks.
REASONS: tuple[Reason, ...] = ("unknown_id", "length", "crc", "decode", "range", "counter")


@dataclass(frozen=True)
class Decoded:
    """A valid frame: its name, SI values by field, and its counter (None = the frame has none)."""

    frame: str
    values: dict[str, float]
    counter: int | None


@dataclass(frozen=True)
class BulkFrame:
    """All good frames of one kind.

    index     (n,) positions in the arrays given to `decode_many`
    values    SI values (n,) by field
    counters  (n,), None without a counter
    """

    index: NDArray[np.intp]
    values: dict[str, NDArray[np.float64]]
    counters: NDArray[np.int64] | None


@dataclass(frozen=True)
class Bulk:
    """The result of `decode_many`.

    frames     by name
    verdicts   (n,) 0 = good, else 1 + the position of the reason in `REASONS`
    """

    frames: dict[str, BulkFrame] = field(default_factory=dict)
    verdicts: NDArray[np.uint8] = field(default_factory=lambda: np.zeros(0, np.uint8))

    def counts(self) -> dict[str, int]:
        """Number of bad frames by reason."""
        numbers = np.bincount(self.verdicts, minlength=len(REASONS) + 1)[1:]
        return {reason: int(number) for reason, number in zip(REASONS, numbers, strict=True) if number}


def _code(reason: Reason) -> int:
    return 1 + REASONS.index(reason)


class Codec:
    """Encodes and decodes the frames of one machine; holds no state."""

    def __init__(self, frames: Mapping[str, FrameSpec]) -> None:
        self.frames: Mapping[str, FrameSpec] = dict(frames)
        self._by_id: dict[tuple[int, bool], list[FrameSpec]] = {}
        for spec in self.frames.values():
            self._by_id.setdefault((spec.arbitration_id, spec.is_extended), []).append(spec)

    @classmethod
    def load(cls, dbc: str | Path = "tz17", mapping: str | Path | None = None, *, of_log: bool = False) -> "Codec":
        """Codec of a machine that comes with the package (by name) or of a DBC file (by path).

        Args:
            dbc: name or path
            mapping: name or path; without one, the `.yaml` beside the DBC file
            of_log: to read a log with, where sensors may be missing, and commands

        Raises:
            CanConfigurationError: a file is missing or broken, or the mapping names something that the DBC file lacks
        """
        return cls(mapping_file.read(dbc, mapping, of_log=of_log))

    def knows(self, arbitration_id: int, extended: bool) -> bool:
        """Whether the mapping names this id: a cheap first check, because most frames of a bus are for others."""
        return (arbitration_id, extended) in self._by_id

    @property
    def command(self) -> FrameSpec:
        """The one frame that goes to the ECU."""
        return next(spec for spec in self.frames.values() if spec.direction == "to_ecu")

    @property
    def incoming(self) -> list[FrameSpec]:
        """The frames that come from the ECU."""
        return [spec for spec in self.frames.values() if spec.direction == "from_ecu"]

    def encode(self, frame: str, values: Mapping[str, float], counter: int = 0) -> tuple[int, bytes]:
        """Arbitration id and payload of a frame, counter and checksum included.

        Args:
            frame: name
            values: SI values of all fields of the frame
            counter: rolling, wraps by itself

        Raises:
            FrameError: `range` if a value is missing, not a number, or not representable
        """
        spec = self.frames[frame]
        payload = spec.template
        for name, field_spec in spec.fields.items():
            try:
                payload = field_spec.layout.insert(payload, field_spec.to_raw(values[name]))
            except KeyError:
                raise FrameError("range", f"{frame}: no value for {name}") from None
            except ValueError as error:
                raise FrameError("range", f"{frame}: {error}") from None
        if spec.counter is not None:
            payload = spec.counter.insert(payload, counter % spec.counter_modulus)
        if spec.crc_byte is not None:
            payload = self._with_checksum(spec, payload)
        return spec.arbitration_id, payload

    @staticmethod
    def _checksum(spec: FrameSpec, payload: bytes) -> int:
        at = spec.crc_byte or 0
        return crc.crc8(payload[:at] + payload[at + 1 :], spec.crc_start)

    def _with_checksum(self, spec: FrameSpec, payload: bytes) -> bytes:
        at = spec.crc_byte or 0
        return payload[:at] + bytes([self._checksum(spec, payload)]) + payload[at + 1 :]

    def decode(self, arbitration_id: int, data: bytes, *, extended: bool = False) -> Decoded:
        """Values of a frame; checks id, length, checksum and range, in this order, but not the order of counters.

        Raises:
            FrameError: the frame is not valid; a page of a multiplexed message that the mapping does not name
                counts as an unknown id
        """
        specs = self._by_id.get((arbitration_id, extended))
        if specs is None:
            raise FrameError("unknown_id", f"id {arbitration_id:#x}")
        spec = specs[0]
        if len(data) != spec.length:
            raise FrameError("length", f"{spec.name}: {len(data)} bytes instead of {spec.length}")
        if spec.crc_byte is not None and data[spec.crc_byte] != self._checksum(spec, data):
            raise FrameError("crc", f"{spec.name}: checksum wrong")
        for spec in specs:
            if all(layout.extract(data) == value for layout, value in spec.select):
                break
        else:
            raise FrameError("unknown_id", f"{spec.message}: page not named by the mapping")
        values = {}
        for name, field_spec in spec.fields.items():
            value = field_spec.to_value(field_spec.layout.extract(data))
            # Also false for what is not a number.
            if not field_spec.is_plausible(value):
                raise FrameError("range", f"{spec.name}: {name} = {value:g}")
            values[name] = value
        counter = None if spec.counter is None else int(spec.counter.extract(data))
        return Decoded(spec.name, values, counter)

    def decode_many(
        self,
        ids: ArrayLike,
        data: NDArray[np.uint8],
        lengths: ArrayLike,
        extended: ArrayLike | None = None,
    ) -> Bulk:
        """Like `decode`, for many frames at once; bit for bit the same values. Counters are returned, not checked.

        Args:
            ids: arbitration ids (n,)
            data: payloads (n, 8), short ones filled up with zeros
            lengths: received bytes (n,)
            extended: whether an id has 29 bits (n,); without it, none has

        Returns:
            good frames by name, in the order given, and a verdict for every frame
        """
        ids = np.asarray(ids, np.int64)
        lengths = np.asarray(lengths, np.int64)
        kinds = np.zeros(len(ids), bool) if extended is None else np.asarray(extended, bool)
        verdicts = np.full(len(ids), _code("unknown_id"), np.uint8)
        frames: dict[str, BulkFrame] = {}
        for (arbitration_id, is_extended), specs in self._by_id.items():
            index = np.flatnonzero((ids == arbitration_id) & (kinds == is_extended))
            fits = lengths[index] == specs[0].length
            verdicts[index[~fits]] = _code("length")
            index = index[fits]
            payloads = data[index]
            if specs[0].crc_byte is not None:
                at = specs[0].crc_byte
                good = crc.crc8_rows(payloads, at, specs[0].length, specs[0].crc_start) == payloads[:, at]
                verdicts[index[~good]] = _code("crc")
                index, payloads = index[good], payloads[good]
            for spec in specs:
                here = np.ones(len(index), bool)
                for layout, value in spec.select:
                    here &= layout.extract_rows(payloads) == value
                frames[spec.name] = self._rows(spec, index[here], payloads[here], verdicts)
        return Bulk(frames, verdicts)

    @staticmethod
    def _rows(
        spec: FrameSpec, index: NDArray[np.intp], payloads: NDArray[np.uint8], verdicts: NDArray[np.uint8]
    ) -> BulkFrame:
        values: dict[str, NDArray[np.float64]] = {}
        good = np.ones(len(index), bool)
        for name, field_spec in spec.fields.items():
            values[name] = field_spec.layout.extract_rows(payloads) * field_spec.scale + field_spec.offset
            good &= values[name] >= field_spec.minimum - field_spec.tolerance
            good &= values[name] <= field_spec.maximum + field_spec.tolerance
        verdicts[index] = np.where(good, 0, _code("range"))
        counters = None if spec.counter is None else spec.counter.extract_rows(payloads).astype(np.int64)[good]
        return BulkFrame(index[good], {name: column[good] for name, column in values.items()}, counters)


@dataclass
class _CounterState:
    last: int
    time: float
    refused: int = -1
    run: int = 0


class CounterCheck:
    """Checks the rolling counters: counts lost frames, refuses repeated and late ones.

    A restarted sender may count from any value: its frames are accepted after `RESYNC` in a row, or at once after a
    silence of `SILENCE_S`.
    """

    RESYNC = 5
    SILENCE_S = 0.1

    def __init__(self, codec: Codec) -> None:
        self._modulus = {name: spec.counter_modulus for name, spec in codec.frames.items()}
        self._states: dict[str, _CounterState] = {}

    def accept(self, frame: str, counter: int | None, time: float = 0.0) -> int:
        """Check the counter of a good frame.

        Args:
            frame: name
            counter: as decoded; None is always accepted
            time: time of the frame [s], on one clock; leave it out if silence does not matter

        Returns:
            how many frames were lost before this one

        Raises:
            FrameError: `counter`: repeated (frozen), or out of order
        """
        modulus = self._modulus[frame]
        if counter is None or not modulus:
            return 0
        state = self._states.get(frame)
        if state is None:
            self._states[frame] = _CounterState(counter, time)
            return 0
        step = (counter - state.last) % modulus
        if step == 0 or (step > modulus // 2 and time - state.time < self.SILENCE_S):
            # Only counting upwards makes a run: a frozen counter never becomes acceptable.
            state.run = state.run + 1 if step and counter == (state.refused + 1) % modulus else 1
            state.refused = counter
            if step == 0:
                raise FrameError("counter", f"{frame}: counter stands at {counter}")
            if state.run < self.RESYNC:
                raise FrameError("counter", f"{frame}: counter {counter} after {state.last}, out of order")
            step = 1
        silent = time - state.time >= self.SILENCE_S
        state.last, state.time, state.run, state.refused = counter, time, 0, -1
        return 0 if silent and step > modulus // 2 else step - 1

    def accept_many(
        self, frame: str, counters: NDArray[np.int64] | None, times: NDArray[np.float64]
    ) -> tuple[NDArray[np.bool_], int]:
        """Like `accept`, for many frames of one kind.

        Args:
            frame: name
            counters: (n,) or None
            times: of the frames [s] (n,)

        Returns:
            which are accepted (n,), and the number lost
        """
        good = np.ones(len(times), bool)
        modulus = self._modulus[frame]
        if counters is None or not modulus or not len(counters):
            return good, 0
        state = self._states.get(frame)
        first = 0 if state is None else int((counters[0] - state.last) % modulus) - 1
        if first == 0 and bool(np.all(np.diff(counters) % modulus == 1)):
            self._states[frame] = _CounterState(int(counters[-1]), float(times[-1]))
            return good, 0
        lost = 0
        for i, (counter, time) in enumerate(zip(counters.tolist(), times.tolist(), strict=True)):
            try:
                lost += self.accept(frame, counter, time)
            except FrameError:
                good[i] = False
        return good, lost

    def forget(self, frame: str | None = None) -> None:
        """Accept any next counter, of one frame or of all."""
        if frame is None:
            self._states.clear()
        else:
            self._states.pop(frame, None)
