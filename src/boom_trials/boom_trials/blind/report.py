"""The report of a blind trial: one HTML file that needs no network and no script."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from boom_input.channels import PREDICTED
from boom_trials.blind import drawing, judging, scoring, tables
from boom_trials.blind.outcomes import Row
from boom_trials.blind.trial import Trial
from concealed_plant.concealments import KNOWN

_STYLE = """
:root{color-scheme:light;font:15px/1.5 system-ui,sans-serif;color:#1c2430;background:#f4f5f7}
body{margin:0}main{max-width:1120px;margin:0 auto;padding:24px 16px}
h1{font-size:1.6rem;margin:0 0 4px}h2{font-size:1.15rem;margin:0 0 8px}h3{font-size:1rem;margin:16px 0 4px}
.card{background:#fff;border:1px solid #dfe3e8;border-radius:8px;padding:16px;margin:16px 0;overflow-x:auto}
.quiet{color:#5b6673}table{border-collapse:collapse;font-size:.92rem}
th,td{padding:4px 10px;border-bottom:1px solid #e7eaee;text-align:left;vertical-align:top}td.n{text-align:right}
.yes{color:#14713d;font-weight:600}.no{color:#b3261e;font-weight:600}
.matrix td,.matrix th{padding:2px 4px;font-size:.72rem;border:1px solid #eef0f3;text-align:center;min-width:15px}
.matrix th.row{text-align:right;white-space:nowrap}
.matrix th.column{writing-mode:vertical-rl;transform:rotate(180deg);white-space:nowrap}
.right{background:#cfe8d8}.wrong{background:#f7d4d0}.soft{background:#eceff3}
svg{max-width:100%;height:auto}svg text{font:10px system-ui,sans-serif;fill:#5b6673}
.frame{fill:none;stroke:#d4d9df}.axis{stroke:#8a8f98}.grid{stroke:#e7eaee}
.ideal{stroke:#8a8f98;stroke-dasharray:4 3}.dot{fill:#1f6feb;fill-opacity:.7}
.side{display:flex;flex-wrap:wrap;gap:24px}.panels{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,420px),1fr));gap:8px}
code{overflow-wrap:anywhere}
@media(max-width:600px){main{padding:16px 8px}.card{padding:12px 8px}th,td{padding:4px}table{font-size:.8rem}}
@media print{.card{break-inside:avoid;border:none;padding:8px 0 0;margin:16px 0 0}main{padding:0}:root{background:#fff}}
"""
_MEANING = (
    "A second plant, written apart from the model and with other functional forms for every effect, was given cranes drawn "
    "around the machine file within its tolerances, so that the nominal model is never exactly right. One detectability is the "
    "size at which what an effect does, and no change of the machine's numbers within tolerance could do, has as much energy in "
    "the recording as all noise. The diagnosis saw one recording of each crane and nothing else. Models are judged on a second "
    "recording that it never saw; the oracle is the second plant itself, driven by the same measured currents."
)


def report(trial: Trial, rows: Sequence[Row], seconds: float) -> str:
    """The whole HTML file; seconds: how long the run took. Raises OSError where a recording of the trial is gone."""
    body = [
        f"<header><h1>Blind trial</h1><p class=quiet>{escape(tables.heading(trial.state))}; {seconds / 60:.1f} minutes"
        f"<br>SHA-256 of the sealed answers: <code>{trial.state.sha256}</code></p><p>{escape(_MEANING)}</p></header>",
        f"<section class=card><h2>What was asked, what was reached</h2>{_measures(rows)}</section>",
        f"<section class=card><h2>Accuracy and confidence</h2><div class=side>{_accuracy(rows)}{_confidence(rows)}</div></section>",
        f"<section class=card><h2>Held-out errors</h2>{_errors(rows)}</section>",
        f"<section class=card><h2>Confusion matrix: what was concealed, and what was said</h2>{_confusion(rows)}</section>",
        f"<section class=card><h2>The worst cases</h2>{_worst(trial, rows)}</section>",
    ]
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'><meta name='viewport' content='width=device-width, "
        "initial-scale=1'><meta http-equiv='Content-Security-Policy' content=\"default-src 'none'; style-src 'unsafe-inline'\">"
        f"<title>Blind trial, seed {trial.state.seed}</title><style>{_STYLE}</style></head>"
        f"<body><main>{''.join(body)}</main></body></html>\n"
    )


def _measures(rows: Sequence[Row]) -> str:
    lines = []
    for m in scoring.measures(rows):
        met = tables.met_text(m)
        lines.append(
            f"<tr><td>{escape(m.title)}</td><td class=n>{m.count}</td><td>{tables.value_text(m)}</td>"
            f"<td>{tables.wanted_text(m)}</td><td class={met if met in ('yes', 'no') else 'quiet'}>{met}</td></tr>"
        )
    return f"<table><tr><th>measure<th>cases<th>measured (95 % bounds)<th>asked<th>met</tr>{''.join(lines)}</table>"


def _accuracy(rows: Sequence[Row]) -> str:
    groups = []
    for strength, (count, first, three, silent) in scoring.by_strength(rows).items():
        shares = (("right first", first / count), ("among three", three / count), ("named nothing", silent / count))
        groups.append((f"{strength:g} x ({count})", shares))
    return f"<div><h3>Single effects over detectability</h3>{drawing.bars(groups) if groups else 'no cases'}</div>"


def _confidence(rows: Sequence[Row]) -> str:
    return f"<div><h3>Is confidence what it says?</h3>{drawing.calibration(scoring.confidence_bins(rows))}</div>"


def _errors(rows: Sequence[Row]) -> str:
    """Median normalised errors over the single effects at 1 x and above: sealed recording and the diagnosis' own."""
    lines = []
    for title, errors in scoring.held_out_stages(rows):
        medians = "".join(
            f"<td class=n>{tables.percent(float(np.median([e[k] for e in errors])))}</td>"
            for k in range(len(PREDICTED))
        )
        lines.append(f"<tr><td>{escape(title)}</td>{medians}<td class=n>{len(errors)}</td></tr>")
    if not lines:
        return "<p>No cases.</p>"
    return (
        "<p class=quiet>Median of the rms error over the measured channel's standard deviation, free runs, single effects at 1 x "
        f"detectability and above.</p><table><tr><th>model<th>{'<th>'.join(sensor.label for sensor in PREDICTED)}<th>cases</tr>"
        f"{''.join(lines)}</table>"
    )


def _confusion(rows: Sequence[Row]) -> str:
    table = scoring.confusion(rows)
    columns = sorted({name for counts in table.values() for name in counts})
    head = "".join(f"<th class=column>{escape(name)}</th>" for name in columns)
    lines = []
    for name in sorted(table):
        cells = []
        for column in columns:
            count = table[name][column]
            right = column == name or _counts_as_right(name, column, name in KNOWN)
            tone = "" if not count else "right" if right else "wrong" if column in (*KNOWN, "failed") else "soft"
            cells.append(f"<td class='{tone}'>{count or ''}</td>")
        lines.append(f"<tr><th class=row>{escape(name)}</th>{''.join(cells)}</tr>")
    return (
        "<p class=quiet>Rows: what was concealed (at 1 x detectability and above) or the kind of case. Columns: the effect "
        f"that was named first, or the verdict.</p><table class=matrix><tr><th></th>{head}</tr>{''.join(lines)}</table>"
    )


def _counts_as_right(name: str, said: str, known: bool) -> bool:
    if name in ("healthy", "parameters", "idle"):
        return said in ("no_mismatch", "parameters_only", "not_enough_excitation")
    return name == scoring.ONE_OF_PAIR or (not (known or name == scoring.NONE_OF_PAIR) and said == "unknown_physics")


def _worst(trial: Trial, rows: Sequence[Row]) -> str:
    parts = []
    for _, what, row in scoring.worst(rows):
        pictures = ""
        for trace in judging.traces(row.truth.name, trial.blind, trial.sealed, str(trial.machine)):
            sensor = next(sensor for sensor in PREDICTED if sensor.name == trace.name)
            pictures += drawing.lines(sensor.label, sensor.shown.name, sensor.shown.scale, trace.time, trace.lines)
        sizes = ", ".join(f"{e.effect}: {e.size:.3g} {e.unit}".removesuffix(" -") for e in row.truth.effects)
        wrong = ", ".join(f"{key} by {off:.1f} standard deviations" for key, off in row.truth.wrong.items())
        parts.append(
            f"<h3>{escape(what)}</h3><p class=quiet>case {row.truth.name}, verdict {escape(row.said.verdict or 'none')}. "
            f"{escape(sizes or wrong)}</p><div class=panels>{pictures}</div>"
        )
    legend = "".join(f"<span style='color:{colour}'>&#9644; {name}</span> " for name, colour in drawing.COLOURS.items())
    return (
        (f"<p>{legend} on the sealed recording</p>" + "".join(parts)) if parts else "<p>None: every case went well.</p>"
    )
