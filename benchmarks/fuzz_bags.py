"""Damages bags and loads them, as `./boom validate` does: nothing may be raised, hang, fill the memory or be lost untold.

    python benchmarks/fuzz_bags.py --cases 20000 --seed 1

A recording of one second is written in ten ways (chunks packed with zstd, with lz4, not packed, no chunks; with and without
checksums; split into two files with metadata.yaml, a folder packed file by file) and then damaged: its bytes, its records
(opcode, length, order, repetition), what its chunks and their headers say, definitions, stamps, or its metadata.yaml.

A case is lost untold where a signal has fewer valid samples, or the file fewer messages, than before the damage, and neither a
warning nor an event says that something is wrong. A changed value counts as lost untold only where the file has checksums:
without them nobody can know, and `Recording.notes` says that there are none. Whole records that are repeated or exchanged
lose nothing. What the damage replaced by something that is a recording as well (another stamp, another name of the machine)
in a file without checksums is not counted.
"""

from __future__ import annotations

import struct
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random

import lz4.frame
import numpy as np
import zstandard
from bag_copies import rewrite
from fuzzing import NUMBERS, TEXTS, Outcome, main, mutate, mutate_text, put_number
from mcap.writer import CompressionType

from boom_recording.errors import RecordingError
from boom_recording.loading import load
from boom_recording.recording import Configuration, Recording
from boom_recording.writing import from_columns, write

_PACKED = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "plain": CompressionType.NONE}
_PACKINGS = (*_PACKED, "unchunked")
KINDS = (*_PACKINGS, *(f"{packing}, no checksums" for packing in _PACKINGS), "split", "packed files")
_PREFIX = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
_CHUNK_OPCODE, _MESSAGE, _SCHEMA = 6, 5, 3
_MAGIC = 8


@dataclass(frozen=True)
class Whole:
    """A bag before the damage: its files, how many messages there are, and what is loaded of it."""

    files: dict[str, bytes]
    recording: Recording
    checked: bool


def recording(part: int = 0, parts: int = 1) -> Recording:
    """A second of the boom's swinging, or a part of it."""
    random = np.random.default_rng(0)
    time = np.arange(100) * 0.01
    columns = {
        "angle": 0.4 + 0.3 * np.sin(time),
        "rate": 0.3 * np.cos(time) + 1e-3 * random.normal(size=100),
        "hose_pressure": 1e7 + 2e4 * random.normal(size=100),
        "rod_pressure": 5e6 + 2e4 * random.normal(size=100),
        "retract_current": 0.3 + 1e-3 * random.normal(size=100),
        "extend_current": np.zeros(100),
        "retract_current_command": np.full(100, 0.3),
        "extend_current_command": np.zeros(100),
    }
    rows = slice(100 * part // parts, 100 * (part + 1) // parts)
    return from_columns(
        "fuzz", time[rows], {k: v[rows] for k, v in columns.items()}, Configuration("tz17", 0.28, 2.2, 0.0)
    )


@cache
def whole(kind: str) -> Whole:
    """The bag of that kind. Made once, before the workers begin."""
    import tempfile

    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "fuzz"
        if kind == "split":
            for part in range(2):
                write(Path(made) / f"part{part}", recording(part, 2), chunk_bytes=4000)
            (Path(made) / "part0").rename(folder)
            (folder / "part0_0.mcap").rename(folder / "fuzz_0.mcap")
            (Path(made) / "part1" / "part1_0.mcap").rename(folder / "fuzz_1.mcap")
            text = (folder / "metadata.yaml").read_text()
            text = text.replace("  - part0_0.mcap\n", "  - fuzz_0.mcap\n  - fuzz_1.mcap\n").replace("part0_0", "fuzz_0")
            (folder / "metadata.yaml").write_text(text.replace("message_count: 251", "message_count: 502"))
        else:
            write(folder, recording(), chunk_bytes=4000)
        if kind == "packed files":
            file = folder / "fuzz_0.mcap"
            (folder / "fuzz_0.mcap.zstd").write_bytes(zstandard.ZstdCompressor().compress(file.read_bytes()))
            file.unlink()
            text = (folder / "metadata.yaml").read_text()
            (folder / "metadata.yaml").write_text(text.replace("fuzz_0.mcap", "fuzz_0.mcap.zstd"))
        checked = not kind.endswith("no checksums")
        packing = kind.split(",")[0]
        if packing in _PACKINGS and kind != "zstd":
            rewrite(
                folder / "fuzz_0.mcap", chunk_size=4000, compression=_PACKED.get(packing, CompressionType.NONE),
                enable_crcs=checked, enable_data_crcs=checked, use_chunking=packing != "unchunked",
            )  # fmt: skip
        files = {file.name: file.read_bytes() for file in folder.iterdir()}
        loaded = load(folder)
        assert not loaded.warnings and not loaded.events, (kind, loaded.warnings, loaded.events)
        return Whole(files, loaded, checked)


# ------------------------------------------------------------------------------------------------- damage by structure


def _records(data: bytes, begin: int = _MAGIC) -> list[tuple[int, int]]:
    """Begin and end of the records in `data`."""
    found = []
    while begin + 9 <= len(data):
        end = begin + 9 + int.from_bytes(data[begin + 1 : begin + 9], "little")
        if end > len(data):
            break
        found.append((begin, end))
        begin = end
    return found


def _damage_records(random: Random, data: bytes, begin: int = _MAGIC) -> tuple[str, bytes]:
    """Opcode, length, order or repetition of records; `begin`: where the first one lies."""
    records = _records(data, begin)
    if not records:
        return mutate(random, data or b"\0")
    a, b = sorted(random.choice(records) for _ in range(2))
    changed = bytearray(data)
    way = random.choice(("opcode", "length", "field", "exchanged", "repeated", "deleted"))
    if way == "opcode":
        changed[a[0]] = random.choice((0, 1, 2, 3, 4, 5, 6, 7, 15, 16, 127, 128, 255, random.randrange(256)))
    elif way == "length":
        length = a[1] - a[0] - 9
        told = random.choice((*NUMBERS, length - 1, length + 1, length * 2, len(data)))
        changed[a[0] + 1 : a[0] + 9] = (told % 2**64).to_bytes(8, "little")
    elif way == "field":
        put_number(random, changed, random.randrange(a[0], a[1]))
    elif way == "exchanged":
        if a != b:
            changed = bytearray(data[: a[0]] + data[slice(*b)] + data[a[1] : b[0]] + data[slice(*a)] + data[b[1] :])
    elif way == "repeated":
        times = random.choice((1, 2, 1000))
        changed = bytearray(data[: b[0]] + data[slice(*a)] * times + data[b[0] :])
    else:
        del changed[slice(*a)]
    return f"record {way}", bytes(changed)


def _damage_chunk(random: Random, data: bytes) -> tuple[str, bytes]:
    """The header of a chunk, or the records in it, packed anew; its checksum fits, or is left out, or does not fit."""
    chunks = [record for record in _records(data) if data[record[0]] == _CHUNK_OPCODE]
    if not chunks:
        return _damage_records(random, data)
    begin, end = random.choice(chunks)
    start, last, size, checksum, name_length = _CHUNK.unpack_from(data, begin + 9)
    name = data[begin + 9 + _CHUNK.size :][:name_length]
    packed = data[begin + 9 + _CHUNK.size + name_length + 8 : end]
    way = random.choice(("size", "checksum", "times", "compression", "name length", "content", "content", "content"))
    if way == "content":
        content = _unpacked(name, packed, size)
        way, content = random.choice((_damage_records, _damage_definition, _damage_stamp))(random, content, 0)
        way = f"{way} in a chunk"
        packed, size = _packed(name, content), len(content)
        checksum = random.choice((0, 0, checksum, _crc(content)))
    elif way == "size":
        size = random.choice((*NUMBERS, size - 1, size + 1, 10**9)) % 2**64
    elif way == "checksum":
        checksum = random.choice((0, 1, checksum ^ 1))
    elif way == "times":
        start, last = random.choice(NUMBERS) % 2**64, random.choice(NUMBERS) % 2**64
    elif way == "compression":
        name = random.choice((b"", b"lz4", b"zstd", b"zst\xff", b"\x1b[2J", b"gzip" * 20))
        name_length = len(name)
    else:
        name_length = random.choice(NUMBERS) % 2**32
    body = _CHUNK.pack(start, last, size, checksum, name_length) + name + struct.pack("<Q", len(packed)) + packed
    return f"chunk: {way}", data[:begin] + _PREFIX.pack(_CHUNK_OPCODE, len(body)) + body + data[end:]


def _unpacked(name: bytes, packed: bytes, size: int) -> bytes:
    if name == b"zstd":
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    return bytes(lz4.frame.decompress(packed)) if name == b"lz4" else packed


def _packed(name: bytes, content: bytes) -> bytes:
    if name == b"zstd":
        return zstandard.ZstdCompressor().compress(content)
    return bytes(lz4.frame.compress(content)) if name == b"lz4" else content


def _crc(content: bytes) -> int:
    import zlib

    return zlib.crc32(content)


def _damage_definition(random: Random, data: bytes, begin: int = _MAGIC) -> tuple[str, bytes]:
    """A schema gets another definition: one that contains itself, is endless, or is damaged."""
    schemas = [record for record in _records(data, begin) if data[record[0]] == _SCHEMA]
    if not schemas:
        return _damage_records(random, data, begin)
    a, b = random.choice(schemas)
    number = data[a + 9 : a + 11]
    place = a + 11
    texts: list[bytes] = []
    for _ in range(3):  # name, encoding, definition
        length = int.from_bytes(data[place : place + 4], "little")
        texts.append(data[place + 4 : place + 4 + length])
        place += 4 + length
    name, encoding, definition = texts
    kind = name.decode("utf-8", "replace")
    definition = random.choice(
        (
            f"{kind} inner\n".encode(),
            b"Inner[99999999] inner\n" + b"=" * 80 + b"\nMSG: pkg/Inner\nInner[99999999] inner\n",
            b"float64[0] nothing\n" * 2000,
            b"int32 x " + random.choice(TEXTS).encode("utf-8", "replace"),
            mutate_text(random, definition.decode("utf-8", "replace"))[1].encode("utf-8", "replace"),
            mutate(random, definition or b" ")[1],
            definition * random.choice((2, 50)),
        )
    )
    if random.random() < 0.2:
        name = mutate(random, name or b" ")[1]
    body = number + b"".join(len(text).to_bytes(4, "little") + text for text in (name, encoding, definition))
    return "definition", data[:a] + _PREFIX.pack(_SCHEMA, len(body)) + body + data[b:]


def _damage_stamp(random: Random, data: bytes, begin: int = _MAGIC) -> tuple[str, bytes]:
    """Stamps and log times of a message."""
    messages = [record for record in _records(data, begin) if data[record[0]] == _MESSAGE]
    if not messages:
        return _damage_records(random, data, begin)
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 3))):
        a, b = random.choice(messages)
        put_number(random, changed, min(a + random.choice((15, 23, 31 + 4, 31 + 8, 31 + 12)), b - 1))
    return "stamp", bytes(changed)


def _damage_metadata(random: Random, data: bytes) -> tuple[str, bytes]:
    way, text = mutate_text(random, data.decode("utf-8"))
    return f"metadata: {way}", text.encode("utf-8", "replace")


_WAYS = (
    mutate,
    mutate,
    _damage_records,
    _damage_records,
    _damage_chunk,
    _damage_chunk,
    _damage_definition,
    _damage_stamp,
)


# ------------------------------------------------------------------------------------------------------------- judging


def case(random: Random, folder: Path) -> Outcome:
    """Damage one bag and load it."""
    kind = random.choice(KINDS)
    before = whole(kind)
    files = dict(before.files)
    name = random.choice([file for file in files if file.endswith((".mcap", ".zstd"))])
    if random.random() < 0.15:
        name, (what, damaged) = "metadata.yaml", _damage_metadata(random, files["metadata.yaml"])
    elif name.endswith(".zstd") and random.random() < 0.6:
        what, damaged = random.choice(_WAYS)(random, zstandard.ZstdDecompressor().decompress(files[name]))
        damaged = zstandard.ZstdCompressor().compress(damaged)
    else:
        what, damaged = (mutate if name.endswith(".zstd") else random.choice(_WAYS))(random, files[name])
    changed = damaged != files[name]
    files[name] = damaged
    bare = len(files) == 2 and name != "metadata.yaml" and random.random() < 0.3
    bag = folder / "fuzz"
    bag.mkdir()
    for file, content in files.items():
        (bag / file).write_bytes(content)
    path = bag / name if bare else bag
    try:
        found = load(path)
        found.on_grid()
    except RecordingError as error:
        text = str(error)
        return Outcome(kind, what, "refused", fault="" if text.isprintable() and len(text) < 1500 else "no plain line")
    sentences = found.warnings + [event.detail for event in found.events] + found.notes
    odd = next((text for text in sentences if not text.isprintable() or len(text) > 1500), "")
    told = bool(found.warnings or found.events)
    untold = "" if told or not changed else _lost(before, found, _resealed(what))
    return Outcome(kind, what, "told" if told else "whole", untold, f"no plain sentence: {odd[:40]!a}" if odd else "")


def _resealed(what: str) -> bool:
    """Whether the checksum may fit the damage: then it is another recording, and not a damaged one."""
    return "in a chunk" in what or what == "chunk: checksum"


def _lost(before: Whole, found: Recording, resealed: bool) -> str:
    for name, signal in before.recording.signals.items():
        now = found.signals.get(name)
        if now is None or now.valid.sum() < signal.valid.sum():
            return f"samples of {signal.topic}"
        if before.checked and not resealed and not np.isin(signal.values, now.values).all():
            return f"values of {signal.topic}"
    return ""


if __name__ == "__main__":
    for made in KINDS:
        whole(made)
    sys.exit(main(__doc__, case, 500))
