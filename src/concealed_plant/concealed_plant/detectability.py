"""The size from which a recording can show an effect: sensitivity relative to noise, without hand-set numbers.

Let s be the effect's signature: the outputs y (four channels over time) with the effect minus those without it, both free runs
of the same specimen on the same currents. The noise has two parts, that of the sensors and the effect of the noise
of the measured currents on a run; their power spectra are added per channel (the second from an ensemble of runs) and divide the
spectrum: W. Every number of the machine is known within its tolerance only, so whatever a change of these numbers imitates does
not count. With z their deviations in standard deviations and y(z) the undisturbed run with them,

    d^2 = min over z of |W (y_effect - y(z))|^2 + z'z      d in standard deviations of the best possible test

by damped Gauss-Newton steps with the sensitivities W dy/dz at the specimen. Initial angle and rod pressure are known only from the
same sensors: both are among z with wide deviations, and so is a configured load.

An effect that is itself one of the machine's numbers (spring, pre-charge, ...) keeps that number out of z, and counts as the effect
only beyond the number's tolerance, which is added to the size that is found (``Concealment.tolerance``): within it the
machine is the same.

d grows with the size of the effect. The detectable size is the one at which the part of the signature that nothing else imitates
carries as much energy as all the noise of the recording, a signal-to-noise ratio of one: d^2 = number of whitened values (four
channels at 50 Hz). A case at k times its detectability has k times that size. The search goes up from a size that does nothing,
and each z starts the next. Where an effect seems detectable, z is searched once more: from zero, and with the sensitivities of the
changed crane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from concealed_plant import sensing
from concealed_plant.climb import CLOSE, FINE, FURTHEST, NEAR, Climb
from concealed_plant.hidden import Concealment, Hidden, Scene, Sensing
from concealed_plant.kernel import STEPS, limiting_from
from concealed_plant.machine import (
    DEVIATIONS_IN_TOLERANCE,
    DRAWN,
    BoomLinkage,
    MachineFile,
    Posture,
    linkage,
    load_deviation,
    quantities,
)
from concealed_plant.plant import Courses, InitialValues, Run, RunError, per_millisecond, run
from concealed_plant.quantities import Quantities

Array = NDArray[np.float64]

ENSEMBLE = 4
START_ANGLE, START_ROD_PRESSURE, TOLD_LOAD = "start.angle", "start.rod_pressure", "load"
NUMBERS = (*DRAWN, START_ANGLE, START_ROD_PRESSURE, TOLD_LOAD)
"""Numbers that may change to imitate an effect."""
ANGLE_UNSURE, ROD_PRESSURE_UNSURE = 0.05, 5.0e5
"""rad, Pa: deviations of the start. An angle may be off by its sensor's mounting, a pressure by its transducer."""
PROBE = 0.1
"""Standard deviations by which a number is changed for its sensitivity."""
CHANGE_STEPS, SENSITIVITY_STEPS = 3, 2
"""Steps per millisecond: for the effect of changed numbers, within 1 % in the median of that with all steps, and for sensitivities,
which only guide the search, within 2 %."""
SPACING = 20
"""Milliseconds between the samples that are compared."""
PROJECTIONS, SETTLED = 6, 0.9
"""Most runs that look for the numbers that imitate an effect best; a step that gains less than a tenth ends the search."""
BENT = 4.0
"""Ratio of a signature to its unimitated part from which the search is repeated."""
CUT = 0.6
"""Share of the requested size that the largest one must have."""
_TRIES = 24


@dataclass(frozen=True)
class DetectionSetting:
    """A specimen at work: everything about a recording except the concealed physics. currents (k, 2) [A], every 10 ms."""

    specimen: MachineFile
    pose: Posture
    start: InitialValues
    currents: Array
    starts: Array

    @property
    def duration(self) -> float:
        """[s]."""
        return len(self.currents) / 100.0


@dataclass(frozen=True)
class Sized:
    """An effect at its size; ``detectable`` is the size at one detectability, None if not searched."""

    size: float
    detectable: float | None
    hidden: Hidden
    outputs: Array


class TooFaintError(ValueError):
    """No size that still is this effect is as detectable in this recording as required."""


class Detectability:
    """Signatures in one setting. Raises RunError if the undisturbed crane leaves its range."""

    def __init__(self, setting: DetectionSetting, rng: np.random.Generator) -> None:
        self._setting, self._rng = setting, rng
        self.linkage = linkage(setting.specimen)
        self.m = quantities(setting.specimen, setting.pose)
        self._held = per_millisecond(setting.currents)
        plain = run(self.m, self.linkage, setting.start, self._held)
        self.scene = scene(self.m, setting, plain)
        self.plain = plain.outputs
        self._undisturbed: dict[int, Array] = {}

    @property
    def detectable(self) -> float:
        """d at which an effect counts as detectable in this recording: signature and noise have the same energy."""
        return float(np.sqrt(len(sensing.SEEN) * (len(self.plain) // SPACING)))

    def seen(self, hidden: Hidden) -> Array:
        """Outputs (n, 4) of ideal sensors with the effect, by millisecond."""
        return outputs(self.m, self.linkage, self._setting, hidden)

    def separation(
        self, changed: Array, twins: tuple[str, ...] = (), guess: Array | None = None, bent: Array | None = None
    ) -> tuple[float, Array]:
        """d of the outputs (n, 4) against the undisturbed ones, and the deviations z of ``NUMBERS`` that imitate it best.

        twins: numbers kept out of z. guess: initial z. bent: sensitivities, if not those of the specimen.
        """
        free = _free(twins)
        n = (self._numbers if bent is None else bent)[:, free]
        solve = np.linalg.inv(n.T @ n + np.eye(len(free)))
        z, rest = np.zeros(len(NUMBERS)), self._white(changed - self.plain)
        cost, share = float(rest @ rest), 1.0
        for step in range(PROJECTIONS):
            tried = z.copy()
            if step == 0 and guess is not None:
                tried = guess
            else:
                tried[free] += share * (solve @ (n.T @ rest - z[free]))
            try:
                left = self._white(changed - self.plain - self._change(dict(zip(NUMBERS, tried, strict=True))))
                reached = float(left @ left + tried @ tried)
            except RunError:
                reached = np.inf
            if reached < cost:
                settled = reached > SETTLED * cost and (step > 0 or guess is None)
                z, rest, cost, share = tried, left, reached, min(1.0, 2.0 * share)
                if settled:
                    break
            elif step > 0 or guess is None:
                share /= 4.0
        return float(np.sqrt(cost)), z

    def beside(self, both: Array, other: Array, twins: tuple[str, ...] = ()) -> float:
        """d of an effect beside another one: the outputs (n, 4) with both against those with the ``other`` alone.

        d^2 = min over z of |W (y_both - y_other) - N z|^2 + z'z, N the sensitivities at the undisturbed crane: along straight
        lines. twins: as in :meth:`separation`.
        """
        n = self._numbers[:, _free(twins)]
        rest = self._white(both - other)
        z = np.linalg.solve(n.T @ n + np.eye(n.shape[1]), n.T @ rest)
        left = rest - n @ z
        return float(np.sqrt(left @ left + z @ z))

    def size_for(self, effect: Concealment, draws: Array, strength: float) -> Sized:
        """The effect at ``strength`` times its detectable size, cut at its largest.

        Raises:
            TooFaintError: even its largest size is well below that.
            RunError: the crane with it leaves its range.
        """
        one = self.detectable_size(effect, draws)
        size = min(strength * one, effect.largest)
        if size < CUT * strength * one:
            raise TooFaintError(
                f"{effect.id}: detectable from {one:.3g} {effect.unit}, so that {strength:g} x is beyond {effect.largest:g}"
            )
        hidden = effect.build(size, draws, self.scene)
        return Sized(size, one, hidden, self.seen(hidden))

    def detectable_size(self, effect: Concealment, draws: Array) -> float:
        """The size at which d is ``detectable``, beyond the tolerance of the numbers that the effect is.

        Raises:
            TooFaintError: even its largest size is below.
            RunError: the crane leaves its range before it is detectable, or without it where the steps are coarser.
        """
        self._largest_shows(effect, draws)
        for steps in (CHANGE_STEPS, SENSITIVITY_STEPS):
            self._change({}, steps)
        climb = Climb(effect.smallest, effect.smallest)
        for _ in range(_TRIES):
            try:
                d, reached = self._looked_at(effect, draws, climb)
            except RunError:
                if climb.z is None or climb.ratio < CLOSE:
                    raise
                d, reached = np.inf, climb.z
            if d < self.detectable:
                if climb.at >= effect.largest:
                    raise TooFaintError(f"{effect.id}: d is {d:.0f} at its largest, {self.detectable:.0f} is asked")
                climb.go_up(d, reached, self.detectable, effect.largest)
            elif climb.ratio < CLOSE:  # what imitates it is not found from here on, however little is added
                return effect.tolerance + climb.at
            elif d < NEAR * self.detectable:
                return effect.tolerance + climb.at * self.detectable / d
            else:
                climb.go_back(d, self.detectable)
        raise TooFaintError(f"{effect.id}: its detectable size was not found")

    def _looked_at(self, effect: Concealment, draws: Array, climb: Climb) -> tuple[float, Array]:
        """d at the next size, and the z that imitates the effect there best."""
        guess = None if climb.z is None else climb.z * min(climb.ratio, FURTHEST)
        changed = self.seen(effect.build(climb.at, draws, self.scene))
        d, reached = self.separation(changed, effect.twins, guess, climb.bent)
        close = climb.z is not None and climb.ratio < CLOSE
        if climb.looks and d >= self.detectable and (close or d < NEAR * self.detectable):
            climb.looks -= 1
            d, reached, climb.bent = self._thoroughly(changed, effect.twins, (d, reached), climb.bent)
            if d < self.detectable:
                climb.overshot, climb.factor = False, float(np.clip(NEAR * self.detectable / d, 1.0, FINE))
        return d, reached

    def _thoroughly(
        self, changed: Array, twins: tuple[str, ...], found: tuple[float, Array], bent: Array | None
    ) -> tuple[float, Array, Array | None]:
        """d, z and the sensitivities to continue with, after a repeated search for an imitation of a seemingly detectable effect.

        It starts from z = 0, and, where much of the effect is imitated or it is one of the numbers itself, uses the sensitivities
        of the changed crane, because straight lines from the specimen do not lead there.
        """
        d, z = min(found, self.separation(changed, twins), key=lambda each: each[0])
        if not twins and float(np.linalg.norm(self._white(changed - self.plain))) <= BENT * d:
            return d, z, bent
        try:
            there = self._sensitivities(dict(zip(NUMBERS, z, strict=True)))
        except RunError:
            return d, z, bent
        again, reached = self.separation(changed, twins, z, there)
        return (again, reached, there) if again < d else (d, z, bent)

    def _largest_shows(self, effect: Concealment, draws: Array) -> None:
        """A check without sensitivities: projecting tolerances out never increases d. Raises TooFaintError."""
        try:
            difference = self.seen(effect.build(effect.largest, draws, self.scene)) - self.plain
        except RunError:
            return
        d = float(np.linalg.norm(self._white(difference)))
        if d < self.detectable:
            raise TooFaintError(f"{effect.id}: d is {d:.0f} at its largest, {self.detectable:.0f} is required")

    @cached_property
    def _weights(self) -> Array:
        """(4, f) weights on the spectrum of a signature: 1 / sqrt of the noise's power per frequency."""
        count = len(self.plain) // SPACING
        power = np.zeros((len(sensing.SEEN), count // 2 + 1))
        for _ in range(ENSEMBLE):
            noise = sensing.CURRENT_SIGMA * self._rng.standard_normal(self._setting.currents.shape)
            measured = np.maximum(self._setting.currents + noise, 0.0)
            driven = run(self.m, self.linkage, self._setting.start, per_millisecond(measured)).outputs
            power += np.abs(_spectrum(driven - self.plain)) ** 2 / ENSEMBLE
        smooth = np.array([_smoothed(row) for row in power])
        # white noise keeps its density when the sensors' 100 Hz are averaged to 50 Hz
        sigma = np.array([
            sensing.ANGLE_QUANTUM / np.sqrt(12.0), sensing.RATE_SIGMA, sensing.PRESSURE_SIGMA, sensing.PRESSURE_SIGMA,
        ])  # fmt: skip
        white = count * sigma**2 / (SPACING / sensing.PERIOD)
        return np.asarray(1.0 / np.sqrt(smooth + white[:, None]), dtype=np.float64)

    @cached_property
    def _numbers(self) -> Array:
        """Sensitivities at the specimen."""
        return self._sensitivities({})

    def _sensitivities(self, at: dict[str, float]) -> Array:
        """Whitened change of the outputs per standard deviation of each of ``NUMBERS``, (4 f 2, numbers); 0: the run fails.

        at: deviations around which they are moved.
        """
        middle = self._change(at, SENSITIVITY_STEPS)
        columns = []
        for key in NUMBERS:
            column = np.zeros(2 * self._weights.size)
            if key == TOLD_LOAD and self._setting.pose.load == 0.0:
                columns.append(column)
                continue
            for direction in (PROBE, -PROBE):
                moved = {**at, key: at.get(key, 0.0) + direction}
                try:
                    column = self._white(self._change(moved, SENSITIVITY_STEPS) - middle) / direction
                    break
                except RunError:
                    continue
            columns.append(column)
        return np.stack(columns, axis=-1)

    def _change(self, deviations: dict[str, float], steps: int = CHANGE_STEPS) -> Array:
        """Change of the undisturbed outputs if numbers move by so many standard deviations. Raises RunError."""
        if steps not in self._undisturbed:
            self._undisturbed[steps] = self._moved({}, steps)
        return self._moved(deviations, steps) - self._undisturbed[steps]

    def _moved(self, deviations: dict[str, float], steps: int = STEPS) -> Array:
        """Undisturbed outputs of the specimen with numbers moved by so many standard deviations. Raises RunError."""
        setting = self._setting
        deviations = {key: z for key, z in deviations.items() if z != 0.0}
        angle = setting.start.angle + ANGLE_UNSURE * deviations.pop(START_ANGLE, 0.0)
        pressure = setting.start.rod_pressure + ROD_PRESSURE_UNSURE * deviations.pop(START_ROD_PRESSURE, 0.0)
        told = setting.pose.load
        pose = replace(setting.pose, load=told + load_deviation(told) * deviations.pop(TOLD_LOAD, 0.0))
        factors = {
            key: max(0.05, 1.0 + z * setting.specimen.tolerance(key, setting.pose) / DEVIATIONS_IN_TOLERANCE)
            for key, z in deviations.items()
        }
        moved = setting.specimen.specimen(factors)
        table = linkage(moved) if any(key.startswith("kinematics.") for key in deviations) else self.linkage
        return run(quantities(moved, pose), table, InitialValues(angle, pressure), self._held, steps=steps).outputs

    def _white(self, difference: Array) -> Array:
        spectrum = _spectrum(difference) * self._weights * np.sqrt(2.0)
        return np.concatenate((spectrum.real.ravel(), spectrum.imag.ravel()))


def _free(twins: tuple[str, ...]) -> list[int]:
    """Indices of ``NUMBERS`` that may move."""
    return [k for k, key in enumerate(NUMBERS) if key not in twins]


def scene(m: Quantities, setting: DetectionSetting, plain: Run) -> Scene:
    """The data of the undisturbed recording that an effect may need."""
    angle, drop, knee = plain["angle"], plain["hose"] - plain["head"], limiting_from(m)
    limited = drop[drop < knee]
    return Scene(
        m, setting.duration, float(angle.min()), float(angle.max()), setting.starts, float(plain["flow_head"].max()),
        float(limited.mean()) if len(limited) else knee,
    )  # fmt: skip


def outputs(m: Quantities, table: BoomLinkage, setting: DetectionSetting, hidden: Hidden) -> Array:
    """Outputs (n, 4) of ideal sensors in a setting with an effect. Raises RunError."""
    changed = m._replace(**dict(hidden.changes))
    held = per_millisecond(setting.currents, hidden.late)
    return sensing.seen(run(changed, table, setting.start, held, hidden.courses).outputs, hidden.sensing)


def together(parts: list[Hidden]) -> Hidden:
    """Several effects in one machine."""
    changes: dict[str, float] = {}
    parameters: dict[str, float] = {}
    courses, seen, late, onset = Courses(), Sensing(), None, None
    for part in parts:
        changes |= part.changes
        parameters |= part.parameters
        given = {name: value for name, value in vars(part.courses).items() if value is not None}
        courses = Courses(**(vars(courses) | given))
        own = {name: value for name, value in vars(part.sensing).items() if value != getattr(Sensing(), name)}
        seen = Sensing(**(vars(seen) | own))
        late = part.late if part.late is not None else late
        onset = part.onset if part.onset is not None else onset
    return Hidden(changes, courses, seen, late, parameters, onset)


def _spectrum(difference: Array) -> Array:
    """(4, f) spectrum of (n, 4) outputs by millisecond, averaged over ``SPACING``."""
    count = len(difference) // SPACING
    coarse = np.einsum("csk->ck", difference[: count * SPACING].reshape(count, SPACING, -1)) / SPACING
    return np.asarray(np.fft.rfft(coarse, axis=0).T)


def _smoothed(power: Array) -> Array:
    """Power averaged over neighbouring frequencies, wider where they are higher."""
    index = np.arange(len(power))
    reach = 2 + index // 4
    total = np.concatenate(([0.0], np.cumsum(power)))
    first, last = np.maximum(index - reach, 0), np.minimum(index + reach + 1, len(power))
    return np.asarray((total[last] - total[first]) / (last - first), dtype=np.float64)
