"""What a control law must show, row by row: what is asked, and what each law reaches on the same plants.

A plant here has an effect of the catalogue, which the law is told by the machine file or not. A row gives numbers, of which each
has a bound; a run that diverged or was stopped leaves its row not met.
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
    boom_flexibility,
    command_delay,
    entrained_air,
    pilot_lag,
    pump_flow_limit,
    valve_hysteresis,
)
from boom_model.catalogue.effect import Effect
from boom_trials.robustness.oscillation import AT_ONCE
from boom_trials.robustness.plants import CONFIGURATIONS, TRAJECTORIES, PlantCase, monte_carlo
from boom_trials.robustness.study import Result, StudyRun

MODES = ("improved", "simple")
"""The law in use and the yardstick."""
SHORT = 20.0
"""s of the trajectories of the rows with many plants."""
ONE_EACH = tuple(
    bags[-1] if pose == "log" else bags[1] if pose == "folded" else bags[0] for pose, bags in TRAJECTORIES.items()
)
"""One trajectory in each pose."""
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
    """

    name: str
    asked: Mapping[str, tuple[float, str]]
    cases: Sequence[PlantCase]
    measure: Measure
    bags: Sequence[str] = ONE_EACH
    duration: float = SHORT
    may_stop: bool = False
    governed: bool = False
    rest: float = 0.0
    settings: Settings = field(default_factory=Settings)

    def jobs(self, mode: str, folder: str, machine: str, seed: int) -> list[StudyRun]:
        """The runs of a mode."""
        return [
            StudyRun(
                mode,
                bag,
                case,
                seed,
                folder,
                machine,
                duration=self.duration,
                governed=self.governed,
                rest=self.rest,
                settings=self.settings,
            )
            for case in self.cases
            for bag in self.bags
        ]


def rows(scattered: int, seed: int) -> list[Requirement]:
    """All requirements; ``scattered``: so many plants with all their numbers within tolerance."""
    mean = {"mean": (0.0, "mm")}
    still = {"at rest": (0.2, "mm"), "force at rest": (2.0, "kN")}
    delays = [_case(f"{1e3 * t:.0f} ms", {command_delay.EFFECT.id: {"T": t}} if t else {}) for t in DEAD_TIMES]
    bends = [_case(f"{n['f']:g} Hz, {n['gain']:g}", {boom_flexibility.EFFECT.id: n}) for n in FLEXIBLE]
    nominal = PlantCase("nominal")
    loaded = [CONFIGURATIONS[name] for name in ("C1", "C2", "C3", "C4")]
    found = [
        Requirement("C0", {"MAE": (0.08, "mm"), "MAXE": (1.4, "mm"), "rho": (12.0, "ms"), "spool at rest": (0.1, "strokes/s")},
            [nominal], _whole, EVERY, 0.0),
        Requirement("C1 to C4", {"MAE": (0.4, "mm"), "after 3 s": (0.3, "mm"), "MAXE": (16.5, "mm")}, loaded, _whole, EVERY, 0.0),
        Requirement("dead time 0 to 60 ms, told", {**_up_to(mean, 0.3), "worst pose": (0.5, "mm")}, _told(delays), _worst_case),
        Requirement("dead time 0 to 60 ms, not told", {"worst pose": (0.5, "mm")}, delays, _worst_case),
        Requirement("flexibility 1.5 to 5 Hz, told", {"worst pose": (0.5, "mm"), **still},
            _told(bends), _worst_case, rest=RESTING),
        Requirement("flexibility 1.5 to 5 Hz, not told", {"out of control": (0.0, "runs")}, bends, _out_of_control, may_stop=True),
        Requirement("lag x 1.7, 40 ms, air, hysteresis, told", _up_to(mean, 0.4), _told([_case("combined", COMBINED)]),
            _worst_case),
        *(
            Requirement(f"{effect.id}, told", {"over nominal": (1.5, "")}, [nominal, *_told([_of(effect)])], _ratio,
                governed=effect is pump_flow_limit.EFFECT)
            for effect in CATALOGUE
        ),
        Requirement("pump limit of 50 l/min, told", {"worst pose": (3.0, "mm"), "MAXE": (3.0, "mm")},
            _told([_case("pump", PUMP)]), _worst_case, governed=True),
    ]  # fmt: skip
    if scattered:
        high = [_case(f"run {k}", {command_delay.EFFECT.id: {"T": LATE}}) for k in range(scattered)]
        found.append(Requirement(f"gains {TOO_HIGH:g} times too high, {1e3 * LATE:.0f} ms not told, {scattered} runs",
            {"recognised late": (0.0, "runs"), "not calmed": (0.0, "runs")}, high, _oscillating, ("",), may_stop=True,
            settings=Settings(feedback_gain=TOO_HIGH)))  # fmt: skip
        plants = monte_carlo(scattered, seed, loaded=False)
        asked = {"mean": (0.15, "mm"), "worst": (0.3, "mm"), "out of control": (0.0, "runs")}
        found.append(Requirement(f"{scattered} scattered plants", asked, plants, _scattered, ("",)))
    return found


def requirement_jobs(
    asked: Sequence[Requirement], modes: Sequence[str], folder: str, machine: str, seed: int
) -> list[StudyRun]:
    """All runs, row by row and mode by mode; scattered plants take the trajectories in turn."""
    jobs = [job for row in asked for mode in modes for job in row.jobs(mode, folder, machine, seed)]
    turn = {"": 0}
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
    numbers = row.measure(results)
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
    """A plant with the effect, its leading numbers at three quarters of their plausible range."""
    numbers = {row.name: row.low + 0.75 * (row.high - row.low) for row in effect.leading}
    if effect.onset:
        numbers[effect.onset] = ONSET
    return _case(effect.id, {effect.id: numbers})


def _up_to(asked: Mapping[str, tuple[float, str]], bound: float) -> dict[str, tuple[float, str]]:
    return {name: (bound, unit) for name, (_, unit) in asked.items()}


def _in_turn(job: StudyRun, turn: dict[str, int]) -> StudyRun:
    turn[""] += 1
    return replace(job, bag=EVERY[turn[""] % len(EVERY)], seed=job.seed + turn[""])


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
    }
