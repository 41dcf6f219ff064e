"""Section ``kinematics`` of a drafted machine file: a triangle of lengths or of the pins of a drawing, or a four-bar linkage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import SimpleNamespace

import casadi as ca
import numpy as np

from boom_model.components.four_bar_linkage import piston_position
from boom_model.errors import MachineError
from boom_model.owner.entry import Entry
from boom_model.owner.questions import BY_KEY

PIN, ANGLE = {"abs": 0.01}, {"abs": 0.035}
"""Tolerances: 1 cm, 2 deg."""
UNUSED = 0.05
"""Share of the stroke that a linkage may leave unused at the retracted end."""
WITHIN = 0.999
"""Share of the range that is used: at its very end a linkage has no lever."""


def linkage(word: str, n: Mapping[str, float]) -> tuple[str, list[Entry]]:
    """Type of the linkage and its numbers.

    Args:
        word: answer to ``linkage``.
        n: answers by key, in the units of the questions.

    Raises:
        MachineError: no such linkage closes.
    """
    if n["stroke"] >= n["closed_length"]:
        raise MachineError(
            f"stroke: {n['stroke']:g} m is not possible in a cylinder that is {n['closed_length']:g} m long retracted, pin to pin "
            "(closed_length): measure both again"
        )
    through_bars = {"four_bar": _four_bar}.get(word)
    return (word, through_bars(n)) if through_bars else ("triangle", _triangle(word, n))


def _triangle(word: str, n: Mapping[str, float]) -> list[Entry]:
    """a^2 + b^2 - 2 a b cos(q_2 + phi_0) = (l_min + s_p)^2; of lengths with the cylinder retracted at the lowest angle."""
    pins = word == "pins"
    a = math.hypot(n["foot_x"], n["foot_y"]) if pins else n["foot_distance"]
    b = math.hypot(n["eye_x"], n["eye_y"]) if pins else n["eye_distance"]
    closed = n["closed_length"]

    def between(length: float) -> float:
        """Angle between a and b [rad]; NaN: no such triangle."""
        cosine = (a * a + b * b - length * length) / (2 * a * b) if a and b else math.nan
        return math.acos(cosine) if abs(cosine) <= 1.0 else math.nan

    begin, end = between(closed), between(min(closed + n["stroke"], WITHIN * (a + b)))
    if not (math.isfinite(begin) and math.isfinite(end) and end > begin):
        raise MachineError(
            f"closed_length: with pins {a:g} m and {b:g} m from the boom joint, the cylinder is {abs(a - b):.3f} .. {a + b:.3f} m "
            f"long, not {closed:g} m: measure the three lengths again"
        )
    if pins:
        turned = math.atan2(n["eye_y"], n["eye_x"]) - math.atan2(n["foot_y"], n["foot_x"])
        low = math.remainder(begin - turned, 2 * math.pi)
        _plausible(low)
    else:
        low = math.radians(n["lowest_angle"])
    phi = begin - low
    source = ("foot_x", "eye_x") if pins else ("foot_distance", "eye_distance")
    why = "between the lines to the pins, boom level" if pins else "from the lowest angle, 2 deg"
    return [
        Entry("a", a, "m", source[0], PIN),
        Entry("b", b, "m", source[1], PIN),
        Entry("phi0", phi, "rad", "derived", ANGLE, why),
        Entry("q2_stroke_min", low, "rad", "derived" if pins else "lowest_angle", None, "cylinder retracted"),
        Entry("q2_max", low + WITHIN * (end - begin), "rad", "derived", None, "cylinder extended"),
    ]


def _four_bar(n: Mapping[str, float]) -> list[Entry]:
    """Its pins and bars as they stand; the range of the boom is where the cylinder is between its ends and lifts."""
    pins = {
        key: [n[f"{word}_x"], n[f"{word}_y"]] for key, word in (("foot", "foot"), ("pivot", "pivot"), ("att", "eye"))
    }
    p = SimpleNamespace(
        kinematics=SimpleNamespace(**pins, L1=n["long_bar"], L2=n["short_bar"]),
        cylinder=SimpleNamespace(l_min=n["closed_length"]),
    )
    angles = np.linspace(-2 * math.pi, 2 * math.pi, 14_401)
    stroke = np.asarray(piston_position(ca.DM(angles), p)).ravel()
    with np.errstate(invalid="ignore"):
        lifts = (np.gradient(stroke) > 0.0) & (stroke >= 0.0) & (stroke <= n["stroke"])
    edges = np.flatnonzero(np.diff(np.concatenate(([False], lifts, [False])).astype(int))).reshape(-1, 2)
    begin, end = max(edges.tolist(), key=lambda run: run[1] - run[0], default=(0, 1))
    used = stroke[[begin, end - 1]] if len(edges) else np.array([math.nan, math.nan])
    if not (used[0] < UNUSED * n["stroke"] and np.ptp(used) > n["stroke"] / 2):
        ever = stroke[np.isfinite(stroke)] + n["closed_length"]
        closes = (
            f"the cylinder is {ever.min():.3f} .. {ever.max():.3f} m long" if len(ever) else "the linkage never closes"
        )
        part = f" and lifts between {used[0] * 1e3:.0f} and {used[1] * 1e3:.0f} mm of its stroke" if len(edges) else ""
        raise MachineError(
            f"closed_length: with these pins and bars {closes}{part}, not from {n['closed_length']:g} m over its stroke of "
            f"{n['stroke']:g} m: measure pins (x outward, y up), bars and cylinder again"
        )
    turn = 2 * math.pi * round((angles[begin] + angles[end - 1]) / (4 * math.pi))
    low, high = float(angles[begin]) - turn, float(angles[end - 1]) - turn
    _plausible(low)
    return [
        *(Entry(key, value, "m", source, PIN, why) for (key, value), source, why in zip(
            pins.items(), ("foot_x", "pivot_x", "eye_x"),
            ("cylinder on the column", "long bar on the column", "short bar on the boom"), strict=True,
        )),
        Entry("L1", n["long_bar"], "m", "long_bar", PIN, "long bar"),
        Entry("L2", n["short_bar"], "m", "short_bar", PIN, "short bar"),
        Entry("q2_stroke_min", low, "rad", "derived", None, "cylinder retracted"),
        Entry("q2_max", low + WITHIN * (high - low), "rad", "derived", None, "cylinder extended"),
    ]  # fmt: skip


def _plausible(low: float) -> None:
    """Raises MachineError where the boom would be lowest at an angle [rad] that no boom has."""
    least, most = BY_KEY["lowest_angle"].low, BY_KEY["lowest_angle"].high
    if not least <= math.degrees(low) <= most:
        raise MachineError(
            f"foot_x: with these pins the cylinder is shortest with the boom at {math.degrees(low):.0f} deg: check the signs "
            "(x outward, y up); a cylinder that lifts by retracting cannot be described"
        )
