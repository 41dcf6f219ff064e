"""Faults put into recordings: what a wrong sign, unit, channel, command or clock makes of a bag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from boom_identification.signals import stretches
from boom_input.channels import AMBIENT_PRESSURE_PA
from boom_recording.recording import Recording

CURRENTS, PRESSURES = ("retract_current", "extend_current"), ("hose_pressure", "rod_pressure")


def changed(recording: Recording, **values: np.ndarray) -> Recording:
    """The recording with other values of some signals."""
    signals = dict(recording.signals)
    for name, given in values.items():
        signals[name] = replace(signals[name], values=given)
    return replace(recording, signals=signals)


def turned(recording: Recording, *names: str) -> Recording:
    """Signals with the other sign."""
    return changed(recording, **{name: -recording.signals[name].values for name in names})


def swapped(recording: Recording, first: str, second: str) -> Recording:
    """Two signals of the same unit, each with the other's samples."""
    a, b = recording.signals[first], recording.signals[second]
    signals = recording.signals | {
        first: replace(b, name=first, topic=a.topic), second: replace(a, name=second, topic=b.topic)
    }  # fmt: skip
    return replace(recording, signals=signals)


def in_bar(recording: Recording, *names: str) -> Recording:
    """Absolute pressures in bar on the wire."""
    wire = {name: (recording.signals[name].values + AMBIENT_PRESSURE_PA) * 1e-5 for name in names}
    return changed(recording, **{name: value - AMBIENT_PRESSURE_PA for name, value in wire.items()})


def in_degrees(recording: Recording, *names: str) -> Recording:
    """Angles in degrees."""
    return changed(recording, **{name: np.rad2deg(recording.signals[name].values) for name in names})


def counted(recording: Recording, zero: float, direction: float = 1.0) -> Recording:
    """An angle that reads ``zero`` [rad] where the boom is horizontal, and rises or falls while it is lifted."""
    angle, rate = (recording.signals[name].values for name in ("angle", "rate"))
    return changed(recording, angle=zero + direction * angle, rate=direction * rate)


def slipped(recording: Recording, jump: float = -0.01) -> Recording:
    """An angle sensor that slips on its mount by ``jump`` [rad] at 60 % of the recording."""
    angle = recording.signals["angle"]
    return changed(recording, angle=angle.values + jump * (angle.time > 0.6 * recording.duration))


def late(recording: Recording, seconds: float, *names: str) -> Recording:
    """Stamps of a clock that differs by this much [s]."""
    signals = dict(recording.signals)
    for name in names:
        s = signals[name]
        signals[name] = replace(s, stamps_ns=s.stamps_ns + round(seconds * 1e9), time=s.time + seconds)
    return replace(recording, signals=signals)


def latched(recording: Recording) -> Recording:
    """A command that stays on through the three longest rests, as after a soft stop: the last large one, with its noise."""
    retract, extend = (recording.signals[name].values.copy() for name in CURRENTS)
    time, command = recording.signals["extend_current"].time, extend - retract
    rate = recording.signals["rate"]
    still = np.abs(np.interp(time, rate.time, np.convolve(rate.values, np.ones(21) / 21, "same"))) < 4e-3
    rests = sorted(stretches(still & (np.abs(command) < 0.02)), key=lambda pair: pair[0] - pair[1])[:3]
    large = np.flatnonzero(np.abs(command) > 0.75 * np.abs(command).max())
    for first, end in rests:
        before = large[large < first]
        value = command[before[-1] if len(before) else large[-1]]
        noise = 8e-4 * np.random.default_rng(first).standard_normal(end - first)
        (extend if value > 0 else retract)[first:end] = np.round(abs(value) + noise, 3)
    return changed(recording, retract_current=retract, extend_current=extend)


FAULTS: dict[str, tuple[str, str, Callable[[Recording], Recording]]] = {
    "command's sign": ("sign", "/boom/solenoid_currents", lambda r: swapped(r, *CURRENTS)),
    "angle's and rate's sign": ("sign", "/joint_states", lambda r: turned(r, "angle", "rate")),
    "angle's sign": ("sign", "/joint_states", lambda r: turned(r, "angle")),
    "rate's sign": ("sign", "/joint_states", lambda r: turned(r, "rate")),
    "hose pressure's sign": ("sign", "/boom/hose_pressure", lambda r: turned(r, "hose_pressure")),
    "rod pressure's sign": ("sign", "/boom/rod_pressure", lambda r: turned(r, "rod_pressure")),
    "bar for Pa": ("units", "/boom/hose_pressure, /boom/rod_pressure", lambda r: in_bar(r, *PRESSURES)),
    "bar for Pa, hose only": ("units", "/boom/hose_pressure", lambda r: in_bar(r, "hose_pressure")),
    "degrees for rad": ("units", "/joint_states", lambda r: in_degrees(r, "angle", "rate")),
    "angle from the vertical": ("units", "/joint_states", lambda r: counted(r, np.pi / 2, -1.0)),
    "angle 90 degrees too large": ("units", "/joint_states", lambda r: counted(r, np.pi / 2)),
    "angle 90 degrees too small": ("units", "/joint_states", lambda r: counted(r, -np.pi / 2)),
    "mA for A": (
        "units",
        "/boom/solenoid_currents",
        lambda r: changed(r, **{name: 1e3 * r.signals[name].values for name in CURRENTS}),
    ),
    "swapped pressures": (
        "swapped_channels",
        "/boom/hose_pressure, /boom/rod_pressure",
        lambda r: swapped(r, *PRESSURES),
    ),
    "angle that slips": ("jump", "/joint_states", slipped),
    "latched command": ("latched_command", "/boom/solenoid_currents", latched),
    "pressures 0.3 s late": ("clock", "/boom/hose_pressure, /boom/rod_pressure", lambda r: late(r, 0.3, *PRESSURES)),
    "currents 0.4 s late": ("clock", "/boom/solenoid_currents", lambda r: late(r, 0.4, *CURRENTS)),
}
"""Name -> kind and topic with which it has to be told, and what makes it."""
