"""Units as FMI tells them: exponents of the SI base units, and the unit in which a tool shows the number."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import pi
from xml.etree.ElementTree import Element, SubElement

_ATOMS: dict[str, dict[str, int]] = {
    "kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "A": {"A": 1}, "rad": {"rad": 1}, "1": {},
    "N": {"kg": 1, "m": 1, "s": -2}, "Pa": {"kg": 1, "m": -1, "s": -2}, "Hz": {"s": -1},
}  # fmt: skip
_SHOWN = {
    "Pa": ("bar", 1e-5),
    "rad": ("deg", 180 / pi),
    "rad/s": ("deg/s", 180 / pi),
    "m^3/s": ("l/min", 60_000.0),
    "m^3": ("l", 1e3),
}
_FACTOR = re.compile(r"([A-Za-z1]+)(?:\^(-?\d+))?")


def exponents(unit: str) -> dict[str, int] | None:
    """``N m s/rad`` as exponents of kg, m, s, A, rad; None if it is not made of whole powers of known units."""
    total: dict[str, int] = {}
    top, *below = unit.replace("(", "").replace(")", "").split("/")
    for sign, part in [(1, top), *((-1, part) for part in below)]:
        for word in part.split():
            match = _FACTOR.fullmatch(word)
            if match is None or match.group(1) not in _ATOMS:
                return None
            for base, power in _ATOMS[match.group(1)].items():
                total[base] = total.get(base, 0) + sign * power * int(match.group(2) or 1)
    return {base: power for base, power in total.items() if power}


def add_units(parent: Element, units: Iterable[str]) -> None:
    """The element ``UnitDefinitions`` with these units."""
    definitions = SubElement(parent, "UnitDefinitions")
    for unit in sorted({unit for unit in units if unit != "-"}):
        element = SubElement(definitions, "Unit", name=unit)
        powers = exponents(unit)
        if powers is not None:
            SubElement(element, "BaseUnit", {base: str(power) for base, power in powers.items()})
            if unit in _SHOWN:
                name, factor = _SHOWN[unit]
                SubElement(element, "DisplayUnit", name=name, factor=repr(factor))


def shown(unit: str) -> str:
    """Name of the unit in which a tool shows it; "" for the unit itself."""
    return _SHOWN.get(unit, ("",))[0]
