"""Makes a mapping of what was found: what is sure is filled in, what is not is asked for, and each entry says why."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from boom_import import dynamics, units, words
from boom_import.candidates import (
    ANGLE,
    DIMENSION,
    EXTEND,
    HOSE,
    RATE,
    RETRACT,
    ROD,
    ColumnCandidate,
    candidates,
    name_evidence,
    ratio_columns,
    transmitters,
)
from boom_import.mapping import ASK, DERIVATIVE, NONE, Mapping, SignalMap
from boom_import.proposal import SURE, Found, find
from boom_import.source import Column, Source
from boom_import.timing import TimeChoice
from boom_input.shown import quoted

_PARTNER = {"extend_current_command": EXTEND, "retract_current_command": RETRACT, "reference_angle": ANGLE}
_NAMED, _ALIKE = 5.0, 0.6
_ABSOLUTE_WORDS, _GAUGE_WORDS = {"abs", "absolute", "absolut"}, {"gauge", "rel", "relative", "relativ", "ueberdruck"}


_VERTICAL = {
    "vertical",
    "vertikal",
    "vertikale",
    "vertikalen",
    "lot",
    "lotrecht",
    "senkrecht",
    "senkrechten",
    "plumb",
    "zenith",
}
_TRANSMITTED = {
    units.PRESSURE: "unit: bar, scale: bar per unit, offset: bar",
    units.ANGLE: "unit: deg, scale: degrees per unit, offset: degrees",
    units.RATE: "unit: deg/s, scale: degrees per second per unit, offset: degrees per second",
}
MOST_NAMED = 6
"""Columns that are left out, in a note."""


@dataclass
class Proposal:
    """A mapping with what an engineer wants to know about it.

    Attributes:
        mapping: the mapping; open entries are "ask".
        probability: signal -> of what it says.
        why: signal -> reasons in a few words.
        questions: signal -> one sentence on what is open.
        options: signal -> what it may be, most probable first, with the probability.
        notes: assumptions that somebody should look at.
    """

    mapping: Mapping
    probability: dict[str, float] = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)
    questions: dict[str, str] = field(default_factory=dict)
    options: dict[str, list[tuple[SignalMap | str, float]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def propose(source: Source, choice: TimeChoice | None = None, joint: str = "") -> Proposal:
    """The most probable mapping of a source."""
    found = find(source.columns, joint=joint)
    proposal = Proposal(Mapping(time=choice or TimeChoice(), joint=joint))
    for signal in found.choices:
        _decide(proposal, found, signal, source.columns)
    _ask_for_direction(proposal, found)
    _ask_for_reference(proposal, found)
    _add_optional(proposal, found, source.columns)
    _note(proposal, found)
    _note_unused(proposal, source.columns)
    return proposal


def _decide(proposal: Proposal, found: Found, signal: str, columns: list[Column]) -> None:
    choice = found.choices[signal]
    made = [(_entry(signal, candidate, found), p) for candidate, p in choice.options]
    best, probability = made[0]
    proposal.options[signal] = made
    proposal.probability[signal] = probability
    candidate = choice.best
    if question := _unit_question(candidate, signal, columns):
        proposal.questions[signal] = question
        best = ASK
    elif candidate is None and DIMENSION[signal] == units.PRESSURE and probability >= SURE:
        proposal.notes.append(f"no column is the {signal.replace('_', ' ')}: it counts as not recorded")
    elif candidate is None and signal != RATE:
        proposal.questions[signal] = "no column fits it" + _percent(signal, ratio_columns(columns))
        best = ASK
    elif probability < SURE:
        proposal.questions[signal] = "it may be " + _either(made)
        best = ASK
    proposal.mapping.signals[signal] = best
    proposal.why[signal] = _reasons(signal, candidate, found) if candidate is not None else ""


def _unit_question(best: ColumnCandidate | None, signal: str, columns: list[Column]) -> str:
    """What is open where the unit that a column has cannot be used as it stands, else empty."""
    if best is not None and units.is_unknown(best.column.unit):
        unit = quoted(best.column.unit, 30)
        return (
            f"'{quoted(best.column.key, 60)}' is in '{unit}', which is no unit that is known: "
            "give one that is, with scale and offset"
        )
    given = transmitters(columns, signal) if best is None and DIMENSION[signal] != units.CURRENT else []
    if not given:
        return ""
    return (
        f"'{quoted(given[0].key, 60)}' is in {quoted(given[0].unit, 10)}: if it is its transmitter, give it with "
        f"{_TRANSMITTED[DIMENSION[signal]]} (4 to 20 mA over R: scale R/16, offset -R/4)"
    )


def _percent(signal: str, ratios: list[Column]) -> str:
    """What to write where a command is in percent: how many amperes 100 % are is in no file."""
    if DIMENSION[signal] != units.CURRENT or not ratios:
        return ""
    column = ratios[0]
    part = ", part: positive or negative" if float(column.values.min()) < 0.0 else ""
    advice = f"if it drives the valve, give it with unit: A, scale: amperes per percent{part}"
    return f"; '{quoted(column.key, 60)}' is in percent: {advice}"


def _entry(signal: str, candidate: ColumnCandidate | None, found: Found) -> SignalMap | str:
    if candidate is None:
        return DERIVATIVE if signal == RATE else NONE
    sign = {ANGLE: found.angle_sign, RATE: found.rate_sign}.get(signal, 1.0)
    sign = -1.0 if candidate.part == "negative" else sign
    reference = reference_of(candidate)[0] if DIMENSION[signal] == units.PRESSURE else ""
    quarter = math.pi / 2 / units.BY_NAME[candidate.unit].factor
    offset = quarter if _from_vertical(signal, candidate) and sign < 0.0 else 0.0
    return SignalMap(
        candidate.column.key, candidate.unit, sign, candidate.scale, round(offset, 9), reference, candidate.part
    )


def _from_vertical(signal: str, candidate: ColumnCandidate) -> bool:
    """Of an angle that falls while the boom is lifted: whether its name says that it counts from the vertical."""
    return signal == ANGLE and not _VERTICAL.isdisjoint(words.tokens(candidate.column.name))


def _either(made: list[tuple[SignalMap | str, float]]) -> str:
    parts = []
    for entry, probability in made[:3]:
        if probability > 0.02:
            what = f"'{entry.column}' in {entry.unit}" if isinstance(entry, SignalMap) else entry
            parts.append(f"{what} ({100 * probability:.0f} %)")
    return " or ".join(parts)


def _reasons(signal: str, candidate: ColumnCandidate, found: Found) -> str:
    said = []
    if name_evidence(candidate.column, signal) >= 3.0:
        said.append("name")
    stated = units.parse(candidate.column.unit).measure
    if candidate.told:
        said.append("unit stated")
    elif stated is not None:
        said.append(f"stated in {stated.name or candidate.column.unit}, but its values fit {candidate.unit}")
    else:
        said.append(f"values fit {candidate.unit}")
    if signal in (EXTEND, RETRACT):
        said.append("precedes the motion")
    if signal == RATE:
        said.append("is the derivative of the angle")
    if signal in (HOSE, ROD):
        said.append("differs between lifting and lowering")
    if signal == ANGLE and found.angle_sign < 0:
        said.append("falls while the boom is lifted")
    return ", ".join(said)


def _ask_for_direction(proposal: Proposal, found: Found) -> None:
    if found.sign_probability >= SURE or proposal.mapping.signals[ANGLE] == ASK:
        return
    proposal.questions[ANGLE] = (
        f"whether it rises or falls while the boom is lifted cannot be told ({100 * found.sign_probability:.0f} % for sign "
        f"{found.angle_sign:+.0f}); the directions of the currents and the pressures follow from it"
    )
    best = proposal.mapping.signals[ANGLE]
    assert isinstance(best, SignalMap)
    turned = replace(best, sign=-best.sign)
    proposal.options[ANGLE] = [(best, found.sign_probability), (turned, 1.0 - found.sign_probability)]
    proposal.mapping.signals[ANGLE] = ASK


def reference_of(candidate: ColumnCandidate) -> tuple[str, float]:
    """Whether a pressure is gauge or absolute, and with which probability."""
    column = candidate.column
    stated = units.parse(column.unit).reference
    said = set(words.tokens(column.name))
    if stated:
        return stated, 0.99
    if said & _ABSOLUTE_WORDS or said & _GAUGE_WORDS:
        return ("absolute" if said & _ABSOLUTE_WORDS else "gauge"), 0.98
    # FluidPressure, also as a column that was exported, is absolute by definition; who writes another unit into it writes what
    # the transducer shows. Elsewhere pressures of hydraulics are gauge, as their transducers are: 0 in air.
    by_definition = (column.by_type or "fluid_pressure" in column.name) and candidate.unit == "Pa"
    gauge = 0.03 if by_definition else 0.95
    below = float(np.quantile(candidate.values, 0.001))
    if below < -2e4:  # no absolute pressure is negative, but for the transducer's offset
        gauge = gauge * 1000.0 / (gauge * 1000.0 + 1.0 - gauge)
    return ("gauge", gauge) if gauge >= 0.5 else ("absolute", 1.0 - gauge)


def _ask_for_reference(proposal: Proposal, found: Found) -> None:
    """One transducer's word holds for the other: both come from the same logger."""
    both = [
        (s, c) for s in (HOSE, ROD) if (c := found.choices[s].best) is not None and proposal.mapping.signals[s] != ASK
    ]
    judged = {signal: reference_of(candidate) for signal, candidate in both}
    if not judged:
        return
    reference, probability = max(judged.values(), key=lambda entry: entry[1])
    for signal, candidate in both:
        own, sure = judged[signal]
        if own == reference or sure < 0.98:
            own, sure = reference, probability
        entry = proposal.mapping.signals[signal]
        assert isinstance(entry, SignalMap)
        if sure < SURE:
            proposal.questions[signal] = (
                f"whether it is gauge or absolute cannot be told ({own} with {100 * sure:.0f} %)"
            )
        made = replace(entry, reference=ASK if sure < SURE else own)
        proposal.mapping.signals[signal] = made
        if SURE <= sure < 0.97:
            proposal.notes.append(
                f"'{quoted(candidate.column.key, 60)}' is taken as {own} pressure, as is usual; nothing in the file says so"
            )


def _add_optional(proposal: Proposal, found: Found, columns: list[Column]) -> None:
    used = {e.column for e in proposal.mapping.signals.values() if isinstance(e, SignalMap)}
    free = [c for c in columns if c.key not in used and float(np.ptp(c.values)) > 0.0]
    for signal in _PARTNER:
        partner = found.choices[_PARTNER[signal]].best
        named = [
            c
            for c in candidates(free, signal)
            if words.features(c.column.name).get("command", 0.0) >= 2.0 and not c.part
        ]
        if partner is None or not named or name_evidence(named[0].column, signal) < _NAMED:
            continue
        best = named[0]
        weight = [math.exp(c.score - best.score) for c in named]
        grid = dynamics.grid([best.column, partner.column])
        if grid is None or weight[0] / sum(weight) < SURE:
            continue
        a, b = grid.of(best.column, best.values), grid.of(partner.column, partner.values)
        alike = float(np.corrcoef(a, b)[0, 1]) if np.std(a) > 0 and np.std(b) > 0 else 0.0
        sign = found.angle_sign if signal == "reference_angle" else 1.0
        if alike >= _ALIKE:
            proposal.mapping.signals[signal] = SignalMap(best.column.key, best.unit, sign, best.scale)
            proposal.probability[signal] = weight[0] / sum(weight)
            proposal.why[signal] = f"name, follows {_PARTNER[signal].replace('_', ' ')}"
            free = [c for c in free if c.key != best.column.key]


def _note_unused(proposal: Proposal, columns: list[Column]) -> None:
    """A pump's pressure that nobody gives drives nothing."""
    used = {e.column for e in proposal.mapping.signals.values() if isinstance(e, SignalMap)}
    left = [c for c in columns if c.key not in used and float(np.ptp(c.values)) > 0.0]
    moving = [c.key for c in left]
    if moving:
        measures = [units.parse(c.unit).measure for c in left]
        pressure = any(m is not None and m.dimension == units.PRESSURE for m in measures)
        advice = "; pump and tank pressures drive the model: give them as supply_pressure, tank_pressure"
        said = ", ".join(f"'{quoted(key, 60)}'" for key in moving[:MOST_NAMED])
        more = f" and {len(moving) - MOST_NAMED} more" if len(moving) > MOST_NAMED else ""
        proposal.notes.append(f"not used: {said}{more}{advice if pressure else ''}")


def _note(proposal: Proposal, found: Found) -> None:
    notes = proposal.notes
    for signal in (EXTEND, RETRACT):
        best = found.choices[signal].best
        if best is not None and words.features(best.column.name).get("command", 0.0) >= 2.0:
            notes.append(
                f"{signal.replace('_', ' ')}: there is no measured current; the command '{quoted(best.column.key, 60)}' is taken"
            )
    angle = found.choices[ANGLE].best
    if angle is not None and found.angle_sign < 0 and _from_vertical(ANGLE, angle):
        notes.append(
            "the angle counts from the vertical, as its name says: it is turned by 90 degrees, as 0 is horizontal"
        )
    elif angle is not None and found.angle_sign < 0:
        notes.append(
            "the angle falls while the boom is lifted: its sign is turned, and its 0 taken for horizontal; "
            "if it counts from the vertical, give it with offset: 90 degrees in its unit"
        )
    rate = proposal.mapping.signals[RATE]
    if rate == DERIVATIVE:
        notes.append("no column is the angular rate: the derivative of the angle is taken, smoothed over 0.1 s")
    elif isinstance(rate, SignalMap) and found.rate_sign < 0.0 < found.angle_sign:
        notes.append("the rate counts against the angle in the file: its sign is turned")
    proposal.notes = list(dict.fromkeys(notes))
