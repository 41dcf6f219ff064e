"""All numbers together: prediction-error estimates of many parameters from several recordings at once.

The search starts from the machine file; if its result still disagrees with the recordings, it starts again from other points.
Initial states are part of the noise model of the predictions. The search does not use the last part of every
recording, which is predicted by free runs afterwards: the held-out check. Of long recordings it looks at the minutes that tell most
(``boom_identification.telling``).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_estimation.experiment import last_part, prepare
from boom_estimation.fit import FitResult, fit
from boom_estimation.problem import EstimationProblem
from boom_estimation.uncertainty import TOLD, Uncertainty, uncertainty
from boom_estimation.unknown import Unknown, machine_unknown
from boom_identification.estimate import Identified, NotDetermined
from boom_identification.held import AREAS, CHARGES, ORIFICES, held_numbers, pairing_told, tied
from boom_identification.machine_output import vector_values
from boom_identification.search import GOOD_LEVEL, PASSABLE_LEVEL, search
from boom_identification.telling import checking, telling
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Recording

Array = NDArray[np.float64]
Progress = Callable[[str], None]

_VALVE = "main_valve_orifices"
UNKNOWNS = (
    "friction.tau_C_pos", "friction.tau_C_neg", "friction.k_v_pos", "friction.k_v_neg", "fluid.beta", "cylinder.V_h",
    "accumulators.p_g0_1", "accumulators.p_g0_2", "accumulators.V_g0", "accumulators.d_1", "accumulators.d_2",
    *AREAS, f"{_VALVE}.A_ta_law.c0", f"{_VALVE}.A_ta_law.c1", f"{_VALVE}.x0", f"{_VALVE}.n",
    "friction.F_C_pos", "friction.F_C_neg", "friction.d_pos", "friction.d_neg", f"{_VALVE}.A_ta_max",
    *(f"{_VALVE}.x0_{edge}" for edge in ("sa", "tb", "sb", "ta")),
)  # fmt: skip
"""Numbers that are estimated by default; those that a machine lacks are left out."""

WIDEN, LEAST = 3.0, 0.3
"""Standard deviation of the prior: three times the tolerance of the machine file's confidence, at least 30 %. A search must be
free to find a number far outside its tolerance; the prior determines the rest."""
HELD_OUT = 0.25
"""Share of every recording, at its end, that the search does not use."""
STARTS = 3
_NOTHING = np.zeros((0, len(OUTPUTS)))
_WIDEST = 0.10
"""Half width of the 90 % interval over the value, from which a number counts as not determined."""
_WIDEST_AREA = 0.05


@dataclass(frozen=True)
class HeldOut:
    """Free-run errors over the held-out blocks: rms error over the standard deviation of the channel, by channel."""

    bag: str
    before: dict[str, float]
    after: dict[str, float]


@dataclass(frozen=True)
class Refinement:
    """Result of :func:`refine`.

    Attributes:
        machine: with the determined numbers in it.
        estimates: the determined parameters. not_determined: the others, each with the reason.
        groups: names that the recordings determine only in combination.
        held_out: the check on data that the search did not use.
        noise_level: ratio of the best model's error to what the currents' noise explains (1: explained).
        iterations: of all searches. starts: number needed.
        fitted_to: parts of long recordings that the search looked at; empty: it looked at everything.
    """

    machine: Machine
    estimates: tuple[Identified, ...]
    not_determined: tuple[NotDetermined, ...]
    groups: tuple[tuple[str, ...], ...] = ()
    held_out: tuple[HeldOut, ...] = ()
    noise_level: float = 1.0
    iterations: int = 0
    starts: int = 0
    fitted_to: tuple[str, ...] = ()

    @property
    def explains(self) -> bool:
        """Whether the model with the best values agrees with the recordings as far as noise lets it."""
        return self.noise_level <= GOOD_LEVEL

    @property
    def errs(self) -> float:
        """Median of the errors of free runs over the held-out blocks, over recordings and measured channels."""
        errors = [error for row in self.held_out for error in row.after.values() if np.isfinite(error)]
        return float(np.median(errors or [np.inf]))

    def document(self) -> dict[str, Any]:
        """For ``identify --json``, key ``refinement``."""
        return {
            "noise_level": self.noise_level,
            "iterations": self.iterations,
            "starts": self.starts,
            "fitted_to": list(self.fitted_to),
            "told_only_together": [list(group) for group in self.groups],
            "held_out": [{"bag": h.bag, "before": h.before, "after": h.after} for h in self.held_out],
        }


def refine(
    recordings: Sequence[Recording],
    machine: Machine,
    progress: Progress | None = None,
    *,
    unknowns: Sequence[str] | None = None,
    held_out: float = HELD_OUT,
    starts: int = STARTS,
    seed: int = 0,
) -> Refinement:
    """Estimate parameters of ``machine`` from recordings of it.

    Args:
        recordings: at least one; gaps are left out.
        machine: prior values, and start of the search.
        progress: called with a short sentence for every step.
        unknowns: components of the machine file, by default those of ``UNKNOWNS`` that it has.
        held_out: share of each recording, at its end, that is held out for the check; 0 for none.
        starts: largest number of searches.
        seed: seed of the other starts.

    Raises:
        MachineError: an unknown that the machine lacks; a pose or load that it cannot have.
    """
    say = progress or (lambda text: None)
    names = _unknowns(machine) if unknowns is None else list(unknowns)
    believed = partial(machine_unknown, machine, widen=WIDEN, least=LEAST)
    asked = [believed(name) for name in names]
    say("preparing the recordings")
    seen = telling(recordings, machine, asked, held_out, say)
    spread_of = 1.0 / np.sqrt(1.0 + np.diag(seen.information))  # of each by itself, at the prior values
    dull = {u.name for u, left in zip(asked, spread_of, strict=True) if left > TOLD}
    lively = [u for u in asked if u.name not in dull]
    silent = tuple(NotDetermined(u.name, "not enough excitation in these recordings") for u in asked if u.name in dull)
    if not lively:
        return Refinement(machine, (), silent)
    problem = EstimationProblem(seen.experiments, lively)
    best, iterations, used = search(problem, starts, seed, say)
    say("intervals")
    spread = uncertainty(problem, best)
    say("numbers that act only together")
    together = tied(problem, best, machine) if best.level <= PASSABLE_LEVEL else []
    reasons = _reasons(best, spread, [members for _, _, members in together])
    kept = [j for j, u in enumerate(best.unknowns) if u.name not in reasons]
    if len(kept) < len(lively) and kept:
        best = _only(problem, best, kept, say)
        iterations += best.iterations
    estimates = _estimates(best, spread, kept, lively)
    estimates = _in_order(estimates)
    extra = held_numbers(together, {u.name for u in lively})
    groups = tuple(members for _, _, members in together)
    fitted = machine.with_values(vector_values(machine, estimates))
    say("free runs over the held-out data")
    check = _held_out(seen.recordings, machine, fitted, held_out) if held_out > 0 else ()
    missing = tuple(NotDetermined(name, why, excitation) for name, (why, excitation) in reasons.items())
    left = (*silent, *missing, *extra)
    return Refinement(
        fitted, tuple(estimates), left, groups, check, best.level, iterations, used, seen.selected
    )  # fmt: skip


def _unknowns(machine: Machine) -> list[str]:
    components = {c for p in machine.parameters.values() for c in p.specification.components}
    return [name for name in UNKNOWNS if name in components]


def _reasons(best: FitResult, spread: Uncertainty, groups: Sequence[Collection[str]]) -> dict[str, tuple[str, bool]]:
    """Why unknowns are not determined: name -> (reason, whether another motion would help)."""
    if best.level > PASSABLE_LEVEL:
        why = "no values were found with which the model reproduces the recordings"
        return {u.name: (why, False) for u in best.unknowns}
    result: dict[str, tuple[str, bool]] = {}
    for j, unknown in enumerate(best.unknowns):
        value = best.values[j]
        half = max(spread.high[j] - value, value - spread.low[j]) / max(abs(value), 1e-300)
        widest = _WIDEST_AREA if unknown.name in AREAS else _WIDEST
        partners = [best.unknowns[k].name for k in spread.partners(j)]
        if spread.shrinkage[j] > TOLD or half > widest:
            together = f"; only together with {', '.join(partners)}" if partners else ""
            result[unknown.name] = (f"known to +-{100 * half:.0f} % only (90 %){together}", not partners)
    for members in groups:
        if {u.name for u in best.unknowns} >= set(members):
            why = f"only together with the others of {', '.join(members)}"
            result |= dict.fromkeys(members, (why, False))
    asked = [u.name for u in best.unknowns if u.name in ORIFICES]
    if asked and not pairing_told(spread, result):
        vague = [name for name in CHARGES if name in result]
        why = "which orifice belongs to which accumulator is not determined"
        why += f", as their pre-charges are not ({', '.join(vague)})" if vague else ""
        result |= {name: (why, True) for name in asked if name not in result}
    return result


def _only(problem: EstimationProblem, full: FitResult, kept: Sequence[int], say: Progress) -> FitResult:
    """The fit again with undetermined numbers held at their prior values, so that all numbers are consistent."""
    fewer = EstimationProblem(problem.experiments, [problem.unknowns[j] for j in kept])
    return fit(fewer, full.z[list(kept)], iterations=10, level=full.level, progress=lambda text: say("again: " + text))


def _estimates(
    best: FitResult, spread: Uncertainty, kept: Sequence[int], lively: Sequence[Unknown]
) -> list[Identified]:
    """Determined numbers; if the fit was repeated, the interval of the first fit is shifted with the value."""
    result = []
    for position, j in enumerate(kept):
        unknown = lively[j]
        k = position if len(best.unknowns) == len(kept) else j
        value = float(best.values[k])
        middle = 0.5 * (spread.low[j] + spread.high[j])
        half = 0.5 * float(spread.high[j] - spread.low[j])
        low, high = (float(spread.low[j]), float(spread.high[j]))
        if not low <= value <= high or abs(value - middle) > 0.5 * half:
            low, high = value - half, value + half
        result.append(Identified(unknown.name, value, unknown.unit, (low, high), "all recordings at once"))
    return result


def _in_order(estimates: list[Identified]) -> list[Identified]:
    """Exchange the accumulators if needed: by (5.43) number 1 is the one with the higher pre-charge."""
    found = {e.key: e for e in estimates}
    pairs = (CHARGES, ORIFICES)
    if not all(key in found for pair in pairs for key in pair):
        return estimates
    if found[CHARGES[0]].value >= found[CHARGES[1]].value:
        return estimates
    other = dict(pair for a, b in pairs for pair in ((a, b), (b, a)))
    return [replace(found[other[e.key]], key=e.key) if e.key in other else e for e in estimates]


def free_run_errors(
    recordings: Sequence[Recording], machine: Machine, held_out: float = HELD_OUT
) -> list[dict[str, float]]:
    """Per recording and channel: rms error of free runs over the held-out part, over the channel's standard deviation.

    held_out: share of each recording, at its end; that of a long one is run a minute at a time, each from its own initial state.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    result = []
    for recording in recordings:
        parts = checking(recording, held_out)
        experiments = [
            prepare(piece, machine, held_out=last_part(piece, share), name=f"{k}:{piece.name}")
            for k, (piece, share) in enumerate(parts)
        ]
        errors = EstimationProblem(experiments, []).free_errors(np.zeros(0))
        segments = [segment for experiment in experiments for segment in experiment.segments]
        error = np.concatenate([e[~s.training] for e, s in zip(errors, segments, strict=True)] or [_NOTHING])
        measured = np.concatenate([s.measured for s in segments] or [_NOTHING])
        numbers = {}
        for i, name in enumerate(OUTPUTS):
            known, seen = error[np.isfinite(error[:, i]), i], measured[np.isfinite(measured[:, i]), i]
            if len(known) and len(seen) and np.std(seen) > 0:
                numbers[name] = float(np.sqrt(np.mean(known**2)) / np.std(seen))
        result.append(numbers)
    return result


def _held_out(recordings: Sequence[Recording], before: Machine, after: Machine, share: float) -> tuple[HeldOut, ...]:
    errors = [free_run_errors(recordings, machine, share) for machine in (before, after)]
    return tuple(HeldOut(r.name, first, second) for r, first, second in zip(recordings, *errors, strict=True))
