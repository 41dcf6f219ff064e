"""What every answer must keep, by whichever way it was found: it does not contradict its own numbers and free runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import erfc, sqrt

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.assumptions import AT_FLOOR, FAR_FROM_FLOOR, NEAR_FLOOR, OPEN, SHOWN, SURE, WORSE
from boom_diagnosis.document import Estimate, Finding, Fit, Verdict
from boom_diagnosis.sizes import THESIS, MachineSize, sized
from boom_model.catalogue import EFFECTS
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]


def told(effect: str, numbers: Mapping[str, Estimate], size: MachineSize = THESIS, *, sound: bool = False) -> bool:
    """Whether one of an effect's ``numbers`` (its own names) differs from doing nothing by more than its 90 % interval.

    sound: from what sound machines of this size have, too. One that is sought by its logarithm always does: it is told where its
    interval leaves some of what is plausible out.
    """
    for row in sized(EFFECTS[effect], size).sizes:
        if (estimate := numbers.get(row.name)) is None:
            continue
        low, high = estimate.interval_90
        anything = row.positive and low <= row.low and row.high <= high
        ordinary = row.ordinary if sound else 0.0
        nothing = low <= row.neutral + ordinary and high >= row.neutral - ordinary
        if not (anything or nothing):
            return True
    return False


def worse_channels(held_out: Mapping[str, Sequence[float]], floor: Sequence[float]) -> list[str]:
    """Channels whose free runs over data not used (errors by stage) are worse than with parameters only, in words.

    floor: errors that noise alone leaves; one of about that size is no worse than another.
    """
    by_noise = np.array(held_out["explained"], dtype=float) <= AT_FLOOR * np.array(floor, dtype=float)
    return _said(np.where(by_noise, 1.0, _worsened(held_out)), WORSE)


def by_free_runs(
    unknown: float,
    held_out: Mapping[str, Sequence[float]],
    noise_floor: Sequence[float],
    leaves: Sequence[float] | None = None,
) -> tuple[float, float]:
    """That unmodelled physics acts, and what of that goes to parameters alone, once both have run freely through data not used.

    Odds of one-step errors times min(1, p^2 / 27) and max(1, e^2 / 81), 27 = NEAR_FLOOR FAR_FROM_FLOOR, 9 = FAR_FROM_FLOOR; p, e:
    errors over those that noise leaves with parameters only, and with what was found; mean square of the channels. Near the floor
    free runs speak against unknown physics, far from it they leave the word to one step. What one step shows and no free run does
    is a sensor's noise or latency; what an effect leaves of free runs is not explained by it. An effect gets of what is taken
    back as much as it makes free runs better, 1 - e^2 / p^2. leaves: errors that noise and numbers that the recordings leave open
    allow what was found, where these are larger.
    """
    plain = _square(held_out["parameters_only"], noise_floor)
    found = _square(held_out.get("explained", held_out["parameters_only"]), leaves or noise_floor)
    odds = unknown / (1.0 - unknown)
    odds *= far(held_out, noise_floor) * max(1.0, found / FAR_FROM_FLOOR**2)
    weighed = odds / (1.0 + odds)
    return weighed, max(0.0, unknown - weighed) * min(1.0, found / plain)


def far(held_out: Mapping[str, Sequence[float]], noise_floor: Sequence[float]) -> float:
    """min(1, p^2 / 27) of parameters only: how far their free runs let physics be missing."""
    return min(1.0, _square(held_out["parameters_only"], noise_floor) / (NEAR_FLOOR * FAR_FROM_FLOOR))


def as_far_by_chance(z: Array) -> float:
    """Probability that of so many numbers one is off by as many standard deviations as the farthest of ``z``, n P(|N(0, 1)| > z).

    Parameters that have gone where tolerances do not go are no explanation that free runs could speak for.
    """
    return min(1.0, len(z) * erfc(float(np.max(np.abs(z), initial=0.0)) / sqrt(2.0)))


def _square(error: Sequence[float], noise_floor: Sequence[float]) -> float:
    """Mean over the channels; neither near nor far where no run came to its end."""
    square = (np.array(error, dtype=float) / np.maximum(np.array(noise_floor, dtype=float), 1e-12)) ** 2
    return float(np.mean(square[np.isfinite(square)])) if np.isfinite(square).any() else FAR_FROM_FLOOR**2


def shown(held_out: Mapping[str, Sequence[float]], floor: Sequence[float]) -> bool:
    """Whether what was found takes as much from a channel's free runs over data not used as half of the noise's error is.

    Squares add: p^2 - e^2 > n^2 / 4 with errors p of parameters only, e of what was explained, n of noise.
    """
    before, explained, noise = (
        np.array(v, dtype=float) for v in (held_out["parameters_only"], held_out["explained"], floor)
    )
    return bool(
        np.any(before**2 - explained**2 > (SHOWN * noise) ** 2) or np.any(np.isnan(before) & np.isfinite(explained))
    )


def worse_on_the_whole(held_out: Mapping[str, Sequence[float]], leaves: Sequence[float]) -> bool:
    """Whether these free runs are worse by the geometric mean of the channels: then it is not what was found that is missing.

    leaves: errors that noise and open numbers allow; one of about that size is no worse than another.
    """
    ratio = _worsened(held_out)
    by_these = np.array(held_out["explained"], dtype=float) <= AT_FLOOR * np.array(leaves, dtype=float)
    ratio = np.where(by_these, np.minimum(ratio, 1.0), ratio)
    known = ratio[~np.isnan(ratio)]
    return bool(len(known) and np.mean(np.log(np.maximum(known, 1e-12))) > np.log(WORSE))


def _worsened(held_out: Mapping[str, Sequence[float]]) -> Array:
    """(NY,) errors of what was explained over those of parameters only; infinite where only the former end early."""
    explained, before = (np.array(held_out[k], dtype=float) for k in ("explained", "parameters_only"))
    ended = np.isfinite(before) & ~np.isfinite(explained)
    return np.where(ended, np.inf, explained / np.maximum(before, 1e-12))


def allowed(noise_floor: Sequence[float], open_numbers: Sequence[float]) -> tuple[float, ...]:
    """(NY,) errors of free runs that noise leaves, and numbers that the recordings leave open, where these are known."""
    return tuple(np.hypot(noise_floor, open_numbers)) if len(open_numbers) else tuple(noise_floor)


def open_channels(fit: Fit) -> Array:
    """(NY,) whether these free runs err by no more than noise, and numbers that the recordings leave open, may make them."""
    if not fit.open_numbers:
        return np.zeros(len(OUTPUTS), dtype=bool)
    error = np.array(fit.held_out["explained"], dtype=float)
    return np.asarray(error <= OPEN * np.array(allowed(fit.noise_floor, fit.open_numbers)))


def far_channels(
    held_out: Mapping[str, Sequence[float]], noise_floor: Sequence[float], factor: float, but: Array | None = None
) -> list[str]:
    """Channels whose free runs over data not used err more than ``factor`` times what noise alone leaves, in words.

    but: (NY,) channels that are left out.
    """
    explained, floor = np.array(held_out["explained"], dtype=float), np.array(noise_floor, dtype=float)
    ratio = np.where(np.isfinite(floor) & ~np.isfinite(explained), np.inf, explained / np.maximum(floor, 1e-12))
    return _said(ratio if but is None else np.where(but, 0.0, ratio), factor)


def _said(ratio: Array, least: float) -> list[str]:
    return [
        f"{name.replace('_', ' ')} {'without end' if np.isinf(r) else f'{r:.3g} times as much'}"
        for name, r in zip(OUTPUTS, ratio, strict=True) if r > least
    ]  # fmt: skip


def kept(
    verdict: Verdict, findings: Sequence[Finding], fit: Fit, floor_known: bool
) -> tuple[Verdict, list[Finding], list[str]]:
    """Verdict, findings and notes that the free runs over data not used allow.

    floor_known: whether a healthy machine ran with the same currents, so that errors can be compared with those of noise.
    """
    notes = list[str]()
    if not fit.held_out:
        return verdict, list(findings), notes
    worse = worse_channels(fit.held_out, allowed(fit.noise_floor, fit.open_numbers)) if findings else []
    if worse:
        verdict = "ambiguous" if verdict in ("identified", "sensor_or_clock") else verdict
        notes.append(f"unproved: free runs over data not used err more than with parameters only: {', '.join(worse)}")
    if not floor_known:
        notes.append(
            "no healthy machine runs these currents to the end: errors are not compared with those that noise leaves"
        )
        return verdict, list(findings), notes
    far = far_channels(fit.held_out, fit.noise_floor, FAR_FROM_FLOOR)
    untold = far_channels(fit.held_out, fit.noise_floor, FAR_FROM_FLOOR, but=open_channels(fit))
    plain = verdict in ("no_mismatch", "parameters_only")
    explained = bool(fit.all_fitted) and not far_channels({"explained": fit.all_fitted}, fit.noise_floor, NEAR_FLOOR)
    opened = far and (explained or not untold)
    if opened:
        notes.append(
            f"free runs over data not used err more than noise alone would ({', '.join(far)}), by no more than numbers may make "
            "them that the recordings fitted leave open"
            + (": fitted to that data, too, parameters within tolerance explain all of it" if explained else "")
            + ". Fit a recording of that motion, too"
        )
    far = [] if opened else untold
    if far and plain:
        verdict = "ambiguous"
        notes.append(
            "unproved: the one-step errors name nothing, but free runs over data not used err more than noise alone would: "
            + ", ".join(far)
        )
    left = far_channels(fit.held_out, fit.noise_floor, NEAR_FLOOR)
    if left and plain and not (far or opened):
        notes.append(f"free runs over data not used still err more than noise alone would: {', '.join(left)}")
    if left:
        said = f"; free runs over data not used still err more than noise alone would: {', '.join(left)}."
        findings = [
            replace(f, evidence=f.evidence.rstrip(".") + said) if f.confidence >= SURE or far else f for f in findings
        ]
    return verdict, list(findings), notes
