"""One line of a drafted machine file: value, unit, source and tolerance in YAML's flow style."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from boom_model.owner.questions import BY_KEY


@dataclass(frozen=True)
class Entry:
    """One number of the file; ``source``: a word of the file, or the key of the question whose answer it is."""

    key: str
    value: Any
    unit: str
    source: str
    tol: Any
    note: str = ""

    def line(self, proposed: Collection[str]) -> str:
        """As YAML; ``proposed``: questions that were not answered."""
        source = ("answered", "assumed")[self.source in proposed] if self.source in BY_KEY else self.source
        note = f', note: "{self.note}"' if self.note else ""
        tol = f", tol: {in_flow_style(self.tol)}" if self.tol is not None else ""
        unit = f'"{self.unit}"' if self.unit == "-" or "," in self.unit else self.unit
        return f"  {self.key}: {{value: {in_flow_style(self.value)}, unit: {unit}, prov: {source}{tol}{note}}}"


def in_flow_style(value: Any) -> str:
    """A value in YAML's flow style; numbers with a point, which YAML 1.1 wants."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {in_flow_style(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(in_flow_style(entry) for entry in value) + "]"
    if isinstance(value, float):
        shown = f"{value:.6g}"
        mantissa, e, exponent = shown.partition("e")
        return mantissa + ("" if "." in mantissa else ".0") + e + exponent
    return str(value)
