"""Everything tunable, once: the fields of :class:`Settings`. ``SETTINGS`` is the same as a table for parameters and docs."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from boom_controller.errors import ControlError
from boom_node.parameters import ParameterSpec


def _tunable(default: float, unit: str, minimum: float, maximum: float, description: str) -> Any:
    return field(default=default, metadata={"unit": unit, "range": (minimum, maximum), "description": description})


@dataclass(frozen=True)
class Settings:
    """What a controller can be told. All numbers SI; ranges and meaning in ``SETTINGS``.

    Raises:
        ControlError: a number that is not finite or outside its range, or limits that exclude each other.
    """

    sample_time: float = _tunable(0.01, "s", 0.002, 0.05, "sample time T_s of all control laws")
    generator_pole: float = _tunable(-10.0, "1/s", -50.0, -0.5, "fourfold pole of the trajectory generator (6.27)")
    position_pole: float = _tunable(-3.0, "1/s", -10.0, -0.1, "triple pole of the position loop (6.9), thesis and baseline")
    force_pole: float = _tunable(-11.0, "1/s", -40.0, -0.5, "double pole of the force loop (6.15), thesis and baseline")
    neutral_pressure: float = _tunable(5.0e5, "Pa", 0.5e5, 8.0e5, "pilot pressure of both sides with the spool centred")
    pilot_response: float = _tunable(0.02, "s", 0.002, 0.2, "time constant to which the pilot stage's lag is inverted, baseline")
    spool_response: float = _tunable(0.01, "s", 0.005, 0.2, "time constant of the spool's set point, baseline")
    largest_current: float = _tunable(0.55, "A", 0.3, 1.5, "largest current of a solenoid")
    largest_spool_position: float = _tunable(1.0, "-", 0.4, 1.2, "largest wanted spool position over its full stroke")

    def __post_init__(self) -> None:
        for spec in SETTINGS:
            problem = spec.problem(getattr(self, spec.name))
            if problem:
                raise ControlError(problem)


def _table() -> tuple[ParameterSpec, ...]:
    rows = []
    for entry in fields(Settings):
        if entry.default is MISSING:
            raise TypeError(f"{entry.name} needs a default")
        low, high = entry.metadata["range"]
        rows.append(ParameterSpec(entry.name, entry.default, entry.metadata["description"], entry.metadata["unit"], low, high))
    return tuple(rows)


SETTINGS: tuple[ParameterSpec, ...] = _table()
"""Name, default, description, unit, range of every field of :class:`Settings`: what ROS parameters are made from."""
