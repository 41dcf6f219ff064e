"""Asks on a terminal for what an import cannot tell."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from boom_bringup.cli import UsageError
from boom_bringup.showing import asked

if TYPE_CHECKING:
    from boom_import.assembly import Proposal


def ask(proposal: Proposal) -> None:
    """Settle every question of a proposal. Raises UsageError where an answer is missing."""
    from boom_import import mapping as mappings
    from boom_import.mapping import ASK, NONE, SignalMap

    signals = proposal.mapping.signals
    for signal in [name for name in signals if name in proposal.questions]:
        print(f"\n{signal.replace('_', ' ')}: {proposal.questions[signal]}")
        given = signals[signal]
        if isinstance(given, SignalMap) and given.reference == ASK:
            chosen = _choice(["gauge (0 in air)", "absolute (about 1 bar in air)"])
            signals[signal] = replace(given, reference=("gauge", "absolute")[chosen])
            continue
        options = [
            entry for entry, probability in proposal.options.get(signal, []) if probability > 0.005 and entry != NONE
        ]
        chosen = _choice([*(mappings.entry_text(entry) for entry in options), "none of these: there is no such column"])
        signals[signal] = options[chosen] if chosen < len(options) else NONE
    proposal.questions.clear()


def _choice(texts: list[str]) -> int:
    for number, text in enumerate(texts, 1):
        print(f"  {number}  {text}")
    for _ in range(5):
        try:
            answer = asked(f"which? [1-{len(texts)}] ")
        except EOFError:
            break
        if answer.isdigit() and 1 <= int(answer) <= len(texts):
            return int(answer) - 1
    raise UsageError("no answer: edit the mapping file and give it with --mapping")
