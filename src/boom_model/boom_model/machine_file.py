"""Machine files: every number of a machine, with unit, source and confidence; read here, checked key by key (``machine_check``).

A missing, misspelt or impossible value is a :class:`MachineError` that names the key and the allowed range; nothing is
filled in silently. See docs/machine_file.md.
"""

from __future__ import annotations

import os
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

from boom_input.files import InputError, read_text
from boom_input.shown import quoted
from boom_input.yaml_text import line_of, parse_yaml
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.machine_check import check

_KEY = re.compile(r"\w+(?:\.\w+)*")
LONGEST_MESSAGE = 500


def load_machine(source: str | Path) -> Machine:
    """Reads a machine file: the name of a shipped one (``tz17``) or the path of a YAML file.

    Raises:
        MachineError: not found, not YAML, or a key that is missing, misspelt or impossible; with file and line.
    """
    machine, faults = check_machine(source)
    if machine is None:
        raise MachineError(faults[0])
    return machine


def shipped_machines() -> list[str]:
    """Names of the shipped machine files."""
    entries = files("boom_model").joinpath("machines").iterdir()
    return sorted(entry.name.removesuffix(".yaml") for entry in entries if entry.name.endswith(".yaml"))


def shipped_machine(name: str) -> Machine:
    """The machine of a name from outside, from a topic or a bag: a shipped one, never a path.

    Raises:
        MachineError: not shipped.
    """
    if name not in shipped_machines():
        raise MachineError(
            f"machine '{quoted(name, 60)}' is not shipped (there is {', '.join(shipped_machines())}): give its file with --machine"
        )
    return load_machine(name)


def machine_from(document: Any) -> Machine:
    """Check a document in the form of a machine file.

    Raises:
        MachineError: names the first key that is missing, misspelt or impossible.
    """
    machine, faults = check(document)
    if machine is None:
        raise MachineError(faults[0])
    return machine


def check_machine(source: str | Path) -> tuple[Machine | None, list[str]]:
    """A machine file, or all of its faults, each one line with file and line, in the order of the file.

    Raises:
        MachineError: it cannot be read, or is not YAML.
    """
    try:
        text, where = _read(source)
        document = parse_yaml(text, where)
    except InputError as error:
        raise MachineError(str(error)) from None
    machine, faults = check(document)
    lines = {fault: _line(fault, text) for fault in faults}
    return machine, [_told(fault, where, lines[fault]) for fault in sorted(faults, key=lambda fault: lines[fault] or 0)]


def _line(fault: str, text: str) -> int | None:
    """The line of the key at the beginning of a fault; None if it is not there."""
    key = _KEY.match(fault)
    return line_of(text, key.group().split(".")) if key else None


def _told(fault: str, where: str, line: int | None) -> str:
    """A fault with file and line, as one line of limited length, whatever the file contains."""
    return quoted(f"{where}, line {line}: {fault}" if line else f"{where}: {fault}", LONGEST_MESSAGE)


def _read(source: str | Path) -> tuple[str, str]:
    shipped = files("boom_model").joinpath("machines")
    known = shipped_machines()
    if not str(source).strip() or str(source) == ".":
        raise MachineError(f"no machine named; shipped are {', '.join(known)}, or give the path of a .yaml file")
    if str(source) in known:
        return shipped.joinpath(f"{source}.yaml").read_text(encoding="utf-8"), str(source)
    path = Path(source)
    if path.suffix in (".yaml", ".yml") or os.path.exists(path):
        return read_text(path), str(path)
    raise MachineError(
        f"{quoted(source)}: no such machine; shipped are {', '.join(known)}, or give the path of a .yaml file"
    )
