"""Cranes of random structure, to run commands on: slots of a machine file, numbers within their tolerances, missing sensors drawn.

Sections come from the shipped files, so that each is one of a plausible machine; areas are scaled to the drop over the supply
edge. The recording is made by the model itself, with the sensors' noise.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_identification.estimate import Identified
from boom_identification.machine_output import document_with
from boom_input.channels import PREDICTED
from boom_model.catalogue import EFFECTS
from boom_model.component_numbers import component_parameters
from boom_model.components import payload
from boom_model.learned import PLACES, VARIABLES, LearnedTerm
from boom_model.machine import Machine, Pose
from boom_model.machine_file import load_machine, machine_from
from boom_model.prior import prior_of
from boom_model.structure import DRIVING
from boom_recording.recording import Configuration, Recording
from boom_recording.writing import from_columns
from boom_sim.offline import simulate
from boom_sim.simulated_crane import CraneStart, EndedEarlyError
from boom_trials import loggers

Array = NDArray[np.float64]
Document = dict[str, Any]

RATES = (20.0, 50.0, 100.0, 100.0, 200.0, 1000.0)
"""Hz: of sensors and commands; most loggers have 100."""
FULLY_OPEN = 1.0e7
"""Pa: drop over the supply edge for which the areas of a valve without compensator are made."""
SHARE = 0.25
"""Of the cranes with an effect, and of those with a learned term."""
LEARNED = 0.02
"""Size of a learned term, in units of its place: far below what moves the boom."""
SPREAD = 0.5
"""Of a standard deviation of the prior: how far numbers are drawn from the file's."""
GEOMETRY = ("kinematics.", "cylinder.l", "hose_burst_valve.unit", "constants.", "pilot_valves.")
"""Numbers that stay: the angle's range follows from the geometry, the units are what they are, a drawn curve may not rise."""
MISSING = ("rate", "hose_pressure", "rod_pressure")


@dataclass(frozen=True)
class DrawnCrane:
    """A machine file and what was recorded.

    Attributes:
        document: of the machine file. choices: slot -> what was drawn, for a report.
        missing: sensors that were not recorded.
    """

    document: Document
    choices: dict[str, str]
    missing: tuple[str, ...]
    recording: Recording


def draw(rng: np.random.Generator, seconds: float = 20.0, name: str = "drawn") -> DrawnCrane:
    """One crane with a recording of ``seconds`` [s].

    Raises:
        SimulationError: the drawn boom leaves the model's range at once.
    """
    document, choices = _document(rng)
    machine = _numbers(machine_from(document), rng)
    pose = machine.tabulated[int(rng.integers(len(machine.tabulated)))]
    configuration = Configuration(
        machine.name, pose.outer_boom_angle, pose.telescope_length, float(rng.choice([0.0, 150.0]))
    )
    low, high = machine.angle_limits
    start = CraneStart(angle=low + (high - low) * float(rng.uniform(0.3, 0.6)))
    period = 1.0 / float(rng.choice(RATES))
    time, currents = _operator(machine, pose, rng, seconds, period)
    try:
        recording = simulate(
            machine,
            configuration,
            start,
            time,
            currents,
            noise=machine.sensor_noise(),
            seed=int(rng.integers(2**31)),
            name=name,
            period=period,
        )
    except EndedEarlyError as ended:
        recording = ended.recording
    missing = tuple(channel for channel in MISSING if rng.uniform() < 0.2)
    for channel in missing:
        del recording.signals[channel]
    if rng.uniform() < 0.5:
        _with_supply(recording, machine, configuration, rng)
    logger = _logged(recording, rng)
    choices |= {
        "missing": ", ".join(missing) or "none",
        "rate": f"{1.0 / period:g} Hz",
        "logger": logger,
        "supply": "measured" if "supply_pressure" in recording.signals else "constant",
    }
    return DrawnCrane(_written(document, machine), choices, missing, recording)


def _document(rng: np.random.Generator) -> tuple[Document, dict[str, str]]:
    """A machine file with the numbers of the shipped ones."""
    shipped = {name: dict(load_machine(name).document) for name in ("tz17", "triangle_direct", "loader_crane")}
    body = str(rng.choice(["tz17", "loader_crane"]))
    spool = str(rng.choice(list(shipped)))
    metering = str(rng.choice(["tz17", "loader_crane"]))
    friction = str(rng.choice(["tz17", "loader_crane"]))
    valve = str(rng.choice(["tz17", "loader_crane", "triangle_direct"]))
    gas = str(rng.choice(["tz17", "triangle_direct"]))
    compensator, anti_cavitation = bool(rng.integers(2)), bool(rng.integers(2))
    document: Document = copy.deepcopy(shipped[body])
    document["meta"] = {"name": "drawn", "version": 1, "pressure_reference": "gauge"}
    chosen = {
        "main_valve_spool": spool, "pilot_valves": spool, "main_valve_orifices": metering, "friction": friction,
        "hose_burst_valve": valve, "accumulators": gas,
    }  # fmt: skip
    document |= {section: copy.deepcopy(shipped[source][section]) for section, source in chosen.items()}
    document["fluid"]["p_s"] = {"value": 2.0e7, "unit": "Pa"}
    margin = shipped["tz17"]["main_valve_orifices"]["dp_c"]
    orifices = document["main_valve_orifices"]
    if bool(orifices.get("compensator", True)) != compensator:
        made_for = float(margin["value"]) if metering == "tz17" else FULLY_OPEN
        wanted = float(margin["value"]) if compensator else FULLY_OPEN
        for key in (key for key in orifices if key.startswith("A_") and key.endswith("_max") and key != "A_ta_max"):
            orifices[key]["value"] = float(orifices[key]["value"]) * sqrt(made_for / wanted)
    orifices["compensator"] = compensator
    orifices.pop("dp_c", None)
    if compensator:
        orifices["dp_c"] = margin
    orifices["anti_cavitation"]["enabled"] = anti_cavitation
    if "p_set" in document["hose_burst_valve"] and rng.uniform() < 0.5:
        orifices |= {"neutral": "vented", "A_v": {"value": 5e-6, "unit": "m^2"}, "x_v": {"value": 0.07, "unit": "-"}}
    steps = bool(rng.uniform() < 0.3)
    document.pop(payload.NAME, None)
    if steps:
        document[payload.NAME] = {"tol": 0.1, "steps": [{"mass": 60.0, "stroke": 0.4}, {"mass": -30.0, "time": 8.0}]}
    machine = machine_from(document)
    names = {c.slot: str(c.name) for c in machine.structure}
    terms = _terms(machine, rng)
    names["effect"] = ", ".join(terms.get("effects", ["none"]))
    names["learned"] = ", ".join(term["equation"] for term in terms.get("learned", [])) or "none"
    return document | terms, names | {"body": body, "steps": "yes" if steps else "none"}


def _numbers(machine: Machine, rng: np.random.Generator) -> Machine:
    """The machine with numbers drawn from their priors."""
    changed: dict[str, float | tuple[float, ...]] = {}
    for key, parameter in machine.parameters.items():
        if key.startswith(GEOMETRY):
            continue
        spec, z = parameter.specification, SPREAD * float(rng.standard_normal())
        prior = prior_of(machine, spec.components[0])
        changed[key] = tuple(
            float(np.clip(prior.away(v, z), max(prior.low, spec.minimum), min(prior.high, spec.maximum)))
            for v in parameter.value
        )
    return machine.with_values(changed)


def _written(document: Document, machine: Machine) -> Document:
    """The document of the machine as its owner has it: with the numbers that made the recording."""
    estimates = [
        Identified(name, value, p.specification.unit, (value, value), "drawn")
        for p in machine.parameters.values()
        for name, value in zip(p.specification.components, p.value, strict=True)
    ]
    return dict(document_with(machine_from(document), estimates))


def _terms(machine: Machine, rng: np.random.Generator) -> Document:
    """Sections of the file for an effect of the catalogue, a learned term, both or neither."""
    sections: Document = {}
    if rng.uniform() < SHARE:
        effect = EFFECTS[str(rng.choice([name for name, e in EFFECTS.items() if machine.structure.has(e.needs)]))]
        rows = effect.parameters
        sections["effects"] = {
            effect.id: {row.name: row.starts[0] if row.starts else 0.5 * (row.neutral + row.high) for row in rows}
        }
    if rng.uniform() < SHARE:
        place = str(rng.choice([name for name in PLACES if name != "spool" or machine.structure.spool.piloted]))
        variable, size = str(rng.choice(list(VARIABLES))), LEARNED * float(rng.standard_normal())
        reach = 3.0 * VARIABLES[variable].scale
        sections["learned"] = [LearnedTerm(place, (variable,), (size,), {variable: (-reach, reach)}).document()]
    return sections


def _logged(recording: Recording, rng: np.random.Generator) -> str:
    """Changes the recording to how another logger has it; in words."""
    kind = str(rng.choice(["as measured", "coarse", "repeated", "jitter", "without gyro"]))
    if kind == "coarse":
        loggers.coarse(recording)
    if kind == "repeated":
        loggers.repeated(recording, int(rng.integers(2, 6)))
    if kind == "jitter":
        loggers.jittered(recording, rng)
    if kind == "without gyro" and "rate" in recording.signals:
        loggers.without_gyro(recording)
    return kind


def _operator(
    machine: Machine, pose: Pose, rng: np.random.Generator, seconds: float, period: float
) -> tuple[Array, Array]:
    """Currents (n, 2) [A] of an operator who lifts and lowers, within what the valve of this machine understands."""
    p, e = component_parameters(machine, pose)
    s, stroke = machine.structure, p.main_valve_spool.s_max
    time: Array = np.arange(round(seconds / period), dtype=np.float64) * period
    currents = np.zeros((len(time), 2))
    begin, lift = 1.2, True
    while begin < seconds - 2.0:
        side = -1.0 if lift else 1.0
        overlap = float(s.metering.overlap(side * stroke, p, e))
        opening = overlap + float(rng.uniform(0.1, 0.5)) * (1.0 - overlap)
        level, length = s.spool.current(opening * stroke, p, s.pilot_valves), float(rng.uniform(1.0, 2.5))
        inside = (time >= begin) & (time < begin + length)
        phase = (time[inside] - begin) / length
        currents[inside, int(lift)] = level * np.minimum(1.0, 5.0 * np.minimum(phase, 1.0 - phase))
        begin, lift = begin + length + float(rng.uniform(0.3, 1.5)), not lift
    return time, currents


def _with_supply(
    recording: Recording, machine: Machine, configuration: Configuration, rng: np.random.Generator
) -> None:
    """Adds a measured supply pressure, high enough for a compensator."""
    angle = recording.signals["angle"]
    section, key = DRIVING["supply_pressure"]
    constant = getattr(getattr(machine.numbers, section), key, 3.0e7)
    noise = machine.sensor_noise()
    values = constant + noise.pressure_sigma * rng.standard_normal(len(angle.time))
    recording.signals |= from_columns(recording.name, angle.time, {"supply_pressure": values}, configuration).signals


def complete(crane: DrawnCrane) -> bool:
    """Whether all sensors that the model predicts were recorded."""
    return all(sensor.name in crane.recording.signals for sensor in PREDICTED)
