"""What a machine file says of how far a number may be off: ``tol`` of an entry, or its confidence.

A tolerance is two standard deviations of the number's prior (``boom_model.prior``).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log
from typing import Any, Literal

from boom_model.errors import MachineError
from boom_model.specification import number

TOLERANCES = {"high": 0.03, "medium": 0.10, "low": 0.30, "": 0.15}
"""Relative tolerance of a number by its confidence (machine notes)."""
LARGEST_FACTOR = 1e3


@dataclass(frozen=True)
class Tolerance:
    """``tol`` of an entry: its word (``relative`` for a bare number) and its number, two for a range."""

    word: Literal["relative", "abs", "factor", "range"]
    numbers: tuple[float, ...]

    def sigma(self, value: float) -> float:
        """Standard deviation of the prior [unit of the number], of its logarithm for a factor."""
        if self.word == "relative":
            return self.numbers[0] * abs(value) / 2
        if self.word == "factor":
            return log(self.numbers[0]) / 2
        return self.numbers[0] / 2 if self.word == "abs" else (self.numbers[1] - self.numbers[0]) / 4

    def relative(self, value: float) -> float:
        """Two standard deviations over the value; 0 for a number that is zero."""
        if self.word == "factor":
            return self.numbers[0] - 1.0
        return 2 * self.sigma(value) / abs(value) if value else 0.0

    def __str__(self) -> str:
        """For people."""
        if self.word == "relative":
            return f"+-{100 * self.numbers[0]:g} %"
        if self.word == "factor":
            return f"factor {self.numbers[0]:g}"
        return f"+-{self.numbers[0]:g}" if self.word == "abs" else "{:g} .. {:g}".format(*self.numbers)


def check_tolerance(given: Any, key: str, value: tuple[float, ...]) -> Tolerance:
    """The tolerance that an entry states under ``tol``.

    Raises:
        MachineError: not one of the four forms, or one that does not fit the value.
    """
    word, stated = next(iter(given.items())) if isinstance(given, dict) and len(given) == 1 else ("relative", given)
    numbers = tuple(number(v) for v in (stated if word == "range" and isinstance(stated, list) else [stated]))
    forms = "write 0.1, {abs: 0.03}, {factor: 3} or {range: [a, b]}"
    if word not in ("relative", "abs", "factor", "range") or not all(abs(v) < inf for v in numbers):
        raise MachineError(f"{key}.tol: {given!r} is no tolerance; {forms}")
    if word == "range":
        if len(numbers) != 2 or not all(numbers[0] <= v <= numbers[1] for v in value) or numbers[0] == numbers[1]:
            raise MachineError(f"{key}.tol: the range [a, b] has to hold the value; {forms}")
    elif word == "factor":
        if not 1.0 < numbers[0] <= LARGEST_FACTOR or not all(v > 0.0 for v in value):
            raise MachineError(
                f"{key}.tol: a factor is above 1, up to {LARGEST_FACTOR:g}, and its value above 0; {forms}"
            )
    elif numbers[0] <= 0.0:
        raise MachineError(f"{key}.tol: {numbers[0]:g} is not above 0; {forms}")
    return Tolerance(word, numbers)  # type: ignore[arg-type]
