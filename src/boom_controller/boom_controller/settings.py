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
    position_pole: float = _tunable(
        -3.0, "1/s", -10.0, -0.1, "triple pole of the position loop (6.9), thesis and baseline"
    )
    force_pole: float = _tunable(-11.0, "1/s", -40.0, -0.5, "double pole of the force loop (6.15), thesis and baseline")
    neutral_pressure: float = _tunable(5.0e5, "Pa", 0.5e5, 8.0e5, "pilot pressure of both sides with the spool centred")
    pilot_response: float = _tunable(0.02, "s", 0.002, 0.2, "time constant to which the pilot stage's lag is inverted")
    spool_response: float = _tunable(0.01, "s", 0.005, 0.2, "time constant with which the spool goes to its set point")
    largest_current: float = _tunable(0.6, "A", 0.3, 1.5, "largest current of a solenoid")
    largest_spool_position: float = _tunable(1.0, "-", 0.4, 1.2, "largest wanted spool position over its full stroke")

    rest_response: float = _tunable(0.05, "s", 0.005, 1.0, "time constant of the spool inside the dead zone, improved")
    feedback_pole: float = _tunable(-5.0, "1/s", -15.0, -0.5, "real pole of the position feedback, improved")
    feedback_damping: float = _tunable(0.7, "-", 0.1, 1.5, "damping wanted of the boom on its oil spring, improved")
    largest_damping: float = _tunable(30.0, "1/s", 1.0, 60.0, "limit of the force feedback K k_d, improved")
    slowest_frequency: float = _tunable(
        3.0, "rad/s", 0.5, 20.0, "frequency to which a softer oil spring is stiffened, improved"
    )
    preview: float = _tunable(0.035, "s", 0.0, 0.2, "lead of the reference over the valve's remaining lag, improved")
    remaining_lag: float = _tunable(0.015, "s", 0.0, 0.2, "lag over which the force is predicted, improved")
    command_delay: float = _tunable(
        0.0, "s", 0.0, 0.05, "dead time from a command to the solenoids, made up for as the samples' age is, improved"
    )
    dead_zone_speed: float = _tunable(
        1.0e-3, "m/s", 1e-4, 0.02, "piston speed below which the spool stays inside its dead zone, improved"
    )
    dead_zone_preview: float = _tunable(
        0.06, "s", 0.0, 0.3, "how long ahead of the reference the spool crosses its dead zone, improved"
    )
    load_pole: float = _tunable(-20.0, "1/s", -60.0, -1.0, "double pole of the load observer, improved")
    load_pole_fast: float = _tunable(-60.0, "1/s", -90.0, -1.0, "the same while the rate is a surprise, improved")
    rate_surprise: float = _tunable(
        6.0e-3, "rad/s", 1e-4, 0.1, "rate error from which the load observer is faster (4 sigma of the gyro)"
    )
    largest_load: float = _tunable(3000.0, "kg", 0.0, 1e5, "largest load that is estimated, improved")
    flow_pole: float = _tunable(
        -3.0, "1/s", -10.0, 0.0, "pole with which flow that the valve's model misses is learnt, improved"
    )
    compliance_gain: float = _tunable(8.0, "1/s", 0.0, 30.0, "how quickly the oil's compliance is learnt, improved")
    compliance_pressure: float = _tunable(
        1.0e6, "Pa", 1e4, 1e7, "pressure change below which it is not learnt, improved"
    )
    stall_time: float = _tunable(
        0.5, "s", 0.1, 5.0, "how long the supply may deliver too little before the load counts as too heavy"
    )

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
        rows.append(
            ParameterSpec(entry.name, entry.default, entry.metadata["description"], entry.metadata["unit"], low, high)
        )
    return tuple(rows)


SETTINGS: tuple[ParameterSpec, ...] = _table()
"""Name, default, description, unit, range of every field of :class:`Settings`: what ROS parameters are made from."""
