"""A mapping: which column becomes which signal, in which unit, with which sign. A file that can be edited and given back.

value [SI] = (sign * scale * number + offset) * unit, and of a pressure that is absolute the ambient pressure is taken off.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from boom_import import units
from boom_import.candidates import DIMENSION, SIGNALS
from boom_import.errors import ImportingError
from boom_import.timing import FASTEST, TimeChoice
from boom_input.files import InputError
from boom_input.shown import quoted
from boom_input.yaml_text import read_yaml

ASK, NONE, DERIVATIVE = "ask", "none", "derivative of angle"
_OF_PISTON = {units.ANGLE: units.LENGTH, units.RATE: units.SPEED}
_KEYS = {"column", "unit", "sign", "scale", "offset", "reference", "part"}
_CONFIGURATION = {"machine", "q3", "q4", "load"}


@dataclass(frozen=True)
class SignalMap:
    """One signal's column.

    Attributes:
        column: key of the column.
        unit: name of its unit; of the signal's dimension.
        sign: +1 or -1.
        scale: of the number, e.g. amperes per percent.
        offset: added behind sign and scale [unit].
        reference: of a pressure "gauge" or "absolute", "ask" where that is open; else "".
        part: "positive" or "negative" half of a signed current, "" for all of it.
    """

    column: str
    unit: str
    sign: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    reference: str = ""
    part: str = ""


@dataclass
class Mapping:
    """What becomes of a source.

    Attributes:
        signals: by name: a `SignalMap`, or "ask", "none", "derivative of angle".
        time: how the time of a table is read.
        joint: name of the boom's joint in the source, "" for none.
        machine, q3, q4, load: configuration, "" or None where it is not known [rad, m, kg].
    """

    signals: dict[str, SignalMap | str] = field(default_factory=dict)
    time: TimeChoice = field(default_factory=TimeChoice)
    joint: str = ""
    machine: str = ""
    q3: float | None = None
    q4: float | None = None
    load: float | None = None

    def open(self) -> list[str]:
        """Signals that somebody has to decide."""
        return [
            signal
            for signal, given in self.signals.items()
            if given == ASK or (isinstance(given, SignalMap) and given.reference == ASK)
        ]


def is_piston(mapping: Mapping) -> bool:
    """Whether what stands in the place of the boom's angle is the position of a piston."""
    angle = mapping.signals.get("angle")
    return isinstance(angle, SignalMap) and units.BY_NAME[angle.unit].dimension == units.LENGTH


def read(path: str | Path) -> Mapping:
    """The mapping in a YAML file.

    Raises:
        ImportingError: not such a file; the message names the entry.
    """
    try:
        document = read_yaml(path)
    except InputError as error:
        raise ImportingError(str(error)) from None
    try:
        return _mapping(_section(document, "the file", {"signals", "time", "configuration", "joint"}))
    except _EntryError as error:
        raise ImportingError(f"{path}: {error}") from None


class _EntryError(Exception):
    pass


_EXPONENT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)[eE][+-]?\d+")
"""A number that YAML 1.1 takes for text."""


def _section(value: Any, where: str, keys: set[str]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise _EntryError(f"{where}: expected {', '.join(sorted(keys))}, found {quoted(repr(value), 60)}")
    unknown = sorted(set(value) - keys)
    if unknown:
        raise _EntryError(f"{where}: unknown entry {quoted(unknown[0], 60)}: there are {', '.join(sorted(keys))}")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise _EntryError(f"{where}: {quoted(repr(value), 60)} is not a number")
    return float(value)


def _mapping(document: dict[str, Any]) -> Mapping:
    result = Mapping()
    signals = _section(document.get("signals"), "signals", set(DIMENSION))
    missing = [signal for signal in SIGNALS if signal not in signals]
    if missing:
        raise _EntryError(f"signals: {missing[0]} is missing: give its column, or 'none'")
    for signal, given in signals.items():
        result.signals[signal] = _signal(signal, given)
    _refuse_shared(result.signals)
    joint = document.get("joint", "")
    if joint is not None and not isinstance(joint, str):
        raise _EntryError("joint: give the name of the boom's joint")
    result.joint = joint or ""
    result.time = _time(_section(document.get("time") or {}, "time", {"column", "unit", "sample_rate"}))
    configuration = _section(document.get("configuration") or {}, "configuration", _CONFIGURATION)
    result.machine = str(configuration.get("machine") or result.machine)
    for name in ("q3", "q4", "load"):
        value = configuration.get(name)
        setattr(result, name, None if value is None else _number(value, f"configuration: {name}"))
    if result.load is not None and result.load < 0.0:
        raise _EntryError(
            f"configuration: load: {result.load:g} kg: a load is 0 or more, or null where it is not known"
        )
    return result


def _refuse_shared(signals: dict[str, SignalMap | str]) -> None:
    """Raises _EntryError: two signals have one column, and are not the halves of a signed current."""
    used: dict[str, list[tuple[str, str]]] = {}
    for signal, entry in signals.items():
        if isinstance(entry, SignalMap):
            for other, part in used.setdefault(entry.column, []):
                if {part, entry.part} != {"positive", "negative"}:
                    raise _EntryError(
                        f"signals: {other} and {signal}: '{quoted(entry.column, 60)}' cannot be both: "
                        "give each its own column, or none"
                    )
            used[entry.column].append((signal, entry.part))


def _signal(signal: str, given: Any) -> SignalMap | str:
    words = {ASK, NONE} | ({DERIVATIVE} if signal == "rate" else set())
    if given is None:
        return NONE
    if isinstance(given, str) and given in words:
        return given
    entry = _section(given, f"signals: {signal}", _KEYS)
    where = f"signals: {signal}"
    column, unit = entry.get("column"), str(entry.get("unit", ""))
    if not isinstance(column, (str, int, float)) or isinstance(column, bool):
        raise _EntryError(f"{where}: column is missing: give its name, or write '{signal}: none'")
    dimension = DIMENSION[signal]
    possible = units.OF_DIMENSION[dimension] + units.OF_DIMENSION.get(_OF_PISTON.get(dimension, ""), ())
    known = [measure.name for measure in possible]
    if unit not in known:
        raise _EntryError(f"{where}: unit {quoted(unit, 40) or '(none)'}: the {dimension} is in {', '.join(known)}")
    reference = str(entry.get("reference", ""))
    if dimension == units.PRESSURE and reference not in ("gauge", "absolute", ASK):
        raise _EntryError(f"{where}: reference: give gauge (0 in air) or absolute (about 1 bar in air)")
    part = str(entry.get("part", ""))
    if part not in ("", "positive", "negative"):
        raise _EntryError(f"{where}: part: give positive or negative, or leave it out")
    sign = _number(entry.get("sign", 1), f"{where}: sign")
    if sign not in (1.0, -1.0):
        raise _EntryError(f"{where}: sign: give 1 or -1 (scale takes any number)")
    scale = _number(entry.get("scale", 1), f"{where}: scale")
    if scale == 0.0:
        raise _EntryError(
            f"{where}: scale: 0 makes the channel a constant: give another number, or 'none' for the column"
        )
    offset = _number(entry.get("offset", 0), f"{where}: offset")
    return SignalMap(str(column), unit, sign, scale, offset, reference, part)


def _time(entry: dict[str, Any]) -> TimeChoice:
    unit = str(entry.get("unit", ""))
    if unit and unit not in [measure.name for measure in units.OF_DIMENSION[units.TIME]]:
        raise _EntryError(f"time: unit {quoted(unit, 40)}: give s, ms, us, ns, min, h or d")
    given = entry.get("sample_rate")
    rate = 0.0 if given is None else _number(given, "time: sample_rate")
    if given is not None and not 0.0 < rate <= FASTEST:
        raise _EntryError(f"time: sample_rate: {rate:g}: give above 0 and up to {FASTEST:g} samples a second")
    try:
        return TimeChoice(str(entry.get("column") or ""), unit, rate)
    except ImportingError as error:
        raise _EntryError(f"time: {error}") from None


def text(mapping: Mapping, comments: dict[str, str], heading: list[str]) -> str:
    """The mapping as a YAML file, with a comment behind each signal."""
    lines = [f"# {line}" for line in heading]
    lines += [
        "# value [SI] = (sign * scale * number + offset) * unit; angle and rate are positive while the boom is lifted"
    ]
    time = {"column": mapping.time.column, "unit": mapping.time.unit, "sample_rate": mapping.time.rate}
    given = {name: value for name, value in time.items() if value}
    lines += [f"time: {_flow(given)}"] if given else []
    lines += [f"joint: {json.dumps(mapping.joint, ensure_ascii=False)}"] if mapping.joint else []
    lines.append("signals:")
    for signal, entry in mapping.signals.items():
        lines += [f"  # {line}" for line in comments.get(signal, "").splitlines()]
        lines.append(f"  {signal}: {entry_text(entry)}")
    known = {name: getattr(mapping, name) for name in ("machine", "q3", "q4", "load")}
    stated = {name: None if value == "" or value != value else value for name, value in known.items()}
    lines.append(f"configuration: {_flow(stated)}  # q3 [rad], q4 [m], load [kg]; null = not known")
    return "\n".join(lines) + "\n"


def entry_text(entry: SignalMap | str) -> str:
    """What stands behind a signal's name in the file."""
    if isinstance(entry, str):
        return entry
    shown: dict[str, Any] = {"column": entry.column, "unit": entry.unit, "sign": int(entry.sign)}
    shown |= {"scale": entry.scale, "offset": entry.offset}
    shown |= {name: getattr(entry, name) for name in ("reference", "part") if getattr(entry, name)}
    return _flow(shown)


def _flow(entry: dict[str, Any]) -> str:
    """A mapping on one line; JSON is YAML."""
    return "{" + ", ".join(f"{name}: {json.dumps(value, ensure_ascii=False)}" for name, value in entry.items()) + "}"
