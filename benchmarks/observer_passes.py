"""How fast the diagnosis' observer passes over a recording: side by side, alone, with all effects computed, with a corner.

    python benchmarks/observer_passes.py [--bag BAG]

Processor time of one pass of the full model, least of several, all in one run. Passes differ by 1 % in one number each. With the
corner: the check valve opens at once (``hose_burst_valve.OPENING`` at a millipascal), as (5.28) is printed. Also how exact
derivatives by the tolerances are and what they cost, by the model's sensitivities and by differences, against differences at a
tolerance of 1e-8.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

import boom_diagnosis.prediction as prediction
from boom_diagnosis.bag_samples import Bag, prepare
from boom_diagnosis.fitting import Problem
from boom_diagnosis.nuisances import tolerances
from boom_diagnosis.prediction import Predictor, Values
from boom_model import compiled_model
from boom_model.codegen.compiled import LANES
from boom_model.components import hose_burst_valve
from boom_model.equations import Equations, full_model
from boom_model.machine_file import load_machine
from boom_model.observer import Job, observe, observe_groups
from boom_recording.loading import load

Array = NDArray[np.float64]
BAG = Path(__file__).resolve().parents[1] / "bags" / "healthy" / "folded_fast"
OFF = ({}, {"cylinder.A_a": 1.01}, {"cylinder.A_b": 1.01}, {"fluid.beta": 0.99})
REPEATS = 5


def jobs(bag: Bag) -> list[Job]:
    """One pass for each of ``OFF``."""
    predictor = Predictor(load_machine("tz17"), [bag])
    p = dict(zip(predictor.base[0].parameter_names, predictor.base[0].p, strict=True))
    return [predictor.job(0, {name: p[name] * factor for name, factor in off.items()}) for off in OFF]


def least(call: Callable[[list[Job]], None], passes: list[Job]) -> float:
    """Processor time [ms] of the quickest call."""
    times = []
    for _ in range(REPEATS):
        begin = process_time()
        call(passes)
        times.append(1e3 * (process_time() - begin))
    return min(times)


def one_by_one(passes: list[Job]) -> None:
    """Each alone."""
    for plant, samples, x, gain, p in passes:
        observe(plant, samples, x, gain, parameters=p, tolerance=prediction.TOLERANCE)


def together(passes: list[Job]) -> None:
    """All in one register."""
    observe_groups([passes], tolerance=prediction.TOLERANCE, workers=1)


class ByDifferences(Predictor):
    """One without sensitivities."""

    def derivatives(self, base: Values, moved: Sequence[Values], step: float) -> None:
        """None: differences instead."""


def derivatives(bag: Bag, tolerance: float, kind: type[Predictor] = ByDifferences) -> tuple[Array, float]:
    """Of the innovations by the tolerances (rows, numbers), and the processor time [s] they took."""
    machine = load_machine("tz17")
    predictor = kind(machine, [bag])
    problem = Problem(predictor, tolerances(machine, predictor.base[0].pose), [bag.counted])
    at = problem.points([(np.zeros(len(problem.nuisances)), {})])[0]
    problem.nuisance_jacobian(at)  # what is to be compiled is
    kept, prediction.TOLERANCE = prediction.TOLERANCE, tolerance
    begin = process_time()
    try:
        found = problem.nuisance_jacobian(at)
        return found, process_time() - begin
    finally:
        prediction.TOLERANCE = kept


@contextmanager
def other_models() -> Iterator[None]:
    """Within it models are built anew."""
    kept = (compiled_model._catalogued, compiled_model._catalogued_abreast, compiled_model._guarded)
    for cached in kept:
        cached.cache_clear()
    try:
        yield
    finally:
        for cached in kept:
            cached.cache_clear()


def with_corner(bag: Bag) -> list[Job]:
    """The passes with the check valve as (5.28) is printed."""
    with other_models(), patch.object(hose_burst_valve, "OPENING", 1e-3):
        return jobs(replace(bag, plants=[]))


def unguarded(bag: Bag) -> float:
    """Processor time [ms] of passes side by side that compute the terms of all effects, whatever these do."""

    def whole(*given: Any, **named: Any) -> Equations:
        return full_model(*given, **{**named, "guarded": ()})

    with other_models(), patch.object(compiled_model, "full_model", whole):
        passes = jobs(replace(bag, plants=[]))
        together(passes)
        return least(together, passes) / LANES


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bag", default=str(BAG), help="recording (default: bags/healthy/folded_fast)")
    bag = prepare(load(parser.parse_args().bag))
    if bag is None:
        parser.error("a channel of this recording is missing")
    smooth = jobs(bag)
    together(smooth)
    single, joined = least(one_by_one, smooth) / LANES, least(together, smooth) / LANES
    whole, cornered = unguarded(bag), least(one_by_one, with_corner(bag)) / LANES
    print(f"{bag.name}, {bag.recording.duration:.0f} s; processor time of one pass [ms] and ratio to the best")
    for label, time in (
        (f"{LANES} side by side", joined), ("the same, all effects", whole), ("alone", single),
        ("alone, valve with a corner", cornered),
    ):  # fmt: skip
        print(f"  {label:28} {time:7.1f} {time / joined:6.1f}")
    exact, _ = derivatives(bag, 1e-8)
    size = np.linalg.norm(exact, axis=0)
    print("derivatives of the tolerances: relative error, median and nine of ten [%], processor time [s]")
    for kind, tolerance in ((Predictor, 2e-5), (ByDifferences, 1e-5), (ByDifferences, 2e-5), (ByDifferences, 1e-4)):
        found, seconds = derivatives(bag, tolerance, kind)
        error = (np.linalg.norm(found - exact, axis=0) / np.maximum(size, 1e-9))[size > 1.0]
        how = "sensitivities" if kind is Predictor else "differences"
        numbers = f"{100 * np.median(error):6.1f} {100 * np.quantile(error, 0.9):6.1f} {seconds:6.2f}"
        print(f"  by {how} at {tolerance:.0e}: {numbers}")


if __name__ == "__main__":
    main()
