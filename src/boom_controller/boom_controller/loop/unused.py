"""What a machine file tells that no control law uses, said when the machine becomes known.

A law uses what the components make of the effects without a state of their own (``ControlModel``), the dead times, the play of the
spool, what moves between cylinder and IMU and a valve that holds the load. It does not see the effects and numbers below, and terms
learnt from data: its observers have to make up for them.
"""

from __future__ import annotations

from boom_controller.observers import mode_observer
from boom_model.catalogue import EFFECTS, effect_name, valve_hysteresis
from boom_model.machine import Machine

ABSENT = frozenset({"throat", "valve_flow", "supply_pressure", "poppet_time"})
"""Quantities without part in the laws' reduced model."""


def unused(machine: Machine) -> tuple[str, ...]:
    """Names of the effects, and ``learned`` where there are such terms; empty if the law uses everything."""
    names = [effect_name(name) for name in machine.effects if not _used(name)]
    for name, numbers in machine.effects.items():
        neutral = {row.name: row.neutral for row in EFFECTS[name].parameters}
        if told := [n for n in EFFECTS[name].not_in_laws if numbers.get(n, neutral[n]) != neutral[n]]:
            names.append(f"{effect_name(name)} ({', '.join(told)})")
    return (*names, *(["learned terms"] if machine.learned else []))


def unused_in_words(machine: Machine) -> str:
    """A sentence for the operator; empty if the law uses everything."""
    names = unused(machine)
    return f"the machine file tells {', '.join(names)}, which the control law does not use" if names else ""


def _used(name: str) -> bool:
    effect = EFFECTS[name]
    quantities = set(effect.terms)
    if name == valve_hysteresis.EFFECT.id or effect.holds or mode_observer.QUANTITIES & quantities:
        return True
    stateless = set(effect.stateless) if effect.states else quantities
    return bool(stateless - ABSENT or effect.delays)
