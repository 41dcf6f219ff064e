"""Test cases of the closed loop: trajectories, configurations of Tables 6.1 and 6.2, off-nominal plants, Monte Carlo.

A plant is the nominal machine with factors on some numbers, effects, and a load in addition to the configured one. The
controller knows the nominal machine and the configuration only, unless it is told (``PlantCase.told``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from boom_model.catalogue.pump_flow_limit import EFFECT
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.variation import BULK_MODULUS, FRICTION, LOAD, PRECHARGE

TRAJECTORIES = {
    "folded": ("healthy/folded_slow", "healthy/folded_fast", "unexplained/crane_2_a"),
    "extended": ("healthy/extended", "explained/hose_burst_valve_lag_a", "explained/payload_change_b"),
    "log": ("healthy/extended_log", "unexplained/crane_3_a", "unexplained/crane_3_b"),
}
"""Pose -> recordings in ``bags/`` whose angles are the reference trajectories."""

POSE_OF = {bag: pose for pose, bags in TRAJECTORIES.items() for bag in bags}

PRECHARGES = ("accumulators.p_g0_1", "accumulators.p_g0_2")
FRICTIONS = ("friction.tau_C_pos", "friction.tau_C_neg", "friction.k_v_pos", "friction.k_v_neg")
DEAD_ZONE, SPRING, PILOT_POLE = "main_valve_orifices.x0", "main_valve_spool.k", "pilot_valves.a1_s"
PILOT_GAIN = "pilot_valves.b0_s"
AREAS = tuple(f"main_valve_orifices.{name}" for name in ("A_sa_max", "A_sb_max", "A_tb_max"))
OFF_NOMINAL = 0.05
"""Relative deviation of dead zone, spring, areas and pilot lag."""
FULL_PUMP_FLOW, SUPPLY_PRESSURE = 1.4e-3, 2.5e7
"""84 l/min and 250 bar: the real supply (machine notes)."""


@dataclass(frozen=True)
class PlantCase:
    """A plant: factors of the nominal numbers by dotted key, load [kg] in addition to the configured one, effects.

    Attributes:
        told: the controller is given the machine file of this plant, but for the load: "explained". Otherwise it knows the
            nominal machine only.
    """

    name: str
    load: float = 0.0
    factors: Mapping[str, float] = field(default_factory=dict)
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    told: bool = False

    def machine(self, nominal: Machine, limited: bool) -> Machine:
        """The machine of the plant; ``limited``: its pump delivers 84 l/min.

        Raises:
            MachineError: a factor leaves the range of its parameter.
        """
        changed = {key: nominal.parameters[key].value[0] * factor for key, factor in self.factors.items()}
        effects = {**nominal.effects, **self.effects}
        if limited:
            effects[EFFECT.id] = {EFFECT.parameters[0].name: 1 / FULL_PUMP_FLOW}
        return nominal.with_values(changed).with_effects(effects)

    def off(self, factors: Mapping[str, float], name: str = "") -> PlantCase:
        """The same plant with further factors."""
        return replace(self, name=name or self.name, factors={**self.factors, **factors})


def _case(name: str, beta: float, load: float, precharge: float, friction: float) -> PlantCase:
    factors = {"fluid.beta": beta, **dict.fromkeys(PRECHARGES, precharge), **dict.fromkeys(FRICTIONS, friction)}
    return PlantCase(name, load, {key: value for key, value in factors.items() if value != 1.0})


CONFIGURATIONS = {
    case.name: case
    for case in (
        _case("C0", 1.0, LOAD[0], 1.0, 1.0),
        _case("C1", BULK_MODULUS[0], LOAD[1], PRECHARGE[0], FRICTION[0]),
        _case("C2", BULK_MODULUS[0], LOAD[1], PRECHARGE[0], FRICTION[1]),
        _case("C3", BULK_MODULUS[0], LOAD[1], PRECHARGE[1], FRICTION[0]),
        _case("C4", BULK_MODULUS[0], LOAD[1], PRECHARGE[1], FRICTION[1]),
    )
}
"""Table 6.2."""


def lag_factors(factor: float) -> dict[str, float]:
    """A pilot stage slower by the factor, at the same stationary gain."""
    return {PILOT_POLE: 1 / factor, PILOT_GAIN: 1 / factor}


def off_nominal() -> list[PlantCase]:
    """C0 with one group of numbers 5 % off at a time, in both directions."""
    cases = []
    for sign, word in ((1, "+"), (-1, "-")):
        factor = 1 + sign * OFF_NOMINAL
        percent = f"{word}{OFF_NOMINAL:.0%}"
        for label, factors in (
            ("dead zone", {DEAD_ZONE: factor}),
            ("spring", {SPRING: factor}),
            ("areas", dict.fromkeys(AREAS, factor)),
            ("pilot lag", lag_factors(factor)),
        ):
            cases.append(PlantCase(f"{label} {percent}", 0.0, factors))
    return cases


def monte_carlo(count: int, seed: int, *, loaded: bool = True) -> list[PlantCase]:
    """Plants drawn from all of Table 6.1, dead zone, spring, areas and pilot lag within 5 %; all uniform.

    loaded: False leaves Table 6.1 out (C0 on off-nominal plants).
    """
    rng = np.random.default_rng(seed)
    cases = []
    for k in range(count):
        beta, friction, precharge, load = (float(rng.uniform(*r)) for r in (BULK_MODULUS, FRICTION, PRECHARGE, LOAD))
        valve = {
            key: float(1 + OFF_NOMINAL * v)
            for key, v in zip((DEAD_ZONE, SPRING, "areas", "lag"), rng.uniform(-1, 1, 4), strict=True)
        }
        areas, lag = valve.pop("areas"), valve.pop("lag")
        off = {**valve, **dict.fromkeys(AREAS, areas), **lag_factors(lag)}
        base = _case("", beta, load, precharge, friction) if loaded else PlantCase("")
        cases.append(base.off(off, f"plant {k}"))
    return cases


def within_tolerance(count: int, seed: int, nominal: Machine) -> list[PlantCase]:
    """Plants whose every single number is drawn within its tolerance of the machine file, uniformly.

    A number whose draw leaves its range is a constant of nature or a unit, and keeps its value.
    """
    rng = np.random.default_rng(seed)
    cases = []
    for k in range(count):
        factors = {}
        for key, entry in nominal.parameters.items():
            factor = 1.0 + entry.tolerance * float(rng.uniform(-1.0, 1.0))
            if len(entry.value) == 1 and _allowed(nominal, key, factor * entry.value[0]):
                factors[key] = factor
        cases.append(PlantCase(f"plant {k}, all numbers", factors=factors))
    return cases


def _allowed(nominal: Machine, key: str, value: float) -> bool:
    try:
        nominal.with_values({key: value})
    except MachineError:
        return False
    return True
