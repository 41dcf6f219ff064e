"""Small pictures as SVG text: lines over time, bars, calibration. No library, no script; they print and zoom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from math import isfinite

from markupsafe import Markup

KINDS = ("measured", "nominal", "explained")
"""Of lines; also the classes that give them their colours."""
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 440, 130, 52, 18


def lines(title: str, unit: str, factor: float, time: Sequence[float], series: Mapping[str, Sequence[float]]) -> Markup:
    """Series over time [s] in one panel; values times ``factor`` are [unit]. Values that are not finite are left out."""
    scaled = {name: [v * factor for v in values] for name, values in series.items()}
    finite = [v for v in scaled.get("measured", []) if isfinite(v)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    margin = 0.15 * (high - low or 1.0)
    low, high = low - margin, high + margin
    begin, end = time[0], max(time[-1], time[0] + 1e-9)

    def point(t: float, v: float) -> str:
        x = _LEFT + (t - begin) / (end - begin) * (_WIDTH - _LEFT - 6)
        y = 4 + (high - min(max(v, low), high)) / (high - low) * (_HEIGHT - _BOTTOM - 4)
        return f"{x:.1f},{y:.1f}"

    parts = [_frame(f"{title} [{unit}]", low, high, f"{begin:.0f}", f"{end:.0f} s")]
    for name, values in scaled.items():
        points = " ".join(point(t, v) for t, v in zip(time, values, strict=True) if isfinite(v))
        parts.append(f"<polyline points='{points}' class='line {escape(name)}'/>")
    return _svg(_WIDTH, _HEIGHT, "".join(parts), f"{title} over time")


def calibration(bins: Sequence[tuple[float, float, int]]) -> Markup:
    """Share right over stated confidence, dots as large as their number of cases; the line is what is meant."""
    size, edge = 260, 34
    span = size - 2 * edge

    def at(x: float, y: float) -> tuple[float, float]:
        return edge + x * span, size - edge - y * span

    (x0, y0), (x1, y1) = at(0, 0), at(1, 1)
    parts = [
        f"<rect x='{x0}' y='{y1}' width='{span}' height='{span}' class='frame'/>",
        f"<line x1='{x0}' y1='{y0}' x2='{x1}' y2='{y1}' class='ideal'/>",
        f"<text x='{size / 2}' y='{size - 8}' text-anchor='middle'>confidence stated</text>",
        f"<text x='12' y='{size / 2}' text-anchor='middle' transform='rotate(-90 12 {size / 2})'>share right</text>",
        f"<text x='{x0}' y='{y0 + 13}' text-anchor='middle'>0</text><text x='{x1}' y='{y0 + 13}' text-anchor='middle'>1</text>",
    ]
    for said, right, count in bins:
        x, y = at(said, right)
        parts.append(
            f"<circle cx='{x:.1f}' cy='{y:.1f}' r='{3 + min(count, 100) ** 0.5:.1f}' class='dot'><title>{count} cases: "
            f"said {said:.2f}, right {right:.2f}</title></circle>"
        )
    return _svg(size, size, "".join(parts), "share right over confidence")


def bars(groups: Sequence[tuple[str, Sequence[tuple[str, float]]]]) -> Markup:
    """Grouped bars of shares (0..1): (group, ((label, share), ...))."""
    width, height, base = 90 + 130 * len(groups), 220, 180
    parts = [f"<line x1='40' y1='{base}' x2='{width - 10}' y2='{base}' class='axis'/>"]
    for share in (0.25, 0.5, 0.75, 1.0):
        y = base - share * 150
        parts.append(
            f"<line x1='40' y1='{y}' x2='{width - 10}' y2='{y}' class='grid'/>"
            f"<text x='34' y='{y + 4}' text-anchor='end'>{share:.0%}</text>"
        )
    for k, (group, members) in enumerate(groups):
        for j, (label, share) in enumerate(members):
            x = 60 + 130 * k + 32 * j
            tall = share * 150
            parts.append(
                f"<rect x='{x}' y='{base - tall:.1f}' width='28' height='{tall:.1f}' class='share-{j % 3}'>"
                f"<title>{escape(label)}: {share:.0%}</title></rect>"
            )
        parts.append(f"<text x='{60 + 130 * k + 46}' y='{base + 16}' text-anchor='middle'>{escape(group)}</text>")
    for j, (label, _) in enumerate(groups[0][1] if groups else ()):
        parts.append(f"<rect x='{44 + 110 * j}' y='{base + 26}' width='10' height='10' class='share-{j % 3}'/>")
        parts.append(f"<text x='{58 + 110 * j}' y='{base + 35}'>{escape(label)}</text>")
    return _svg(max(width, 380), height, "".join(parts), "shares by detectability")


def _frame(title: str, low: float, high: float, begin: str, end: str) -> str:
    return (
        f"<rect x='{_LEFT}' y='4' width='{_WIDTH - _LEFT - 6}' height='{_HEIGHT - _BOTTOM - 4}' class='frame'/>"
        f"<text x='{_LEFT + 4}' y='15'>{escape(title)}</text>"
        f"<text x='{_LEFT - 4}' y='14' text-anchor='end'>{high:.3g}</text>"
        f"<text x='{_LEFT - 4}' y='{_HEIGHT - _BOTTOM}' text-anchor='end'>{low:.3g}</text>"
        f"<text x='{_LEFT}' y='{_HEIGHT - 4}'>{begin}</text><text x='{_WIDTH - 6}' y='{_HEIGHT - 4}' text-anchor='end'>{end}</text>"
    )


def _svg(width: float, height: float, body: str, label: str) -> Markup:
    return Markup(
        f"<svg viewBox='0 0 {width:g} {height:g}' width='{width:g}' role='img' aria-label='{escape(label)}' "
        f"xmlns='http://www.w3.org/2000/svg'>{body}</svg>"
    )
