"""The page of the chain."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from boom_checks.chain import ChainStudy
from boom_input.whole import write_whole
from boom_report import __version__, inputs, terms
from boom_report.chain.figures import flow_figure, link_row, links_figure, valve_figures
from boom_report.chain.terminal import HEADS
from boom_report.doubts import check_lines, damage_lines
from boom_report.page import chart, page
from boom_report.templates import render

METHOD = (
    "Each link is driven by measurements on both sides, so an error stays where it arises: the angle gives the rate; angle, "
    "rate and rod pressure give the hose pressure that the boom needs; currents, motion and pressures give the flow out of the "
    "main valve, to compare with the flow that motion and pressures ask for. The tolerance is what the sensors' noise and the "
    "tolerances of the machine file leave. The flow at the cylinder is area times piston speed."
)
_WORDS = ("NRMSE", "tolerance", "90 % interval", "hose pressure, rod pressure", "extend, retract")


def write_chain_report(
    study: ChainStudy, path: str | Path, *, command: str = "", machine_source: str | None = None
) -> None:
    """Writes the report of a study.

    Raises:
        OSError: the file cannot be written.
    """
    names = [chain.recording.name for chain in study.chains]
    heading = f"Chain of {', '.join(names) if len(names) <= 3 else f'{len(names)} recordings'}"
    rows = [(c.recording.name, *entry) for c in study.chains for entry in inputs.recording_files(c.recording)]
    if machine_source is not None:
        rows.append(("machine", *inputs.machine_file(machine_source)))
    body = render(
        "boom_report/chain/report.html",
        heading=heading,
        when=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z"),
        version=__version__,
        command=command,
        study=study,
        heads=HEADS,
        link_row=link_row,
        check_lines=check_lines,
        damage_lines=damage_lines,
        links_figure=links_figure,
        valve_figures=valve_figures,
        flow_figure=flow_figure,
        chart=chart,
        method=METHOD,
        words=terms.section(*_WORDS, *(("law",) if study.laws else ())),
        files=inputs.files_table(rows),
    )
    write_whole(path, page(heading, body))
