"""The picture of docs/control.md: why the printed control law diverges in the folded pose, and the baseline does not.

    ./boom python benchmarks/control_picture.py --output docs/control_thesis.svg

Both follow `healthy/folded_fast` at C0. Upper: error of the piston. Lower: torque tau~_f of friction and hose burst valve in the
run of the printed law, at the measured rate, which that law compensates, and at the wanted rate, which the baseline compensates.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_controller.blocks.control_model import ControlModel, OperatingPoint
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_report.tracking.position_error import piston_positions
from boom_trials.robustness.crane import History
from boom_trials.robustness.plants import CONFIGURATIONS
from boom_trials.robustness.study import StudyRun, carry_out_one

BAG = "healthy/folded_fast"
FOLDER = Path(__file__).parents[1] / "bags"
PERIOD = 0.01
WIDTH, HEIGHT, LEFT, TOP, GAP = 760, 190, 70, 34, 56
BEFORE_S, AFTER_S = 9.5, 0.5

Array = NDArray[np.float64]
Curve = tuple[str, str, Array, Array]


def torques(machine: Machine, history: History) -> tuple[Array, Array]:
    """tau~_f [N m] at the measured and at the wanted rate."""
    c = load(FOLDER / BAG).configuration
    model = ControlModel(machine, machine.pose(c.outer_boom_angle, c.telescope_length, c.load_mass))
    wanted = np.gradient(history.reference, PERIOD)
    values = history.values
    rows = [
        model.at(OperatingPoint(angle, rate, hose, rod, reference, speed, 0.0, 0.0, 0.0))
        for angle, rate, hose, rod, reference, speed in zip(
            values["angle"], values["rate"], values["hose_pressure"], values["rod_pressure"], history.reference, wanted, strict=True
        )
    ]  # fmt: skip
    return np.array([q.friction for q in rows]), np.array([q.friction_wanted for q in rows])


def panel(curves: list[Curve], title: str, row: int, begin: float, end: float, low: float, high: float) -> str:
    """One diagram as SVG."""
    top = TOP + row * (HEIGHT + GAP)

    def x(t: float) -> float:
        return LEFT + (t - begin) / (end - begin) * (WIDTH - LEFT - 10)

    def y(v: float) -> float:
        return top + (high - min(max(v, low), high)) / (high - low) * HEIGHT

    parts = [f'<text x="{LEFT}" y="{top - 8}" font-weight="bold">{title}</text>']
    for k in range(5):
        value = low + k / 4 * (high - low)
        parts.append(f'<path d="M{LEFT} {y(value):.1f}H{WIDTH - 10}" stroke="#dde3e8"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
    for t in np.arange(np.ceil(begin), end):
        parts.append(f'<text x="{x(t):.1f}" y="{top + HEIGHT + 15}" text-anchor="middle">{t:g}</text>')
    for k, (name, colour, time, values) in enumerate(curves):
        inside = (time >= begin) & (time <= end)
        points = " ".join(f"{x(t):.1f},{y(v):.1f}" for t, v in zip(time[inside], values[inside], strict=True))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        parts.append(f'<text x="{WIDTH - 12}" y="{top + 14 + 15 * k}" fill="{colour}" text-anchor="end">{name}</text>')
    return "\n".join(parts)


def main() -> None:
    """Draws."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", required=True, metavar="F.svg", help="where the picture goes")
    args = parser.parse_args()
    machine = load_machine("tz17")
    found: dict[str, History] = {}
    for mode in ("thesis", "baseline"):
        history = carry_out_one(StudyRun(mode, BAG, CONFIGURATIONS["C0"], folder=str(FOLDER), keep=True)).history
        assert history is not None  # it was asked for
        found[mode] = history
    thesis, baseline = found["thesis"], found["baseline"]
    end = float(thesis.time[-1]) + AFTER_S
    begin = max(end - BEFORE_S - AFTER_S, 0.0)
    error = {
        mode: 1e3 * (piston_positions(machine, h.values["angle"]) - piston_positions(machine, h.reference))
        for mode, h in found.items()
    }
    measured, wanted = torques(machine, thesis)
    curves: list[Curve] = [
        ("thesis, as printed", "#d9720a", thesis.time, error["thesis"]),
        ("baseline", "#7a3e9d", baseline.time, error["baseline"]),
    ]
    friction: list[Curve] = [
        ("at the measured rate", "#d9720a", thesis.time, measured / 1e3),
        ("at the wanted rate", "#7a3e9d", thesis.time, wanted / 1e3),
    ]
    largest = float(np.ceil(np.max(np.abs(measured[thesis.time >= begin])) / 4e3) * 4)
    height = TOP + 2 * (HEIGHT + GAP)
    Path(args.output).write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="12">\n'
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>\n'
        + panel(curves, "error of the piston s_p - s_p* [mm]", 0, begin, end, -100.0, 100.0)
        + panel(friction, "torque of friction and hose burst valve [kN m]", 1, begin, end, -largest, largest)
        + f'\n<text x="{WIDTH - 10}" y="{height - 8}" text-anchor="end">time [s]</text>\n</svg>\n',
        encoding="utf-8",
    )
    print(f"picture: {args.output}")


if __name__ == "__main__":
    main()
