"""How well an effect shows: what is left of it after the best disguise as numbers within tolerance, relative to the noise.

Let y be what a crane shows in free runs on the same currents, in units of the noise of each channel (sensors, and what the noise of
the measured currents does to a run). The visibility of an effect is

    E = min over z, |z_i| <= 2, of mean of (y_effect - y(z))^2

with z the deviations of the crane's numbers in standard deviations: no number leaves its tolerance. E is one at the **1 x** size:
what is left has as much energy as all the noise. The minimum is found with the crane's own sensitivities, and tried and improved
with runs of the disguised crane.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from unseen_plant.families import Family, Laid, Site
from unseen_plant.layout import SLOTS, WIDTH
from unseen_plant.machine import DEVIATIONS, LockedPose, Owner, crane
from unseen_plant.running import Machinery, OutOfRangeError, rest, run, seen
from unseen_plant.sensing import SEEN, Fitting

Array = NDArray[np.float64]

DISGUISES = (
    "fluid.beta", "fluid.p_t", "fluid.p_s", "cylinder.A_a", "cylinder.A_b", "cylinder.V_0b", "cylinder.V_h", "kinematics.att.0",
    "kinematics.b", "friction.tau_C_pos", "friction.tau_C_neg", "friction.k_v_pos", "friction.k_v_neg", "hose_burst_valve.a12",
    "hose_burst_valve.a21", "hose_burst_valve.a30", "accumulators.V_g0", "accumulators.p_g0_1", "accumulators.p_g0_2",
    "accumulators.d_1", "accumulators.d_2", "main_valve_spool.A_s", "main_valve_spool.f_c", "main_valve_spool.K_i",
    "main_valve_spool.T_s", "main_valve_orifices.dp_c", "main_valve_orifices.x0", "main_valve_orifices.A_sa_max",
    "main_valve_orifices.A_tb_max", "main_valve_orifices.A_sb_max", "pilot_valves.a1_s", "rigid_body.inertia",
    "rigid_body.moment", "load",
)  # fmt: skip
"""Numbers that may disguise an effect: those of ``machine.DRAWN`` that a run notices."""
EVERY = 4
"""Steps of the grid (20 ms) between the values that count."""
PROBE = 0.7
"""Standard deviations by which sensitivities are measured."""
LEAST_SHARE = 0.6
"""Of a run that has to stay inside the linkage."""


class NotVisibleError(RuntimeError):
    """No size of the effect, or none that still is this effect, shows in this recording."""


@dataclass(frozen=True)
class Work:
    """A crane at work: owner's file with the crane's factors, pose, start (angle, rod pressure), currents (n, 2), sensors."""

    owner: Owner
    pose: LockedPose
    start: tuple[float, float]
    currents: Array
    fitting: Fitting

    def machinery(self, laid: Sequence[Laid], factors: Mapping[str, float] | None = None) -> Machinery:
        """The crane with effects laid into it, its numbers times further ``factors``."""
        own = {key: self.owner.factors.get(key, 1.0) * f for key, f in (factors or {}).items()}
        owner = replace(self.owner, factors={**self.owner.factors, **own})
        c, e = crane(owner, self.pose), np.zeros((SLOTS, WIDTH))
        base = crane(self.owner, self.pose)._asdict()
        changes: dict[str, float] = {}
        courses: dict[int, Array] = {}
        for each in laid:
            # a number that is drawn and concealed at once keeps the ratio (or the difference from zero) that is concealed
            changes |= {n: v * (getattr(c, n) / base[n] if base[n] else 1.0) for n, v in each.crane.items()}
            for row, values in each.rows.items():
                e[row, : len(values)] = values
            for column, course in each.courses.items():
                courses[column] = courses.get(column, 0.0) + course
        moving = tuple(state for each in laid for state in each.moving)
        starts = {state: value for each in laid for state, value in each.starts.items()}
        return Machinery(c._replace(**changes), e, courses, moving, starts)

    def shown(
        self, laid: Sequence[Laid] = (), factors: Mapping[str, float] | None = None, currents: Array | None = None
    ) -> Array:
        """What the sensors see (n, 4), shorter where the crane leaves its linkage. Raises OutOfRangeError: it cannot rest."""
        m = self.machinery(laid, factors)
        applied = self.currents if currents is None else currents
        for change in (change for each in laid for change in each.currents):
            applied = change(applied)
        return sensed(seen(run(m, rest(m, *self.start), applied)), laid)


def sensed(outputs: Array, laid: Sequence[Laid]) -> Array:
    """The true signals as changed sensors see them."""
    for change in (change for each in laid for change in each.senses):
        outputs = change(outputs)
    return outputs


@dataclass
class Visibility:
    """Measures effects on one crane at work. Raises OutOfRangeError if the undisturbed crane leaves its linkage."""

    work: Work
    rng: np.random.Generator
    base: Array = field(init=False)
    noise: Array = field(init=False)
    _slopes: dict[str, Array] = field(init=False, default_factory=dict)
    _shaped: tuple[Array, Array] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.base = self.work.shown()
        if len(self.base) < LEAST_SHARE * len(self.work.currents):
            raise OutOfRangeError("the undisturbed crane leaves its linkage on these currents")
        moved = self._driven_by_noise()
        self.noise = np.hypot(self.work.fitting.noise, np.sqrt(np.mean((moved - self.base[: len(moved)]) ** 2, axis=0)))

    def _driven_by_noise(self) -> Array:
        """A run on currents as a recorder would have measured them; those that are zero stay so."""
        clean = self.work.currents
        every = round(self.work.fitting.period / 0.005)
        kicks = self.rng.standard_normal((len(clean) // every + 1, 2)) * self.work.fitting.current_sigma
        noisy = np.where(clean > 0.0, clean + np.repeat(kicks, every, axis=0)[: len(clean)], 0.0)
        return self.work.shown(currents=noisy)

    def slopes(self) -> dict[str, Array]:
        """Key -> what one standard deviation of a number changes, in units of the noise (n, 4)."""
        if not self._slopes:
            for key in DISGUISES:
                step = self._off(key, PROBE)
                if step is None:
                    continue
                try:
                    moved = self._scaled(self.work.shown(factors={key: step}))
                except OutOfRangeError:
                    continue
                if len(moved) == len(self._scaled(self.base)):
                    self._slopes[key] = moved / PROBE
        return self._slopes

    def energy(self, laid: Sequence[Laid], beside: Sequence[Laid] = (), tries: int = 0) -> float:
        """E of ``laid``, beside other effects; ``tries``: how often the disguise is tried out and improved."""
        with_it = self.work.shown([*beside, *laid])
        if len(with_it) < LEAST_SHARE * len(self.base):
            return np.inf
        left = self._scaled(with_it, self.work.shown(beside) if beside else self.base)
        z, energy = self._disguised(left, np.zeros(len(self.slopes())))
        if not tries:
            return energy
        best = float(np.mean(left**2))
        for _ in range(tries):
            factors = {
                key: f for key, off in zip(self.slopes(), z, strict=True) if (f := self._off(key, off)) is not None
            }
            left = self._scaled(with_it, self.work.shown(beside, factors))
            best = min(best, float(np.mean(left**2)))
            z, _ = self._disguised(left, z)
        return best

    def _off(self, key: str, deviations: float) -> float | None:
        """Factor of a number that is off by so many standard deviations, None where this crane has no such number."""
        tolerance = self.work.owner.tolerance(key, self.work.pose) if self.work.owner.has(key) else 0.0
        return 1.0 + deviations * tolerance / DEVIATIONS if tolerance else None

    def _scaled(self, outputs: Array, base: Array | None = None) -> Array:
        base = self.base if base is None else base
        count = min(len(outputs), len(base), len(self.base))
        return np.asarray((outputs[:count:EVERY] - base[:count:EVERY]) / self.noise)

    def _disguised(self, left: Array, z: Array) -> tuple[Array, float]:
        """The best deviations from where they are, z, and the mean square that is left by them."""
        if not len(z):
            return z, float(np.mean(left**2))
        columns, factor = self._shape(len(left))
        wanted = np.linalg.solve(factor.T, columns.T @ left.ravel())
        solved: Any = lsq_linear(factor, wanted, (-DEVIATIONS - z - 1e-9, DEVIATIONS - z + 1e-9))
        return z + solved.x, float(np.mean((left.ravel() - columns @ solved.x) ** 2))

    def _shape(self, count: int) -> tuple[Array, Array]:
        """The slopes over the first ``count`` values as columns, and the upper triangle R with R'R = columns' columns."""
        if self._shaped is None or len(self._shaped[0]) != count * len(SEEN):
            columns = np.stack([slope[:count].ravel() for slope in self.slopes().values()], axis=-1)
            gram = columns.T @ columns
            gram += 1e-9 * np.trace(gram) * np.eye(len(gram))
            self._shaped = columns, np.asarray(np.linalg.cholesky(gram).T, dtype=np.float64)
        return self._shaped


def size_at_once(family: Family, form: int, draws: Array, site: Site, visibility: Visibility) -> float:
    """The 1 x size of a form. Raises NotVisibleError: there is none between the family's smallest and largest."""
    lay = family.lay

    def energy(size: float, tries: int = 0) -> float:
        try:
            return visibility.energy([lay(size, form, draws, site)], tries=tries)
        except OutOfRangeError:
            return np.inf

    low, high = family.low, family.high
    size = float(np.sqrt(low * high))
    for _ in range(9):
        e = energy(size)
        if 0.8 < e < 1.25:
            break
        low, high = (size, high) if e < 1.0 else (low, size)
        guess = size / np.sqrt(min(max(e, 1e-3), 1e4))
        size = float(guess if low < guess < high else np.sqrt(low * high))
        if high < 1.15 * low:
            break
    for _ in range(3):  # sensitivities flatter: what the disguised crane itself leaves is what counts
        e = energy(size, tries=2)
        if e > 0.7:
            break
        size *= float(min(np.sqrt(1.0 / max(e, 1e-3)), 3.0))
    if e < 0.5 or not family.low <= size <= family.high:
        raise NotVisibleError(f"{family.name} does not show")
    return size
