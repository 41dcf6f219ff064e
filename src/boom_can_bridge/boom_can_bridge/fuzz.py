"""Feeds random, mutated and truncated frames to the checks and compares the output with the ranges of the mapping."""

import math
import random
from dataclasses import dataclass

from boom_can_bridge.python_can import can

from .codec import Codec
from .receiver import FrameChecker


@dataclass
class FuzzResult:
    """The results for the frames.

    frames      fed in
    readings    accepted as good
    escaped     exceptions that left the checks
    bad_values  readings with a value that is no number or outside the range of its field, or of a frame that was mutated under a
                checksum without passing it by chance
    bad         dropped frames by reason
    """

    frames: int = 0
    readings: int = 0
    escaped: int = 0
    bad_values: int = 0
    bad: dict[str, int] | None = None


def _mutate(rng: random.Random, message: can.Message, ids: list[int]) -> can.Message:
    kind = rng.randrange(8)
    if kind == 0 and message.data:
        for _ in range(rng.randint(1, 12)):
            message.data[rng.randrange(len(message.data))] ^= 1 << rng.randrange(8)
    elif kind == 1:
        message.data = message.data[: rng.randrange(len(message.data) + 1)]
        message.dlc = len(message.data)
    elif kind == 2:
        message.data = bytearray(rng.randbytes(rng.choice((0, 1, 4, 5, 8, 8, 8, 12, 64))))
        message.dlc = rng.choice((len(message.data), 8, 0))
    elif kind == 3:
        message.arbitration_id = rng.choice((*ids, rng.getrandbits(29), rng.getrandbits(11)))
    elif kind == 4:
        message.is_extended_id = not message.is_extended_id
    elif kind == 5:
        message.is_error_frame = True
        message.arbitration_id = rng.choice((*ids, 0x40, 0x04, rng.getrandbits(29)))
    elif kind == 6:
        message.is_remote_frame = True
    else:
        message.timestamp = rng.choice((math.nan, math.inf, -1.0, 0.0, 1e300, rng.random()))
    return message


def fuzz(codec: Codec, frames: int, seed: int) -> FuzzResult:
    """Feed `frames` frames to the checks: a quarter valid, a quarter random, half mutated. Time advances by 1 ms per frame."""
    rng = random.Random(seed)
    checker = FrameChecker(codec, proof=2)
    result = FuzzResult()
    ids = [spec.arbitration_id for spec in codec.frames.values()]
    specs = list(codec.frames.values())
    counters = dict.fromkeys(codec.frames, 0)
    while result.frames < frames:
        result.frames += 1
        now = 0.001 * result.frames
        spec = rng.choice(specs)
        counters[spec.name] += rng.choice((1, 1, 1, 1, 0, 2, -1))
        values = {
            f.name: f.minimum + (0.5 + 0.001 * rng.random()) * (f.maximum - f.minimum) for f in spec.fields.values()
        }
        identifier, payload = codec.encode(spec.name, values, counters[spec.name])
        kind = rng.randrange(4)
        if kind == 0:
            payload = rng.randbytes(rng.randrange(9))
            identifier = rng.choice((*ids, rng.getrandbits(29)))
        message = can.Message(
            timestamp=now, arbitration_id=identifier, data=payload, is_extended_id=spec.is_extended, check=False
        )
        if kind > 1:
            message = _mutate(rng, message, ids)
        try:
            reading = checker.check(message, now)
        except Exception:
            result.escaped += 1
            continue
        if reading is None:
            continue
        result.readings += 1
        fields = codec.frames[reading.frame].fields
        sound = all(math.isfinite(v) and fields[name].is_plausible(v) for name, v in reading.values.items())
        times = math.isfinite(reading.steady) and reading.steady <= now
        if not (sound and times and len(reading.values) == len(fields)):
            result.bad_values += 1
    result.bad = dict(checker.counts.bad)
    return result
