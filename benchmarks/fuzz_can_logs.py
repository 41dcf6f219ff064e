"""Damages CAN logs and imports them, as `./boom import-can` does: nothing may be raised, hang, fill the memory or be lost untold.

    python benchmarks/fuzz_can_logs.py --cases 20000 --seed 1

A log of 0.6 s of the shipped machine's frames is written in five formats (BLF deflated, ASC, candump, CSV, TRC) by python-can and
damaged: its bytes, its lines, a word of a line (a time, a date, an identifier, a length), and of a BLF file its header, the
header of a container or of an object, or the objects in a container, deflated anew.

A case is lost untold where fewer frames of a kind are used than before the damage and nothing says so: no warning, nothing among
what was left out, no frame that the counters miss or that is counted as damaged or unknown, no gap of more than 50 ms in a signal.
Two losses cannot be told and are not counted: a text that ends behind a whole line, for it has no end of its own, and the frames
before the first or behind the last ones that are left where whole lines or objects went. A frame that got another possible time
is no loss: no format but BLF has a checksum.
"""

from __future__ import annotations

import re
import struct
import sys
import tempfile
import zlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random

import can
import numpy as np
from fuzzing import FLOATS, NUMBERS, TEXTS, Outcome, main, mutate, mutate_text, put_number

from boom_can_bridge.codec import Codec
from boom_recording import can_import, can_log, writing
from boom_recording.can_import import Imported
from boom_recording.errors import RecordingError
from boom_recording.recording import Configuration

_START = 1_790_000_000.0
_CONFIGURATION = Configuration("tz17", 0.28, 2.2, 0.0)
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")
_DATES = (
    "date Tue Feb 30 10:00:00.000 2026", "date Mon Foo 1 99:99:99 1", "date Mon Sep 21 1e999:0:0 2026",
    "date Mon Sep 21 02:13:20.0 pm 99999", ";$STARTTIME=nan", ";$STARTTIME=1e999", ";$STARTTIME=-1e9", ";$STARTTIME=9e5",
    "base hex  timestamps relative", "base dec  timestamps absolute", ";$COLUMNS=", ";$COLUMNS=D,T,O", ";$FILEVERSION=9.9",
)  # fmt: skip


@dataclass(frozen=True)
class Whole:
    """A log before the damage, and how many frames of each kind are used of it."""

    content: bytes
    used: dict[str, int]


@cache
def codec() -> Codec:
    """Of the shipped machine."""
    return Codec.load("tz17")


@cache
def whole(suffix: str) -> Whole:
    """The log in that format. Made once, before the workers begin."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log{suffix}"
        with can.Logger(path) as log:
            if suffix == ".blf":
                log.max_container_size = 2000  # type: ignore[union-attr]  # several containers in a short log
            for k in range(60):
                values = {
                    "angle": 0.4 + 0.001 * k, "rate": 0.1, "hose_pressure": 1e7 + 1e4 * k, "rod_pressure": 5e6,
                    "retract_current": 0.3, "extend_current": 0.0, "mode": 2, "faults": 0, "uptime_s": 0.01 * k, "enable": 1,
                }  # fmt: skip
                for j, spec in enumerate(codec().frames.values()):
                    identifier, data = codec().encode(spec.name, values, k)
                    stamp = _START + 0.01 * k + 0.0002 * j
                    log(can.Message(stamp, identifier, spec.is_extended, data=data))
        content = re.sub(
            rb"(?m)^date .*$", b"date Mon Sep 21 14:13:20.000 2026", path.read_bytes()
        )  # as it were written then
        path.write_bytes(content.replace(bytes(path), b"log.trc"))
        return Whole(path.read_bytes(), {row.name: row.used for row in _read(path).frames})


def _read(path: Path) -> Imported:
    return can_import.convert("fuzz", can_log.read(path), codec(), _CONFIGURATION)


# --------------------------------------------------------------------------------------------------------------- damage


def _damage_word(random: Random, content: bytes) -> tuple[str, bytes]:
    """A word of a line exchanged for a hostile one, or a digit in it; or a header line for a hostile one."""
    lines = content.decode("ascii", "replace").split("\n")
    k = random.randrange(len(lines))
    way = random.choice(("digit", "digit", "number", "text", "line"))
    if way == "line":
        lines[random.randrange(min(len(lines), 12))] = random.choice(_DATES)
        return "header line", "\n".join(lines).encode()
    separator = "," if "," in lines[k] else " "
    words = lines[k].split(separator)
    place = random.choice([i for i, word in enumerate(words) if word] or [0])
    word = words[place]
    if way == "digit" and word:
        i = random.randrange(len(word))
        words[place] = word[:i] + random.choice("0123456789.-eE(#x") + word[i + 1 :]
    elif way == "number":
        words[place] = str(random.choice((*NUMBERS, *FLOATS)))
    else:
        words[place] = random.choice(TEXTS)
    lines[k] = separator.join(words)
    return f"word: {way}", "\n".join(lines).encode("utf-8", "replace")


def _damage_text(random: Random, content: bytes) -> tuple[str, bytes]:
    way, text = mutate_text(random, content.decode("ascii", "replace"))
    return way, text.encode("utf-8", "replace")


def _damage_header(random: Random, content: bytes) -> tuple[str, bytes]:
    changed = bytearray(content)
    put_number(random, changed, random.randrange(4, 72))
    return "BLF header", bytes(changed)


def _damage_container(random: Random, content: bytes) -> tuple[str, bytes]:
    """The head of a container, its order or repetition, or the objects in it."""
    containers = []
    begin = struct.unpack_from("<L", content, 4)[0]
    while begin + _OBJECT.size <= len(content):
        size = _OBJECT.unpack_from(content, begin)[3]
        containers.append((begin, begin + size, begin + size + size % 4))
        begin += size + size % 4
    begin, end, following = random.choice(containers)
    way = random.choice(("head", "head", "objects", "objects", "repeated", "deleted"))
    changed = bytearray(content)
    if way == "head":
        put_number(random, changed, random.randrange(begin, begin + 32))
    elif way == "repeated":
        changed[begin:begin] = content[begin:following] * random.choice((1, 200))
    elif way == "deleted":
        del changed[begin:following]
    else:
        _, size = _CONTAINER.unpack_from(content, begin + _OBJECT.size)
        objects = zlib.decompress(content[begin + 32 : end])
        way, objects = random.choice((mutate, _damage_objects))(random, objects)
        way = f"objects: {way}"
        packed = zlib.compress(objects)
        told = random.choice((len(objects), len(objects), size, random.choice(NUMBERS) % 2**32))
        head = _OBJECT.pack(b"LOBJ", 16, 1, 32 + len(packed), 10) + _CONTAINER.pack(2, told)
        changed[begin:following] = head + packed + bytes((32 + len(packed)) % 4)
    return f"container: {way}", bytes(changed)


def _damage_objects(random: Random, objects: bytes) -> tuple[str, bytes]:
    """A field of an object: its size, its kind, its time, the frame's length."""
    changed = bytearray(objects)
    places = [k for k in range(0, len(objects) - 48, 4) if objects[k : k + 4] == b"LOBJ"]
    if places:
        put_number(random, changed, random.choice(places) + random.choice((0, 4, 6, 8, 12, 16, 24, 32, 34, 36)))
    return "field", bytes(changed)


# ------------------------------------------------------------------------------------------------------------- judging


def case(random: Random, folder: Path) -> Outcome:
    """Damage one log and import it."""
    suffix = random.choice(can_log.SUFFIXES)
    before = whole(suffix)
    ways = (
        (mutate, _damage_header, _damage_container, _damage_container)
        if suffix == ".blf"
        else (mutate, _damage_word, _damage_word, _damage_text)
    )
    what, content = random.choice(ways)(random, before.content)
    path = folder / f"log{suffix}"
    path.write_bytes(content)
    kind = suffix[1:]
    try:
        found = _read(path)
        writing.write(folder / "bag", found.recording)
        found.recording.on_grid()
    except RecordingError as error:
        text = str(error)
        return Outcome(kind, what, "refused", fault="" if text.isprintable() and len(text) < 1500 else "no plain line")
    odd = next((text for text in found.recording.warnings if not text.isprintable() or len(text) > 1500), "")
    told = bool(
        found.recording.warnings or found.left_out or found.unknown or any(r.lost or r.bad for r in found.frames)
    )
    told = told or any(np.diff(signal.time).max(initial=0.0) > 0.05 for signal in found.recording.signals.values())
    less = [row.name for row in found.frames if row.used < before.used[row.name]]
    untold = "" if told or not less or _at_an_end(before, found, content) else f"frames {', '.join(less)}"
    return Outcome(kind, what, "told" if told else "whole", untold, f"no plain sentence: {odd[:40]!a}" if odd else "")


def _at_an_end(before: Whole, found: Imported, content: bytes) -> bool:
    """Whether what is missing lay before the first or behind the last frames that are left."""
    if before.content.startswith(content):
        return True
    first = min(float(signal.stamps_ns.min()) for signal in found.recording.signals.values()) / 1e9
    last = max(float(signal.stamps_ns.max()) for signal in found.recording.signals.values()) / 1e9
    return first > _START + 0.005 or last < _START + 0.595


if __name__ == "__main__":
    for made in can_log.SUFFIXES:
        whole(made)
    sys.exit(main(__doc__, case, 500))
