"""Colours of all reports: each stands for one thing, on a light ground, and with a counterpart on a dark one.

Charts are made with the light colour; `report.js` puts the counterparts in their place on a dark screen. Paper is always light.
Text and drawings take them as CSS variables, ``--model`` for `MODEL`.
"""

from __future__ import annotations

_OF_THING: dict[str, tuple[str, str]] = {
    "ground": ("#f3f5f7", "#11151a"), "paper": ("#ffffff", "#1a2027"), "plot": ("#fbfcfd", "#161b21"),
    "ink": ("#1f2933", "#e2e8ee"), "quiet": ("#5b6570", "#9fabb7"), "line": ("#dde3e8", "#313a44"), "grid": ("#e4e8ec", "#2a323b"),
    "axis": ("#c9d0d6", "#46515d"), "veil": ("rgba(255,255,255,0.8)", "rgba(26,32,39,0.8)"),
    "good": ("#1d6b34", "#77d493"), "good-ground": ("#e3f2e6", "#17321f"),
    "bad": ("#b3261e", "#ff9a90"), "bad-ground": ("#fdf0ef", "#3c1d1b"),
    "warn": ("#8a5a00", "#efbf68"), "warn-ground": ("#fff8e8", "#362a12"), "warn-edge": ("#d79a1d", "#b5821f"),
    "bar": ("#4a5560", "#b4bfca"), "track": ("#e3e8ed", "#2f3842"), "pale": ("#9aa7b4", "#66727f"),
    "model": ("#1257a6", "#6cb2ff"), "model-band": ("rgba(18,87,166,0.16)", "rgba(108,178,255,0.22)"),
    "other": ("#d9720a", "#ffa14d"), "between": ("#8a63b8", "#c3a2ee"), "measured": ("#a3a9b3", "#8b95a1"),
    "retract": ("#7a3e9d", "#c792ea"), "extend": ("#0b8a74", "#4fd1b5"), "error": ("#8c5a2b", "#d9a066"),
    "outer-boom": ("#1b7f5c", "#58c79c"), "telescope": ("#b0467c", "#ea8fbd"), "slewing": ("#6b6f1d", "#c5c95f"),
    "noise": ("rgba(46,133,64,0.16)", "rgba(119,212,147,0.18)"), "noise-edge": ("rgba(46,133,64,0.55)", "rgba(119,212,147,0.6)"),
    "event": ("rgba(214,69,65,0.13)", "rgba(255,120,110,0.18)"), "event-edge": ("rgba(190,40,40,0.55)", "rgba(255,120,110,0.6)"),
    "window": ("rgba(240,173,32,0.20)", "rgba(240,173,32,0.22)"), "window-edge": ("rgba(190,130,10,0.45)", "rgba(240,190,80,0.5)"),
    "held-out": ("rgba(91,101,112,0.07)", "rgba(159,171,183,0.10)"),
    "held-out-edge": ("rgba(91,101,112,0.40)", "rgba(159,171,183,0.45)"),
    "stable": ("#9ccca6", "#3f7d4e"), "unstable": ("#e6b0ac", "#8f4640"),
    "below-2": ("#5e3c99", "#b79cf0"), "below-1": ("#b2abd2", "#5d4e80"), "zero": ("#f1f1f1", "#20262d"),
    "above-1": ("#fdb863", "#8a5a1c"), "above-2": ("#e66101", "#ff9f40"),
    "heat-0": ("#fffffe", "#1a2028"), "heat-0-edge": ("#8793a0", "#7f8b98"), "heat-1": ("#fff3cf", "#3d3417"),
    "heat-1-edge": ("#b98a14", "#d0a93f"), "heat-2": ("#ffd98a", "#5c4315"), "heat-2-edge": ("#b36b00", "#e9a33c"),
    "heat-3": ("#f7a04b", "#8a4713"), "heat-3-edge": ("#a84300", "#ffae6b"), "heat-4": ("#e2533f", "#b3261e"),
    "heat-4-edge": ("#8f1d12", "#ff9a90"),
}  # fmt: skip
DARK = dict(_OF_THING.values())
"""Light colour -> its counterpart on a dark screen."""


def light(thing: str) -> str:
    """The colour of a thing on a light ground."""
    return _OF_THING[thing][0]


PAPER, PLOT, INK, QUIET, GRID, AXIS, VEIL = map(light, ("paper", "plot", "ink", "quiet", "grid", "axis", "veil"))
RED = light("bad")
MODEL, MODEL_BAND = light("model"), light("model-band")
"""The model that is judged: full, explained, fitted. Nothing else is blue."""
OTHER = light("other")
"""The model beside it: reduced, before."""
BETWEEN, MEASURED, ERROR = light("between"), light("measured"), light("error")
RETRACT, EXTEND = light("retract"), light("extend")
JOINT_COLOURS = {name: light(name.replace("_", "-")) for name in ("outer_boom", "telescope", "slewing")}
NOISE, NOISE_EDGE = light("noise"), light("noise-edge")
EVENT, EVENT_EDGE = light("event"), light("event-edge")
WINDOW, WINDOW_EDGE = light("window"), light("window-edge")
HELD_OUT, HELD_OUT_EDGE = light("held-out"), light("held-out-edge")
DIVERGING = [
    [0, light("below-2")], [0.25, light("below-1")], [0.42, light("zero")], [0.58, light("zero")], [0.75, light("above-1")],
    [1, light("above-2")],
]  # fmt: skip
"""From negative to positive; safe for those who do not tell red from green."""
STABILITY = [[0, light("unstable")], [1, light("stable")]]
LAWS = (OTHER, RETRACT, EXTEND, RED, ERROR, QUIET)
"""Control laws, in their order."""
FONT = {"family": "system-ui, 'Segoe UI', Roboto, Arial, sans-serif", "size": 12, "color": INK}


def variable(colour: str) -> str:
    """The CSS variable of a light colour, for text in it: readable on either ground."""
    return next(f"var(--{thing})" for thing, (own, _) in _OF_THING.items() if own == colour)


def style() -> str:
    """The colours as CSS variables, light, and dark for a screen that is."""
    sides = (" ".join(f"--{thing}: {pair[k]};" for thing, pair in _OF_THING.items()) for k in (0, 1))
    light_side, dark_side = sides
    return (
        f":root {{ color-scheme: light; {light_side} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ color-scheme: dark; {dark_side} }} }}\n"
    )
