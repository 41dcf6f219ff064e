"""The hydraulic scheme as inline SVG: the twelve subsystems of the contract, each coloured by the evidence against it.

Drawn in a frame of 556 x 606, which is legible on a phone: pump and supply at the bottom, pilot and main valve,
hose with accumulators, hose burst valve, cylinder, four-bar linkage, boom and load on top.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from boom_diagnosis.document import SUBSYSTEMS
from boom_model.catalogue import SUBSYSTEM_NAMES
from boom_report.diagnosis.words import probability

_STEPS = ((0.05, "#ffffff", "#8793a0"), (0.2, "#fff3cf", "#b98a14"), (0.5, "#ffd98a", "#b36b00"),
          (0.8, "#f7a04b", "#a84300"), (1.01, "#e2533f", "#8f1d12"))  # fmt: skip
"""Upper limit of the probability, fill, edge. Lightness falls with evidence, so that it survives a black and white print."""


def colours(value: float) -> tuple[str, str]:
    """Fill and edge for a probability."""
    return next((fill, edge) for limit, fill, edge in _STEPS if value < limit)


def scheme(subsystems: Mapping[str, float]) -> str:
    """The drawing, coloured by the probability that something is wrong in each subsystem (missing: zero)."""
    p = {name: min(max(float(subsystems.get(name, 0.0)), 0.0), 1.0) for name in SUBSYSTEMS}
    order = sorted(SUBSYSTEMS, key=lambda name: p[name])  # what is in doubt lies on top
    parts = "".join(_group(name, p[name]) for name in order)
    said = ", ".join(f"{SUBSYSTEM_NAMES[n]} {probability(p[n])}" for n in reversed(order) if p[n] >= _STEPS[0][0])
    return (
        f"<figure class=scheme><svg viewBox='30 48 556 606' role=img aria-label='Hydraulic scheme. "
        f"{escape(said or 'No subsystem is in doubt', quote=True)}.'>{_LINES}{parts}</svg>{legend()}</figure>"
    )


def legend() -> str:
    """What the colours mean."""
    names = ("below 0.05", "to 0.2", "to 0.5", "to 0.8", "above 0.8")
    entries = "".join(
        f"<span><i style='background:{fill};border-color:{edge}'></i>{name}</span>"
        for (_, fill, edge), name in zip(_STEPS, names, strict=True)
    )
    return f"<figcaption class=keys><b>probability that something is wrong here</b>{entries}</figcaption>"


def _group(name: str, value: float) -> str:
    fill, edge = colours(value)
    doubted = value >= _STEPS[0][0]
    x, y, anchor = _LABELS[name]
    label = SUBSYSTEM_NAMES[name] if name != "structure" else "boom"
    weight = " class=doubted" if doubted else ""
    number = f"<tspan dx=6 class=number>{probability(value)}</tspan>" if doubted else ""
    return (
        f"<g id='scheme-{name}' class=part style='--fill:{fill};--edge:{edge};--w:{3 if doubted else 1.8}'>"
        f"<title>{SUBSYSTEM_NAMES[name]}: {probability(value)}</title>{_SHAPES[name]}"
        f"<text x={x} y={y} text-anchor={anchor}{weight}>{label}{number}</text></g>"
    )


# Pipes: head side (left), rod side (right), pressure, return, and the dashed pilot and current lines.
_LINES = (
    "<g class=pipes><path d='M206 372V404M206 446V520H262V538M230 268H470V520H352V538'/>"
    "<path d='M206 482H64M64 482V470M132 482V470'/><path d='M286 588V604M286 632V640'/>"
    "<path d='M330 588V618'/></g>"
    "<g class=ground><path d='M70 300H134M78 300l-8 9M92 300l-8 9M106 300l-8 9M120 300l-8 9M134 300l-8 9'/></g>"
)

_SHAPES = {
    # pivot post, four-bar linkage and boom with its arm
    "structure": (
        "<path class=body d='M96 300V196l14-10 14 10v104z'/>"
        "<path class=body d='M102 190 118 172 392 62l20 14-8 20L126 202z'/>"
        "<path class=body d='M396 66 414 66 506 130 500 142 398 88z'/>"
        "<path class=link d='M112 258 206 212M206 212 250 144'/>"
        "<circle class=pin cx=112 cy=188 r=7 /><circle class=pin cx=404 cy=78 r=6 /><circle class=pin cx=112 cy=258 r=5 />"
        "<circle class=pin cx=250 cy=144 r=5 />"
    ),
    "load": (
        "<path class=link d='M503 136V172'/><path class=body d='M462 172h82a12 15 0 0 1 0 30h-82a12 15 0 0 1 0-30z'/>"
        "<ellipse class=pin cx=544 cy=187 rx=9 ry=15 />"
    ),
    # barrel and rod; the chambers are the oil's
    "cylinder": (
        "<rect class=body x=200 y=212 width=12 height=96 /><rect class=shell x=182 y=252 width=48 height=122 rx=3 />"
        "<circle class=pin cx=206 cy=212 r=6 />"
    ),
    "oil": "<rect class=body x=186 y=322 width=40 height=48 /><rect class=body x=186 y=256 width=12 height=46 />"
    "<rect class=body x=214 y=256 width=12 height=46 />",
    "friction": (
        "<rect class=body x=184 y=302 width=44 height=18 />"
        "<path class=link d='M188 318l8-14M198 318l8-14M208 318l8-14M218 318l8-14'/>"
    ),
    "hose_burst_valve": (
        "<rect class=body x=178 y=404 width=56 height=42 rx=3 /><path class=link d='M206 410v10M196 420h20l-10 13zM195 434h22'/>"
        "<path class=link d='M222 412l5 4-10 4 10 4-10 4 5 4'/>"
    ),
    "accumulators": (
        "<rect class=body x=46 y=404 width=36 height=58 rx=18 />"
        "<path class=link d='M46 433h36M54 474l10-6 10 6M54 464l10 6 10-6'/>"
        "<rect class=body x=114 y=404 width=36 height=58 rx=18 />"
        "<path class=link d='M114 433h36M122 474l10-6 10 6M122 464l10 6 10-6'/>"
    ),
    "main_valve": (
        "<rect class=body x=230 y=538 width=154 height=50 rx=2 /><path class=link d='M281 538v50M333 538v50'/>"
        "<path class=link d='M246 584V544m-5 8 5-8 5 8M266 542v40m-5-8 5 8 5-8'/>"
        "<path class=link d='M294 546v8m-5 0h10M320 546v8m-5 0h10M294 580v-8m-5 0h10M320 580v-8m-5 0h10'/>"
        "<path class=link d='M344 584 372 544m-9 3 9-3v9M344 542l28 40m0-9v9l-9-3'/>"
    ),
    "pilot_valves": (
        "<rect class=body x=186 y=548 width=44 height=30 rx=2 /><path class=link d='M190 578l18-30'/>"
        "<rect class=body x=384 y=548 width=44 height=30 rx=2 /><path class=link d='M410 578l14-30'/>"
        "<path class=pilot d='M186 563H160M428 563H456'/>"
    ),
    "supply": (
        "<rect class=body x=262 y=600 width=48 height=18 rx=2 /><path class=link d='M272 616l24-14m-8 0h8v6'/>"
        "<circle class=body cx=286 cy=634 r=14 /><path class=solid d='M279 630 286 622 293 630z'/>"
    ),
    "return_line": "<path class=link d='M330 588v34'/><path class=tank d='M312 620v20h36v-20'/>",
    "sensors": (
        "<g><circle class=body cx=168 cy=500 r=13 /><path class=link d='M181 500h25M168 500l7-7'/></g>"
        "<g><circle class=body cx=432 cy=380 r=13 /><path class=link d='M445 380h25M432 380l7-7'/></g>"
        "<g><path class=body d='M322 98l14-14 14 14-14 14z'/></g>"
    ),
}

# Where the name is written: x, y, anchor.
_LABELS = {
    "structure": (240, 78, "middle"), "load": (503, 226, "middle"), "cylinder": (246, 350, "start"),
    "oil": (172, 350, "end"), "friction": (246, 317, "start"), "hose_burst_valve": (246, 431, "start"),
    "accumulators": (98, 394, "middle"), "main_valve": (392, 606, "start"), "pilot_valves": (244, 603, "end"),
    "supply": (258, 636, "end"), "return_line": (360, 638, "start"), "sensors": (412, 386, "end"),
}  # fmt: skip
