"""Charts of the chain: each link from measurements against the measurement, and the cylinder valve's flow over each pressure."""

from __future__ import annotations

import numpy as np

from boom_checks.chain import ChainLink, ChainStudy, RecordingChain
from boom_checks.cylinder_valve import FOLLOWS, ValveLaw
from boom_report.channel_panels import OUTER_GAP, title
from boom_report.palette import EVENT, EVENT_EDGE, EXTEND, MEASURED, MODEL, OTHER, QUIET, RED, RETRACT
from boom_report.panels import Json, Panels, legend_area, legend_line, line, shaded
from boom_report.xy import cloud, curve, xy

SHOWN = {"rad/s": ("mrad/s", 1e3), "Pa": ("bar", 1e-5), "m^3/s": ("l/min", 6e4)}
"""Unit of a link -> unit for people, factor."""
_HEIGHT = 170
_PRESSURES = (("hose", "hose pressure p_h"), ("head", "cylinder pressure p_a"), ("rod", "rod pressure p_b"))


def links_figure(chain: RecordingChain) -> Json:
    """All links of a recording below each other, with the stretches of its checks shaded."""
    panels, traces = Panels(), []
    for link in chain.links:
        unit, scale = SHOWN[link.unit]
        n = panels.add(link.name, _HEIGHT, OUTER_GAP)
        title(panels, link.name, f"<b>{link.name.capitalize()}</b> [{unit}]")
        said = f"error {scale * link.error.value:.3g} {unit}, {link.ratio:.1f} x tolerance"
        colour = RED if link.ratio > 1.0 else QUIET
        panels.write(
            link.name, said, x=1, xanchor="right", yanchor="bottom", yshift=3, font={"size": 11, "color": colour}
        )
        traces.append(line(link.time, scale * link.measured, n, "measured", MEASURED, 2.6))
        traces.append(line(link.time, scale * link.model, n, "from the other measurements", MODEL, 1.2))
    traces += [legend_line("measured", MEASURED), legend_line("from the other measurements", MODEL)]
    shapes: list[Json] = []
    stretches = [
        pair for check in chain.checks for pair in check.intervals_s if pair[1] - pair[0] < 0.9 * chain.time[-1]
    ]
    for start, end in stretches:
        shapes += [shaded(panels.suffix(name), start, end, EVENT, EVENT_EDGE) for name in panels.names]
    if stretches:
        traces.append(legend_area("doubted", EVENT, EVENT_EDGE))
    return {"data": traces, "layout": panels.layout(shapes, float(chain.time[-1]))}


def valve_figures(study: ChainStudy) -> list[Json]:
    """Flow over each pressure beside the valve, over all recordings, and flow over time with the best law."""
    data = [chain.valve for chain in study.chains if chain.valve is not None]
    figures = []
    for name, label in _PRESSURES:
        pressure = np.concatenate([1e-5 * getattr(part, name) for part in data])
        flow = np.concatenate([6e4 * part.flow for part in data])
        up, down = flow > 1.0, flow < -1.0
        traces = [
            cloud(pressure[up], flow[up], "lifting", EXTEND), cloud(pressure[down], flow[down], "lowering", RETRACT),
            cloud(pressure[~up & ~down], flow[~up & ~down], "at rest", MEASURED, 3.0),
        ]  # fmt: skip
        figures.append(xy(traces, f"{label} [bar]", "flow into the head side [l/min]", height=300))
    return figures


def flow_figure(chain: RecordingChain, laws: tuple[ValveLaw, ...]) -> Json:
    """Flow at the cylinder over time: measured, the best opened law, the static curve."""
    data = chain.valve
    assert data is not None
    known = np.isfinite(data.flow + data.hose + data.head + data.rod + data.head_rate)
    time, seen = chain.time[known], data.where(known)
    opened = next((law for law in laws if law.opened_by not in ("", FOLLOWS)), None)
    static = next((law for law in laws if not law.opened_by), None)
    traces = [curve(time, 6e4 * seen.flow, "measured: area times piston speed", MEASURED, width=2.6)]
    if static:
        traces.append(curve(time, 6e4 * static.flow(seen), "a static curve q(dp)", OTHER, width=1.2))
    if opened:
        traces.append(curve(time, 6e4 * opened.flow(seen), opened.words, MODEL, width=1.2))
    return xy(traces, "time since the start of the recording [s]", "flow into the head side [l/min]", height=340)


LARGEST = 1e3
"""An NRMSE of which more is that of a signal that stands still."""


def link_row(link: ChainLink) -> tuple[str, str, str, str, str]:
    """Name, error with unit, NRMSE, tolerance, ratio of a link as text."""
    unit, scale = SHOWN[link.unit]
    low, high = (scale * v for v in link.error.interval_90)
    share = f"{link.nrmse:.2f}" if link.nrmse < LARGEST else "-"
    return (
        link.name, f"{scale * link.error.value:.3g} {unit} ({low:.3g} to {high:.3g})", share,
        f"{scale * link.tolerance:.3g} {unit}", f"{link.ratio:.1f}",
    )  # fmt: skip
