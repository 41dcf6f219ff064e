"""What all fuzzers share: mutations, cases run under limits in a process of their own, the table of results.

A fuzzer is a function `case(random, folder) -> Outcome` and one call of `main`. The function makes one input from the random
numbers it is given, offers it to what is to be tried and says what came of it. It runs in a worker process: an exception that
leaves it, a crash, a hang or too much memory costs that case and is counted, never the fuzzer. The same seed and number give
the same case: `--only NUMBER` runs one alone and shows its traceback.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from random import Random
from typing import Any

SECONDS = 5.0
"""Processor time beyond which a case counts as a hang; after twice that time by the clock it is ended."""
MEMORY_BYTES = 1.5e9
"""Peak of the resident memory that counts as too much; a process beyond twice of it is ended."""
_LOOK_S = 0.02
_ADDRESS_SPACE = 8 * 2**30  # saves the computer where memory grows faster than anybody looks


@dataclass(frozen=True)
class Outcome:
    """What came of one case.

    kind     rows of the table, e.g. the format
    what     what was done to the input, in a few words; failures are listed by it
    answer   "whole" (nothing lost, nothing to tell), "told" (read, with a warning) or "refused" (one line)
    untold   what was lost without a word, "" where nothing was
    fault    something else that must not be, e.g. a refusal of two lines
    """

    kind: str
    what: str
    answer: str
    untold: str = ""
    fault: str = ""


Case = Callable[[Random, Path], Outcome]


@dataclass
class Tally:
    """Counts of one run; `failures` holds signature -> numbers of the cases."""

    rows: dict[str, Counter[str]] = field(default_factory=dict)
    failures: dict[str, list[int]] = field(default_factory=dict)
    slowest_s: float = 0.0
    peak_bytes: float = 0.0

    def count(self, kind: str, column: str) -> None:
        """One more of `column` in the row `kind`."""
        self.rows.setdefault(kind, Counter())[column] += 1

    def fail(self, kind: str, column: str, signature: str, number: int) -> None:
        """One failure: counted in its column and kept by its signature."""
        self.count(kind, column)
        self.failures.setdefault(f"{column}: {kind}: {signature}", []).append(number)

    def lines(self) -> list[str]:
        """The table and what failed, ready to print."""
        columns = ("cases", "whole", "told", "refused", *FAILURES)
        width = max([12, *(len(kind) + 2 for kind in self.rows)])
        lines = [f"{'':{width}}" + "".join(f"{column:>{len(column) + 2}}" for column in columns)]
        total: Counter[str] = sum(self.rows.values(), Counter())
        for kind, row in [*sorted(self.rows.items()), ("all", total)]:
            lines.append(f"{kind:{width}}" + "".join(f"{row[column]:>{len(column) + 2}}" for column in columns))
        lines.append(f"slowest case {self.slowest_s:.2f} s, largest process {self.peak_bytes / 1e6:.0f} MB")
        for signature, numbers in sorted(self.failures.items(), key=lambda item: -len(item[1])):
            lines.append(f"{len(numbers):6}  {signature}  (--only {numbers[0]})")
        return lines


FAILURES = ("tracebacks", "over 5 s", "over 1.5 GB", "died", "untold", "faults")


def run(case: Case, cases: int, seed: int, workers: int = 1) -> Tally:
    """Run `cases` cases; what happens in them is counted, whatever it is."""
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        crew = [_Worker(case, seed, Path(folder) / str(k)) for k in range(workers)]
        try:
            _share_out(crew, cases, tally)
        finally:
            for worker in crew:
                worker.stop()
    return tally


def _share_out(crew: list[_Worker], cases: int, tally: Tally) -> None:
    following = 0
    while True:
        for worker in crew:
            if worker.number is None and following < cases:
                worker.begin(following)
                following += 1
        busy = [worker for worker in crew if worker.number is not None]
        if not busy:
            return
        wait([worker.pipe for worker in busy], timeout=_LOOK_S)
        for worker in busy:
            worker.look(tally)


class _Worker:
    """One process that runs one case after the other; a new one takes its place where it has to be ended."""

    def __init__(self, case: Case, seed: int, folder: Path) -> None:
        self._case, self._seed, self._folder = case, seed, folder
        self.number: int | None = None
        self._begin()

    def _begin(self) -> None:
        context = multiprocessing.get_context("fork")
        self.pipe, far = context.Pipe()
        self._process = context.Process(
            target=_work, args=(self._case, self._seed, self._folder, far, self.pipe), daemon=True
        )
        self._process.start()
        far.close()

    def begin(self, number: int) -> None:
        self.number, self._begun = number, time.monotonic()
        self.pipe.send(number)

    def look(self, tally: Tally) -> None:
        """Take in the case's result, or end it where it went beyond the limits."""
        assert self.number is not None
        spent = time.monotonic() - self._begun
        try:
            if self.pipe.poll():
                _judge(tally, self.number, *self.pipe.recv())
                self.number = None
                return
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode or 0
            name = signal.Signals(-code).name if code < 0 else f"exit status {code}"
            self._replace(tally, "died", name)
            return
        memory = _peak_bytes(self._process.pid)
        tally.peak_bytes = max(tally.peak_bytes, memory)
        tally.slowest_s = max(tally.slowest_s, spent)
        if memory > 2 * MEMORY_BYTES:
            self._replace(tally, "over 1.5 GB", "ended")
        elif spent > 2 * SECONDS:
            self._replace(tally, "over 5 s", "ended")

    def _replace(self, tally: Tally, column: str, signature: str) -> None:
        assert self.number is not None
        kind = "unfinished"  # its outcome, with the kind, never came
        tally.count(kind, "cases")
        tally.fail(kind, column, signature, self.number)
        self.number = None
        self.stop()
        self._begin()

    def stop(self) -> None:
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _judge(tally: Tally, number: int, outcome: Outcome | str, seconds: float, peak: float) -> None:
    tally.slowest_s, tally.peak_bytes = max(tally.slowest_s, seconds), max(tally.peak_bytes, peak)
    if isinstance(outcome, str):
        outcome = Outcome("traceback", outcome, "")
        tally.count(outcome.kind, "cases")
        tally.fail(outcome.kind, "tracebacks", outcome.what, number)
    else:
        tally.count(outcome.kind, "cases")
        tally.count(outcome.kind, outcome.answer)
    if seconds > SECONDS:
        tally.fail(outcome.kind, "over 5 s", outcome.what, number)
    if peak > MEMORY_BYTES:
        tally.fail(outcome.kind, "over 1.5 GB", outcome.what, number)
    for column, text in (("untold", outcome.untold), ("faults", outcome.fault)):
        if text:
            tally.fail(outcome.kind, column, f"{outcome.what}: {text}", number)


def _work(case: Case, seed: int, folder: Path, pipe: Connection, near: Connection) -> None:
    near.close()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends us
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    while True:
        try:
            number = pipe.recv()
        except EOFError:
            return
        _forget_peak()
        begin = _computed_s()
        result: Outcome | str
        try:
            result = one(case, seed, number, folder)
        except Exception as error:
            result = _signature(error)
        pipe.send((result, _computed_s() - begin, _peak_bytes("self")))


def _computed_s() -> float:
    """Processor time of this process and of the children that it waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def one(case: Case, seed: int, number: int, folder: Path) -> Outcome:
    """Run one case in an empty folder, in this process; what it raises comes through."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return case(Random(f"{seed}:{number}"), folder)


def _signature(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "/src/" in frame.filename] or frames
    where = f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else "?"
    return f"{type(error).__name__} from {where}"


def _peak_bytes(process: int | str | None) -> float:
    """Largest resident memory since `_forget_peak`."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0
    peaks = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return 1024.0 * int(peaks[0]) if peaks else 0.0


def _forget_peak() -> None:
    with contextlib.suppress(OSError):  # where it may not be written the peak is that of the process
        Path("/proc/self/clear_refs").write_text("5")


# ---------------------------------------------------------------------------------------------------------- mutations

_CODES = ("<B", "<H", "<I", "<Q", ">I", "<d")
NUMBERS = (
    0, 1, -1, 2, 4, 7, 8, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF,
    2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**63, 2**64 - 1,
)  # fmt: skip
"""Where lengths and counters turn over."""
FLOATS = (0.0, -0.0, 1e-320, 1e300, -1e300, 1e999, -1e999, float("nan"), 2.0**31, 2.0**53, 2.0**63, 1e18)
TEXTS = (
    "", " ", "\0", "\n", "../../etc/passwd", "/dev/zero", "\x1b[2J", "[/red]", "{0}", "%s", "a" * 5000, "\ud7ff\u202e",
    "1" * 5000, "1e999", "nan", "-0", "2026-02-31", "NaN", "0x", "\u0661",
)  # fmt: skip
"""Texts that have broken readers: ends, paths, terminals, formats, lengths, numbers that are none."""

Mutation = Callable[[Random, bytearray], None]


def _flip(random: Random, data: bytearray) -> None:
    data[random.randrange(len(data))] ^= 1 << random.randrange(8)


def _byte(random: Random, data: bytearray) -> None:
    data[random.randrange(len(data))] = random.randrange(256)


def _cut(random: Random, data: bytearray) -> None:
    del data[random.randrange(len(data)) :]


def _delete(random: Random, data: bytearray) -> None:
    start = random.randrange(len(data))
    del data[start : start + _length(random)]


def _insert(random: Random, data: bytearray) -> None:
    start = random.randrange(len(data))
    data[start:start] = random.randbytes(_length(random))


def _repeat(random: Random, data: bytearray) -> None:
    start = random.randrange(len(data))
    data[start:start] = data[start : start + _length(random)]


def _swap(random: Random, data: bytearray) -> None:
    length = _length(random)
    a, b = sorted(random.randrange(len(data)) for _ in range(2))
    length = min(length, b - a, len(data) - b)
    data[a : a + length], data[b : b + length] = data[b : b + length], data[a : a + length]


def _zero(random: Random, data: bytearray) -> None:
    start = random.randrange(len(data))
    end = min(start + _length(random), len(data))
    data[start:end] = bytes(end - start)


def _number(random: Random, data: bytearray) -> None:
    put_number(random, data, random.randrange(len(data)))


def put_number(random: Random, data: bytearray, place: int) -> None:
    """Overwrite what lies at `place` with a number at which something turns over, as long as the data go."""
    code = random.choice(_CODES)
    if code == "<d":
        raw = struct.pack(code, random.choice(FLOATS))
    else:
        size = struct.calcsize(code)
        raw = struct.pack(code, random.choice(NUMBERS) % 256**size)
    raw = raw[: len(data) - place]
    data[place : place + len(raw)] = raw


def _length(random: Random) -> int:
    return int(2 ** random.uniform(0, 12))


BYTE_MUTATIONS: dict[str, Mutation] = {
    "bit flipped": _flip, "byte replaced": _byte, "cut": _cut, "bytes deleted": _delete, "bytes inserted": _insert,
    "bytes repeated": _repeat, "bytes swapped": _swap, "zeros": _zero, "number": _number,
}  # fmt: skip
"""What can be done to any bytes (at least one byte long)."""


def mutate(random: Random, data: bytes) -> tuple[str, bytes]:
    """One kind of damage, mostly once: its name, and what is left."""
    name = random.choice(list(BYTE_MUTATIONS))
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 5))):
        if changed:
            BYTE_MUTATIONS[name](random, changed)
    return name, bytes(changed)


def mutate_text(random: Random, text: str) -> tuple[str, str]:
    """Damage to a text: a word exchanged for a hostile one, lines cut, repeated or swapped, or damage to its bytes."""
    way = random.choice(("word", "word", "line repeated", "line deleted", "lines swapped", "bytes"))
    if way == "bytes" or not text.strip():
        name, data = mutate(random, text.encode("utf-8", "surrogatepass") or b"\n")
        return name, data.decode("utf-8", "replace")
    if way == "word":
        words = text.split(" ")
        words[random.randrange(len(words))] = random.choice((*TEXTS, *map(str, NUMBERS), *map(str, FLOATS)))
        return "word replaced", " ".join(words)
    lines = text.split("\n")
    a, b = random.randrange(len(lines)), random.randrange(len(lines))
    if way == "line repeated":
        lines.insert(a, lines[b])
    elif way == "line deleted":
        del lines[a]
    else:
        lines[a], lines[b] = lines[b], lines[a]
    return way, "\n".join(lines)


# ------------------------------------------------------------------------------------------------------------ command


def main(description: str | None, case: Case, cases: int) -> int:
    """The command of a fuzzer: run, print the table; 1 where something failed."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=cases, help="how many (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same cases (default: 0)")
    parser.add_argument("--workers", type=int, default=1, help="processes at the same time (default: 1)")
    parser.add_argument("--only", type=int, metavar="NUMBER", help="run this one case here, with its traceback")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="with --only: where its input stays")
    options: Any = parser.parse_args()
    if options.only is not None:
        folder = options.keep or Path(tempfile.mkdtemp(prefix="fuzz-"))
        print(one(case, options.seed, options.only, folder / "case"))
        if options.keep is None:
            shutil.rmtree(folder)
        return 0
    begin = time.monotonic()
    tally = run(case, options.cases, options.seed, options.workers)
    print(f"{options.cases} cases, seed {options.seed}, {time.monotonic() - begin:.0f} s")
    print("\n".join(tally.lines()))
    return int(bool(tally.failures))


if __name__ == "__main__":
    sys.exit("benchmarks/fuzzing.py is what the fuzzers share: start fuzz_bags.py, fuzz_can_logs.py or another")
