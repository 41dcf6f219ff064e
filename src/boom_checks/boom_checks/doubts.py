"""All doubts about one recording, before any physics: what ``validate``, ``diagnose`` and ``chain`` call."""

from __future__ import annotations

import math

from boom_checks.check import RecordingCheck
from boom_checks.clocks import clock_checks
from boom_checks.commands import chatter_checks, latched_checks
from boom_checks.even_series import even_series
from boom_checks.mechanics import mechanics
from boom_checks.readings import reading_checks
from boom_checks.sampling import sampling_checks
from boom_model.machine import Machine
from boom_recording.recording import Recording


def checks(recording: Recording, machine: Machine) -> list[RecordingCheck]:
    """What is wrong with a recording of a machine, the likeliest first.

    Signs, units and swapped channels come first; commands and clocks are judged with them put right.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    series, boom = even_series(recording), mechanics(machine, recording)
    found, repaired = reading_checks(series, boom)
    found += latched_checks(repaired, boom, supply_pressure(machine))
    found += clock_checks(repaired, boom)
    found += chatter_checks(series)
    found += sampling_checks(recording)
    return sorted(found, key=lambda check: (not check.spoils, -check.log_odds))


def supply_pressure(machine: Machine) -> float:
    """p_s [Pa] of a machine that has a constant supply, infinite for one whose pump follows the load."""
    known = machine.parameters.get("fluid.p_s")
    return known.value[0] if known else math.inf
