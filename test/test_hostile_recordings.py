"""Bags and CAN logs made to harm, through ./boom: refused or told in one line, in no time and with no memory to speak of."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from refusals import refusal

ROOT = Path(__file__).resolve().parents[1]
MAGIC = b"\x89MCAP0\r\n"
BYTES = 400_000_000
HEADER = struct.pack("<BQ", 1, 8) + struct.pack("<II", 0, 0)
CLOSED = struct.pack("<BQI", 15, 4, 0) + struct.pack("<BQQQI", 2, 20, 0, 0, 0) + MAGIC
MESSAGE = struct.pack("<BQHIQQ", 5, 22, 7, 0, 1, 1)


# A small process between: a child's largest memory counts from what its parent had when it was forked.
MEASURED = """
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([done.returncode, done.stdout, used.ru_utime + used.ru_stime, used.ru_maxrss / 1000]))
"""


def boom(*words: str | Path, cwd: Path) -> tuple[str, float, float]:
    """Run ./boom, which has to refuse in one line; its line, processor time [s] and largest memory [MB]."""
    command = [sys.executable, "-c", MEASURED, str(ROOT / "boom"), *words]
    measured = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=60, check=True)
    status, text, seconds, megabytes = json.loads(measured.stdout)
    assert status == 2, text[-2000:]
    return refusal(text), seconds, megabytes


def mcap(records: bytes) -> bytes:
    return MAGIC + HEADER + records + CLOSED


def chunk(packed: bytes, compression: bytes, told: int) -> bytes:
    body = (
        struct.pack("<QQQII", 0, 1, told, 0, len(compression)) + compression + struct.pack("<Q", len(packed)) + packed
    )
    return struct.pack("<BQ", 6, len(body)) + body


def zstd(piece: bytes, times: int) -> bytes:
    packer = zstandard.ZstdCompressor().compressobj(size=len(piece) * times)
    return b"".join(packer.compress(piece) for _ in range(times)) + packer.flush()


def _zstd_told_small(path: Path) -> None:
    path.write_bytes(mcap(chunk(zstd(bytes(10**7), BYTES // 10**7), b"zstd", 1000)))


def _zstd_told(path: Path) -> None:
    path.write_bytes(mcap(chunk(zstd(bytes(10**7), BYTES // 10**7), b"zstd", BYTES)))


def _lz4(path: Path) -> None:
    path.write_bytes(mcap(chunk(lz4.frame.compress(bytes(BYTES)), b"lz4", 1000)))


def _zeros(path: Path) -> None:
    path.write_bytes(mcap(chunk(zstd(bytes(10**7), 6), b"zstd", 6 * 10**7)))


def _many_chunks(path: Path) -> None:
    messages = MESSAGE * (10**6 // len(MESSAGE))
    path.write_bytes(mcap(chunk(zstd(messages, 40), b"zstd", 40 * len(messages)) * 20))


def _packed_file(path: Path) -> None:
    path.write_bytes(zstd(MAGIC + HEADER + bytes(10**7), BYTES // 10**7))


def _container(path: Path) -> None:
    packer = zlib.compressobj()
    piece = bytes(10**6)
    first, block = (packer.compress(piece) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    packed = first + block * (BYTES // 10**6 - 1)
    header = struct.pack("<4sL8xQQL", b"LOGG", 144, 0, 0, 0).ljust(144, b"\0")
    told = struct.pack("<H6xL4x", 2, BYTES)
    path.write_bytes(header + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 32 + len(packed), 10) + told + packed)


def _sparse_bag(path: Path) -> None:
    path.write_bytes(MAGIC + HEADER + struct.pack("<BQ", 5, 8 * 10**9))
    os.truncate(path, 8 * 10**9 + 1000)


def _sparse_log(path: Path) -> None:
    path.touch()
    os.truncate(path, 8 * 10**9)


def _empty_messages(path: Path) -> None:
    path.write_bytes(mcap(MESSAGE * 900_000))


def _empty_chunks(path: Path) -> None:
    path.write_bytes(mcap(chunk(b"", b"", 0) * 300_000))


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (_zstd_told_small, "a.mcap"), (_zstd_told, "a.mcap"), (_lz4, "a.mcap"), (_zeros, "a.mcap"), (_many_chunks, "a.mcap"),
        (_packed_file, "a.mcap.zstd"), (_container, "a.blf"), (_sparse_bag, "a.mcap"), (_sparse_log, "a.log"),
        (_empty_messages, "a.mcap"), (_empty_chunks, "a.mcap"),
    ],
)  # fmt: skip
def test_what_unpacks_or_reads_without_end_is_refused_within_2_s_and_300_mb(
    make: Callable[[Path], None], name: str, tmp_path: Path
) -> None:
    make(tmp_path / name)
    log = ("python", "-m", "boom_bringup.cli", "import-can", name, "--output", "made")
    words = ("validate", name) if "mcap" in name else log
    told, seconds, megabytes = boom(*words, cwd=tmp_path)
    assert told.startswith(f"boom: {name}: ")
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / name).touch()
    _, start, _ = boom(*words, cwd=tmp_path / "empty")  # a slow computer starts slowly, too
    print(f"{seconds:.2f} s, {megabytes:.0f} MB; {start:.2f} s for an empty file")
    assert seconds < max(2.0, 4.0 * start), "processor time, so that other processes do not count"
    assert megabytes < 300


@pytest.mark.parametrize("fuzzer", ["fuzz_bags", "fuzz_can_logs"])
def test_a_short_run_of_the_fuzzer_finds_nothing(fuzzer: str) -> None:
    result = subprocess.run(
        [sys.executable, ROOT / "benchmarks" / f"{fuzzer}.py", "--cases", "100", "--seed", "22"],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout + result.stderr
