"""Measures how fast a CAN log becomes a bag: reading, decoding with all checks, writing. Run it alone.

    python benchmarks/can_import.py [--frames 500000]

The log holds what the ECU stand-in and the bridge would send (four frames and a command every 10 ms), in all formats. Prints
frames per second on one core; exit status 1 where one is below the 40 000 that are promised.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import can
import numpy as np

from boom_can_bridge.codec import Codec
from boom_recording import can_import, can_log, writing
from boom_recording.recording import Configuration

PROMISED = 40_000


def messages(count: int, codec: Codec) -> list[can.Message]:
    """A boom that swings, on the bus."""
    random = np.random.default_rng(0)
    result = []
    for k in range(count // 5 + 1):
        swing = 0.005 * k
        values = {
            "angle": 0.4 + 0.3 * np.sin(swing), "rate": 0.15 * np.cos(swing) + 1.5e-3 * random.normal(),
            "hose_pressure": 1e7 + 1.7e4 * random.normal(), "rod_pressure": 5e6 + 1.7e4 * random.normal(),
            "retract_current": max(0.3 * np.cos(swing), 0), "extend_current": max(-0.3 * np.cos(swing), 0),
            "mode": 2, "faults": 0, "uptime_s": 0.01 * k, "enable": 1,
        }  # fmt: skip
        for j, spec in enumerate(codec.frames.values()):
            identifier, data = codec.encode(spec.name, values, k)
            stamp = 1_790_000_000 + 0.01 * k + 0.0002 * j
            result.append(
                can.Message(timestamp=stamp, arbitration_id=identifier, is_extended_id=spec.is_extended, data=data)
            )
    return result[:count]


def main() -> int:
    """Make the logs, import them, print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--frames", type=int, default=500_000, help="length of the log (default: %(default)s)")
    parser.add_argument("--repeat", type=int, default=3, help="how often, the best counts (default: %(default)s)")
    options = parser.parse_args()
    codec = Codec.load("tz17")
    made = messages(options.frames, codec)
    slow = False
    print(f"{len(made)} frames, load of the computer {os.getloadavg()[0]:.1f}")
    print(f"{'format':8}{'size [MB]':>10}{'read [s]':>10}{'decode [s]':>12}{'write [s]':>11}{'frames/s':>11}")
    with tempfile.TemporaryDirectory() as folder:
        for suffix in can_log.SUFFIXES:
            path = Path(folder) / f"log{suffix}"
            with can.Logger(path) as log:
                for message in made:
                    log(message)
            best: tuple[float, ...] = (np.inf,) * 3
            for k in range(options.repeat):
                marks = [time.perf_counter()]
                frames = can_log.read(path)
                marks.append(time.perf_counter())
                imported = can_import.convert("log", frames, codec, Configuration("tz17", 0.28, 2.2, 0.0))
                marks.append(time.perf_counter())
                writing.write(Path(folder) / f"{suffix[1:]}{k}", imported.recording)
                marks.append(time.perf_counter())
                spent = tuple(np.diff(marks).tolist())
                best = min(best, spent, key=sum)
            rate = len(made) / sum(best)
            slow |= rate < PROMISED
            size = path.stat().st_size / 1e6
            print(f"{suffix[1:]:8}{size:10.1f}{best[0]:10.2f}{best[1]:12.2f}{best[2]:11.2f}{rate:11.0f}")
    return int(slow)


if __name__ == "__main__":
    raise SystemExit(main())
