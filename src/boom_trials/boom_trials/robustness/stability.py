"""Where the closed loop is stable: dead time in the valve chain against oil stiffness and against load.

A run of 20 s of a trajectory in each pose. Stable: it does not diverge, and in its last three seconds f_p moves less than
``LARGEST`` above 0.8 Hz against the feedforward force.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from boom_trials.robustness.plants import POSE_OF, PlantCase
from boom_trials.robustness.study import Result, StudyRun

DELAYS = (0, 2, 4, 6, 8, 10)
"""Sample times of 10 ms."""
STIFFNESSES = (1.0, 0.7, 0.45, 0.3, 0.2)
LOADS = (0.0, 500.0, 1000.0, 1500.0, 2000.0)
BAGS = ("healthy/folded_fast", "healthy/extended", "healthy/extended_log")
DURATION = 20.0
LARGEST = 1.0e4
"""N."""
PERIOD_MS = 10


def stability_jobs(modes: Sequence[str], folder: str, machine: str) -> list[StudyRun]:
    """One run for every mode, pose, dead time and stiffness or load."""
    cases = [PlantCase(f"beta {b:g}", 0.0, {"fluid.beta": b} if b != 1.0 else {}) for b in STIFFNESSES]
    cases += [PlantCase(f"load {m:g}", m) for m in LOADS]
    return [
        StudyRun(mode, bag, case, 0, folder, machine, delay=delay, duration=DURATION)
        for mode in modes for bag in BAGS for case in cases for delay in DELAYS
    ]  # fmt: skip


def is_stable(result: Result) -> bool:
    """Whether a run is stable in the sense of the module."""
    return not result.diverged and result.final_oscillation < LARGEST


def stability_document(results: Sequence[Result]) -> dict[str, Any]:
    """Mode -> pose -> case -> list over the dead times: true where stable; and the axes."""
    maps: dict[str, Any] = {}
    for r in results:
        pose = maps.setdefault(r.job.mode, {}).setdefault(POSE_OF[r.job.bag], {})
        pose.setdefault(r.job.case.name, []).append(is_stable(r))
    return {"dead_time_ms": [d * PERIOD_MS for d in DELAYS], "maps": maps}
