"""The CRC-8 of the frames: SAE J1850 (polynomial 0x1D, start 0xFF, result inverted).

AUTOSAR end-to-end protection uses this polynomial for payloads of a CAN frame: over the at most 80 bits of a frame and its
data id it finds every error of up to three bits and every burst of up to eight. The data id is not sent: it goes into
the checksum first, low byte then high byte, so that a frame that arrives under the wrong id, or from a sender that counts
other frames, does not pass.
"""

import numpy as np
from numpy.typing import NDArray

POLYNOMIAL = 0x1D
START = 0xFF
INVERT = 0xFF


def _make_table() -> bytes:
    table = bytearray()
    for value in range(256):
        for _ in range(8):
            value = ((value << 1) ^ POLYNOMIAL) & 0xFF if value & 0x80 else value << 1
        table.append(value)
    return bytes(table)


_TABLE = _make_table()
_TABLE_ARRAY: NDArray[np.uint8] = np.frombuffer(_TABLE, np.uint8)


def crc8(data: bytes, state: int = START) -> int:
    """Checksum of `data`; `state` comes from `start` if a data id goes first."""
    for byte in data:
        state = _TABLE[state ^ byte]
    return state ^ INVERT


def start(data_id: int | None) -> int:
    """State of the checksum after the 16-bit data id, or the initial state without one."""
    if data_id is None:
        return START
    return crc8(data_id.to_bytes(2, "little")) ^ INVERT


def crc8_rows(data: NDArray[np.uint8], position: int, length: int, state: int) -> NDArray[np.uint8]:
    """Checksums of many payloads.

    Args:
        data: payloads (n, 8)
        position: byte that holds the checksum itself and is left out
        length: bytes of the payload
        state: as from `start`

    Returns:
        checksums (n,)
    """
    result = np.full(len(data), state, np.uint8)
    for column in range(length):
        if column != position:
            result = _TABLE_ARRAY[result ^ data[:, column]]
    return result ^ np.uint8(INVERT)
