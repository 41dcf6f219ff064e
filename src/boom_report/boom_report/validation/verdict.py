"""What a validation says, in one line per recording: agrees, or what differs most and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from boom_estimation.free_run import FreeRun
from boom_identification.validation import BagValidation
from boom_input.channels import PREDICTED, Sensor
from boom_report.channels import error_text, number, ratio, statistic

Kind = Literal["agrees", "differs", "stopped", "not compared"]

WINDOW = 1.0
"""s. Length of the stretches in which "where it differs" is counted."""
WINDOW_FACTOR = 2.0
"""Times the limit: what the rms error of such a stretch must exceed. Noise alone reaches 1.5, in fast stops."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on one recording.

    Attributes:
        kind: agrees, differs, stopped (the run left the model's range) or not compared.
        short: for a terminal, without the recording's name.
        sentence: for the report: more numbers, and where.
    """

    kind: Kind
    short: str
    sentence: str


def verdict(bag: BagValidation) -> Verdict:
    """Judges the full model against the measurement."""
    judged = [(c, r) for c in PREDICTED if (r := ratio(c, bag)) is not None]
    missing = [_missing(c, bag) for c in PREDICTED if _missing(c, bag)]
    unjudged = [c.label for c in PREDICTED if not _missing(c, bag) and bag.limits[c.judging] is None]
    derived = f" Not judged, a derivative of another channel: {_listed(unjudged)}." if unjudged else ""
    compared = [c for c, _ in judged]
    off = sorted((pair for pair in judged if pair[1] > 1), key=lambda pair: -pair[1])
    numbers = ", ".join(_with_number(c, bag) for c, _ in judged)
    if bag.full.stopped:
        short = f"stopped: {bag.full.stopped}"
        until = f" Up to there: {numbers}." if judged else ""
        return Verdict("stopped", short, f"The full model did not reach the end: {bag.full.stopped}.{until}")
    if off:
        (worst, times), others = off[0], [c.label for c, _ in off[1:]]
        most = f"{_with_number(worst, bag)}, {number(times, 2)} x its noise limit"
        also = f"; also {_listed(others)}" if others else ""
        rest = [c for c, r in judged if r <= 1]
        fine = f" Within noise: {_listed([c.label for c in rest])}." if rest else ""
        limit = error_text(worst, bag.limits[worst.judging]).removesuffix(f" {statistic(worst)}")
        sentence = (
            f"The full model differs from the measurement, most in {worst.label}: "
            f"{error_text(worst, bag.full.metrics[worst.judging])}, {number(times, 2)} times the {limit} that noise "
            "explains"
            f"{' (also beyond it: ' + _listed([_with_number(c, bag) for c, _ in off[1:]]) + ')' if others else ''}."
            f"{where(bag, worst)}{fine}{_not_compared(missing)}{derived}"
        )
        return Verdict("differs", f"differs: {most}{also}", sentence)
    if PREDICTED[0] not in compared:
        text = f"no prediction could be compared in {_listed(missing)}"
        return Verdict("not compared", f"not compared: {text}", f"{text[0].upper()}{text[1:]}.{_why(bag.full)}")
    if bag.too_little:
        return Verdict(
            "not compared", f"not compared: {bag.too_little}", f"No verdict: {bag.too_little}.{_not_compared(missing)}"
        )
    sentence = f"The full model agrees with the measurement within the sensors' noise: {numbers}.{_not_compared(missing)}{derived}"
    return Verdict(
        "agrees", f"agrees within sensor noise{f'; without {_listed(missing)}' if missing else ''}", sentence
    )


def _missing(channel: Sensor, bag: BagValidation) -> str:
    """A channel that was not compared, or for too short a time; empty: it was."""
    few = bag.scarce(channel.name)
    if few is not None:
        return f"{channel.label} (of which there are {few:.2g} s)"
    return channel.label if bag.full.metrics[channel.judging] is None else ""


def where(bag: BagValidation, channel: Sensor) -> str:
    """In which stretches of one second the error of the full model is well beyond its limit; empty if nowhere.

    Returns:
        A sentence with a leading blank.
    """
    signal = bag.recording.signals[channel.name]
    limit = bag.limits[channel.judging]
    error = np.where(signal.valid, bag.full.values[channel.name] - signal.values, np.nan)
    known = np.isfinite(error)
    if limit is None or not known.any():
        return ""
    window = np.floor(signal.time[known] / WINDOW).astype(np.int64)
    windows, of = np.unique(window, return_inverse=True)
    rms = np.sqrt(np.bincount(of, weights=error[known] ** 2) / np.bincount(of))
    beyond = windows[rms > WINDOW_FACTOR * limit]
    if len(beyond) == 0:
        return ""
    worst = windows[np.argmax(rms)] * WINDOW
    return (
        f" Stretches of {WINDOW:g} s with more than {WINDOW_FACTOR:g} times the limit: {len(beyond)} of "
        f"{len(windows)}, the first at "
        f"{beyond[0] * WINDOW:.0f} s, the worst at {worst:.0f} s."
    )


def _with_number(channel: Sensor, bag: BagValidation) -> str:
    return f"{channel.label} {error_text(channel, bag.full.metrics[channel.judging])}"


def _not_compared(labels: list[str]) -> str:
    return f" Not compared, for lack of valid samples: {_listed(labels)}." if labels else ""


def _why(prediction: FreeRun) -> str:
    return (
        " " + "; ".join(prediction.runs) + "."
        if prediction.runs
        else " There are no valid currents to run the model on."
    )


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1] if words else ""
