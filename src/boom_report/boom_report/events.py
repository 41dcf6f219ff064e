"""Events of a recording: a few lines for the terminal, a table for the report."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from boom_recording.recording import Event
from boom_report.templates import render

SHOWN = 200
"""So many rows at most in the report; what is more is told as a number."""
_TOGETHER = 0.1  # s: the same interruption begins and ends a few samples apart on different topics


def summary(events: Sequence[Event]) -> list[str]:
    """One line for what happened at the same time on several topics; losses of all topics in one line."""
    lines = []
    lost = [e for e in events if e.kind == "loss"]
    groups: list[list[Event]] = []
    for event in events:
        if event.kind == "loss":
            continue
        for group in groups:
            first = group[0]
            near = abs(first.start_s - event.start_s) < _TOGETHER and abs(first.end_s - event.end_s) < _TOGETHER
            if first.kind == event.kind and near:
                group.append(event)
                break
        else:
            groups.append([event])
    for group in groups:
        first, topics = group[0], sorted({e.topic for e in group})
        at = (
            f"{first.start_s:.2f} s to {first.end_s:.2f} s"
            if first.end_s > first.start_s
            else f"at {first.start_s:.2f} s"
        )
        on = topics[0] if len(topics) == 1 else f"on {len(topics)} topics"
        lines.append(f"{first.kind} {at}, {on}: {first.detail}" if first.detail else f"{first.kind} {at}, {on}")
    if lost:
        on = lost[0].topic if len(lost) == 1 else f"on {len(lost)} topics"
        lines.append(f"loss of {sum(e.count for e in lost)} single samples, {on}")
    return lines


def section(events: Sequence[Event]) -> Markup:
    """HTML: the table of all events, or the sentence that there are none."""
    return render("boom_report/events.html", events=events, most=SHOWN)
