"""The channels of a recording, one table: what is measured, its unit and range, where it comes from, how it is shown.

Everything above goes over this table. A measured channel is added with a row in :data:`SENSORS` and
the type of its topic's messages in ``boom_recording.channels``.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

AMBIENT_PRESSURE_PA = 101_325.0
"""What ``sensor_msgs/FluidPressure``, which is absolute, is larger by than the gauge pressures inside."""


@dataclass(frozen=True)
class Channel:
    """One signal on the wire.

    Attributes:
        name: of the signal.
        unit: SI unit inside (pressures gauge).
        topic: that carries it.
        field: of the message; a JointState's list is indexed by the joint's name.
        low, high: plausible range [unit]; outside, a value is a fault of the sensor or the bus, not of the machine.
        joint: that of a JointState which is meant, by its part of ``JOINT_NAMES``; empty: the boom's own.
    """

    name: str
    unit: str
    topic: str
    field: str
    low: float
    high: float
    joint: str = dataclasses.field(default="", kw_only=True)

    @property
    def is_pressure(self) -> bool:
        """Whether it is a pressure: absolute on the wire, gauge inside."""
        return self.unit == "Pa"

    @property
    def wire_offset(self) -> float:
        """What the wire value is larger by [unit]."""
        return AMBIENT_PRESSURE_PA if self.is_pressure else 0.0


class Unit(NamedTuple):
    """A unit for people: its name, and how many of it one SI unit is."""

    name: str
    scale: float


@dataclass(frozen=True)
class Sensor(Channel):
    """A measured quantity of the machine.

    Attributes:
        symbol: in a formula, "p_h".
        shown, error: units in which it and its errors are shown.
        sigma, quantum: members of ``boom_model.sensors.SensorNoise`` that tell its noise and its resolution; "" for none.
        statistics: of the errors of a prediction, "mae" or "rmse"; the first one judges it.
        predicted: whether the model predicts it: then it is an output of the model, and every recording needs it.
            Another one is recorded, checked and shown, and compared with nothing.
        required: whether the machine's bus and recorder have to provide it.
    """

    symbol: str
    shown: Unit
    error: Unit
    sigma: str = ""
    quantum: str = ""
    statistics: tuple[str, ...] = ("rmse",)
    predicted: bool = True
    required: bool = True

    def __post_init__(self) -> None:
        if self.predicted and not self.required:
            raise ValueError(f"{self.name}: what the model predicts cannot be optional")

    @property
    def label(self) -> str:
        """For people: "hose pressure"."""
        return self.name.replace("_", " ")

    @property
    def frame(self) -> str:
        """``frame_id`` of its messages: where on the machine it is measured, "hose"."""
        return self.name.removesuffix("_pressure")

    @property
    def judging(self) -> str:
        """Key of the error that judges a prediction."""
        return self.metric(self.statistics[0])

    def metric(self, statistic: str) -> str:
        """Key of an error in the documents: "hose_pressure_rmse_pa"."""
        return f"{self.name}_{statistic}_{self.unit.lower().replace('/', '_')}"


_BAR = Unit("bar", 1e-5)


def _pressure(name: str, symbol: str, *, predicted: bool = True, required: bool = True) -> Sensor:
    """A pressure transducer: it ends at 600 bar and reads vacuum to its accuracy, 1 bar."""
    return Sensor(
        name, "Pa", f"/boom/{name}", "fluid_pressure", -2.02e5, 600e5, symbol, _BAR, _BAR, "pressure_sigma", "pressure_quantum",
        predicted=predicted, required=required,
    )  # fmt: skip


# Ranges hold for any machine of this kind (the machine file's own limits are the model's affair): an angle is within a
# turn, a boom of 2 rad/s would tear itself off, a solenoid of 0.6 A is fed by a driver of 3 A, a current is clipped at zero.
SENSORS: tuple[Sensor, ...] = (
    Sensor(
        "angle", "rad", "/joint_states", "position", -3.2, 3.2, "q_2", Unit("rad", 1.0), Unit("mrad", 1e3),
        sigma="angle_sigma", quantum="angle_quantum", statistics=("mae", "rmse"),
    ),
    Sensor(
        "rate", "rad/s", "/joint_states", "velocity", -2.0, 2.0, "dq_2/dt", Unit("rad/s", 1.0), Unit("mrad/s", 1e3),
        sigma="rate_sigma",
    ),
    _pressure("hose_pressure", "p_h"),
    _pressure("rod_pressure", "p_b"),
    _pressure("head_pressure", "p_a", predicted=False, required=False),
    _pressure("supply_pressure", "p_s", predicted=False, required=False),
    _pressure("tank_pressure", "p_t", predicted=False, required=False),
)  # fmt: skip
"""What the machine's sensors measure."""

CURRENTS: tuple[Channel, ...] = (
    Channel("retract_current", "A", "/boom/solenoid_currents", "retract", -0.01, 3.0),
    Channel("extend_current", "A", "/boom/solenoid_currents", "extend", -0.01, 3.0),
)
"""What drives the model: the measured currents of the solenoids."""

JOINT_NAMES = {"outer_boom": "outer_boom_joint", "telescope": "telescope_joint", "slewing": "slewing_joint"}
"""The other joints whose motion drives the model where it is recorded, and their names in /joint_states unless others are given."""
JOINTS: tuple[Channel, ...] = (
    Channel("outer_boom_angle", "rad", "/joint_states", "position", -7.0, 7.0, joint="outer_boom"),
    Channel("outer_boom_rate", "rad/s", "/joint_states", "velocity", -3.0, 3.0, joint="outer_boom"),
    Channel("telescope_length", "m", "/joint_states", "position", -1.0, 50.0, joint="telescope"),
    Channel("telescope_rate", "m/s", "/joint_states", "velocity", -5.0, 5.0, joint="telescope"),
    Channel("slewing_angle", "rad", "/joint_states", "position", -100.0, 100.0, joint="slewing"),
    Channel("slewing_rate", "rad/s", "/joint_states", "velocity", -3.0, 3.0, joint="slewing"),
)
"""Position and velocity of each, q_3, q_4 (both stages of the telescope together) and q_1."""

CHANNELS: tuple[Channel, ...] = (
    *SENSORS,
    *CURRENTS,
    *JOINTS,
    Channel("retract_current_command", "A", "/boom/current_command", "retract", -0.01, 3.0),
    Channel("extend_current_command", "A", "/boom/current_command", "extend", -0.01, 3.0),
    Channel("reference_angle", "rad", "/boom/reference", "position", -3.2, 3.2),
    Channel("smooth_reference_angle", "rad", "/boom/reference_state", "angle", -3.2, 3.2),
    Channel("smooth_reference_rate", "rad/s", "/boom/reference_state", "rate", -2.0, 2.0),
    Channel("smooth_reference_acceleration", "rad/s^2", "/boom/reference_state", "acceleration", -100.0, 100.0),
    Channel("smooth_reference_jerk", "rad/s^3", "/boom/reference_state", "jerk", -10000.0, 10000.0),
)
"""All signals that a recording may hold."""

BY_NAME = {channel.name: channel for channel in CHANNELS}
PREDICTED = tuple(sensor for sensor in SENSORS if sensor.predicted)
"""The model's outputs, in their order."""

REQUIRED: tuple[Channel, ...] = (*(sensor for sensor in SENSORS if sensor.required), *CURRENTS)
"""What every machine measures."""
SENSOR_TOPICS = tuple(dict.fromkeys(channel.topic for channel in REQUIRED))
"""Topics that every machine has."""
ESSENTIAL = ("angle", *(channel.name for channel in CURRENTS))
"""Channels without which a recording is refused; another one that the model predicts has no valid sample where it is missing."""
ESSENTIAL_TOPICS = tuple(dict.fromkeys(channel.topic for channel in CHANNELS if channel.name in ESSENTIAL))
"""Their topics."""
MEASURED_TOPICS = tuple(dict.fromkeys(channel.topic for channel in (*SENSORS, *CURRENTS)))
"""The same with those that only some machines have."""


def of_topic(topic: str) -> tuple[Channel, ...]:
    """The signals that `topic` carries."""
    return tuple(channel for channel in CHANNELS if channel.topic == topic)
