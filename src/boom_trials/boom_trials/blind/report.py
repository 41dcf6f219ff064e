"""The report of a blind trial: one HTML file that needs no network and no script."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from functools import partial

import numpy as np
from markupsafe import Markup

from boom_input.channels import PREDICTED
from boom_report import terms
from boom_report.page import style
from boom_report.templates import render
from boom_trials.blind import drawing, judging, scoring, tables
from boom_trials.blind.outcomes import Row
from boom_trials.blind.plants import ConcealedForm
from boom_trials.blind.trial import Trial

_MEANING = (
    "A second plant, written independently of the model and with another functional form for every effect, simulated cranes drawn "
    "around the machine file within its tolerances, so that the nominal model is never exactly right. One detectability is the "
    "size at which the part of an effect that no change of the machine's numbers within tolerance could imitate has as much "
    "energy in the recording as all noise. The diagnosis saw one recording of each crane and nothing else. Models are judged "
    "on a second recording that it never saw; the oracle is the second plant itself, driven by the same measured currents."
)


def report(trial: Trial, rows: Sequence[Row], seconds: float) -> str:
    """The whole HTML file; seconds: how long the run took. Raises OSError where a recording of the trial is gone."""
    return render(
        "boom_trials/blind/report.html",
        state=trial.state,
        tables=tables,
        seconds=seconds,
        meaning=_MEANING,
        measures=scoring.measures(rows),
        accuracy=_accuracy(rows),
        calibration=drawing.calibration(scoring.confidence_bins(rows)),
        stages=_stages(rows),
        channels=PREDICTED,
        confusion=_confusion(trial.plant.forms(), rows),
        worst=[(what, row) for _, what, row in scoring.worst(rows)],
        concealed=_concealed,
        pictures=partial(_pictures, trial),
        kinds=drawing.KINDS,
        style=style(),
        words=terms.section("detectability", "confidence", "oracle", "tolerance", "held out", "effect"),
    )


def _accuracy(rows: Sequence[Row]) -> Markup:
    """The bars of single effects over detectability; empty without cases."""
    groups = []
    for strength, (count, first, three, silent) in scoring.by_strength(rows).items():
        shares = (("right first", first / count), ("among three", three / count), ("named nothing", silent / count))
        groups.append((f"{strength:g} x ({count})", shares))
    return drawing.bars(groups) if groups else Markup()


def _stages(rows: Sequence[Row]) -> list[tuple[str, list[float], int]]:
    """Model, median normalised error per channel, cases: single effects at 1 x and above."""
    return [
        (title, [float(np.median([e[k] for e in errors])) for k in range(len(PREDICTED))], len(errors))
        for title, errors in scoring.held_out_stages(rows)
    ]


def _confusion(forms: Mapping[str, ConcealedForm], rows: Sequence[Row]) -> Markup:
    confusion = scoring.confusion(rows)
    known = {name for name, form in forms.items() if form.known}
    columns = sorted({name for counts in confusion.values() for name in counts})
    return render("boom_trials/blind/confusion.html", confusion=confusion, columns=columns, tone=partial(_tone, known))


def _tone(known: Set[str], name: str, said: str, count: int) -> str:
    if not count:
        return ""
    if said == name or _counts_as_right(name, said, name in known):
        return "right"
    return "wrong" if said in (*known, "failed") else "soft"


def _counts_as_right(name: str, said: str, known: bool) -> bool:
    if name in ("healthy", "parameters", "idle"):
        return said in ("no_mismatch", "parameters_only", "not_enough_excitation")
    return name == scoring.ONE_OF_PAIR or (not (known or name == scoring.NONE_OF_PAIR) and said == "unknown_physics")


def _concealed(row: Row) -> str:
    sizes = ", ".join(f"{e.effect}: {e.size:.3g} {e.unit}".removesuffix(" -") for e in row.truth.effects)
    return sizes or ", ".join(f"{key} by {off:.1f} standard deviations" for key, off in row.truth.wrong.items())


def _pictures(trial: Trial, row: Row) -> Iterator[Markup]:
    for trace in judging.traces(row.truth.name, trial.blind, trial.sealed, str(trial.machine)):
        sensor = next(sensor for sensor in PREDICTED if sensor.name == trace.name)
        yield drawing.lines(sensor.label, sensor.shown.name, sensor.shown.scale, trace.time, trace.lines)
