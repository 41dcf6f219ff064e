"""What a control law must show, row by row: what is asked, and what each law reaches on the same plants.

A plant here has an effect of the catalogue, which the law is told by the machine file or not. A row gives numbers, of which each
has a bound; a run that diverged or was stopped leaves its row not met. Rows with few plants run along all nine recorded
trajectories, and again along nine that are drawn afresh from the seed; the others along one of either kind in each pose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, isinf, isnan, nan
from typing import Any

import numpy as np

from boom_controller.controller import Settings
from boom_model.catalogue import (
    CATALOGUE,
    EFFECTS,
    boom_flexibility,
    command_delay,
    entrained_air,
    pilot_lag,
    pump_flow_limit,
    valve_hysteresis,
)
from boom_model.catalogue.effect import Effect
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_trials.robustness.crane import Grasp
from boom_trials.robustness.oscillation import AT_ONCE
from boom_trials.robustness.plants import CONFIGURATIONS, TRAJECTORIES, PlantCase, monte_carlo, within_tolerance
from boom_trials.robustness.study import Result, StudyRun
from boom_trials.robustness.trajectories import HOLD, fresh

MODES = ("improved", "simple")
"""The law in use and the yardstick."""
SHORT = 20.0
"""s of the trajectories of the rows with many plants."""
ONE_EACH = tuple(
    bags[-1] if pose == "log" else bags[1] if pose == "folded" else bags[0] for pose, bags in TRAJECTORIES.items()
)
"""One recorded trajectory in each pose."""
EVERY = tuple(bag for bags in TRAJECTORIES.values() for bag in bags)
DEAD_TIMES = (0.0, 0.04, 0.06)
FLEXIBLE = tuple({"gain": gain, "f": f} for f in (1.5, 2.5, 5.0) for gain in (0.25, 0.5))
COMBINED = {
    pilot_lag.EFFECT.id: {"r": 1.7}, command_delay.EFFECT.id: {"T": 0.04},
    entrained_air.EFFECT.id: {"a": 0.02}, valve_hysteresis.EFFECT.id: {"h": 0.02},
}  # fmt: skip
PUMP = {pump_flow_limit.EFFECT.id: {"inverse_q_max": 60_000 / 50}}
RESTING = 6.0
"""s after the trajectory, for what is asked at rest."""
TOO_HIGH, LATE = 3.0, 0.04
"""Factor of all gains; dead time [s] that is not told, without which three times the gains do not oscillate."""
HELD_AT = {"extended": (0.0, 0.15, 0.3), "log": (0.0, 0.15, 0.3), "folded": (0.3,)}
"""Pose -> angles [rad] at which a load is grasped while the boom holds."""
GRASPED_AT = 1.0
"""s."""
LIFTABLE, TOO_HEAVY = (300.0, 700.0), 2000.0
"""kg that the crane lifts with its supply; kg that it does not."""
ONSET = 5.0
"""s. When an effect sets in that does on the way."""
Measure = Callable[[Sequence[Result]], dict[str, float]]


@dataclass(frozen=True)
class Requirement:
    """One requirement.

    Attributes:
        name: what the plant is. asked: name of a number -> (bound, unit), unit included in the print.
        cases: plants, in the order in which ``measure`` gets their results.
        measure: the numbers, in the units of ``asked``, of all results.
        others: what the runs are beside that (fields of :class:`StudyRun`).
    """

    name: str
    asked: Mapping[str, tuple[float, str]]
    cases: Sequence[PlantCase]
    measure: Measure
    bags: Sequence[str] = ONE_EACH
    duration: float = SHORT
    may_stop: bool = False
    others: Mapping[str, Any] = field(default_factory=dict)

    @property
    def needs(self) -> set[str]:
        """What a machine must have for the effects of these plants (``Structure.has``)."""
        return {EFFECTS[effect].needs for case in self.cases for effect in case.effects}

    def jobs(self, mode: str, folder: str, machine: str, seed: int) -> list[StudyRun]:
        """The runs of a mode."""
        return [
            StudyRun(mode, bag, case, seed, folder, machine, duration=self.duration, **self.others)
            for case in self.cases
            for bag in self.bags
        ]


def rows(scattered: int, seed: int, machine: str = "tz17") -> list[Requirement]:
    """All requirements whose plants the ``machine`` can be; ``scattered``: so many plants, every number within its tolerance."""
    both, file = (*ONE_EACH, *fresh(seed, 1)), load_machine(machine)
    found = [*_whole_rows(seed), *_plant_rows(both), *_load_rows()]
    if scattered:
        found += _scattered_rows(scattered, seed, file)
    return [row for row in found if all(file.structure.has(need) for need in row.needs)]


def _whole_rows(seed: int) -> list[Requirement]:
    """C0 to C4 on whole trajectories, without and with the reference governor; the time that a cycle takes."""
    nominal, loaded = [PlantCase("nominal")], [CONFIGURATIONS[name] for name in ("C1", "C2", "C3", "C4")]
    at_c0 = {"MAE": (0.08, "mm"), "MAXE": (1.4, "mm"), "rho": (12.0, "ms"), "spool at rest": (0.1, "strokes/s")}
    at_load = {"MAE": (0.4, "mm"), "after 3 s": (0.3, "mm"), "MAXE": (16.5, "mm")}
    found = []
    for word, bags in (("", EVERY), (", fresh trajectories", fresh(seed))):
        found += [
            Requirement(f"C0{word}", at_c0, nominal, _whole, bags, 0.0),
            Requirement(f"C1 to C4{word}", at_load, loaded, _whole, bags, 0.0),
            Requirement(
                f"C1 to C4, off the slowed path{word}", at_load, loaded, _whole, bags, 0.0, others={"governed": True}
            ),
        ]
    return [*found, Requirement("a cycle's computation, in this process", {"p99": (100.0, "us")}, nominal, _cycle)]


def _plant_rows(bags: Sequence[str]) -> list[Requirement]:
    """Dead time, bending, the combined case, each effect, a small pump."""
    mean = {"mean": (0.0, "mm")}
    still = {"at rest": (0.2, "mm"), "force at rest": (2.0, "kN")}
    delays = [_case(f"{1e3 * t:.0f} ms", {command_delay.EFFECT.id: {"T": t}} if t else {}) for t in DEAD_TIMES]
    bends = [_case(f"{n['f']:g} Hz, {n['gain']:g}", {boom_flexibility.EFFECT.id: n}) for n in FLEXIBLE]
    nominal = PlantCase("nominal")
    return [
        Requirement("dead time 0 to 60 ms, told", {**_up_to(mean, 0.3), "worst pose": (0.5, "mm")}, _told(delays), _worst_case,
            bags),
        Requirement("dead time 0 to 60 ms, not told", {"worst pose": (0.5, "mm")}, delays, _worst_case, bags),
        Requirement("flexibility 1.5 to 5 Hz, told", {"worst pose": (0.5, "mm"), **still},
            _told(bends), _worst_case, bags, others={"rest": RESTING}),
        Requirement("flexibility 1.5 to 5 Hz, not told", {"out of control": (0.0, "runs")}, bends, _out_of_control, bags,
            may_stop=True),
        Requirement("lag x 1.7, 40 ms, air, hysteresis, told", _up_to(mean, 0.4), _told([_case("combined", COMBINED)]),
            _worst_case, bags),
        *(
            Requirement(f"{effect.id}, told", {"over nominal": (1.5, "")}, [nominal, *_told([_of(effect)])], _ratio, bags,
                others={"governed": True})  # as shipped: droop and pump leave less speed than the paths ask for
            for effect in CATALOGUE if not effect.foreign
        ),
        Requirement("pump limit of 50 l/min, told, off the slowed path", {"worst pose": (3.0, "mm"), "MAXE": (3.0, "mm")},
            _told([_case("pump", PUMP)]), _worst_case, bags, others={"governed": True}),
    ]  # fmt: skip


def _load_rows() -> list[Requirement]:
    """Loads under the supervision as shipped: attached at the first instant, and grasped while the boom holds."""
    real = {"supervised": True, "limited": True, "governed": True}
    held = [f"{HOLD}/{pose}/{angle:g}" for pose, angles in HELD_AT.items() for angle in angles]
    found = [
        Requirement(f"{load:g} kg, 250 bar and 84 l/min, default supervision", {"MAE": (1.5, "mm")},
            [PlantCase(f"{load:g} kg", load)], _whole, EVERY, 0.0, others=real)
        for load in LIFTABLE
    ]  # fmt: skip
    for load, asked in (
        (LIFTABLE[-1], {"back after": (0.7, "s"), "stopped": (0.0, "runs")}),
        (TOO_HEAVY, {"neither stopped nor held": (0.0, "runs")}),
    ):
        case, grasp = PlantCase(f"{load:g} kg grasped"), Grasp(GRASPED_AT, load)
        found.append(
            Requirement(f"{load:g} kg grasped, default supervision", asked, [case], _grasped, held, 0.0, may_stop=True,
                others={"supervised": True, "grasp": grasp})
        )  # fmt: skip
    return found


def _scattered_rows(count: int, seed: int, nominal: Machine) -> list[Requirement]:
    """Oscillations put in, plants 5 % off, plants with every number within its tolerance."""
    high = [_case(f"run {k}", {command_delay.EFFECT.id: {"T": LATE}}) for k in range(count)]
    asked = {"mean": (0.15, "mm"), "worst": (0.3, "mm"), "out of control": (0.0, "runs"), "oscillating": (0.0, "runs")}
    return [
        Requirement(f"gains {TOO_HIGH:g} times too high, {1e3 * LATE:.0f} ms not told, {count} runs",
            {"recognised late": (0.0, "runs"), "not calmed": (0.0, "runs")}, high, _oscillating, ("",), may_stop=True,
            others={"settings": Settings(feedback_gain=TOO_HIGH)}),
        Requirement(f"{count} plants, valve within 5 %", asked, monte_carlo(count, seed, loaded=False), _scattered, ("",)),
        *(
            Requirement(f"{count} plants, every number within its tolerance{word}", asked, within_tolerance(count, seed, nominal),
                _scattered, ("",), others={"governed": governed})
            for word, governed in (("", False), (", off the slowed path", True))
        ),
    ]  # fmt: skip


def requirement_jobs(
    asked: Sequence[Requirement], modes: Sequence[str], folder: str, machine: str, seed: int
) -> list[StudyRun]:
    """All runs, row by row and mode by mode; scattered plants take the trajectories in turn."""
    jobs = [job for row in asked for mode in modes for job in row.jobs(mode, folder, machine, seed)]
    turn = [0]
    return [job if job.bag else _in_turn(job, turn) for job in jobs]


def requirement_document(
    asked: Sequence[Requirement], modes: Sequence[str], results: Sequence[Result]
) -> dict[str, Any]:
    """``requirements``: for each row what is asked and, for each mode, its numbers and whether they meet it; empty without rows."""
    rest = iter(results)
    document = []
    for row in asked:
        count = len(row.cases) * len(row.bags)
        reached = {mode: _reached(row, [next(rest) for _ in range(count)]) for mode in modes}
        document.append(
            {
                "row": row.name,
                "asked": {name: {"at_most": bound, "unit": unit} for name, (bound, unit) in row.asked.items()},
                "reached": reached,
            }
        )
    return {"requirements": document} if document else {}


def _reached(row: Requirement, results: Sequence[Result]) -> dict[str, Any]:
    numbers = {
        "rho": max((1e3 * r.rho for r in results if r.finished and isfinite(r.rho)), default=nan),
        **row.measure(results),
    }
    lost = sum(not r.finished for r in results)
    met = (row.may_stop or not lost) and all(
        isfinite(numbers[name]) and round(numbers[name], 2) <= bound for name, (bound, _) in row.asked.items()
    )
    return {"numbers": {k: v if isfinite(v) else None for k, v in numbers.items()}, "lost": lost, "met": met}


def _case(name: str, effects: Mapping[str, Mapping[str, float]]) -> PlantCase:
    return PlantCase(name, effects=effects)


def _told(cases: Sequence[PlantCase]) -> list[PlantCase]:
    return [replace(case, told=True) for case in cases]


def _of(effect: Effect) -> PlantCase:
    """A plant with the effect, its leading numbers that a law can be told at three quarters of their plausible range."""
    known = [row for row in effect.leading if row.name not in effect.not_in_laws]
    numbers = {row.name: row.low + 0.75 * (row.high - row.low) for row in known}
    if effect.onset:
        numbers[effect.onset] = ONSET
    return _case(effect.id, {effect.id: numbers})


def _up_to(asked: Mapping[str, tuple[float, str]], bound: float) -> dict[str, tuple[float, str]]:
    return {name: (bound, unit) for name, (_, unit) in asked.items()}


def _in_turn(job: StudyRun, turn: list[int]) -> StudyRun:
    turn[0] += 1
    every = (*EVERY, *fresh(job.seed))
    return replace(job, bag=every[turn[0] % len(every)], seed=job.seed + turn[0])


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else nan


def _by_case(results: Sequence[Result]) -> list[list[Result]]:
    names = dict.fromkeys((r.job.case.name, r.job.case.told) for r in results)
    return [[r for r in results if (r.job.case.name, r.job.case.told) == name] for name in names]


def _whole(results: Sequence[Result]) -> dict[str, float]:
    """Means over the trajectories, of the worst plant."""
    groups = [[r for r in group if r.finished] for group in _by_case(results)]
    return {
        "MAE": max(1e3 * _mean([r.mae for r in g]) for g in groups),
        "after 3 s": max(1e3 * _mean([r.late_mae for r in g]) for g in groups),
        "MAXE": max(1e3 * _mean([r.maxe for r in g]) for g in groups),
        "rho": max(1e3 * _mean([r.rho for r in g]) for g in groups),
        "spool at rest": max(_mean([r.rest_travel for r in g if isfinite(r.rest_travel)]) for g in groups),
    }


def _worst_case(results: Sequence[Result]) -> dict[str, float]:
    good = [r for r in results if r.finished]
    return {
        "mean": max((1e3 * _mean([r.mae for r in group if r.finished]) for group in _by_case(results)), default=nan),
        "worst pose": max((1e3 * r.mae for r in good), default=nan),
        "MAXE": max((1e3 * r.maxe for r in good), default=nan),
        "at rest": max((1e3 * r.rest_swing for r in good), default=nan),
        "force at rest": max((1e-3 * r.final_oscillation for r in good), default=nan),
    }


def _out_of_control(results: Sequence[Result]) -> dict[str, float]:
    good = [r for r in results if r.finished]
    return {
        "out of control": float(sum(bool(r.diverged) for r in results)),
        "stopped": float(sum(r.stopped is not None for r in results)),
        "worst pose": max((1e3 * r.mae for r in good), default=nan),
    }


def _ratio(results: Sequence[Result]) -> dict[str, float]:
    """Mean error with the effect over that without, pose by pose."""
    half = len(results) // 2
    return {"over nominal": _mean([r.mae for r in results[half:]]) / _mean([r.mae for r in results[:half]])}


def _oscillating(results: Sequence[Result]) -> dict[str, float]:
    """Of the runs that oscillate: how many were recognised late or never, and did not become smaller."""
    found = [r.oscillated for r in results if not isnan(r.oscillated.recognised)]
    return {
        "oscillating": float(len(found)),
        "recognised late": float(sum(o.recognised > AT_ONCE for o in found)),
        "never": float(sum(isinf(o.recognised) for o in found)),
        "not calmed": float(sum(not o.calmed for o in found)),
        "out of control": float(sum(bool(r.diverged) for r in results)),
    }


def _scattered(results: Sequence[Result]) -> dict[str, float]:
    good = [1e3 * r.mae for r in results if r.finished]
    return {
        "mean": _mean(good),
        "worst": max(good, default=nan),
        "out of control": float(sum(not r.finished for r in results)),
        "oscillating": float(sum(r.noted is not None for r in results)),
    }


def _grasped(results: Sequence[Result]) -> dict[str, float]:
    """Of the runs that were not stopped: the longest time until the boom is back."""
    held = [r.back for r in results if r.finished]
    return {
        "back after": max(held, default=nan),
        "stopped": float(sum(r.stopped is not None for r in results)),
        "neither stopped nor held": float(sum(r.stopped is None and not isfinite(r.back) for r in results)),
    }


def _cycle(results: Sequence[Result]) -> dict[str, float]:
    return {"p99": min(1e6 * r.cycle for r in results)}
