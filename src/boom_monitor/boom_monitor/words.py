"""Messages of the watch: one line for ``/diagnostics``, and its numbers."""

from __future__ import annotations

from boom_model.catalogue import SUBSYSTEM_NAMES, effect_name
from boom_monitor.watch import Alarm, Status

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


def message(status: Status) -> str:
    """One line on the state of the watch."""
    if status.alarm is not None:
        return alarm(status.alarm)
    if status.waits_for:
        return f"waits for samples of {status.waits_for}"
    return "within the tolerance of the model" if status.watching else "starts: finds the state of the machine"


def values(status: Status) -> dict[str, object]:
    """Numbers for ``/diagnostics``, units in the keys."""
    result: dict[str, object] = {
        "score [1 = noise]": f"{status.score:.2f}",
        "time [s]": f"{status.time:.2f}",
        "alarms": status.alarms,
    }
    if status.alarm is not None:
        given = status.alarm
        result |= {
            "subsystem": given.subsystem,
            "like effect": effect_name(given.effect),
            f"of about [{given.unit}]": f"{given.size:.3g}",
            "since [s]": f"{given.begin:.2f}",
            "share": ", ".join(f"{name} {share:.2f}" for name, share in list(given.share.items())[:4]),
        }
    return result
