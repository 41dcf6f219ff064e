"""All doubts about one recording, before any physics: what ``validate``, ``diagnose`` and ``chain`` call."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boom_checks.check import RecordingCheck
from boom_checks.clocks import clock_checks
from boom_checks.commands import chatter_checks, frozen_checks, latched_checks
from boom_checks.even_series import SHORTEST, EvenSeries, even_series, seldom
from boom_checks.jumps import jump_checks, turn_checks
from boom_checks.mechanics import Mechanics, mechanics
from boom_checks.readings import reading_checks
from boom_checks.sampling import independent, sampling_checks
from boom_checks.statics import Statics, statics_of
from boom_estimation.free_run import predict
from boom_model.machine import Machine
from boom_recording.recording import Recording

MOVES = 0.2
"""Share of the measured motion that a model must make for its lag to be that of a crane."""
ALL = ("angle", "rate", "hose_pressure", "rod_pressure", "extend_current", "retract_current")
"""Signals without which only the samples themselves can be doubted."""


@dataclass(frozen=True)
class FirstLook:
    """What a recording says before any model runs: its doubts, and its levels; without levels why (``no_levels``)."""

    name: str
    checks: tuple[RecordingCheck, ...]
    statics: Statics | None
    no_levels: str = ""

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "checks": [check.document() for check in self.checks], "statics": self.statics.document() if self.statics else None
        }  # fmt: skip


def first_look(recording: Recording, machine: Machine) -> FirstLook:
    """Doubts and levels of a recording of a machine; the levels with signs, units and channels put right.

    Behind a valve that holds the load, where the file has one, the hose pressure is not what the boom needs: no levels then.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    turns, recording = turn_checks(recording, machine)
    series, boom = _series(recording), mechanics(machine, recording)
    found, repaired = checks_of(recording, series, boom, machine)
    why = ""
    if machine.holds:
        why = "no levels: the valve that holds the load stands between the hose pressure and the boom"
    elif missing := [name for name in ALL if not repaired.known(name)]:
        why = f"no levels: {lacking(recording, missing, 'they need')}"
    return FirstLook(recording.name, (*turns, *found), None if why else statics_of(repaired, boom), why)


def _series(recording: Recording) -> EvenSeries:
    """A rate computed from the angle is late by its filter: against it every other clock would be early."""
    return even_series(independent(recording))


def lacking(recording: Recording, missing: list[str], need: str) -> str:
    """What of these signals is not there, or not often or long enough, in words; need: "it needs", where that is the sentence."""
    absent = [name for name in missing if name not in recording.signals or not recording.signals[name].valid.any()]
    named = " and the ".join(name.replace("_", " ") for name in absent or missing)
    if absent:
        logged = all(name in recording.signals and len(recording.signals[name].time) for name in absent)
        return f"{need} the {named}, {'of which no sample can be used' if logged else 'not recorded'}"
    short = f"{need} {SHORTEST:g} s of the {named}, and there is less in these {recording.duration:.3g} s"
    return seldom(*(recording.signals[name] for name in missing)) or short


def checks(recording: Recording, machine: Machine) -> list[RecordingCheck]:
    """What is wrong with a recording of a machine, the likeliest first.

    Signs, units and swapped channels come first; commands and clocks are judged with them put right.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    turns, recording = turn_checks(recording, machine)
    return turns + checks_of(recording, _series(recording), mechanics(machine, recording), machine)[0]


def checks_of(
    recording: Recording, series: EvenSeries, boom: Mechanics, machine: Machine
) -> tuple[list[RecordingCheck], EvenSeries]:
    """The same from prepared series, and the series with signs, units and channels put right; nothing where a sensor is missing."""
    if not series.known(*ALL):
        return [*jump_checks(recording), *sampling_checks(recording)], series
    found, repaired = reading_checks(series, boom)
    found += latched_checks(repaired, boom, supply_pressure(machine)) or frozen_checks(repaired, boom)
    found += clock_checks(repaired, boom, lambda: None if found else _answer(recording, machine))
    found += chatter_checks(series)
    found += jump_checks(recording)
    found += sampling_checks(recording)
    return sorted(found, key=lambda check: (not check.spoils, -check.log_odds)), repaired.plausible()


def _answer(recording: Recording, machine: Machine) -> EvenSeries | None:
    """The recording with the motion that the model makes of its currents; None where it makes none, or hardly any."""
    run = predict(recording, machine, "full")
    signals = dict(recording.signals)
    signals |= {n: replace(signals[n], values=run.values[n]) for n in ("angle", "rate") if n in signals}
    series, measured = even_series(replace(recording, signals=signals)), even_series(recording)
    if not series.known("angle", "rate"):
        return None
    moves = [float(np.nanstd(one.smooth("rate"))) for one in (series, measured)]
    return series if moves[0] > MOVES * moves[1] else None


def supply_pressure(machine: Machine) -> float:
    """p_s [Pa] of a machine that has a constant supply, infinite for one whose pump follows the load."""
    known = machine.parameters.get("fluid.p_s")
    return known.value[0] if known else math.inf
