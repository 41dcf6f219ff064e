"""Makes frame descriptions of a DBC file and the mapping beside it; what does not fit ends in one plain line."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from boom_input.channels import REQUIRED, SENSORS
from boom_input.shown import quoted

from . import crc
from .errors import CanConfigurationError
from .layout import FieldSpec, SignalLayout
from .mapping_files import closest, find_files, read_dbc, read_mapping

LONGEST_MESSAGE = 500
Direction = Literal["from_ecu", "to_ecu"]

SENSOR_FIELDS = tuple(channel.name for channel in REQUIRED)
OPTIONAL_FIELDS = tuple(sensor.name for sensor in SENSORS if sensor.is_pressure and not sensor.required)
STATUS_FIELDS = ("mode", "faults", "uptime_s")
LOGGED_FIELDS = ("angle",)
COMMAND_FIELDS = ("retract_current", "extend_current", "enable")
TOGETHER = (("angle", "rate"), ("retract_current", "extend_current"))

_FRAME_KEYS = ("message", "direction", "fields", "select", "crc", "counter", "period")
_FIELD_KEYS = ("signal", "factor", "offset", "sign", "minimum", "maximum", "rate_limit")


@dataclass(frozen=True)
class FrameSpec:
    """One frame as the bridge sees it: a message of the DBC file, or one page of a multiplexed message.

    name            in the mapping
    message         in the DBC file
    arbitration_id, is_extended, length [bytes]
    fields          by name
    period_s        between two frames [s]
    direction       `from_ecu` or `to_ecu`
    select          multiplexer signals and the raw values that mean this frame
    template        payload with all values at rest, multiplexer set
    crc_byte, crc_start   byte of the checksum (None = none) and its state after the data id
    counter         layout of the rolling counter (None = none)
    """

    name: str
    message: str
    arbitration_id: int
    is_extended: bool
    length: int
    fields: dict[str, FieldSpec]
    period_s: float
    direction: Direction
    select: tuple[tuple[SignalLayout, int], ...] = ()
    template: bytes = b""
    crc_byte: int | None = None
    crc_start: int = crc.START
    counter: SignalLayout | None = None

    @property
    def counter_modulus(self) -> int:
        """Number of values that the counter takes; 0 without one."""
        return 0 if self.counter is None else 1 << self.counter.bits


class _MappingReader:
    """Builds the frames of one mapping; `where` prefixes every error message."""

    def __init__(self, database: Any, document: dict[str, Any], dbc: Path, mapping: Path) -> None:
        self.database = database
        self.document = document
        self.dbc = dbc
        self.path = mapping
        self.where = str(mapping)

    def fail(self, text: str) -> CanConfigurationError:
        return CanConfigurationError(quoted(f"{self.where}: {text}", LONGEST_MESSAGE))

    def number(self, value: Any, key: str) -> float:
        # YAML 1.1 takes 1e5 for a text.
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            raise self.fail(f"{key} must be a number, not {value!r}") from None
        if isinstance(value, bool) or not math.isfinite(number):
            raise self.fail(f"{key} must be a finite number, not {value!r}")
        return number

    def check_keys(self, entry: Any, keys: tuple[str, ...], needed: tuple[str, ...]) -> None:
        if not isinstance(entry, dict):
            raise self.fail(f"must have the keys {', '.join(needed)}")
        for key in entry:
            if key not in keys:
                raise self.fail(f"unknown key {key}: {closest(str(key), keys)}")
        for key in needed:
            if key not in entry:
                raise self.fail(f"the key {key} is missing")

    def signal(self, message: Any, name: Any) -> Any:
        for signal in message.signals:
            if signal.name == name:
                return signal
        names = [signal.name for signal in message.signals]
        raise self.fail(f"message {message.name} of {self.dbc.name} has no signal {name}: {closest(str(name), names)}")

    def layout(self, message: Any, name: Any) -> tuple[SignalLayout, Any]:
        signal = self.signal(message, name)
        layout = SignalLayout.at(
            signal.name,
            signal.start,
            signal.length,
            big_endian=signal.byte_order == "big_endian",
            signed=signal.is_signed,
            is_float=signal.conversion.is_float,
        )
        if layout.is_float and layout.bits not in (32, 64):
            raise self.fail(f"signal {name}: a float of {layout.bits} bits cannot be read")
        return layout, signal

    def field(self, message: Any, name: str, entry: Any) -> tuple[FieldSpec, Any]:
        self.check_keys(entry, _FIELD_KEYS, ("signal",))
        layout, signal = self.layout(message, entry["signal"])
        sign = self.number(entry.get("sign", 1), "sign")
        factor = self.number(entry.get("factor", 1), "factor")
        if sign not in (1, -1) or factor <= 0:
            raise self.fail(f"field {name}: sign is 1 or -1 and factor larger than zero")
        scale = sign * factor * self.number(signal.scale, f"the factor of {signal.name}")
        shift = self.number(entry.get("offset", 0), "offset")
        offset = sign * factor * self.number(signal.offset, f"the offset of {signal.name}") + shift
        if not scale:
            raise self.fail(f"signal {signal.name} of {self.dbc.name} has the factor 0")
        ends = sorted(raw * scale + offset for raw in layout.raw_limits)
        # [0|0] in a DBC file means: no range given. cantools hands None then.
        for limit in (signal.minimum, signal.maximum):
            if limit is not None:
                value = self.number(limit, f"the range of {signal.name}") * sign * factor + shift
                is_low = (limit is signal.minimum) == (sign > 0)
                ends = [max(ends[0], value), ends[1]] if is_low else [ends[0], min(ends[1], value)]
        low = max(ends[0], self.number(entry["minimum"], "minimum")) if "minimum" in entry else ends[0]
        high = min(ends[1], self.number(entry["maximum"], "maximum")) if "maximum" in entry else ends[1]
        if not low < high:
            raise self.fail(f"field {name}: the range {low:g} to {high:g} is empty")
        limit = self.number(entry["rate_limit"], "rate_limit") if "rate_limit" in entry else math.inf
        if limit <= 0:
            raise self.fail(f"field {name}: rate_limit must be larger than zero")
        return FieldSpec(name, layout, scale, offset, low, high, limit), signal

    def period(self, entry: dict[str, Any], message: Any) -> float:
        stated = entry.get("period", self.document.get("period"))
        if stated is None:
            # Without a statement of its own a message gets the default of the file, which cantools does not fill in.
            stated = self.number(message.cycle_time or 10, f"the cycle time of {message.name}") / 1000
        period = self.number(stated, "period")
        if not 0 < period <= 10:
            raise self.fail(f"period must be above 0 and at most 10 s, not {period:g}")
        return period

    def frame(self, name: str, entry: Any) -> FrameSpec:
        self.where = f"{self.path}: frame {name}"
        self.check_keys(entry, _FRAME_KEYS, ("message", "direction", "fields"))
        direction = entry["direction"]
        if direction not in ("from_ecu", "to_ecu"):
            raise self.fail(f"direction is from_ecu or to_ecu, not {direction}")
        message = self.message(entry["message"])
        if not isinstance(entry["fields"], dict) or not entry["fields"]:
            raise self.fail("fields is empty")
        select, chosen = self.select(message, entry)
        allowed = COMMAND_FIELDS if direction == "to_ecu" else SENSOR_FIELDS + OPTIONAL_FIELDS + STATUS_FIELDS
        fields = self.fields(message, entry["fields"], allowed, chosen)
        crc_byte, crc_start = self.checksum(message, entry.get("crc"))
        counter = self.counter(message, entry.get("counter"), in_pages=bool(select))
        return FrameSpec(
            name, message.name, message.frame_id, message.is_extended_frame, message.length, fields,
            self.period(entry, message), direction, select, self.template(message, select), crc_byte, crc_start, counter,
        )  # fmt: skip

    def message(self, name: Any) -> Any:
        messages = {message.name: message for message in self.database.messages}
        if not isinstance(name, str) or name not in messages:
            raise self.fail(f"{self.dbc.name} has no message {name}: {closest(str(name), messages)}")
        message = messages[name]
        if message.length > 8:
            raise self.fail(f"message {message.name} has {message.length} bytes: CAN FD is not supported")
        return message

    def fields(
        self, message: Any, entries: dict[str, Any], allowed: tuple[str, ...], chosen: dict[str, int]
    ) -> dict[str, FieldSpec]:
        """Of the page that the multiplexer values ``chosen`` select; each signal is used once."""
        fields: dict[str, FieldSpec] = {}
        used = set(chosen)
        for field, description in entries.items():
            if field not in allowed:
                raise self.fail(f"unknown field {field}: {closest(str(field), allowed)}")
            spec, signal = self.field(message, field, description)
            if signal.multiplexer_signal and chosen.get(signal.multiplexer_signal) not in signal.multiplexer_ids:
                raise self.fail(
                    f"signal {signal.name} is there only when {signal.multiplexer_signal} is "
                    f"{' or '.join(map(str, signal.multiplexer_ids))}: say so under select"
                )
            if signal.name in used:
                raise self.fail(f"signal {signal.name} is used twice")
            used.add(signal.name)
            fields[field] = spec
        return fields

    def counter(self, message: Any, name: Any, *, in_pages: bool) -> SignalLayout | None:
        if name is None:
            return None
        if in_pages:
            # Whether such a counter runs per page or per message is not told by a DBC file.
            raise self.fail("a counter in a message with pages is not supported: leave it out")
        counter, signal = self.layout(message, name)
        if counter.is_float or counter.signed or not 2 <= counter.bits <= 16 or signal.multiplexer_signal:
            raise self.fail(f"counter {counter.name} must be an unsigned number of 2 to 16 bits, not multiplexed")
        return counter

    def select(self, message: Any, entry: Any) -> tuple[tuple[tuple[SignalLayout, int], ...], dict[str, int]]:
        chosen = entry.get("select") or {}
        if not isinstance(chosen, dict):
            raise self.fail("select must be signal: value")
        result = []
        for name, value in chosen.items():
            layout, signal = self.layout(message, name)
            if not signal.is_multiplexer:
                raise self.fail(f"signal {name} does not select pages of {message.name}")
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= layout.mask:
                raise self.fail(f"select {name} must be a whole number from 0 to {layout.mask}, not {value!r}")
            result.append((layout, value))
        return tuple(result), dict(chosen)

    def checksum(self, message: Any, entry: Any) -> tuple[int | None, int]:
        if entry is None:
            return None, crc.START
        self.check_keys(entry, ("signal", "data_id"), ("signal",))
        layout, signal = self.layout(message, entry["signal"])
        lowest = 64 - layout.shift - 8 if layout.big_endian else layout.shift
        if layout.bits != 8 or lowest % 8 or signal.multiplexer_signal:
            raise self.fail(f"checksum {layout.name} must fill one byte and not be multiplexed")
        data_id = entry.get("data_id")
        if data_id is not None and (
            isinstance(data_id, bool) or not isinstance(data_id, int) or not 0 <= data_id <= 0xFFFF
        ):
            raise self.fail(f"data_id must be a whole number of 16 bits, not {data_id!r}")
        return lowest // 8, crc.start(data_id)

    def template(self, message: Any, select: tuple[tuple[SignalLayout, int], ...]) -> bytes:
        payload = bytes(message.length)
        for signal in message.signals:
            if signal.raw_initial and not signal.multiplexer_signal:
                layout, _ = self.layout(message, signal.name)
                payload = layout.insert(payload, signal.raw_initial)
        for layout, value in select:
            payload = layout.insert(payload, value)
        return payload

    def frames(self, of_log: bool = False) -> dict[str, FrameSpec]:
        for key in self.document:
            if key not in ("dbc", "period", "frames"):
                raise self.fail(f"unknown key {key}: {closest(str(key), ('dbc', 'period', 'frames'))}")
        frames = {str(name): self.frame(str(name), entry) for name, entry in self.document["frames"].items()}
        self.where = str(self.path)
        incoming, outgoing = (
            [frame for frame in frames.values() if frame.direction == d] for d in ("from_ecu", "to_ecu")
        )
        self.check_sensors(incoming, LOGGED_FIELDS if of_log else SENSOR_FIELDS)
        if outgoing or not of_log:
            self.check_command(outgoing, COMMAND_FIELDS[:2] if of_log else COMMAND_FIELDS)
        elif not {field for frame in incoming for field in frame.fields} >= set(COMMAND_FIELDS[:2]):
            raise self.fail(
                "a log needs the currents: retract_current and extend_current of one frame, from or to the ECU"
            )
        self.check_identifiers(frames.values())
        return frames

    def check_sensors(self, incoming: Sequence[FrameSpec], needed: Sequence[str]) -> None:
        """No field of a sensor comes twice, those needed do once, and each with what makes one message with it."""
        home: dict[str, str] = {}
        for frame in incoming:
            for field in frame.fields:
                if field in home:
                    raise self.fail(f"field {field} is in two frames, {home[field]} and {frame.name}")
                home[field] = frame.name
        for field in needed:
            if field not in home:
                raise self.fail(f"no frame from the ECU has the field {field}")
        for first, second in TOGETHER:
            if {first, second} <= home.keys() and home[first] != home[second]:
                raise self.fail(f"{first} and {second} make one message and must come in one frame")

    def check_command(self, outgoing: Sequence[FrameSpec], needed: Sequence[str]) -> None:
        """One frame commands, and it can close the valve."""
        if len(outgoing) != 1:
            raise self.fail(f"exactly one frame goes to the ECU, there are {len(outgoing)}")
        for field in needed:
            spec = outgoing[0].fields.get(field)
            if spec is None:
                raise self.fail(f"frame {outgoing[0].name} to the ECU needs the field {field}")
            if not spec.minimum <= 0 <= spec.maximum:
                raise self.fail(f"field {field} of {outgoing[0].name} cannot be zero: the valve could not be closed")

    def check_identifiers(self, frames: Iterable[FrameSpec]) -> None:
        """Frames of one identifier are pages of one message, which their multiplexer values tell apart."""
        ids: dict[tuple[bool, int], list[FrameSpec]] = {}
        for frame in frames:
            same = ids.setdefault((frame.is_extended, frame.arbitration_id), [])
            for other in same:
                mine, theirs = dict(frame.select), dict(other.select)
                if mine.keys() != theirs.keys() or mine == theirs or other.direction != frame.direction:
                    raise self.fail(
                        f"frames {other.name} and {frame.name} cannot be told apart: both are {frame.message}"
                    )
                if (frame.crc_byte, frame.crc_start, frame.counter) != (other.crc_byte, other.crc_start, other.counter):
                    raise self.fail(
                        f"frames {other.name} and {frame.name} need the same crc and counter: both are {frame.message}"
                    )
            same.append(frame)


def read(dbc: str | Path, mapping: str | Path | None, *, of_log: bool = False) -> dict[str, FrameSpec]:
    """Frames of a machine, by name; ``of_log``: to read what others sent, so that sensors may be missing, and commands.

    Raises:
        CanConfigurationError: a file is missing or the two do not fit together
    """
    dbc_path, mapping_path = find_files(dbc, mapping)
    document = read_mapping(mapping_path)
    return _MappingReader(read_dbc(dbc_path), document, dbc_path, mapping_path).frames(of_log)
