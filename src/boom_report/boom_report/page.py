"""What all reports share: one page that needs no network, and charts that are drawn when they come into view."""

from __future__ import annotations

import json
import re
from collections import Counter
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from boom_report.templates import render

# In names and charts every "<" is escaped: what begins with one is an element.
_ID = re.compile(r"<[a-z][^<>]*? id=['\"]?([^'\" >]+)")
_CLOUD = "https://cloud.plotly.com/newchart"


def page(heading: str, body: str, styles: tuple[str, ...] = ("report.css",)) -> str:
    """A whole HTML page.

    Args:
        heading: its title, as plain text.
        body: HTML inside ``main``.
        styles: style sheets of this package that it takes, in order.
    """
    _only_once(body)
    from plotly.offline import get_plotlyjs  # half a second, which only a report costs

    # The library can send a chart to its maker's server; report.js switches that off, and there is no address either.
    plotly = get_plotlyjs().replace(_CLOUD, "")
    own = files("boom_report")
    return render(
        "boom_report/page.html",
        heading=heading,
        body=Markup(body),
        style=Markup("".join(own.joinpath(name).read_text("utf-8") for name in styles)),
        plotly=Markup(plotly),
        script=Markup(own.joinpath("report.js").read_text("utf-8")),
    )


def chart(figure: dict[str, Any]) -> Markup:
    """HTML of a chart: its place, and right behind it its data.

    Args:
        figure: ``data`` and ``layout`` as plotly.js takes them, with a height in the layout.
    """
    # "<" would end the script element wherever a name holds "</script>".
    spec = json.dumps(figure, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return Markup(
        f"<div class=figure style='min-height:{figure['layout']['height']}px'></div>"
        f"<script type='application/json'>{spec}</script>"
    )


def _only_once(body: str) -> None:
    """A link leads to the first element of its name, a second one is never found."""
    ids = Counter(_ID.findall(body))
    assert set(ids.values()) <= {1}, (
        f"ids that are not unique on the page: {[name for name, n in ids.items() if n > 1]}"
    )
