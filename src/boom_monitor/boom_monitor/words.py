"""Messages of the watch: one line for ``/diagnostics``, and its numbers."""

from __future__ import annotations

from collections.abc import Sequence

from boom_model.catalogue import SUBSYSTEM_NAMES, effect_name
from boom_monitor.status import Alarm, Status

OFTEN = 0.1  # share of the last minute without currents from which on it is told in the message
_MENTIONED = 0.15  # share from which another subsystem is named too


def alarm(given: Alarm) -> str:
    """The alarm in one line, the same for as long as the evidence names the same subsystems."""
    first, *others = given.share
    also = [SUBSYSTEM_NAMES[name] for name in others if given.share[name] >= _MENTIONED]
    or_else = f", else {' or '.join(also)}" if also else ""
    return (
        f"the machine has left the tolerance of its model: {SUBSYSTEM_NAMES[first]}{or_else}; record it and run "
        "'boom diagnose'"
    )


def silence(channels: Sequence[str]) -> str:
    """That these channels bring nothing that can be used, in one line; empty: none."""
    if not channels:
        return ""
    return f"no samples of {', '.join(channels)}: has the publisher died, or are its stamps late or its values out of range?"


def stuck(channels: Sequence[str]) -> str:
    """That these channels repeat their value, in one line; empty: none."""
    if not channels:
        return ""
    return f"nothing is judged: {', '.join(channels)} repeats its value, as of a sensor or a bus that is stuck"


def message(status: Status, silent: str = "") -> str:
    """One line on the state of the watch; ``silent``: what :func:`silence` says."""
    if status.stuck:
        return stuck(status.stuck)
    if status.alarm is not None:
        return f"{alarm(status.alarm)}; {silent}" if silent else alarm(status.alarm)
    if status.waits_for:
        return f"waits for samples of {status.waits_for}"
    if silent:
        return silent
    if not status.watching:
        return "starts: finds the state of the machine"
    without = f" (without {', '.join(status.absent)})" if status.absent else ""
    seldom = f", judged in {100 * (1.0 - status.blind):.0f} % of the last minute: the currents have gaps"
    return f"within the tolerance of the model{without}{seldom if status.blind > OFTEN else ''}"


def values(status: Status) -> dict[str, object]:
    """Numbers for ``/diagnostics``, units in the keys."""
    result: dict[str, object] = {
        "score [1 = noise]": f"{status.score:.2f}",
        "time [s]": f"{status.time:.2f}",
        "alarms": status.alarms,
        "gaps in the currents [% of the last minute]": f"{100 * status.blind:.0f}",
    }
    if status.alarm is not None:
        given = status.alarm
        result |= {
            "subsystem": given.subsystem,
            "like effect": effect_name(given.effect),
            f"{given.parameter} of about [{given.unit}]": f"{given.size:.3g}",
            "since [s]": f"{given.begin:.2f}",
            "share": ", ".join(f"{name} {share:.2f}" for name, share in list(given.share.items())[:4]),
        }
    return result
