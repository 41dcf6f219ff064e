"""Measures how long it takes to load one hour of five topics at 100 Hz (1.8 million messages). Run it alone.

    python benchmarks/load_one_hour.py [--minutes 60] [--repeat 3] [--unchunked]

The fifth topic is /boom/current_command beside the four sensor topics. The file is made in a temporary folder first and
removed afterwards. Prints a table; exit status 1 where an hour takes longer than the 6 s that are promised.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from bag_copies import rewrite

from boom_recording.loading import load
from boom_recording.recording import Configuration, Recording
from boom_recording.writing import from_columns, write

PROMISED_S = 6.0


def make(minutes: float) -> Recording:
    """A boom that swings, with the sensors' noise and quantisation, on five topics."""
    random = np.random.default_rng(0)
    n = round(minutes * 6000)
    time_s = np.arange(n) * 0.01
    swing = 0.5 * time_s
    current = np.round((0.3 * np.cos(swing) + 8e-4 * random.normal(size=n)) * 1e3) / 1e3
    quantum = 2 * np.pi / 2**14
    columns = {
        "angle": np.round((0.4 + 0.3 * np.sin(swing)) / quantum) * quantum,
        "rate": 0.15 * np.cos(swing) + 1.5e-3 * random.normal(size=n),
        "hose_pressure": np.round((1e7 + 1.7e4 * random.normal(size=n)) / 1e4) * 1e4,
        "rod_pressure": np.round((5e6 + 1.7e4 * random.normal(size=n)) / 1e4) * 1e4,
        "retract_current": np.maximum(current, 0),
        "extend_current": np.maximum(-current, 0),
        "retract_current_command": np.maximum(current, 0),
        "extend_current_command": np.maximum(-current, 0),
    }
    return from_columns("hour", time_s, columns, Configuration("tz17", 0.28, 2.2, 0.0))


def main() -> int:
    """Make the file, load it, print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument(
        "--minutes", type=float, default=60.0, help="length of the recording [min] (default: %(default)s)"
    )
    parser.add_argument("--repeat", type=int, default=3, help="how often to load it (default: %(default)s)")
    parser.add_argument("--unchunked", action="store_true", help="messages one by one in the file, not in chunks")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hour"
        begin = time.perf_counter()
        write(path, make(options.minutes))
        written = time.perf_counter() - begin
        if options.unchunked:
            rewrite(next(path.glob("*.mcap")), use_chunking=False)
        size = sum(file.stat().st_size for file in path.iterdir()) / 1e6
        load(path)  # the first call also loads the message definitions
        times = []
        for _ in range(options.repeat):
            begin = time.perf_counter()
            recording = load(path)
            times.append(time.perf_counter() - begin)
    messages = sum(
        len(s.values)
        for name, s in recording.signals.items()
        if name not in ("rate", "extend_current", "extend_current_command")
    )
    rows = [
        ("recording", f"{recording.duration / 60:.1f} min, {messages} messages, {size:.1f} MB"),
        ("written in", f"{written:.2f} s"),
        ("loaded in", f"{min(times):.2f} s best, {max(times):.2f} s worst of {len(times)}"),
        ("promised for an hour", f"{PROMISED_S:.1f} s"),
        ("events, warnings", f"{len(recording.events)}, {len(recording.warnings)}"),
    ]
    for label, value in rows:
        print(f"{label:22} {value}")
    return int(max(times) > PROMISED_S * max(1.0, options.minutes / 60))


if __name__ == "__main__":
    raise SystemExit(main())
