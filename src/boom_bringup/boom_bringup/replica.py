"""The simulated crane for a recording: machine, initial state at rest, parameters of the nodes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from boom_input.shown import quoted

if TYPE_CHECKING:
    from boom_model.machine import Machine
    from boom_recording.recording import Configuration, Recording


COARSER = 1.5
"""Times the file's resolution: what a recording shows of its own is told this well."""
_NOT_OF_AN_ECU = ("robot_description", "publish_description", "controller_follows", "realtime_priority")
_TOLD = ("outer_boom_angle", "telescope_length", "load_mass", "robot_description")


class ReplicaError(ValueError):
    """The recording lacks data that the simulation needs; one line that says what to do."""

    exit_status = 2


def machine_of(recordings: Mapping[str, Recording], wanted: str | None = None) -> tuple[Machine, str]:
    """The machine to run and its name or path: the requested one, or the one that all recordings name.

    Its sensors are as coarse as in the recordings.

    Args:
        recordings: by the name under which the user knows them.
        wanted: machine file or shipped name; None = the recordings'.

    Raises:
        ReplicaError: the recordings name none, several, or one that is not shipped.
        MachineError: the file cannot be used.
    """
    from boom_model.machine_file import load_machine, shipped_machine, shipped_machines

    if wanted is not None:
        if not wanted:
            raise ReplicaError("--machine is empty: give a machine file or the name of a shipped one")
        return _as_recorded(load_machine(wanted), recordings.values()), wanted
    named: dict[str, list[str]] = {}
    for bag, recording in recordings.items():
        named.setdefault(recording.configuration.machine, []).append(bag)
    if len(named) > 1:
        each = "; ".join(f"{quoted(name, 60) or 'no name'}: {', '.join(bags)}" for name, bags in named.items())
        raise ReplicaError(
            f"the recordings are of different machines: {each}: run them separately, or give one --machine"
        )
    name, (bag, *_) = next(iter(named.items()))
    shipped = shipped_machines()
    if not name:
        raise ReplicaError(
            f"{bag}: no machine named: give its file, or a shipped one ({', '.join(shipped)}), with --machine"
        )
    if name not in shipped:
        raise ReplicaError(
            f"{bag}: recorded on machine '{quoted(name, 60)}', for which no file is shipped (there is {', '.join(shipped)}): "
            "give its file with --machine FILE"
        )
    return _as_recorded(shipped_machine(name), recordings.values()), name


def _as_recorded(machine: Machine, recordings: Iterable[Recording]) -> Machine:
    """The machine with sensors whose resolution is that of the recordings where it is coarser than the file's."""
    from boom_input.channels import PREDICTED
    from boom_recording.measurement import measurements

    noise, seen = machine.sensor_noise(), [measurements(recording) for recording in recordings]
    steps: dict[str, float] = {}
    for sensor in PREDICTED:
        step = max((found[sensor.name].quantum for found in seen), default=0.0)
        if sensor.quantum and step > COARSER * noise.quantum(sensor):
            steps[sensor.quantum] = max(step, steps.get(sensor.quantum, 0.0))
    return machine.with_resolution(steps.get("angle_quantum", 0.0), steps.get("pressure_quantum", 0.0))


def rest_of(recording: Recording, bag: str, advice: str = "give another recording") -> dict[str, float]:
    """State of the boom at rest at the beginning: angle [rad], hose_pressure and rod_pressure [Pa, gauge].

    Args:
        recording: the recording.
        bag: its name for the user.
        advice: remedy for the message if the boom moves.

    Raises:
        ReplicaError: the boom moves at the beginning.
    """
    from boom_estimation.initial_state import resting_start

    rest = resting_start(recording)
    if rest is None:
        raise ReplicaError(f"{bag}: the boom is not at rest at the beginning, so its state is unknown: {advice}")
    return rest


def misfit(bag: str, machine: Machine, told: Configuration, why: object) -> str:
    """Why a machine cannot have the pose or the load of a recording, and whether that is of another machine."""
    other = told.machine not in ("", machine.name)
    whose = f"; the bag was recorded on machine '{quoted(told.machine, 60)}': give its file" if other else ""
    return f"{bag}: its configuration does not fit machine {machine.name}: {why}{whose}"


def pose_of(machine: Machine) -> Configuration:
    """Without a load, extended; of a crane that has no such pose the first of its file."""
    from boom_model.errors import MachineError
    from boom_recording.recording import Configuration

    extended = Configuration(machine.name, 0.28, 2.2, 0.0)
    try:
        machine.pose(extended.outer_boom_angle, extended.telescope_length)
    except MachineError:
        first = machine.tabulated[0]
        return replace(extended, outer_boom_angle=first.outer_boom_angle, telescope_length=first.telescope_length)
    return extended


def check_pose(bag: str, machine: Machine, told: Configuration) -> None:
    """Raises ReplicaError where the machine cannot have the pose or the load of a recording."""
    from boom_model.errors import MachineError

    try:
        machine.pose(
            told.outer_boom_angle, told.telescope_length, 0.0 if math.isnan(told.load_mass) else told.load_mass
        )
    except MachineError as error:
        raise ReplicaError(f"{misfit(bag, machine, told, error)}; give --q3, --q4 or --load") from None


def simulation_parameters(recording: Recording, bag: str, machine: Machine, source: str, seed: int) -> dict[str, Any]:
    """ROS parameters of the crane in lockstep (simulation or ECU stand-in), in the pose and with the load of the recording.

    Args:
        recording: to repeat.
        bag: its name for the user.
        machine: of the simulated crane.
        source: its file or shipped name, for the node.
        seed: of the sensors' noise.

    Raises:
        ReplicaError: the boom moves at the beginning.
    """
    from boom_description.shipped import robot_description

    rest, c = rest_of(recording, bag), recording.configuration
    return {
        "machine": source,
        "outer_boom_angle": float(c.outer_boom_angle),
        "telescope_length": float(c.telescope_length),
        "load_mass": 0.0 if math.isnan(c.load_mass) else float(c.load_mass),
        "initial_angle": float(rest["angle"]),
        "initial_hose_pressure": float(rest["hose_pressure"]),
        "initial_rod_pressure": float(rest["rod_pressure"]),
        "mode": "lockstep",
        "seed": seed,
        "robot_description": robot_description(machine.name),
    }


def ecu_parameters(simulation: Mapping[str, Any]) -> dict[str, Any]:
    """ROS parameters of the ECU stand-in: those of the simulation without what the bridge tells of the machine.

    Args:
        simulation: as `simulation_parameters` gives them.
    """
    return {name: value for name, value in simulation.items() if name not in _NOT_OF_AN_ECU}


def bridge_parameters(simulation: Mapping[str, Any], machine: Machine, *, lockstep: bool = True) -> dict[str, Any]:
    """ROS parameters of the CAN bridge for that crane: data that the bus does not carry, and no limits.

    Args:
        simulation: as `simulation_parameters` gives them.
        machine: of the simulated crane.
        lockstep: whether the ECU makes the time.
    """
    return {
        "lockstep": lockstep,
        "wait_for_bus": True,
        "machine": machine.name,
        **{name: simulation[name] for name in _TOLD},
        "note": f"simulated behind CAN, seed {simulation['seed']}",
        "pressure_variance": machine.sensor_noise().pressure_sigma ** 2,
        "rise_rate": 1000.0,  # the recorded currents have their own; the ECU is simulated
    }
