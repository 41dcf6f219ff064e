"""How the control laws follow on the concealed plant, which shares no equation, code or effect's form with the model of the laws.

    ./boom python benchmarks/control_independent.py

The plant has no state that could be carried from one period to the next, so every period computes the run from its beginning:
8 s of a trajectory take half a minute a pose. The laws are told an effect in the catalogue's form; the plant has another one.
Errors are of the piston, from the angle at the IMU, in mm, with the sensors' noise.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from boom_controller.controller import make_controller
from boom_model.machine_file import load_machine
from boom_report.tracking.position_error import errors, piston_positions
from boom_sim.simulated_crane import PERIOD, CraneSample
from boom_trials import closed_loop
from boom_trials.robustness.requirements import ONE_EACH
from boom_trials.robustness.study import references_of
from concealed_plant.kernel import NAMES, STEPS, simulate
from concealed_plant.machine import BoomLinkage, MachineFile, Posture, linkage, quantities
from concealed_plant.quantities import Quantities

FOLDER = str(Path(__file__).parents[1] / "bags")
MACHINE = Path(__file__).parents[1] / "src/boom_model/boom_model/machines/tz17.yaml"
MILLISECONDS = round(1e3 * PERIOD)
DURATION = 8.0
CASES: dict[str, tuple[dict[str, float], float, dict[str, dict[str, float]]]] = {
    "nominal": ({}, 0.0, {}),
    "dead time 40 ms": ({}, 0.04, {"command_delay": {"T": 0.04}}),
    "dead time 60 ms": ({}, 0.06, {"command_delay": {"T": 0.06}}),
    "bends, 1.5 Hz, 0.5": (
        {"bend_share": 0.5, "bend_frequency": 1.5}, 0.0, {"boom_flexibility": {"gain": 0.5, "f": 1.5}}),
    "bends, 2.5 Hz, 0.5": (
        {"bend_share": 0.5, "bend_frequency": 2.5}, 0.0, {"boom_flexibility": {"gain": 0.5, "f": 2.5}}),
    "bends, 5 Hz, 0.5": ({"bend_share": 0.5, "bend_frequency": 5.0}, 0.0, {"boom_flexibility": {"gain": 0.5, "f": 5.0}}),
    "lag x 1.7, 40 ms, air": (
        {"slower_rising": 1.7, "slower_falling": 1.7, "air": 0.02}, 0.04,
        {"pilot_lag": {"r": 1.7}, "command_delay": {"T": 0.04}, "entrained_air": {"a": 0.02}}),
}  # fmt: skip
"""What the plant has, its dead time [s], what the law is told."""


class IndependentCrane:
    """A :class:`boom_trials.closed_loop.Crane` made of the concealed plant: at rest at the angle [rad]."""

    period = PERIOD

    def __init__(self, m: Quantities, table: BoomLinkage, angle: float, periods: int, seed: int) -> None:
        self._m, self._table = m, table
        self._currents = np.zeros((periods * MILLISECONDS, 2))
        cell = int(np.searchsorted(table.angles, angle))
        x, y = m.moment_x + m.load * m.tip_x, m.moment_y + m.load * m.tip_y
        torque = m.gravity * (x * np.cos(angle) - y * np.sin(angle))
        self._start = np.array([angle, (torque / table.levers[cell] + 1e6 * m.area_b) / m.area_a, 1e6])
        self._noise = np.random.default_rng(seed).normal(0.0, (2e-5, 1.5e-3, 2e4, 2e4), (periods + 1, 4))
        self._done = 0
        self.angles = [angle]
        self.sample = self._measured(np.array([angle, 0.0, *self._start[1:]]))

    def command(self, retract: float, extend: float, at: float | None = None) -> None:
        """Both currents [A] from ``at`` [s] on."""
        begin = self._done if at is None else round(1e3 * at)
        self._currents[begin:] = retract, extend

    def advance(self) -> CraneSample:
        """One period."""
        self._done += MILLISECONDS
        n = self._done
        none = np.zeros(n)
        table = self._table
        values = simulate(
            self._m, table.angles, table.strokes, table.levers, self._currents[:n], none, none + 1.0, none + 1.0, none,
            self._start, STEPS,
        )  # fmt: skip
        last = values[-1]
        self.angles.append(float(last[NAMES.index("angle")]))
        self.sample = self._measured(last[:4])
        return self.sample

    def _measured(self, values: NDArray[np.float64]) -> CraneSample:
        shown = values + self._noise[self._done // MILLISECONDS]
        return CraneSample(self._done * 1e-3, *(float(v) for v in shown))


def run(mode: str, name: str, bag: str, told: bool, duration: float) -> str:
    """MAE / MAXE [mm] of a case, or how it ended."""
    changes, dead_time, effects = CASES[name]
    machine = load_machine("tz17")
    references, key = references_of(FOLDER, bag, PERIOD, -10.0)
    references = references[: round(duration / PERIOD)]
    file, pose = MachineFile.read(MACHINE), Posture(*key)
    m = quantities(file, pose)._replace(**changes)
    crane = IndependentCrane(m, linkage(file), references[0].angle, len(references), 0)
    known = machine.with_effects(effects if told else {})
    controller = make_controller(mode, known, known.pose(*key))
    done = closed_loop.run(
        controller,
        crane,
        references,
        dead_time=dead_time,
        heed=True,
        astray=lambda wanted: abs(crane.angles[-1] - wanted) > 0.2,
    )
    n = len(done.outputs)
    wished = piston_positions(machine, np.array([r.angle for r in references[:n]]))
    found = errors(wished - piston_positions(machine, np.array(crane.angles[:n])))
    ended = " diverged" if done.astray is not None else f" stopped at {done.stopped[0]:.1f} s" if done.stopped else ""
    noted = " (safe gains)" if any(output.note for output in done.outputs) else ""
    return f"{1e3 * found.mae:.2f} / {1e3 * found.maxe:.1f}{ended}{noted}"


def main() -> None:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES), metavar="CASE")
    parser.add_argument("--seconds", type=float, default=DURATION)
    args = parser.parse_args()
    for name in args.cases:
        for mode, told in (("improved", True), ("improved", False), ("simple", False)):
            if told or mode == "simple" or CASES[name][2]:
                cells = [run(mode, name, bag, told, args.seconds) for bag in ONE_EACH]
                print(f"{name}, {mode}{', told' if told else ''}: {'; '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
