"""The robustness test of chapter 6.4: many runs of the closed loop, spread over processes, and their numbers.

Measures of (6.29) are those of ``boom_report.tracking.position_error``. Force oscillation: rms of f_p - f_p^f above 0.8 Hz,
f_p from the true p_h and p_b, f_p^f the force (6.2) that the reference needs with the true load: the same for all
modes.
"""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_controller.blocks.control_model import ControlModel, OperatingPoint
from boom_controller.controller import Settings, make_controller
from boom_controller.references.governor import Governor
from boom_controller.references.polynomial import to_rest
from boom_controller.types import Controller, Reference
from boom_model.catalogue import EFFECTS, EffectParameter
from boom_model.cores import usable_cores
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_node.children import end_with, without_ctrl_c
from boom_report.tracking.position_error import errors, piston_positions
from boom_trials.robustness.crane import Grasp, History, TrialCrane, carried_out, start_state
from boom_trials.robustness.oscillation import Oscillation, oscillation_of
from boom_trials.robustness.plants import SUPPLY_PRESSURE, PlantCase
from boom_trials.robustness.trajectories import pose_of, references_of
from boom_trials.robustness.watched import Watched

Array = NDArray[np.float64]

OSCILLATION_FROM = 0.8
"""Hz."""
LATE = 3.0
"""s. By then a load that was attached at the first instant is carried."""
BRAKING, LAST = 0.5, 3.0
"""s in which a trajectory comes to rest; s at the end of a run that are looked at by themselves."""
STILL, SETTLING = 5.0e-6, 1.0
"""m/s below which the reference rests; s after which the boom does, too."""
NEAR = 5.0e-3
"""m from its reference, within which a boom that grasped a load is back."""
SLOWEST = 1.0e-3
"""m/s. Largest speed that a motion has at least."""


@dataclass(frozen=True)
class StudyRun:
    """One run.

    Attributes:
        mode: of the controller; bag: name of the trajectory in ``folder``; case: the plant; seed: of the sensors' noise.
        folder: that holds the bags. machine: name or path of the machine file.
        limited: supply of 250 bar and 84 l/min. delay: dead time of the valve chain [sample times].
        keep: also return the history (for pictures).
        duration: [s] of the trajectory to run; 0: all.
        settings: of the controller.
        governed: the path is slowed where the boom cannot follow; Table 6.3 has no such thing.
        rest: [s] at rest after the trajectory; not part of the errors.
        supervised: the default supervision ends the run where it would stop the boom.
    """

    mode: str
    bag: str
    case: PlantCase
    seed: int = 0
    folder: str = "bags"
    machine: str = "tz17"
    limited: bool = False
    delay: int = 0
    keep: bool = False
    duration: float = 0.0
    settings: Settings = field(default_factory=Settings)
    grasp: Grasp | None = None
    governed: bool = False
    rest: float = 0.0
    supervised: bool = False


@dataclass(frozen=True)
class Result:
    """Result of a run: errors of the piston [m], force oscillation [N] (NaN if it diverged), why it diverged or stopped.

    Attributes:
        late_mae: mean error after the first ``LATE`` seconds. rho: largest error over largest wanted speed [s], NaN without motion.
        rest_travel: travel of the spool over full stroke while the reference rests [1/s]; NaN if it never does.
        noted: see :class:`boom_trials.robustness.crane.History`. rest_swing: peak to peak of the last 3 s [m].
        oscillated: see :mod:`boom_trials.robustness.oscillation`.
        back: [s] after a grasp from which on the piston stays within ``NEAR``; infinite if it does not, NaN without a grasp.
        cycle: [s] of the law's computation, 99 of 100 take less.
    """

    job: StudyRun
    mae: float
    maxe: float
    rmse: float
    oscillation: float
    final_oscillation: float
    diverged: str
    stopped: tuple[float, str] | None
    late_mae: float = math.nan
    rho: float = math.nan
    rest_travel: float = math.nan
    noted: float | None = None
    history: History | None = None
    rest_swing: float = math.nan
    oscillated: Oscillation = field(default_factory=Oscillation)
    back: float = math.nan
    cycle: float = math.nan

    @property
    def finished(self) -> bool:
        """Neither diverged nor stopped by the controller."""
        return not self.diverged and self.stopped is None


def carry_out(
    jobs: Sequence[StudyRun], workers: int | None = None, told: Callable[[], None] | None = None
) -> list[Result]:
    """All jobs, in their order, on ``workers`` processes (default: all cores); ``told`` is called after each.

    Raises:
        RecordingError: a bag is missing or cannot be read. MachineError, ControlError: from the first run that raises it.
    """
    count = min(workers or usable_cores(), len(jobs))
    results = []
    if count <= 1:
        for job in jobs:
            results.append(carry_out_one(job))
            if told:
                told()
        return results
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])  # imported once for all workers
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=end_with, initargs=(os.getpid(),))
    try:
        with without_ctrl_c():
            coming = pool.map(carry_out_one, jobs, chunksize=1)
        for result in coming:
            results.append(result)
            if told:
                told()
    finally:
        pool.shutdown(cancel_futures=True)
    return results


def carry_out_one(job: StudyRun) -> Result:
    """One run and its numbers."""
    nominal = _machine(job.machine)
    references, pose_key = references_of(job.folder, job.bag, job.settings.sample_time, job.settings.generator_pole)
    if job.duration:
        references = references[: round(job.duration / job.settings.sample_time)]
    moving = len(references)
    references = [*references, *_to_rest(references[-1], job.rest, job.settings.sample_time)]
    base = nominal.pose(*pose_key)
    machine = job.case.machine(nominal, job.limited)
    plant = _plant(job.machine, frozenset(machine.effects), machine.still, pose_key).with_numbers(
        machine, replace(base, load=base.load + job.case.load)
    )
    crane = TrialCrane(
        plant,
        start_state(plant, machine, base, references[0].angle),
        len(references),
        noise=nominal.sensor_noise(),
        seed=job.seed,
        period=job.settings.sample_time,
        supply_pressure=SUPPLY_PRESSURE if job.limited else float("inf"),
        grasp=job.grasp,
    )
    known = machine if job.case.told else nominal
    law = _controller(job.mode, _Known(job.machine, known), pose_key, job.settings)
    controller = Watched(law, nominal, base, supervised=job.supervised)
    governor = Governor(job.settings.sample_time) if job.governed else None
    history = carried_out(controller, crane, references, delay=job.delay, governor=governor)
    wished = piston_positions(nominal, history.reference)
    error = wished - piston_positions(nominal, history.values["true_angle"])
    measured = errors(error[:moving])
    speed = np.abs(np.gradient(wished, job.settings.sample_time)) if len(wished) > 1 else np.zeros(1)
    late = error[:moving][round(LATE / job.settings.sample_time) :]
    wanted = _feedforward(job.machine, pose_key, job.case.load, job.folder, job.bag, job.settings)
    if job.governed or job.rest:
        wanted = _force_along(history.references, job.machine, pose_key, job.case.load)
    oscillation, final = _oscillation(
        force(nominal, history) - wanted[: len(history.time)], history, job.settings.sample_time
    )
    period = job.settings.sample_time
    return Result(
        job, measured.mae, measured.maxe, measured.rmse, oscillation, final, history.diverged, history.stopped,
        late_mae=float(np.mean(np.abs(late))) if len(late) else math.nan,
        rho=measured.maxe / float(speed.max()) if speed.max() > SLOWEST else math.nan,
        rest_travel=_rest_travel(nominal, history, speed),
        noted=history.noted, history=history if job.keep else None, rest_swing=float(np.ptp(error[-round(LAST / period) :])),
        oscillated=oscillation_of(error, period, history.noted, history.stopped is not None),
        back=_back(error, period, job.grasp), cycle=float(np.quantile(controller.seconds, 0.99)),
    )  # fmt: skip


def _to_rest(end: Reference, seconds: float, period: float) -> list[Reference]:
    piece = to_rest(end, BRAKING)
    times = (period * (k + 1) for k in range(round(seconds / period)))
    return [piece.at(t) if t < BRAKING else Reference(piece.at(BRAKING).angle) for t in times]


def _back(error: Array, period: float, grasp: Grasp | None) -> float:
    if grasp is None:
        return math.nan
    far = np.flatnonzero(np.abs(error) > NEAR)
    if len(far) and far[-1] == len(error) - 1:
        return math.inf
    return float((far[-1] + 1) * period - grasp.time) if len(far) else 0.0


def _rest_travel(machine: Machine, history: History, speed: Array) -> float:
    """Travel of the spool over full stroke [1/s] while the reference has rested for ``SETTLING`` and will."""
    period = history.time[1] - history.time[0] if len(history.time) > 1 else 1.0
    moving = (speed > STILL).astype(float)
    reach = round(SETTLING / period)
    near = np.convolve(moving, np.ones(reach + reach // 10 + 1))[reach // 10 :][: len(speed)]
    resting = near[1:] < 0.5
    if not resting.any():
        return math.nan
    travel = np.abs(np.diff(history.values["true_spool"])) / machine.numbers.main_valve_spool.s_max
    return float(np.sum(travel[resting]) / (np.sum(resting) * period))


def force(machine: Machine, history: History) -> Array:
    """f_p (n,) [N] from the true p_h and p_b."""
    area_a, area_b = (machine.parameters[f"cylinder.{k}"].value[0] for k in ("A_a", "A_b"))
    return np.asarray(history.values["hose_pressure"] * area_a - history.values["rod_pressure"] * area_b)


def summary(results: Iterable[Result]) -> dict[str, Any]:
    """Means over the finished runs, number diverged, number stopped by the controller (if any), as in the JSON."""
    every = list(results)
    good = [r for r in every if r.finished]

    def mean(values: list[float]) -> float | None:
        return float(np.mean(values)) if values else None

    return {
        "mae_mm": mean([1e3 * r.mae for r in good]),
        "maxe_mm": mean([1e3 * r.maxe for r in good]),
        "rmse_mm": mean([1e3 * r.rmse for r in good]),
        "diverged": sum(bool(r.diverged) for r in every),
        "stopped": sum(r.stopped is not None for r in every),
        "rho_ms": mean([1e3 * r.rho for r in good if math.isfinite(r.rho)]),
        "force_oscillation_n": mean([r.oscillation for r in good]),
    }


def with_poses(results: Iterable[Result]) -> dict[str, Any]:
    """:func:`summary` over all and under ``poses`` over each pose."""
    every = list(results)
    poses = list(dict.fromkeys(pose_of(r.job.bag) for r in every))
    return {
        **summary(every),
        "poses": {pose: summary([r for r in every if pose_of(r.job.bag) == pose]) for pose in poses},
    }


def _oscillation(error: Array, history: History, period: float) -> tuple[float, float]:
    """(whole run, last three seconds) rms [N] of the force error (n,) [N] above 0.8 Hz."""
    if history.diverged or history.stopped:
        return float("nan"), float("nan")
    spectrum = np.fft.rfft(np.concatenate((error, error[::-1])))  # mirrored: no step where the end meets the beginning
    spectrum[np.fft.rfftfreq(2 * len(error), period) < OSCILLATION_FROM] = 0.0
    filtered = np.fft.irfft(spectrum, 2 * len(error))[: len(error)]
    last = filtered[-round(LAST / period) :]
    return float(np.sqrt(np.mean(filtered**2))), float(np.sqrt(np.mean(last**2)))


@lru_cache(maxsize=32)
def _feedforward(
    machine: str, pose: tuple[float, float, float], load: float, folder: str, bag: str, settings: Settings
) -> Array:
    """f_p^f (n,) [N] of (6.2) along the reference, with the true load [kg]."""
    references, _ = references_of(folder, bag, settings.sample_time, settings.generator_pole)
    return _force_along(references, machine, pose, load)


def _force_along(references: Sequence[Reference], machine: str, pose: tuple[float, float, float], load: float) -> Array:
    model = ControlModel(_machine(machine), _machine(machine).pose(*pose))
    points = (OperatingPoint(r.angle, 0.0, 0.0, 0.0, *r, load) for r in references)
    return np.array([model.at(point).feedforward_force for point in points])


@lru_cache(maxsize=4)
def _machine(name: str) -> Machine:
    return load_machine(name)


@lru_cache(maxsize=16)
def _plant(name: str, effects: frozenset[str], still: frozenset[str], pose: tuple[float, float, float]) -> Plant:
    """Compiled with these effects, those in ``still`` without their states, whose numbers follow (``with_numbers``)."""
    machine = _machine(name)
    active = {
        effect: {
            **machine.effects.get(effect, {row.name: _not_neutral(row) for row in EFFECTS[effect].parameters}),
            **{
                row.name: row.neutral if effect in still else _not_neutral(row)
                for row in EFFECTS[effect].parameters
                if row.name in EFFECTS[effect].moving
            },
        }
        for effect in effects
    }
    machine = machine.with_effects(active)
    return Plant(machine, machine.pose(*pose))


def _not_neutral(row: EffectParameter) -> float:
    return next(value for value in (row.low, row.high) if value != row.neutral)


@dataclass(frozen=True)
class _Known:
    """A machine as a key of a cache: two are the same if their numbers are."""

    name: str
    machine: Machine = field(compare=False)
    numbers: str = field(init=False)

    def __post_init__(self) -> None:
        m = self.machine
        object.__setattr__(self, "numbers", repr(([p.value for p in m.parameters.values()], m.effects, m.learned)))


@lru_cache(maxsize=32)
def _controller(mode: str, known: _Known, pose: tuple[float, float, float], settings: Settings) -> Controller:
    return make_controller(mode, known.machine, known.machine.pose(*pose), settings)
