"""What a parameter of the model is: name, symbol, unit, range, equation. Loader, documentation and checks read it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Shape = Literal["scalar", "pair", "triple"]


@dataclass(frozen=True)
class Specification:
    """One parameter of a component.

    Attributes:
        key: name in the machine file, joined with dots: ``section.name``.
        symbol: the symbol of the thesis, as plain text.
        unit: SI unit, or the unit that the thesis prints where it keeps coefficients in bar and l/min.
        meaning: a few words.
        minimum: smallest allowed value (of each component of a vector).
        maximum: largest allowed value.
        equation: number of the equation in the thesis in which it stands.
        shape: scalar, pair or triple of numbers.
    """

    key: str
    symbol: str
    unit: str
    meaning: str
    minimum: float
    maximum: float
    equation: str
    shape: Shape = "scalar"

    @property
    def components(self) -> tuple[str, ...]:
        """Dotted names of the numbers that this parameter holds."""
        if self.shape == "scalar":
            return (self.key,)
        return tuple(f"{self.key}.{i}" for i in range(2 if self.shape == "pair" else 3))
