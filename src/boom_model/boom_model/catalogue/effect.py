"""What an effect is: its term, its numbers, and what diagnosis, watch and report need to know of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, Literal

from boom_model.regularisation import Expression
from boom_model.sensors import OUTPUTS
from boom_model.state import ELAPSED_TIME, State

Term = Callable[[Expression, Any, Any], Expression]
"""(value, own, at) -> the quantity with the term. own: the effect's numbers and states (``terms.Own``); at: see ``QUANTITIES``."""

QUANTITIES: dict[str, str] = {
    "load_mass": "m at the tip [kg]; at.position of the piston",
    "gravity_torque": "g(q_2) [N m]; at.angle, at.p",
    "coulomb_friction": "tau_C, its size without direction [N m]; at.angle, at.rate",
    "sliding_friction": "tau_C tanh(w / sigma) [N m]; at.rate, at.coulomb",
    "friction_torque": "tau_f [N m]; at.angle, at.rate",
    "angular_acceleration": "q_2'' [rad/s^2]; at.angle, at.rate, at.inertia, at.torque, at.drive of the cylinder, at.p",
    "seen_angle": "q_2 where the angle is measured [rad]",
    "seen_rate": "q_2' where it is measured [rad/s]",
    "leakage": "q_l from the head to the rod side [m^3/s]; at.head_pressure, at.rod_pressure",
    "cushion": "(A_tb / A_c)^2, A_c: throttle that oil leaves through [-]; at.distance to the end of stroke, at.way: a, b, h or r",
    "bulk_modulus": "beta [Pa]; at.pressure",
    "precharge": "p_g0 of an accumulator [Pa]",
    "throat": "orifice diameter of an accumulator [m]",
    "adiabat": "p_g0 of the adiabat on which an accumulator's gas is [Pa]; at.number, at.pressure, at.p",
    "entropy_rate": "rate of an accumulator's ln(p V_g^kappa) [1/s]; at.number",
    "limited_flow": "a_30 of the hose burst valve",
    "limited_conductance": "q_a / (p_h - p_a) while it limits [m^3/s/Pa]",
    "valve_flow": "q_a through the valve between hose and head side [m^3/s]; at.hose, at.head, at.rod [Pa]",
    "set_pressure": "set pressure p_set of the load-holding valve [Pa]",
    "poppet_time": "time constant T of the load-holding valve's pilot [s]",
    "neutral_area": "from each port to the tank in neutral [m^2]; at.position of the spool, at.p",
    "port_leakage": "past the spool into a port, whatever its position [m^3/s]; at.port: hose or rod, at.pressure of it",
    "overlap": "x_0 [-]; at.position of the spool, at.edge: supply or tank",
    "metering_position": "s_s at the metering edges [m]; at.p",
    "supply_pressure": "p_s without a compensator [Pa]",
    "supply_fall": "by how much the supply has fallen since it was p_s, without a compensator [Pa]",
    "supply_flow": "from the supply to a port [m^3/s]; at.conductance = q / sqrt(dp), at.pressure of the port, at.pump",
    "tank_flow": "from a port to the tank [m^3/s]; at.conductance = q / sqrt(dp)",
    "flow_force": "F_q, closes the spool [N]; at.size of |q| sqrt(|dp|), at.extend",
    "return_spring": "k [N/m]",
    "pilot_rate": "a_1, b_0 of the pilot valves [1/s]",
    "pilot_state_rate": "lambda' of a pilot valve [A]",
    "pilot_settling": "time constant of the pilot stage [s]",
    "pilot_difference": "p_+ - p_- that moves the spool [Pa]",
    "spool_rate": "1 / T_s or omega_n of a spool without pilot stage [1/s]",
    **{f"measured_{name}": f"what the sensor shows of {name} [SI]" for name in OUTPUTS},
}
"""What the equations let pass through the terms of the active effects (``Terms.through``): quantity -> meaning, context."""

SUBSYSTEM_NAMES = {
    "load": "load", "structure": "boom structure", "friction": "friction", "cylinder": "cylinder", "oil": "oil",
    "accumulators": "accumulators", "hose_burst_valve": "hose burst valve", "main_valve": "main valve",
    "pilot_valves": "pilot valves", "supply": "supply", "return_line": "return line", "sensors": "sensors",
}  # fmt: skip
"""The twelve subsystems in words, in the order of the catalogue."""

LAST = 1000
"""Place of an effect that does not say one."""


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect: neutral value, plausible range [low, high], limits outside which it is refused.

    Attributes:
        starts: values from which a search tries it, because the answer is far from linear in it.
        positive: searched in its logarithm.
        possible: what a machine can have; an effect that is found outside stands in for something else.
        possible_less: the same where the effect's first number is below nothing.
        surely: it is outside ``possible`` only if its whole interval is.
        form: standard deviation (of the logarithm for a factor) to which it means anything, because the machine's form of
            the effect is not the catalogue's. From blind trials.
        almost_nothing: value at which the watch switches the effect on, where a millionth of the range is too stiff or has no
            derivative.
        gains: value at which the gains of an observer are computed where nothing is known of it yet.
        within: key of the machine file that stands for two numbers whose difference this is: where it is a guess, each has its
            tolerance, and a difference that they allow is no physics.
        visited: its starts are shares of the range of angles that the boom visits.
        accuracy: tolerance of a sensor, or of how a part is made, two standard deviations [unit]: a sound one is off by as much.
        ordinary: size that a sound machine may have of what cannot be a tolerance: as little is no effect, as that explains what
            other small things do. From data sheets.
        swallows: a play of the spool over full stroke. As small as what the noise of measured currents makes of the spool it lets
            none of that noise through, and predicts better than the truth.
        of: number of the same effect without which this one says nothing.
        acts: also where the leading number does nothing. leads: it does so as another size of the effect, beside the first one.
        fixed: no unknown; where a search starts it is set.
        flow_power: with which power of a machine's flow it goes, beside what its unit says: a share at the thesis' full flow.
    """

    name: str
    unit: str
    neutral: float
    low: float
    high: float
    minimum: float
    maximum: float
    meaning: str
    starts: tuple[float, ...] = ()
    positive: bool = False
    possible: tuple[float, float] = (-inf, inf)
    possible_less: tuple[float, float] | None = None
    surely: bool = False
    form: float = 0.0
    almost_nothing: float | None = None
    gains: float | None = None
    within: str = ""
    visited: bool = False
    accuracy: float = 0.0
    ordinary: float = 0.0
    swallows: bool = False
    of: str = ""
    acts: bool = False
    leads: bool = False
    fixed: bool = False
    flow_power: int = 0


def parameter(
    name: str, unit: str, neutral: float, plausible: tuple[float, float], limits: tuple[float, float], meaning: str,
    **search: Any,
) -> EffectParameter:  # fmt: skip
    """One number of an effect; ``search``: the further attributes of :class:`EffectParameter`."""
    return EffectParameter(name, unit, neutral, *plausible, *limits, meaning, **search)


@dataclass(frozen=True, eq=False)
class Effect:
    """One effect of the catalogue.

    Attributes:
        id: name that others rely on, that of its file.
        subsystem: one of the twelve subsystem ids.
        equation: equation of the thesis that the term changes.
        term: what is added, in symbols.
        says: subject and predicate of the sentence that states it in a report.
        says_less: the same where its first number is below nothing; None: as ``says``.
        regime: when it shows.
        parameters: its numbers.
        terms: quantity of the equations (``QUANTITIES``) -> what the effect makes of it. May be empty for a delay.
        place: in the order of its subsystem, in which terms are applied and tables are written.
        states: states that it brings while active; the reduced model leaves it out then, but for what is ``stateless``.
        stateless: quantities whose terms need none of them: these it keeps there, and where a component stands alone.
        moving: numbers that alone need its states: while they are neutral in a machine, the effect is built without these, and
            in the reduced model always.
        not_in_laws: numbers of which no control law makes anything, where it does of the others.
        at_rest: (states so far, p, e) -> values of its own states of a boom that has rested, where these are not zero;
            ``load`` [kg] among the states is what hangs at the tip.
        check: (its numbers, machine); raises MachineError where both do not go together.
        holds: it shuts the head side, whose pressure p_a then carries the boom whatever the hose's is; hose and head side are two
            volumes then.
        needs: what the machine's structure must have, words like "hose_burst_valve"; "no_" before one: must not; empty if nothing.
        independent: each parameter is a term of its own; otherwise the first one leads, and without it there is no term.
        changes: components of the parameter vector that it is a change of: off by more than their tolerance they are this effect.
        alike: components that do nearly what it does: no further off than their tolerance, unless they are wrong in the file.
        delays: its first parameter is a dead time of what is said here.
        load: a load, which may be less than nothing: as much as was told to hang there. Of others that are plausible on one side
            of neutral there are none on the other.
        onset: parameter that is the time at which it begins in a recording. release: that at which it ends; neutral: never.
        steps: of a load each mass and the piston position below which that rests on the ground.
        told: parameter that is 1 where its load is the one that is told.
        lasting: effect that it is if it began before the recording, with parameters of the same names.
        margin: the prior reaches so far beyond the plausible range, in widths of it.
        sets_in: shares of a probe that are tried, of an effect that does nothing up to some size and soon far too much.
        points: values of all its parameters from which a search tries it, where single starts say too little.
        watched: whether the watch suspects it: not what acts on the times of inputs and samples, begins at a time, is less of
            something, or brings fast states of its own.
        foreign: what acts is no part of the crane, or in nobody's list: it is told as unknown physics, with its numbers.
        plainest: (its numbers by name) -> those that do the same and are plainer, where its numbers trade off against one another.
        reach: halves of the range over which the watch takes a difference, where the derivative at nothing says little.
    """

    id: str
    subsystem: str
    equation: str
    term: str
    says: tuple[str, str]
    regime: str
    parameters: tuple[EffectParameter, ...]
    terms: Mapping[str, Term] = field(default_factory=dict)
    place: int = LAST
    states: tuple[State, ...] = ()
    at_rest: Callable[[Mapping[str, Expression], Any, Any], dict[str, Expression]] | None = None
    check: Callable[[Mapping[str, float], Any], None] | None = None
    holds: bool = False
    needs: str = ""
    independent: bool = False
    changes: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    delays: Literal["", "command", "pressures"] = ""
    load: bool = False
    onset: str = ""
    release: str = ""
    steps: tuple[tuple[str, str], ...] = ()
    told: str = ""
    lasting: str = ""
    margin: float = 10.0
    sets_in: tuple[float, ...] = (1.0,)
    points: tuple[tuple[float, ...], ...] = ()
    watched: bool = True
    foreign: bool = False
    plainest: Callable[[Mapping[str, float]], dict[str, float]] | None = None
    reach: float = 0.0
    says_less: tuple[str, str] | None = None
    stateless: tuple[str, ...] = ()
    not_in_laws: tuple[str, ...] = ()
    moving: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Raises ValueError for a quantity that the equations do not have: its term would never act."""
        unknown = set(self.terms) - set(QUANTITIES)
        if unknown:
            raise ValueError(f"effect {self.id}: no quantity of the equations is called {', '.join(sorted(unknown))}")

    @property
    def light(self) -> bool:
        """Whether it brings no state but the time: one compiled model then serves it and all others of its kind."""
        return all(state is ELAPSED_TIME for state in self.states)

    def stateful(self, numbers: Iterable[str]) -> bool:
        """Whether an effect of which ``numbers`` are not neutral has states."""
        return bool(self.states) and (not self.moving or not set(self.moving).isdisjoint(numbers))

    def at_nothing(self, *, moving: bool) -> dict[str, float]:
        """Its numbers while it does nothing; moving: next to nothing, where it would be built without its states else."""
        values = {row.name: row.neutral for row in self.parameters}
        rows = (row for row in self.parameters if moving and row.name in self.moving)
        return values | {row.name: row.almost_nothing for row in rows if row.almost_nothing is not None}

    @property
    def leading(self) -> tuple[EffectParameter, ...]:
        """The parameters at whose neutral values the term vanishes."""
        return tuple(row for k, row in enumerate(self.parameters) if self.independent or row.leads or k == 0)

    @property
    def sizes(self) -> tuple[EffectParameter, ...]:
        """How much of it there is: the leading parameters, each mass of a load in steps, what acts where it ``changes``."""
        also = {mass for mass, _ in self.steps} | {row.name for row in self.parameters if row.acts and self.changes}
        return tuple(row for row in self.parameters if row in self.leading or row.name in also)

    @property
    def lacking(self) -> str:
        """What a machine that cannot have it has: "no pilot valves", "a load holding valve"."""
        words = []
        for need in self.needs.split():
            name = need.removeprefix("no_")
            article = "no " if name == need else "" if name.endswith("s") else "a "
            words.append(article + name.replace("_", " "))
        return " or ".join(words)
