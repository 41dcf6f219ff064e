"""Finds and reads a DBC file and the mapping beside it; what is no such file ends in one plain line."""

import difflib
import logging
import re
from pathlib import Path
from typing import Any

from boom_can_bridge.python_can import cantools
from boom_input.files import InputError, read_bytes
from boom_input.shown import quoted
from boom_input.yaml_text import read_yaml

from .errors import CanConfigurationError

DBC_LIMIT = 2_000_000
"""Largest DBC file [bytes]: cantools takes seconds for one of that size."""
MOST_BYTES = 1785
"""Bytes of a message in a DBC file: a CAN FD frame has 64, what ISO 11783 and J1939 share out over frames has this."""
MOST_SIGNALS = 1000
"""Of one message, on all its pages: cantools compares each with each."""
logging.getLogger("cantools").setLevel(logging.ERROR)
SHIPPED = Path(__file__).with_name("dbc")
_LENGTHS = re.compile(r"\bBO_\s+\d+\s+\w+\s*:\s*(\d+)|(\d+)\s*\|\s*(\d+)\s*@")


def shipped_names() -> list[str]:
    """Machines whose DBC file and mapping come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.dbc"))


def closest(name: str, known: Any) -> str:
    """Half a sentence that proposes the most similar of what is known."""
    known = sorted(str(k) for k in known)
    found = difflib.get_close_matches(name, known, 1)
    return f"did you mean {found[0]}?" if found else f"there are {', '.join(known) or 'none'}"


def find_files(dbc: str | Path, mapping: str | Path | None) -> tuple[Path, Path]:
    """Paths of the DBC file and of its mapping, from shipped names or paths.

    Raises:
        CanConfigurationError: one of them does not exist
    """
    path = Path(dbc)
    if not path.suffix and not path.exists():
        path = SHIPPED / f"{dbc}.dbc"
        if not path.is_file():
            raise CanConfigurationError(
                f"no DBC {dbc}: give a path to a .dbc file or one of {', '.join(shipped_names())}"
            )
    elif not path.is_file():
        raise CanConfigurationError(f"{path}: no such DBC file")
    if mapping is None or not str(mapping):
        beside = path.with_suffix(".yaml")
        if not beside.is_file():
            raise CanConfigurationError(
                f"{path}: no mapping {beside.name} beside it: write one or give its path as mapping"
            )
        return path, beside
    where = Path(mapping)
    if not where.suffix and not where.exists():
        where = SHIPPED / f"{mapping}.yaml"
    if not where.is_file():
        raise CanConfigurationError(f"{mapping}: no such mapping file")
    return path, where


def read_mapping(path: Path) -> dict[str, Any]:
    """The document of a mapping, with a section frames. Raises CanConfigurationError."""
    try:
        document = read_yaml(path, hexadecimal=True)
    except InputError as error:
        raise CanConfigurationError(str(error)) from None
    if not isinstance(document, dict) or not isinstance(document.get("frames"), dict):
        raise CanConfigurationError(f"{path}: a mapping needs a section frames")
    return document


def read_dbc(path: Path) -> Any:
    """The database of a DBC file, no message in it twice. Raises CanConfigurationError."""
    try:
        text = read_bytes(path, DBC_LIMIT).decode("cp1252", "replace")  # as DBC editors write it
    except InputError as error:
        raise CanConfigurationError(str(error)) from None
    if max(part.count("SG_ ") for part in text.split("BO_ ")) > MOST_SIGNALS:
        raise CanConfigurationError(f"{path}: not a usable DBC file: a message with more than {MOST_SIGNALS} signals")
    # cantools makes a list of all bits of a message and of a signal before it looks whether one fits into the other.
    lengths = _LENGTHS.findall(text)
    if any(int(number.lstrip("0")[:9] or "0") > 8 * MOST_BYTES for found in lengths for number in found if number):
        raise CanConfigurationError(
            f"{path}: not a usable DBC file: a message of more than {MOST_BYTES} bytes, or a signal beyond its end"
        )
    try:
        database: Any = cantools.database.load_string(text, database_format="dbc", strict=True)
    except Exception as error:  # the parser raises what its parts raise
        raise CanConfigurationError(f"{path}: not a usable DBC file: {quoted(error)}") from None
    seen: set[object] = set()
    for message in database.messages:  # cantools takes the last one and says so in a log only
        for told in (message.name, (message.frame_id, message.is_extended_frame)):
            if told in seen:
                raise CanConfigurationError(
                    f"{path}: message {quoted(message.name)}: its name or its identifier 0x{message.frame_id:x} is there twice"
                )
            seen.add(told)
    return database
