"""The errors of the bridge: wrong configuration, and invalid frames."""

from typing import Literal

Reason = Literal["unknown_id", "length", "crc", "counter", "range", "decode"]


class CanConfigurationError(Exception):
    """The DBC file, the mapping or the bus cannot be used; the message is one line that says what to do."""

    exit_status = 2


class FrameError(Exception):
    """A frame is invalid, or a value cannot be sent.

    reason   unknown_id, length, crc, counter, range or decode
    """

    def __init__(self, reason: Reason, detail: str = "") -> None:
        super().__init__(detail or reason)
        self.reason: Reason = reason
