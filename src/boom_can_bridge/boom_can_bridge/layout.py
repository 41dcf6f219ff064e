"""Position of a signal in a payload of up to eight bytes, and the meaning of its bits."""

import math
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SignalLayout:
    """Bits of one signal and their physical value `raw * scale + offset`.

    name       in the DBC file
    shift      from the lowest bit of the payload, read as one 64-bit number in the signal's byte order
    bits       length
    big_endian byte order
    signed, is_float   kind of the raw number (a float has 32 or 64 bits)
    """

    name: str
    shift: int
    bits: int
    big_endian: bool
    signed: bool
    is_float: bool

    @classmethod
    def at(cls, name: str, start: int, bits: int, *, big_endian: bool, signed: bool, is_float: bool) -> "SignalLayout":
        """Layout from the start bit in the numbering of a DBC file (big-endian: of the highest bit)."""
        shift = 64 - (8 * (start // 8) + 7 - start % 8) - bits if big_endian else start
        return cls(name, shift, bits, big_endian, signed, is_float)

    @property
    def mask(self) -> int:
        """A mask with as many ones as the signal has bits."""
        return (1 << self.bits) - 1

    @property
    def raw_limits(self) -> tuple[float, float]:
        """Lowest and highest raw number."""
        if self.is_float:
            return (-3.4028234663852886e38, 3.4028234663852886e38) if self.bits == 32 else (-1e300, 1e300)
        if self.signed:
            return -(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1
        return 0, self.mask

    def extract(self, payload: bytes) -> float:
        """Raw number from a payload (an int; a float for float signals)."""
        word = int.from_bytes(payload.ljust(8, b"\0"), "big" if self.big_endian else "little")
        raw = (word >> self.shift) & self.mask
        if self.is_float:
            kind = ("<I", "<f") if self.bits == 32 else ("<Q", "<d")
            return float(struct.unpack(kind[1], struct.pack(kind[0], raw))[0])
        if self.signed and raw >> (self.bits - 1):
            raw -= 1 << self.bits
        return raw

    def insert(self, payload: bytes, raw: float) -> bytes:
        """Payload with the raw number in place."""
        if self.is_float:
            kind = ("<I", "<f") if self.bits == 32 else ("<Q", "<d")
            number = int(struct.unpack(kind[0], struct.pack(kind[1], raw))[0])
        else:
            number = int(raw) & self.mask
        order = "big" if self.big_endian else "little"
        word = int.from_bytes(payload.ljust(8, b"\0"), order)  # type: ignore[arg-type]
        word = word & ~(self.mask << self.shift) | number << self.shift
        return word.to_bytes(8, order)[: len(payload)]  # type: ignore[arg-type]

    def extract_rows(self, data: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Raw numbers (n,) from payloads (n, 8)."""
        words = np.ascontiguousarray(data).view(">u8" if self.big_endian else "<u8")[:, 0].astype(np.uint64)
        raw = (words >> np.uint64(self.shift)) & np.uint64(self.mask)
        if self.is_float:
            if self.bits == 32:
                return raw.astype(np.uint32).view(np.float32).astype(np.float64)
            return raw.view(np.float64)
        if self.signed:
            unused = np.uint64(64 - self.bits)
            return ((raw << unused).view(np.int64) >> np.int64(64 - self.bits)).astype(np.float64)
        return raw.astype(np.float64)


@dataclass(frozen=True)
class FieldSpec:
    """One value that the bridge knows.

    name      of the field, e.g. `angle`
    layout    of the signal that carries it
    scale, offset    SI value = raw * scale + offset
    minimum, maximum    plausible range [SI unit]
    rate_limit    largest plausible rate of change [unit/s]; infinity = not checked
    """

    name: str
    layout: SignalLayout
    scale: float
    offset: float
    minimum: float
    maximum: float
    rate_limit: float = math.inf

    @property
    def tolerance(self) -> float:
        """Half a bit [SI unit]: the rounding allowed at the ends of the range."""
        return 0.0 if self.layout.is_float else 0.5000001 * abs(self.scale)

    def to_raw(self, value: float) -> float:
        """Raw number nearest to an SI value.

        Raises:
            ValueError: the value is not a number or not within the range
        """
        if not self.minimum <= value <= self.maximum:
            raise ValueError(f"{self.name} = {value:g} is not within {self.minimum:g} to {self.maximum:g}")
        raw = (value - self.offset) / self.scale
        if self.layout.is_float:
            return raw
        low, high = self.layout.raw_limits
        return min(max(round(raw), low), high)

    def to_value(self, raw: float) -> float:
        """SI value of a raw number."""
        return float(raw) * self.scale + self.offset

    def is_plausible(self, value: float) -> bool:
        """Whether the value is a number within the range, including rounding."""
        return self.minimum - self.tolerance <= value <= self.maximum + self.tolerance
