"""The machine's own numbers with their priors (``boom_model.prior``): what may be off without being another machine.

z is counted in standard deviations: value = nominal exp(sigma z). How far a guess (``conf: low``) may be off is a guess itself:
value = nominal exp(sigma sinh(k z) / k), whose tails are about those of Student's t with five degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import asinh, cosh, exp, hypot, inf, isfinite, log, sinh, sqrt

import numpy as np

from boom_diagnosis.sizes import size_of, sized
from boom_estimation.currents import HeldCurrents
from boom_model.catalogue import CATALOGUE
from boom_model.machine import Machine, Parameter, Pose
from boom_model.prior import Prior, prior_of, tolerance_of
from boom_model.sensors import OUTPUTS

LARGEST_Z = 4.0
"""Standard deviations a number may move: twice its tolerance."""
LEAST_SHARE = 0.05
"""Of its nominal value is left of a number at least."""
TAIL = 0.7
"""k of a guess: four standard deviations are a factor of six, as far as owners of real cranes were off."""
TWINS = frozenset(name for effect in CATALOGUE for name in effect.changes)
"""Numbers that an effect of the catalogue multiplies, shifts or adds to."""
ALIKE = TWINS.union(*(effect.alike for effect in CATALOGUE))
"""These, and those that do nearly what an effect does."""
TWIN_Z = 2.0
"""Standard deviations that such a number may move: its tolerance."""
PRECHARGE = 0.05
"""Relative tolerance of a pre-charge pressure that has no ``tol`` (machine notes)."""
HEAD_SIDE, ROD_SIDE = "cylinder.A_a", "cylinder.A_b"
GEOMETRY, SEEN = "kinematics.", 1e-3
"""m. A length of the linkage whose tolerance is less than this moves nothing that the sensors see."""
STROKE_ZERO = "cylinder.l_min"
"""Follows the geometry: at the lower end of the angle's range the cylinder is retracted, whatever the lengths are."""
ONE_FACTOR = (("main_valve_orifices.A_ta_law.c0", "main_valve_orifices.A_ta_law.c1"),)
"""Numbers that move together: an area as a whole."""
PILOT_POLE, PILOT_GAIN, PILOT_FEEDTHROUGH = "pilot_valves.a1_s", "pilot_valves.b0_s", "pilot_valves.b1_s"
"""The gain follows the two others: at rest nu is the current (5.2), and how much pressure a current gives is h alone. One that has
a tolerance of its own in the file is a number of its own."""
CLOCK = "clock of the logged currents"
CLOCKS = "clocks."
"""With which the names of the clocks of channels begin; they are the log's, and no machine file has them."""
LATENCY = next(e.parameters[0].ordinary for e in CATALOGUE if e.delays == "pressures")
"""s. By how much a channel may be late or early against the angle, its tolerance: response time of a transducer or gyro (1 to 5 ms
by data sheets), and the wait for its message on the bus."""
_EFFECTS = "effects."
_NOT_PHYSICS = ("constants.", "hose_burst_valve.unit", "hose_burst_valve.dp_lin", "cylinder.l_")
_VALVE = "main_valve_orifices."
_OF_EVERYTHING = ("fluid.C_d", "fluid.rho", "cylinder.A_a", "kinematics.b")
_UNITS_OF_THE_SPOOL = ("main_valve_spool.A_s", "main_valve_spool.s_max")
"""Assumed, and everything else of the valve is known relative to them: the spring by (5.10), k = p_max A_s / s_max, the friction as
a pilot pressure, the areas over s / s_max. Were they off, those would be with them and nothing would change. By as much as they
may be off, where the file says that, spring or stroke over current may be."""
_DEFLECTING = ("main_valve_spool.k", "main_valve_spool.K_i")


@dataclass(frozen=True)
class Nuisance:
    """One number: component of the parameter vector, standard deviation (relative, or absolute where ``shift``).

    together: components that have the same factor, beside one of their own; ``alike``: that change by the same amount.
    tail: k of a guess, 0 for a normal prior.
    ends: of its value over the nominal one, or less it where ``shift``. factor: the owner says by which factor it may be off.
    label: what a report calls one that is not the machine's. nominal: of one that belongs to a pose or load.
    """

    name: str
    sigma: float
    shift: bool = False
    together: tuple[str, ...] = ()
    tail: float = 0.0
    ends: tuple[float, float] = (-inf, inf)
    factor: bool = False
    label: str = ""
    nominal: float | None = None
    alike: tuple[str, ...] = ()

    @property
    def components(self) -> tuple[str, ...]:
        """All that it moves."""
        return (self.name, *self.together, *self.alike)

    def move(self, numbers: dict[str, float], nominal: Mapping[str, float], z: float) -> None:
        """``numbers``, those that have been moved, moved by ``z`` standard deviations; ``nominal``: of all that it moves."""
        for name in (self.name, *self.together):
            numbers[name] = self.value(numbers.get(name, nominal[name]), z)
        for name in self.alike:
            changed = numbers.get(name, nominal[name]) + self.value(nominal[self.name], z) - nominal[self.name]
            numbers[name] = max(changed, LEAST_SHARE * nominal[name])

    @property
    def difference(self) -> bool:
        """Whether the machine has no such number: between two for which it has one, or of a sensor or a log."""
        return self.name.startswith((_EFFECTS, CLOCKS))

    @property
    def smooth(self) -> bool:
        """Whether its derivative tells what a part of its tolerance does: not of what cannot be less than nothing, at nothing."""
        return not (self.shift and 0.0 in self.ends)

    @property
    def tolerated(self) -> tuple[float, float]:
        """Least and largest z as far as ``LARGEST_Z`` standard deviations go, counted straight.

        Where an effect of the catalogue is the number's being further off than its tolerance: as far as that. A guess is nobody's
        tolerance.
        """
        twin = (self.name in ALIKE and not self.tail) or self.difference
        return self._straight(TWIN_Z if twin else LARGEST_Z)

    def beyond(self, z: float) -> bool:
        """Whether z lies outside the tolerance of the file; a guess is nobody's."""
        low, high = self._straight(TWIN_Z)
        return not (self.tail or low <= z <= high)

    def _straight(self, most: float) -> tuple[float, float]:
        """Least and largest z, ``most`` standard deviations to either side of a number, counted straight."""
        if self.shift or self.tail or self.factor:
            return -most, most
        return log(max(LEAST_SHARE, 1.0 - most * self.sigma)) / self.sigma, log(1.0 + most * self.sigma) / self.sigma

    @property
    def limits(self) -> tuple[float, float]:
        """Least and largest z: as far as is tolerated, and as the prior ends."""
        low, high = self.tolerated
        if self.shift:
            return max(low, self.ends[0] / self.sigma), min(high, self.ends[1] / self.sigma)
        least, largest = max(self.ends[0], LEAST_SHARE), self.ends[1]
        return max(low, self._at(least)), min(high, self._at(largest) if largest < inf else high)

    def ended(self, z: float) -> bool:
        """Whether z stands at a limit of the tolerance, not of what is possible; fits end there exactly."""
        low, high = self.tolerated
        return not low < z < high

    def _at(self, ratio: float) -> float:
        """z of a value over the nominal one."""
        away = log(ratio) / self.sigma
        return asinh(self.tail * away) / self.tail if self.tail else away

    def multiplied(self, z: float, ratio: float) -> float:
        """z of a value that is ``ratio`` times that at z, of one counted relative to its nominal value."""
        return self._at(max(self.value(1.0, z) * ratio, LEAST_SHARE))

    def value(self, nominal: float, z: float) -> float:
        """Its value ``z`` standard deviations from the nominal one."""
        if self.shift:
            return nominal + self.sigma * z
        return nominal * exp(self.sigma * (sinh(self.tail * z) / self.tail if self.tail else z))

    def deviation(self, nominal: float, z: float) -> float:
        """By how much its value changes with a standard deviation, at z: |d value / dz|."""
        return self.sigma if self.shift else abs(self.value(nominal, z)) * self.sigma * cosh(self.tail * z)


def tolerances(machine: Machine, pose: Pose) -> tuple[Nuisance, ...]:
    """All numbers that have a tolerance in this machine and pose."""
    result, units = [], _units(machine, pose)
    for key, parameter in machine.parameters.items():
        follows = (key == PILOT_GAIN and parameter.tol is None) or any(key in row[1:] for row in ONE_FACTOR)
        if follows or key.startswith(_NOT_PHYSICS) or key in units:
            continue
        for name, value in zip(parameter.specification.components, parameter.value, strict=True):
            if _sign_open(prior := prior_of(machine, name), value):
                ends = (prior.low - value, prior.high - value)
                result += [Nuisance(name, prior.sigma, shift=True, ends=ends)] if prior.sigma > 0.0 else []
            else:
                own = _own(machine, parameter, name, value)
                if not _unseen(own, value):
                    result.append(own)
    return (*result, *of_pose(machine, pose), *_differences(machine), *_as_made(machine))


def _sign_open(prior: Prior, value: float) -> bool:
    """Whether a number may have either sign as far as its tolerance goes: no factor leads across zero."""
    either = prior.kind != "log_normal" and prior.low < 0.0 < prior.high
    return value == 0.0 or (either and abs(value) <= LARGEST_Z * prior.sigma)


def of_pose(machine: Machine, pose: Pose) -> list[Nuisance]:
    """The numbers that belong to a pose and its load."""
    result = []
    for name, value in pose.values().items():
        prior = prior_of(machine, name, pose)
        if prior.sigma > 0.0 and value != 0.0:
            shift = name == "pose.load"
            result.append(
                Nuisance(name, prior.sigma if shift else prior.sigma / abs(value), shift=shift, nominal=value)
            )
    return result


def _units(machine: Machine, pose: Pose) -> set[str]:
    """Numbers that others are known relative to, as far as these may be off by as much.

    Without accumulators and burst valve all areas are relative to C_d and rho, and masses, friction, volumes and areas to the
    piston area and the lever b. Along what such numbers leave open together a fit would creep. Stroke over current is none of
    them: the spool's stop tells it.
    """
    valve = [
        p for key, p in machine.parameters.items() if key.startswith(_VALVE) and key != f"{_VALVE}n" and p.value[0]
    ]
    told = min(2.0 * prior_of(machine, "pose.D0", pose).sigma / pose.D0, *map(_relative, valve))
    others = machine.structure.has("accumulators") or machine.structure.has("hose_burst_valve")
    units = () if others else _OF_EVERYTHING
    small = (key for key in units if key in machine.parameters and _relative(machine.parameters[key]) <= told)
    return {*_UNITS_OF_THE_SPOOL, *small}


def known(machine: Machine, pose: Pose) -> list[Nuisance]:
    """The numbers that no fit moves, as far as one of them alone may be wrong.

    Others are known relative to them, or they are lengths that were measured better than the sensors see.
    """
    numbers = {key: machine.parameters[key] for key in sorted(_units(machine, pose).intersection(_OF_EVERYTHING))}
    result = [_own(machine, p, key, p.value[0]) for key, p in numbers.items()]
    for key, p in machine.parameters.items():
        for name, value in zip(p.specification.components, p.value, strict=True) if key.startswith(GEOMETRY) else ():
            if value and _unseen(own := _own(machine, p, name, value), value):
                result.append(own)
    return result


def _unseen(length: Nuisance, value: float) -> bool:
    """Whether a length of the linkage moves nothing that the sensors see, as far as its tolerance goes."""
    return length.name.startswith(GEOMETRY) and 2.0 * length.sigma * abs(value) < SEEN


def masses(known: Sequence[Nuisance]) -> list[Nuisance]:
    """All moments of mass by one factor: the density of the steel, or pounds; of all poses."""
    moments = [n for n in known if n.nominal is not None and not n.shift]
    return [replace(moments[0], together=tuple(n.name for n in moments[1:]))] if len(moments) > 1 else []


def bore(known: Sequence[Nuisance]) -> list[Nuisance]:
    """The area of the piston with that of its rod side, which are pi / 4 (d^2 - d_rod^2): the rod stays."""
    return [replace(n, alike=(ROD_SIDE,)) for n in known if n.name == HEAD_SIDE]


def _relative(parameter: Parameter) -> float:
    """Tolerance over the value."""
    return tolerance_of(parameter).relative(parameter.value[0])


def _own(machine: Machine, parameter: Parameter, name: str, value: float) -> Nuisance:
    """A number by its prior; counted relative to its value."""
    key, prior = parameter.specification.key, prior_of(machine, name)
    sigma = prior.sigma if prior.kind == "log_normal" else prior.sigma / abs(value)
    if key.startswith("accumulators.p_g0") and parameter.tol is None:
        sigma = PRECHARGE / 2.0
    if key in _DEFLECTING:
        told = [machine.parameters[unit] for unit in _UNITS_OF_THE_SPOOL if unit in machine.parameters]
        sigma = hypot(sigma, *(0.5 * _relative(unit) for unit in told if unit.tol is not None))
    ends = sorted((prior.low / value, prior.high / value))
    together = next((row[1:] for row in ONE_FACTOR if key == row[0]), ())
    guess = _guessed(parameter)
    factor = parameter.tol is not None and parameter.tol.word == "factor"
    return Nuisance(name, sigma, together=together, tail=TAIL if guess else 0.0, ends=(ends[0], ends[1]), factor=factor)


def _differences(machine: Machine) -> list[Nuisance]:
    """Between two numbers for which the machine has one guess: as far off as the tolerance of each allows."""
    guesses = {p.specification.key: p for p in machine.parameters.values() if _guessed(p)}
    result = []
    for effect in (e for e in CATALOGUE if machine.structure.has(e.needs) and e.id not in machine.effects):
        for row in (row for row in effect.parameters if row.within in guesses):
            sigma = sqrt(2.0) * prior_of(machine, row.within).sigma
            result.append(
                Nuisance(f"{_EFFECTS}{effect.id}.{row.name}", sigma, shift=True, ends=(row.minimum, row.maximum))
            )
    return result


def _as_made(machine: Machine) -> list[Nuisance]:
    """What every sensor is off by, as its data sheet allows, and edges of a spool, as they are made; a guess allows more."""
    guesses = {p.specification.key for p in machine.parameters.values() if _guessed(p)}
    size = size_of(machine)
    return [
        Nuisance(
            f"{_EFFECTS}{e.id}.{row.name}",
            row.accuracy / 2.0,
            shift=True,
            ends=(max(row.minimum - row.neutral, -row.accuracy), row.accuracy),
            label=row.meaning,
        )
        for e in (sized(e, size) for e in CATALOGUE)
        if e.id not in machine.effects and machine.structure.has(e.needs)
        for row in e.parameters
        if row.accuracy and row.within not in guesses
    ]


def _guessed(parameter: Parameter) -> bool:
    """Whether a number, and how far it may be off, is a guess."""
    return parameter.tol is None and parameter.confidence == "low"


def clock(machine: Machine, logs: Sequence[HeldCurrents]) -> tuple[Nuisance, ...]:
    """How late a log shows its currents, against the angle.

    What samples them does so up to one sample after they changed, always by about as much where both have one clock; where lines
    between samples already stand half a sample earlier, by half a sample to either side. The angle is late itself, as other
    channels are: by up to ``LATENCY`` commands seem to act later. A machine with a dead time of its own in the file has that one.
    """
    effect = next(e for e in CATALOGUE if e.delays == "command")
    steps = [(float(np.median(np.diff(held.sampled_at))), held.late) for held in logs if len(held.time) > 1]
    if not steps or effect.id in machine.effects:
        return ()
    step, late = max(steps)
    early, after = (0.5 * step, 0.5 * step) if late else (step, 0.0)
    name, ends = f"{_EFFECTS}{effect.id}.{effect.parameters[0].name}", (-early, after + LATENCY)
    return (Nuisance(name, 0.5 * max(map(abs, ends)), shift=True, ends=ends, label=CLOCK),)


def clocks(lacking: Iterable[frozenset[str]]) -> tuple[Nuisance, ...]:
    """How late the channels are against the angle, of those that some recording has; ``lacking``: channels that each does not."""
    missing = frozenset.intersection(*lacking)
    return tuple(
        Nuisance(
            CLOCKS + name, LATENCY / 2.0, shift=True, ends=(-LATENCY, LATENCY),
            label=f"latency of the {name.replace('_', ' ')}",
        )
        for name in OUTPUTS[1:] if name not in missing
    )  # fmt: skip


def clocks_in(values: Mapping[str, float]) -> tuple[float, ...]:
    """(NY,) how late each channel is [s] by a hypothesis; empty if none is."""
    late = tuple(values.get(CLOCKS + name, 0.0) for name in OUTPUTS)
    return late if any(late) else ()


def closed(machine: Machine, values: Mapping[str, float]) -> dict[str, float]:
    """``values`` (components of the parameter vector) with what follows from them.

    The gain of the pilot stage such that at rest nu / i stays what it is in ``machine`` (5.2), if it has no tolerance there, and
    the pin-to-pin length at s_p = 0 that the geometry asks for: l_min such that s_p(q_2 at the lower end of the angle's range)
    stays (3.13a). Where the linkage cannot be assembled there, l_min stays.
    """
    return _assembled(machine, _unit_gain(machine, values))


def _unit_gain(machine: Machine, values: Mapping[str, float]) -> dict[str, float]:
    """With b_0 = -a_1 (g - b_1) [1/s], where g = b_1 - b_0 / a_1 [-] is the machine's own gain at rest, one by (5.2).

    As given where the file has a tolerance of b_0.
    """
    own = PILOT_GAIN in machine.parameters and machine.parameters[PILOT_GAIN].tol is not None
    if own or (PILOT_POLE not in values and PILOT_FEEDTHROUGH not in values):
        return dict(values)
    pole, gain, through = (machine.parameters[key].value[0] for key in (PILOT_POLE, PILOT_GAIN, PILOT_FEEDTHROUGH))
    lagging = through - gain / pole - values.get(PILOT_FEEDTHROUGH, through)
    return {**values, PILOT_GAIN: -values.get(PILOT_POLE, pole) * lagging}


def _assembled(machine: Machine, values: Mapping[str, float]) -> dict[str, float]:
    """With the l_min [m] that the geometry asks for (3.13a)."""
    moved = {name: value for name, value in values.items() if name.startswith(GEOMETRY)}
    if not moved:
        return dict(values)
    changed: dict[str, float | tuple[float, ...]] = {}
    for key, parameter in machine.parameters.items():
        components = parameter.specification.components
        if any(name in moved for name in components):
            changed[key] = tuple(moved.get(n, v) for n, v in zip(components, parameter.value, strict=True))
    low = machine.angle_limits[0]
    shift = machine.with_values(changed).piston_position(low) - machine.piston_position(low)
    length = machine.parameters[STROKE_ZERO].value[0]
    return {**values, STROKE_ZERO: length + shift if isfinite(shift) else length}
