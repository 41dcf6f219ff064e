"""Parameters of the simulation node in one table, used by the node, its README and the tests of the launch files."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

from boom_input.files import InputError
from boom_input.shown import quoted
from boom_input.yaml_text import parse_yaml
from boom_model.errors import ModelError
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.sensors import IDEAL
from boom_node import face
from boom_node.parameters import ParameterSpec
from boom_node.publishers import PARAMETER as SHARED_TOPICS
from boom_sim.simulated_crane import CraneStart, SimulatedCrane

UNSET = -1.0e9
"""A number parameter that was not given; ROS parameters have no empty number."""

PARAMETERS = (
    ParameterSpec("machine", "tz17", "machine file: the name of one that is shipped, or a path to a .yaml", read_only=True),
    ParameterSpec(
        "effects", "", "physics in addition to the machine file, as YAML, e.g. {piston_leakage: {c: 1.0e-12}}", read_only=True
    ),
    ParameterSpec("outer_boom_angle", 0.28, "locked outer boom joint q3", "rad", -3.2, 6.3, read_only=True),
    ParameterSpec("telescope_length", 2.2, "locked telescope extension q4, both stages", "m", 0.0, 20.0, read_only=True),
    ParameterSpec("load_mass", 0.0, "load at the tip at the beginning", "kg", 0.0, 1e5, read_only=True),
    ParameterSpec("initial_angle", 0.3, "boom angle at the beginning, 0 = horizontal", "rad", -3.2, 3.2, read_only=True),
    ParameterSpec(
        "initial_hose_pressure", UNSET, "gauge p_h at the beginning; not given: the pressure that carries the boom", "Pa",
        read_only=True
    ),
    ParameterSpec("initial_rod_pressure", UNSET, "gauge p_b at the beginning; not given: 10 bar", "Pa", read_only=True),
    ParameterSpec("mode", "real_time", "time base", choices=("real_time", "lockstep"), read_only=True),
    ParameterSpec("seed", 0, "seed of the sensor noise", minimum=0, maximum=2**31 - 1, read_only=True),
    ParameterSpec("sensors", "thesis", "noise and quantisation of ch. 6.4, or none", choices=("thesis", "ideal"), read_only=True),
    SHARED_TOPICS,
    *face.PARAMETERS,
    ParameterSpec("ground_truth", False, "publish the true states on /boom/ground_truth", read_only=True),
)  # fmt: skip

NODE_PARAMETERS = (
    *PARAMETERS,
    ParameterSpec(
        "controller_follows", False, "a controller is also being started: do not report motions that no controller follows yet",
        read_only=True,
    ),
    ParameterSpec("realtime_priority", 0, "in real time: SCHED_FIFO priority; 0: none", "", 0, 90, read_only=True),
)  # fmt: skip
"""Parameters of the simulation on topics; the ECU stand-in has :data:`PARAMETERS` and its own."""


class SimulationSettingError(ModelError):
    """A parameter of the simulation that cannot be used; one line that says why."""


def make_crane(values: SimpleNamespace) -> SimulatedCrane:
    """The simulated crane that the parameters describe.

    Raises:
        SettingError, MachineError, ModelError: one line that says what is wrong.
    """
    machine = with_effects(load_machine(values.machine), values.effects)
    pose = machine.pose(values.outer_boom_angle, values.telescope_length, values.load_mass)
    start = CraneStart(values.initial_angle, _given(values.initial_hose_pressure), _given(values.initial_rod_pressure))
    noise = machine.sensor_noise() if values.sensors == "thesis" else IDEAL
    return SimulatedCrane(machine, pose, start, noise, values.seed)


def with_effects(machine: Machine, text: str) -> Machine:
    """The machine with additional effects, given as YAML text; effects of its file stay unless named again.

    Raises:
        SimulationSettingError: not YAML, or not effects. MachineError: an effect, parameter or value that does not exist.
    """
    if not text.strip():
        return machine
    try:
        given: Any = parse_yaml(text, "effects")
    except InputError as error:
        raise SimulationSettingError(str(error)) from None
    if not isinstance(given, dict):
        raise SimulationSettingError(
            f"effects: {quoted(repr(text))} is not of the form {{effect: {{parameter: number}}}}"
        )
    return machine.with_effects({**machine.effects, **given})


def _given(value: float) -> float:
    return value if value != UNSET else math.nan
