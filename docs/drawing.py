"""Boxes, arrows and lines as SVG that stands alone and follows a dark screen; the colours are those of the reports."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

from boom_report import palette

_STYLE = """
text { font: 13px system-ui, "Segoe UI", Roboto, Arial, sans-serif; fill: var(--ink); }
.small { font-size: 11px; fill: var(--quiet); } .title { font-weight: 600; } .middle { text-anchor: middle; }
.box { fill: var(--paper); stroke: var(--axis); stroke-width: 1.3; } .strong { stroke: var(--ink); stroke-width: 1.8; }
.soft { fill: var(--plot); stroke: var(--grid); } .arrow { fill: none; stroke: var(--quiet); stroke-width: 1.4; }
.tip { fill: var(--quiet); } .ground { fill: var(--ground); } .curve { fill: none; stroke-width: 1.6; stroke-linejoin: round; }
.measured { stroke: var(--measured); stroke-width: 3; } .other { stroke: var(--other); } .model { stroke: var(--model); }
"""
Point = tuple[float, float]


class Drawing:
    """A picture of a fixed size [px]."""

    def __init__(self, width: float, height: float, said: str) -> None:
        self.width, self.height, self.said = width, height, said
        self.parts: list[str] = []

    def box(
        self, x: float, y: float, w: float, h: float, title: str, lines: Sequence[str] = (), kind: str = ""
    ) -> None:
        """A box with a title and small lines below it, all centred."""
        self.parts.append(f'<rect class="box {kind}" x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="7"/>')
        top = y + h / 2 + 4.5 - 7.5 * len(lines)
        self.text(x + w / 2, top, title, "title middle")
        for k, line in enumerate(lines):
            self.text(x + w / 2, top + 16 + 15 * k, line, "small middle")

    def text(self, x: float, y: float, text: str, kind: str = "") -> None:
        """One line of text with its foot at y."""
        self.parts.append(f'<text class="{kind}" x="{x:g}" y="{y:g}">{html.escape(text)}</text>')

    def arrow(self, *points: Point, label: str = "", at: Point | None = None, kind: str = "small middle") -> None:
        """Straight pieces through the points, a tip at the last one; the label beside the middle of the first piece, or `at`."""
        path = "M" + " L".join(f"{x:g} {y:g}" for x, y in points)
        self.parts.append(f'<path class="arrow" d="{path}" marker-end="url(#tip)"/>')
        if label:
            (x0, y0), (x1, y1) = points[0], points[1]
            x, y = at or ((x0 + x1) / 2, (y0 + y1) / 2 - 6)
            self.text(x, y, label, kind)

    def curve(self, points: Sequence[Point], kind: str) -> None:
        """A line through many points."""
        self.parts.append(
            f'<polyline class="curve {kind}" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}"/>'
        )

    def svg(self, style: str = "") -> str:
        """The whole file."""
        tip = '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto-start-reverse">'
        return alone(
            f'<svg viewBox="0 0 {self.width:g} {self.height:g}" width="{self.width:g}" role="img" '
            f'aria-label="{html.escape(self.said)}"><defs>{tip}<path class="tip" d="M0 0L8 4L0 8z"/></marker></defs>'
            f'<rect class="ground" width="{self.width:g}" height="{self.height:g}" rx="8"/>{"".join(self.parts)}</svg>',
            _STYLE + style,
        )


def alone(svg: str, style: str) -> str:
    """Makes a file of an SVG element of a page: a name space, quoted attributes, and the colours that it uses."""
    quoted = re.sub(r"<[^>]+>", lambda tag: re.sub(r'(\s[\w:-]+)=([^\'"\s/>]+)', r'\1="\2"', tag[0]), svg)
    named = set(re.findall(r"var\(--([\w-]+)\)", style + svg))
    colours = re.sub(r"--([\w-]+): [^;]+; ?", lambda entry: entry[0] if entry[1] in named else "", palette.style())
    return quoted.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1).replace(
        ">", f"><style>{colours}{style}</style>", 1
    ).rstrip() + "\n"  # fmt: skip
