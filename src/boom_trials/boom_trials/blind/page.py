"""The trial as a page of the documentation: what was done, every measure, every effect, the worst cases. Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from boom_trials.blind import scoring, tables
from boom_trials.blind.outcomes import Row
from boom_trials.blind.plants import PLANTS
from boom_trials.blind.trial import TrialState

_INTRODUCTION = """\
`./boom prove` conceals physics in a second plant ({plant}), lets the diagnosis find it blindly, and scores the answers. To repeat
it:

```
./boom prove {fresh}--cases {count}
./boom prove {options} --output {folder}
```

The first command uses a fresh seed, the second repeats the trial below. How the trial is kept honest:
[proof_method.md](proof_method.md)."""


def _introduction(state: TrialState) -> str:
    fresh = state.options.removesuffix(f"--seed {state.seed} --cases {state.count}")
    return _INTRODUCTION.format(
        plant=PLANTS[state.plant].title, fresh=fresh, count=state.count, options=state.options, folder=state.folder
    )


def page(state: TrialState, rows: Sequence[Row], seconds: float) -> str:
    """The whole page; seconds: how long the run took."""
    parts = [
        "# The blind trial",
        _introduction(state),
        f"The command wrote this page: {tables.heading(state)}; {seconds / 60:.0f} minutes.\n"
        f"SHA-256 of the sealed answers: `{state.sha256}`.",
        "## Required and measured",
        tables.measures_table(rows),
        _missed(rows),
        "## Accuracy against detectability",
        tables.strengths_table(rows),
        "## Does the confidence mean what it says?",
        _confidence(rows),
        "## Held-out errors",
        _errors(rows),
        "## Every effect",
        "Cases in which the effect was named first, of all cases at each multiple of the detectable size, and what was named "
        "instead at 1 x and above. The size is the median of the detectable sizes, which depend on how the operator happened to "
        "move. The whole confusion matrix is in the report.",
        _effects(state, rows),
        "## Other cases",
        _kinds(rows),
        "## The worst cases",
        "The report of the command shows their pictures.",
        _worst(rows),
        "Terms: [glossary](glossary.md).",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _missed(rows: Sequence[Row]) -> str:
    measures = scoring.measures(rows)
    missed, open_ = [m.title for m in measures if m.met is False], [m.title for m in measures if m.too_few]
    said = [f"Not met: {'; '.join(missed)}. The tables below show where."] if missed else []
    if open_:
        said.append(f"Short of the requirement, but within chance for so few cases: {'; '.join(open_)}.")
    return " ".join(said) or "Every measure with cases is met."


def _confidence(rows: Sequence[Row]) -> str:
    lines = ["| stated (mean) | right | cases |", "|---|---|---|"]
    lines += [f"| {said:.2f} | {right:.2f} | {count} |" for said, right, count in scoring.confidence_bins(rows)]
    return "\n".join(lines) if len(lines) > 2 else "No finding had a confidence."


def _errors(rows: Sequence[Row]) -> str:
    names = ("angle", "rate", "hose pressure", "rod pressure")
    lines = [f"| model | {' | '.join(names)} | cases |", "|---|---|---|---|---|---|"]
    for title, errors in scoring.held_out_stages(rows):
        medians = " | ".join(tables.percent(float(np.median([e[k] for e in errors]))) for k in range(len(names)))
        lines.append(f"| {title} | {medians} | {len(errors)} |")
    if len(lines) == 2:
        return "No single effect at 1 x and above."
    return (
        "Median of the rms error over the measured channel's standard deviation, free runs, single effects at 1 x and above.\n\n"
        + "\n".join(lines)
    )


def _effects(state: TrialState, rows: Sequence[Row]) -> str:
    """A line per effect of the catalogue and per effect outside it."""
    lines = [
        "| concealed | concealed form | size at 1 x | 0.5 x | 1 x | 3 x | named instead |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, row in PLANTS[state.plant].forms().items():
        cases = [r for r in rows if r.truth.kind in ("effect", "outside") and r.true_effect.effect == name]
        if not cases:
            continue
        sizes = [r.true_effect.detectable for r in cases if r.true_effect.detectable is not None]
        size = f"{np.median(sizes):.2g} {row.unit}" if sizes else "-"
        shares = []
        for strength in (0.5, 1.0, 3.0):
            of = [r for r in cases if r.true_effect.strength == strength]
            shares.append(f"{sum(r.right_first for r in of)}/{len(of)}" if of else "")
        wrong = Counter(scoring.label(r) for r in cases if r.true_effect.strength >= 1.0 and not r.right_first)
        said = ", ".join(_times(word, n) for word, n in wrong.most_common(4))
        shown = f"`{name}`" if row.known else f"{name.replace('_', ' ')} (outside)"
        lines.append(f"| {shown} | {row.text} | {size} | {' | '.join(shares)} | {said} |")
    return "\n".join(lines)


def _kinds(rows: Sequence[Row]) -> str:
    lines = ["| kind | cases | answer |", "|---|---|---|"]
    table = scoring.confusion(rows)
    for kind in scoring.KINDS:
        said = table.get(kind)
        if said:
            words = ", ".join(_times(word, n) for word, n in said.most_common())
            lines.append(f"| {kind} | {said.total()} | {words} |")
    return "\n".join(lines)


def _worst(rows: Sequence[Row]) -> str:
    listed = scoring.worst(rows)
    return "\n".join(f"{k}. {what} (case {row.truth.name})" for k, (_, what, row) in enumerate(listed, 1)) or "None."


def _times(word: str, count: int) -> str:
    return word if count == 1 else f"{word} {count} x"
