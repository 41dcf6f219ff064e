"""What is said of a machine of a fleet, in sentences; from the rows of its table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from math import exp
from typing import Any

from boom_model.catalogue import EFFECTS, SUBSYSTEM_NAMES, effect_name
from boom_report.diagnosis.words import SCALES

Row = Mapping[str, Any]
_WHOLE = 0.9
"""Share of the recordings from which on they are as good as screened whole: gaps and short ends are not."""
_FAR = 5.0
"""nats per innovation beyond noise, errors from sample to sample of more than three times the sensors' noise, that a machine's file
may leave of its first recording for changes of it to be judged at all."""
_UNITS = {unit: (name, scale) for unit, (scale, name) in SCALES.items()} | {"-": ("%", 1e2), "s": ("ms", 1e3)}


@dataclass(frozen=True)
class FleetMachine:
    """A machine: its rows in the order of time, the changes known after the last one, and what is said of it."""

    name: str
    rows: tuple[Row, ...]
    changes: tuple[Mapping[str, Any], ...]
    sentences: tuple[str, ...]

    @property
    def unchanged(self) -> float | None:
        """Probability that nothing that matters has changed since its first recording."""
        judged = [row for row in self.rows if row.get("log_odds_changed") is not None]
        if not judged or (self.far and not self.changes):
            return None
        return (
            1.0 / (1.0 + exp(min(judged[-1]["log_odds_changed"], 700.0))) if self.changes else judged[-1]["unchanged"]
        )

    @property
    def far(self) -> str:
        """Where its file does not describe its first screened recording, and by how much; empty where it does."""
        first = next((row for row in self.rows if row.get("screened_s")), {})
        left = {name: value for name, value in first.items() if name.startswith("nats_") and value is not None}
        worst = max(left, key=lambda name: left[name], default="")
        if not worst or left[worst] < _FAR:
            return ""
        channel, _, regime = worst.removeprefix("nats_").rpartition("_")
        times = (1.0 + 2.0 * left[worst]) ** 0.5
        return (
            f"{channel.replace('_', ' ')} {regime}: errors from sample to sample {times:.0f} times the sensor's noise"
        )

    @property
    def status(self) -> str:
        """changed, refused, failed, far from its file, or unchanged."""
        if self.changes:
            return "changed"
        if self.far:
            return "not judged"
        if not any(row.get("screened_s") for row in self.rows):
            return "not screened"
        return "spoilt" if self.rows[-1].get("refused") else "unchanged"


def machines(rows: Sequence[Row]) -> list[FleetMachine]:
    """All machines; those that have changed first, the surest of them first."""
    by_name: dict[str, list[Row]] = {}
    for row in rows:
        by_name.setdefault(row["machine"], []).append(row)
    found = [_machine(name, own) for name, own in by_name.items()]
    return sorted(found, key=lambda m: (m.status == "unchanged", not m.changes, *_surest(m), m.name))


def _surest(machine: FleetMachine) -> tuple[float, float]:
    """Where it stands among those of its state: the surest change first, or what is least sure not to have changed."""
    known = (row["log_odds_changed"] for row in machine.rows if row.get("log_odds_changed") is not None)
    return (
        -max(known, default=0.0) if machine.changes else 0.0,
        machine.unchanged if machine.unchanged is not None else 1.0,
    )


def _machine(name: str, rows: Sequence[Row]) -> FleetMachine:
    judged = [row for row in rows if row.get("changes") is not None]
    changes = tuple(judged[-1]["changes"]) if judged else ()
    levels = {level["quantity"]: level for level in judged[-1]["levels"]} if judged else {}
    said = []
    for quantity in dict.fromkeys(change["quantity"] for change in changes):
        own = [change for change in changes if change["quantity"] == quantity]
        said.append(change_sentence(own[0]) if len(own) == 1 else _several(own, levels[quantity]))
    said += [verdict_sentence(row) for row in rows if row.get("raised") and row.get("verdict")]
    said += [f"{row['recording']}: {row['refused']}" for row in rows if row.get("refused")]
    found = FleetMachine(name, tuple(rows), changes, tuple(said))
    if found.status == "not judged":
        doubt = f"its file does not describe it ({found.far}), so that no change can be judged: diagnose the first recording"
        found = replace(found, sentences=(doubt, *said))
    return found


def quantity_words(quantity: str) -> str:
    """A quantity with its subsystem."""
    effect, _, part = quantity.partition(".")
    said = effect_name(effect) + (f" ({part.replace('_', ' ')})" if part else "")
    where = SUBSYSTEM_NAMES[EFFECTS[effect].subsystem] if effect in EFFECTS else ""
    return f"{said} [{where}]" if where and where not in said else said


def shown(value: float, unit: str) -> str:
    """A number with the unit in which people think of it."""
    name, scale = _UNITS.get(unit, (unit, 1.0))
    return f"{scale * value:+.3g} {name}".rstrip()


def _with_interval(numbers: Sequence[float], unit: str) -> str:
    """A value with the ends of its interval of 90 %."""
    scale = unit_of(unit)[1]
    value, low, high = numbers
    return f"{shown(value, unit)} ({scale * low:+.3g} to {scale * high:+.3g}, 90 %)"


def _sure(probability: float) -> str:
    """Never quite certain."""
    return "above 99 %" if probability > 0.99 else f"{100 * probability:.0f} %"


def _number(count: int, word: str) -> str:
    return f"{count} {word}" + ("" if count == 1 else "s")


def _between(early: datetime, late: datetime) -> str:
    first, last = f"{early:%Y-%m-%d}", f"{late:%Y-%m-%d}"
    return f"on {first}" if first == last else f"between {first} and {last}"


def change_sentence(change: Mapping[str, Any]) -> str:
    """What changed, how far, since when."""
    early, late = change["since_earliest"], change["since_latest"]
    how = "has been drifting since" if change["shape"] == "ramp" else "changed"
    when = _between(early, late)
    if change["shape"] == "step" and early == late:
        how, when = "has been outside the tolerance of the machine file from", f"the first recording, {early:%Y-%m-%d}"
    others = ", ".join(f"{quantity_words(a['quantity'])} {_sure(a['probability'])}" for a in change["alternatives"])
    return (
        f"{quantity_words(change['quantity'])} {how} {when}: "
        f"{_with_interval([change[k] for k in ('change', 'change_low', 'change_high')], change['unit'])}, "
        f"probability {_sure(change['probability'])}" + (f"; else {others}" if others else "")
    )


def _several(changes: Sequence[Mapping[str, Any]], level: Mapping[str, Any]) -> str:
    """Several changes of one quantity: when they began, and where it is now against the first recording."""
    early, late = (min(change[k] for change in changes) for k in ("since_earliest", "since_latest"))
    return (
        f"{quantity_words(level['quantity'])} has changed {len(changes)} times, "
        f"first {_between(early, late)}: "
        f"now {_with_interval([level[k] for k in ('level', 'level_low', 'level_high')], level['unit'])} against the first recording"
    )


def verdict_sentence(row: Row) -> str:
    """What the diagnosis of a raised recording said."""
    said = f"diagnosis of {row['recording']}: {row['verdict'].replace('_', ' ')}"
    if row.get("effect"):
        said += f", {effect_name(row['effect'])}"
        if row.get("size") is not None:
            said += f", {row['parameter']} {row['size']:.3g} {row['unit']}".rstrip(" -")
        if row.get("confidence") is not None:
            said += f" ({_sure(row['confidence'])})"
    return said


def sums(rows: Sequence[Row]) -> str:
    """The whole run in a line."""
    found = machines(rows)
    hours = sum(row.get("duration_s") or 0.0 for row in rows) / 3600
    seconds = sum((row.get("screen_processor_s") or 0.0) for row in rows)
    unjudged = sum(m.status == "not judged" for m in found)
    diagnosed = [row["diagnosis_processor_s"] for row in rows if row.get("diagnosis_processor_s")]
    return (
        f"{_number(len(found), 'machine')}, {_number(len(rows), 'recording')}, {hours:.2g} h{_screened(rows)}: "
        f"{sum(bool(m.changes) for m in found)} changed{f', {unjudged} not judged' if unjudged else ''}; "
        f"{_number(sum(bool(r.get('failure')) for r in rows), 'recording')} failed, "
        f"{sum(bool(r.get('refused')) for r in rows)} refused; processor time: screen {seconds:.0f} s "
        f"({seconds / hours if hours else 0:.0f} s a recorded hour), "
        f"{len(diagnosed)} diagnoses {sum(diagnosed):.0f} s"
    )


def _screened(rows: Sequence[Row]) -> str:
    """How much of the recordings was screened, where that is not all of them; the checks look at the whole."""
    seen = [(row["screened_s"], row["duration_s"]) for row in rows if row.get("screened_s")]
    screened, recorded = (sum(column) / 3600 for column in zip(*seen, strict=True)) if seen else (0.0, 0.0)
    if screened >= _WHOLE * recorded:
        return ""
    return f" (checked whole, screened {screened:.2g} h of {recorded:.2g}: the minutes in which the boom travels most)"


def unit_of(unit: str) -> tuple[str, float]:
    """The unit in which people think of a quantity, and the factor to it."""
    return _UNITS.get(unit, (unit, 1.0))
