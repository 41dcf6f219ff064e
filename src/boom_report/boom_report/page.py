"""What all reports share: one page that needs no network, and charts that are drawn when they come into view."""

from __future__ import annotations

import json
import re
from collections import Counter
from functools import cache
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from boom_report import palette
from boom_report.packing import compressed, deflated, stepped
from boom_report.templates import render

# In names and charts every "<" is escaped: what begins with one is an element.
_ID = re.compile(r"<[a-z][^<>]*? id=['\"]?([^'\" >]+)")
CHARTS = ("vendor/plotly-cartesian.min.js",)
"""What draws charts."""


def page(
    heading: str, body: str, styles: tuple[str, ...] = ("report.css",), libraries: tuple[str, ...] = CHARTS
) -> str:
    """A whole HTML page.

    Args:
        heading: its title, as plain text.
        body: HTML inside ``main``.
        styles: style sheets of this package that it takes, in order.
        libraries: scripts of this package that it takes, in order.
    """
    _only_once(body)
    return render(
        "boom_report/page.html",
        heading=heading,
        body=Markup(body),
        style=style(styles),
        dark=Markup(json.dumps(palette.DARK)),
        notice=notice(),
        libraries=[library(name) for name in libraries],
        script=own(("packing.js", "report.js")),
    )


def style(sheets: tuple[str, ...] = ("report.css",)) -> Markup:
    """The text of style sheets of this package, with the colours that they name."""
    return Markup(palette.style()) + own(sheets)


def own(names: tuple[str, ...]) -> Markup:
    """Files of this package, one behind the other."""
    folder = files("boom_report")
    return Markup("".join(folder.joinpath(name).read_text("utf-8") for name in names))


@cache
def library(name: str) -> Markup:
    """A script of this package, deflated: the charts' alone would be half of what a mail takes."""
    return Markup(deflated(own((name,))))


def notice() -> Markup:
    """The licences of the libraries, as a comment."""
    return Markup("<!--\n{}-->").format(own(("vendor/LICENSES.txt",)))


def chart(figure: dict[str, Any]) -> Markup:
    """HTML of a chart: its place, and right behind it its data.

    Args:
        figure: ``data`` and ``layout`` as plotly.js takes them, with a height in the layout.
    """
    return Markup(
        f"<div class=figure style='min-height:{figure['layout']['height']}px'></div>"
        f"<script type='text/plain' class=chart>{compressed(stepped(figure))}</script>"
    )


def _only_once(body: str) -> None:
    """A link leads to the first element of its name, a second one is never found."""
    ids = Counter(_ID.findall(body))
    assert set(ids.values()) <= {1}, (
        f"ids that are not unique on the page: {[name for name, n in ids.items() if n > 1]}"
    )
