"""The result of a diagnosis on a terminal: the headline and a short table, readable at 80 columns."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from boom_diagnosis.document import DiagnosisResult
from boom_input.channels import PREDICTED
from boom_model.catalogue import EFFECTS, SUBSYSTEM_NAMES, effect_name
from boom_report.channels import probability
from boom_report.diagnosis.words import (
    VERDICTS,
    finding_name,
    headline,
    intervals_text,
    percent,
    ranking_title,
    shown,
)
from boom_report.doubts import print_first_looks

_STYLES = {
    "identified": "bold red", "unknown_physics": "bold red", "ambiguous": "yellow", "sensor_or_clock": "yellow",
    "parameters_only": "blue", "no_mismatch": "green", "not_enough_excitation": "yellow",
}  # fmt: skip
_MOST = 5  # hypotheses shown


def print_diagnosis(result: DiagnosisResult, console: Console) -> None:
    """Prints verdict, findings, proof and ranking; without blanks at the ends of lines where it is no terminal."""
    if console.is_terminal:
        _print(result, console)
        return
    with console.capture() as printed:
        _print(result, console)
    console.file.write("".join(line.rstrip() + "\n" for line in printed.get().splitlines()))


def _print(result: DiagnosisResult, console: Console) -> None:
    document = result.document
    console.print(Text.assemble((VERDICTS[document.verdict], _STYLES[document.verdict]), ": ", headline(result)))
    for note in result.notes:
        console.print(Text(f"note: {note}", "yellow"))
    print_first_looks(result.looks, console)
    console.print()
    if document.findings:
        console.print(findings_table(result))
        for said in meanings(result):
            console.print(Text(said))
        console.print()
    for curve in result.learned:
        console.print(Text(f"learnt for equation ({curve.equation}): {curve.formula}; {curve.reading}"))
        console.print()
    if "nominal" in document.fit.held_out:
        console.print(proof_table(result))
    if result.document.ranking:
        console.print(ranking_table(result))
    if result.remaining:
        console.print(Text(f"remains: {result.remaining}"))
    if document.next_experiment:
        console.print(Text(f"record next: {document.next_experiment}"))


def findings_table(result: DiagnosisResult) -> Table:
    """What was found: effect, numbers, regime, confidence."""
    table = _table("Found")
    table.add_column("what", overflow="fold")
    table.add_column("how much [90 % interval]", overflow="fold")
    table.add_column("when", overflow="fold")
    table.add_column("sure", justify="right", no_wrap=True)
    for finding in result.document.findings:
        numbers = []
        for name, estimate in finding.parameters.items():
            said = shown(estimate)
            numbers.append(f"{name} {said.value} {said.unit} [{said.interval}{said.inverse}]".replace(" [", " [", 1))
        what = f"{finding_name(finding)} ({SUBSYSTEM_NAMES.get(finding.subsystem, finding.subsystem)})"
        times = intervals_text(finding.intervals_s, 2)
        when = f"{finding.regime}{f'; {times}' if times else ''}"
        table.add_row(Text(what), Text("\n".join(numbers)), Text(when), Text(probability(finding.confidence)))
    return table


def meanings(result: DiagnosisResult) -> list[str]:
    """What the numbers of each effect that was found are, in the words of the catalogue."""
    said = []
    for finding in result.document.findings:
        rows = EFFECTS[effect].parameters if (effect := finding.effect or finding.like) else ()
        named = "; ".join(f"{row.name}: {row.meaning}" for row in rows if row.name in finding.parameters)
        said += [f"{finding_name(finding)}: {named}"] if named else []
    return said


def proof_table(result: DiagnosisResult) -> Table:
    """Held-out errors of each step of the ladder, in percent of the signal."""
    table = _table("Held-out error of free runs [% of the signal]")
    table.add_column("model", overflow="fold")
    for sensor in PREDICTED:
        table.add_column(sensor.label, justify="right")
    fit = result.document.fit
    steps = [(step.label, step.held_out) for step in result.ladder] or list(fit.held_out.items())
    for label, values in [*steps, ("noise floor", fit.noise_floor)]:
        table.add_row(Text(label.replace("_", " ")), *(Text(percent(v).removesuffix(" %")) for v in values))
    return table


def ranking_table(result: DiagnosisResult) -> Table:
    """The most probable hypotheses."""
    document, table = result.document, _table(ranking_title(result))
    table.add_column("hypothesis", overflow="fold")
    table.add_column("kind", no_wrap=True)
    table.add_column("probability", justify="right", no_wrap=True)
    table.add_column(
        "log-odds against\nparameters [nats]" if document.hypotheses else "gain held out\n[nats]", justify="right"
    )
    for row in document.ranking[:_MOST]:
        gain = "–" if row.kind == "unknown" else f"{row.held_out_gain:.1f}"  # it is weighed by what is left
        table.add_row(Text(row.label), Text(row.kind), Text(probability(row.probability)), Text(gain))
    return table


def print_hypotheses(result: DiagnosisResult, console: Console) -> None:
    """Every hypothesis that was weighed, with what speaks for it [nats]."""
    table = _table("Hypotheses weighed [nats]")
    table.add_column("hypothesis", overflow="fold")
    for title in ("log-likelihood", "cost of its numbers", "prior", "probability"):
        table.add_column(title, justify="right")
    best = max((row.log_likelihood for row in result.document.hypotheses), default=0.0)
    for row in result.document.hypotheses:
        parts = [*map(effect_name, row.effects), *(f"unknown physics at {p.replace('_', ' ')}" for p in row.unknown)]
        table.add_row(
            Text(" + ".join(parts) or "parameters only"), f"{row.log_likelihood - best:.1f}", f"{row.cost:.1f}",
            f"{row.log_prior:.1f}", f"{row.posterior:.4f}",
        )  # fmt: skip
    console.print(table)


def _table(title: str) -> Table:
    return Table(
        title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True,
        header_style="bold",
    )  # fmt: skip
