"""Tunable numbers in one place: fields with unit, range and meaning, from which checks, node parameters and tables are made."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

from boom_controller.errors import ControlError
from boom_node.parameters import ParameterSpec

LONGEST_SAMPLE_TIME = 0.05
"""s."""
QUICKEST = 0.6
"""Largest rate of a feedback or an observer [1/s] times the sample time: at 60 1/s and samples 30 ms apart the boom would swing."""


def tunable(default: float, unit: str, minimum: float, maximum: float, description: str) -> Any:
    """A field of :class:`Tunables`: default in ``unit``, allowed range (both ends included), meaning in a phrase."""
    return field(default=default, metadata={"unit": unit, "range": (minimum, maximum), "description": description})


@dataclass(frozen=True)
class Tunables:
    """Numbers that are checked on construction; a derived dataclass defines the fields, each a :func:`tunable`.

    Raises:
        ControlError: a number that is not finite or outside its range.
    """

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for spec in specifications(kind):
            problem = spec.problem(getattr(self, spec.name))
            if problem:
                raise ControlError(problem)


@cache
def specifications(kind: Any) -> tuple[ParameterSpec, ...]:
    """Name, default, description, unit, range of every field of a class of :class:`Tunables`, for ROS parameters."""
    return tuple(
        ParameterSpec(f.name, f.default, f.metadata["description"], f.metadata["unit"], *f.metadata["range"])
        for f in fields(kind)
    )


@dataclass(frozen=True)
class LawSettings(Tunables):
    """Settings common to all control laws, SI. A law adds its own."""

    sample_time: float = tunable(0.01, "s", 0.002, LONGEST_SAMPLE_TIME, "sample time T_s of all control laws")
    generator_pole: float = tunable(-10.0, "1/s", -50.0, -0.5, "fourfold pole of the trajectory generator (6.27)")
    neutral_pressure: float = tunable(5.0e5, "Pa", 0.5e5, 8.0e5, "pilot pressure of both sides with the spool centred")
    pilot_response: float = tunable(0.02, "s", 0.002, 0.2, "time constant to which the pilot stage's lag is inverted")
    spool_response: float = tunable(0.01, "s", 0.005, 0.2, "time constant with which the spool goes to its set point")
    largest_current: float = tunable(0.6, "A", 0.3, 1.5, "largest current of a solenoid")
    largest_spool_position: float = tunable(1.0, "-", 0.4, 1.2, "largest wanted spool position over its full stroke")
