"""Units as people write them: what they measure, and what one of them is in SI."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

PRESSURE, ANGLE, RATE, CURRENT, TIME, RATIO = "pressure", "angle", "rate", "current", "time", "ratio"
LENGTH, SPEED = "length", "speed"
"""Of a cylinder whose piston is recorded in the place of the boom's joint: never proposed, only given."""


class UnitOfMeasure(NamedTuple):
    """A unit.

    Attributes:
        name: as this package writes it.
        dimension: what it measures; "other" for all that no signal of a boom has.
        factor: SI units in one of it.
    """

    name: str
    dimension: str
    factor: float


_TABLE: tuple[tuple[str, str, float, str], ...] = (
    ("Pa", PRESSURE, 1.0, "pa pascal n/m2 n/m^2"),
    ("hPa", PRESSURE, 1e2, "hpa mbar"),
    ("kPa", PRESSURE, 1e3, "kpa"),
    ("MPa", PRESSURE, 1e6, "mpa n/mm2 n/mm^2"),
    ("bar", PRESSURE, 1e5, "bar bars"),
    ("psi", PRESSURE, 6894.757293, "psi lbf/in2 lb/in2"),
    ("kgf/cm2", PRESSURE, 98066.5, "kgf/cm2 kgf/cm^2 kg/cm2 kg/cm^2 kp/cm2 kp/cm^2"),
    ("rad", ANGLE, 1.0, "rad radian radians"),
    ("mrad", ANGLE, 1e-3, "mrad"),
    ("deg", ANGLE, math.pi / 180, "deg degs degree degrees ° grad altgrad º"),
    ("gon", ANGLE, math.pi / 200, "gon"),
    ("rad/s", RATE, 1.0, "rad/s rad/sec rads radps rps rad_s rad_per_s rad/sek"),
    ("mrad/s", RATE, 1e-3, "mrad/s"),
    ("deg/s", RATE, math.pi / 180, "deg/s °/s º/s deg/sec degs/s dps grad/s deg_s deg_per_s degree/s degrees/s °/sec grad/sek"),
    ("rpm", RATE, math.pi / 30, "rpm u/min 1/min r/min"),
    ("A", CURRENT, 1.0, "a amp amps ampere amperes"),
    ("mA", CURRENT, 1e-3, "ma milliampere milliamp"),
    ("s", TIME, 1.0, "s sec secs second seconds sek sekunden"),
    ("ms", TIME, 1e-3, "ms msec millis milliseconds millisekunden"),
    ("us", TIME, 1e-6, "us µs μs usec micros microseconds"),
    ("ns", TIME, 1e-9, "ns nsec nanos nanoseconds"),
    ("min", TIME, 60.0, "min minutes minuten"),
    ("h", TIME, 3600.0, "h hr hours stunden"),
    ("d", TIME, 86400.0, "d day days tage"),
    ("%", RATIO, 0.01, "% percent prozent pct"),
    ("m", LENGTH, 1.0, "m"),
    ("mm", LENGTH, 1e-3, "mm"),
    ("m/s", SPEED, 1.0, "m/s"),
    ("mm/s", SPEED, 1e-3, "mm/s"),
    ("", "other", 1.0, "cm km km/h m/s2 m/s^2 g kg t n kn nm n*m knm v mv volt"),
    ("", "other", 1.0, "kw w hz l/min lpm l cm3 °c degc c k f °f counts"),
)  # fmt: skip
_BY_TEXT = {
    text: UnitOfMeasure(name or text, dimension, factor)
    for name, dimension, factor, texts in _TABLE
    for text in texts.split()
}
BY_NAME = {name: _BY_TEXT[texts.split()[0]] for name, _, _, texts in _TABLE if name}
"""The units that a mapping file may name."""
OF_DIMENSION = {
    dimension: tuple(m for m in BY_NAME.values() if m.dimension == dimension)
    for dimension in (PRESSURE, ANGLE, RATE, CURRENT, TIME, LENGTH, SPEED)
}
ELECTRICAL = tuple(_BY_TEXT[text] for text in ("a", "ma", "v", "mv"))
"""What transmitters give."""

_MULTIPLE = re.compile(r"^(\d*[.,]?\d+(?:e[+-]?\d+)?)\s*[*x·]?\s*(\D.*)$")
"""A bus counts in multiples: "0.01 deg", "0.1 bar"."""
_PREFIXES = {"m": 1e-3, "c": 1e-2, "d": 1e-1}
_ABSOLUTE = re.compile(r"^(bar|psi|mpa|kpa|pa)[ _]?(a|\(a\)|abs\.?|absolut[e]?|\(abs\))$")
_GAUGE = re.compile(r"^(bar|psi|mpa|kpa|pa)[ _]?(g|\(g\)|gauge|\(gauge\)|rel\.?|relativ[e]?|\(rel\)|ü|ue|\(ü\))$")
_RANGE = re.compile(r"^[+-]?\d[\d.,]*\s*(?:-|–|\.{2,3}|to|bis)\s*[+-]?\d[\d.,]*\s*([a-z°%].*)$")
"""A remark: "0-250 bar"."""
_LONGEST = 120
"""Characters of a header or a unit; what is longer is neither."""
_REFERRED = re.compile(r"^(.*?)(?<![a-z])((?:bar|psi|mpa|kpa|pa) ?\((?:a|g|abs|rel|ü|gauge)\))$", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[({<]\s*([^\[\](){}<>]{1,20}(?:\((?:a|g|abs|rel|ü|gauge)\))?)\s*[\])}>]\s*$", re.IGNORECASE)
_AFTER_SLASH = re.compile(r"^(.{1,}?)(?:\s+/\s*|\s*/\s+|\s+in\s+)((?:\d*[.,]\d+ ?)?\S{1,12})$")
_SUFFIX = re.compile(
    r"^(.+?)[_ .\-]((?:\d*[.,]\d+ ?)?(?:(?:m?rad|deg|grad|°)(?:_per_|/|_)s(?:ec)?)|(?:\d*[.,]\d+ ?)?[a-z°%µμ]+)$",
    re.IGNORECASE,
)
_WEAK = frozenset((*"adhkfmgtnvwlcs", "min", "rads", "grad"))


class StatedUnit(NamedTuple):
    """A unit that a text states; `measure` is None where it is not known, `reference` "gauge", "absolute" or "".

    scale: how many of it the number one is.
    """

    measure: UnitOfMeasure | None
    reference: str = ""
    scale: float = 1.0


def parse(text: str) -> StatedUnit:
    """What a unit's text says."""
    plain = text[:_LONGEST].strip().lower().replace("²", "2").replace("sek.", "sek")
    for opening, closing in ("[]", "()"):
        if plain.startswith(opening):
            plain = plain[1:].removesuffix(closing).strip()
    plain = re.sub(r"_per_|_(?=s(?:ec)?$)", "/", plain)
    if ranged := _RANGE.match(plain):
        plain = ranged[1]
    found = _known(plain)
    match = None if found.measure else _MULTIPLE.match(plain)
    if not match:
        return found
    found, scale = _known(match[2]), float(match[1].replace(",", "."))
    return found._replace(scale=scale * found.scale) if found.measure and 0.0 < scale < math.inf else StatedUnit(None)


def _known(plain: str) -> StatedUnit:
    """Of a unit without a number in front of it; with a prefix: "cdeg"."""
    for pattern, reference in ((_ABSOLUTE, "absolute"), (_GAUGE, "gauge")):
        if match := pattern.match(plain):
            return StatedUnit(_BY_TEXT[match[1]], reference)
    found = _BY_TEXT.get(plain) or _BY_TEXT.get(plain.replace(" ", ""))
    if found is None and plain[:1] in _PREFIXES and len(plain) > 3:
        one = _BY_TEXT.get(plain[1:])
        if one is not None and one.dimension in (PRESSURE, ANGLE, RATE):
            return StatedUnit(one, scale=_PREFIXES[plain[0]])
    return StatedUnit(found)


def is_unknown(text: str) -> bool:
    """Whether a text states some unit, but not one that is known: "bar x10", "0.5 inHg"; a remark such as "filtered" is none."""
    parts = re.split(r"[^a-zµ°%]+", text.lower())
    return parse(text).measure is None and any(part in _BY_TEXT and part not in _WEAK for part in parts)


def split(header: str) -> tuple[str, str]:
    """A header's name and unit: "Druck [bar]", "pressure (MPa)", "p / bar", "angle_deg"; the unit is "" where none is stated."""
    text = header.strip()
    if len(text) > _LONGEST:
        return text, ""
    if (match := _REFERRED.match(text)) and match[1]:  # "p bar(a)"
        return match[1].rstrip("_ "), match[2]
    for pattern in (_BRACKETS, _AFTER_SLASH):
        match = pattern.search(text)
        if match:
            unit = match[match.lastindex or 1]
            if text.endswith("]") or parse(unit).measure:
                name = text[: match.start()] if pattern is _BRACKETS else match[1]
                return name.strip() or text, unit.strip()
    match = _SUFFIX.match(text)
    # One letter is as often the name of a side (p_a) as a unit: it counts only in "current_a", "time_s".
    if match and parse(match[2]).measure and (match[2].lower() not in _WEAK or _goes_with(match[1], match[2].lower())):
        return match[1], match[2]
    return text, ""


def _goes_with(name: str, unit: str) -> bool:
    words = {
        "a": r"(curr|strom|extend|retract|amp|solenoid|coil|^i$)",
        "s": r"(time|zeit|^t$|stamp)",
        "min": r"(time|zeit|^t$)",
    }
    return unit in words and re.search(words[unit], name.lower()) is not None
