"""Events of a recording: a few lines for the terminal, a table for the report."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from boom_recording.recording import Event

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


def section(events: Sequence[Event]) -> str:
    """HTML: the table of all events, or the sentence that there are none."""
    if not events:
        return "<p>No gaps, lost samples or sensor faults were found in this recording.</p>"
    rows = "".join(
        f"<tr><td>{escape(str(e.kind)).replace('_', ' ')}</td><td><code>{escape(e.topic)}</code></td><td "
        f"class=n>{e.start_s:.2f}</td>"
        f"<td class=n>{e.end_s:.2f}</td><td class=n>{e.count}</td><td>{escape(e.detail)}</td></tr>"
        for e in events[:SHOWN]
    )
    more = (
        f"<p>And {len(events) - SHOWN} more, in the document of <code>--json</code>.</p>" if len(events) > SHOWN else ""
    )
    return (
        "<div class=scroll><table><thead><tr><th>event</th><th>topic</th><th class=n>from [s]</th><th class=n>to "
        "[s]</th>"
        f"<th class=n>samples</th><th>what</th></tr></thead><tbody>{rows}</tbody></table></div>{more}"
        "<p class=note>Affected samples are masked: they are not interpolated over and count in no number. A free "
        "run does "
        "not cross a gap in the currents, it starts again behind it.</p>"
    )
