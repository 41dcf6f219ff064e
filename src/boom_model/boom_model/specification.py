"""The specification of a model parameter: name, symbol, unit, range, equation, for loader, documentation and checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from boom_model.errors import MachineError

Shape = Literal["scalar", "pair", "triple"]


@dataclass(frozen=True)
class Specification:
    """One parameter of a component.

    Attributes:
        key: name in the machine file, joined with dots: ``section.name``.
        symbol: the symbol of the thesis, as plain text.
        unit: SI unit, or the unit that the thesis prints where it keeps coefficients in bar and l/min.
        meaning: short phrase.
        minimum: smallest allowed value (of each component of a vector).
        maximum: largest allowed value.
        equation: number of the equation in the thesis in which it stands.
        shape: scalar, pair or triple of numbers.
        default: value of a number that the file may leave out.
        entry: makes ``{value: ..., unit: ...}`` of the section where the file writes it in another form; raises MachineError.
    """

    key: str
    symbol: str
    unit: str
    meaning: str
    minimum: float
    maximum: float
    equation: str
    shape: Shape = "scalar"
    default: float | None = None
    entry: Callable[[Mapping[str, Any], Specification], Mapping[str, Any]] | None = field(default=None, compare=False)

    @property
    def components(self) -> tuple[str, ...]:
        """Dotted names of the numbers that this parameter holds."""
        if self.shape == "scalar":
            return (self.key,)
        return tuple(f"{self.key}.{i}" for i in range(2 if self.shape == "pair" else 3))


def number(entry: Any) -> float:
    """The number of an entry, with or without its wrapper of unit and source; NaN if it is not a number."""
    value = entry.get("value") if isinstance(entry, dict) else entry
    if isinstance(value, bool) or not isinstance(value, int | float):
        return float("nan")
    try:
        return float(value)
    except OverflowError:
        return float("inf")


def none_unless_given(section: Mapping[str, Any], spec: Specification, **own: Any) -> dict[str, Any]:
    """Entry of a number that a file may leave out: 0 then, with its ``own`` tolerance."""
    entry = section.get(spec.key.rpartition(".")[2], {"value": 0.0, "unit": spec.unit, "prov": "assumed", **own})
    if isinstance(entry, dict) and "value" in entry:
        return entry
    raise MachineError(f"{spec.key}: write {{value: ..., unit: {spec.unit!r}}}")
