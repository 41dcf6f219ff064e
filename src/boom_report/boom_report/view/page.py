"""The page of the moving crane: of a recording, whole in one file, or live, fed by a stream; and its place in a report."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from boom_report.packing import compressed
from boom_report.page import library, notice, own, style
from boom_report.templates import render
from boom_report.view.series import Series, shown

LIBRARIES = (
    "vendor/three.min.js", "vendor/uplot.min.js", "view/data.js", "view/crane3d.js", "view/scheme.js", "view/plots.js",
    "view/player.js",
)  # fmt: skip
"""Scripts of a moving crane."""
REPLAY = (*LIBRARIES, "view/replay.js")
STYLES = ("vendor/uplot.min.css", "scheme.css", "view/view.css", "view/dark.css")


def recording_page(scene: dict[str, Any], series: Series, said: str) -> str:
    """The page of a recording; it needs no server and no network.

    Args:
        scene: as ``boom_report.view.scene.scene`` gives it.
        series: what is shown.
        said: one line below the heading.
    """
    heading = f"{series.name} on {scene['machine']}"
    return _page(heading, said, REPLAY, "playReplay", replay=stage(scene, series), live=False)


def live_page() -> str:
    """The page of a running machine: scene and samples come as server-sent events from ``stream`` beside it."""
    said = "Waiting for the program behind this page."
    return _page("Crane, live", said, (*LIBRARIES, "view/live.js"), "playLive", replay=_stage(), live=True)


def stage(scene: dict[str, Any], series: Series) -> Markup:
    """A moving crane with the data that it shows; at most one on a page."""
    replay = compressed({"scene": complete(scene), "series": series.document()})
    return _stage() + Markup("<script type='text/plain' id=replay>{}</script>").format(replay)


def complete(scene: dict[str, Any]) -> dict[str, Any]:
    """The scene with the names of the channels."""
    return scene | {"channels": shown()}


def _stage() -> Markup:
    return render("boom_report/view/stage.html")


def _page(heading: str, said: str, libraries: tuple[str, ...], start: str, *, replay: Markup, live: bool) -> str:
    return render(
        "boom_report/view/view.html",
        heading=heading,
        said=said,
        live=live,
        style=style(("report.css", *STYLES)),
        stage=replay,
        notice=notice(),
        libraries=[library(name) for name in libraries],
        script=own(("packing.js",)),
        start=start,
    )
