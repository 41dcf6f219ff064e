"""What the moving crane looks like: outlines and linkage from the machine file, in numbers that the page draws.

The page only turns the boom and interpolates: every position that needs an equation of the machine is computed here, over a grid of
boom angles. Where the machine file states no ``rigid_body.planar`` the shapes are sketches that end in the known tip.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from boom_model.errors import MachineError
from boom_model.machine import Machine, Pose
from boom_model.rigid_body import entry, vector
from boom_report.scheme import scheme

ANGLES = 161
"""Grid over the stroke: the linkage is off by less than 1 mm between two of them."""
JOINT_HEIGHT = 2.4
"""m. Of the boom joint above the ground, where the machine file does not tell it."""
_SKETCHED_ELBOW = 0.75
"""Of the furthest tip that the file tells: where the elbow of a sketched boom lies."""


def scene(machine: Machine, pose: Pose) -> dict[str, Any]:
    """The drawing of a machine in a pose, as JSON: lengths [m], angles [rad], areas [m^2], pressures [Pa gauge].

    Keys:
        machine, load: name, and the load [kg]. pose: q_3 [rad], q_4 [m].
        angles: (n,) grid of q_2. piston: (n,) s_p [m]. bars: for each part of the linkage, cylinder first, its two pins as (n, 4)
            x, y, x, y in the column frame.
        boom: joint, elbow and tip (x, y) in the boom's frame. joint: of the boom, (behind the slewing axis, height).
        area: of the head and the rod side. supply, tank: pressures of the machine file, null without.
        holds: whether the valve at the cylinder keeps p_a from following p_h.
        scheme: the hydraulic scheme as SVG.
    """
    low, high = machine.angle_limits
    angles = np.linspace(low, high, ANGLES)
    bars: list[list[list[float]]] = []
    for angle in angles:
        for k, bar in enumerate(machine.structure.linkage.bars(float(angle), machine.numbers)):
            if k == len(bars):
                bars.append([])
            bars[k].append([round(float(v), 5) for v in (*bar.start, *bar.end)])
    bars = [bar for bar in bars if np.isfinite(bar).all()]
    numbers = machine.numbers
    elbow, joint = _elbow(machine, pose), _joint(machine)
    return {
        "machine": machine.name, "load": pose.load, "pose": [pose.outer_boom_angle, pose.telescope_length],
        "angles": _rounded(angles), "piston": _rounded([machine.piston_position(float(a)) for a in angles]), "bars": bars,
        "boom": [[0.0, 0.0], _rounded(elbow), _rounded(pose.tip)], "joint": _rounded(joint),
        "area": [numbers.cylinder.A_a, numbers.cylinder.A_b],
        "supply": _number(machine, "fluid.p_s"), "tank": _number(machine, "fluid.p_t"),
        "holds": machine.holds, "scheme": str(scheme(machine)),
    }  # fmt: skip


def _elbow(machine: Machine, pose: Pose) -> tuple[float, float]:
    try:
        return _planar(machine, "elbow")
    except MachineError:
        tips = [known.tip for known in machine.tabulated] + [pose.tip]
        return _SKETCHED_ELBOW * max(math.hypot(*tip) for tip in tips), 0.0


def _joint(machine: Machine) -> tuple[float, float]:
    try:
        return _planar(machine, "boom_joint")
    except MachineError:
        return 0.0, JOINT_HEIGHT


def _planar(machine: Machine, name: str) -> tuple[float, float]:
    body = machine.document.get("rigid_body", {})
    value = vector(entry(entry(body, "rigid_body", "planar"), "rigid_body.planar", name), name, 2)
    return float(value[0]), float(value[1])


def _number(machine: Machine, key: str) -> float | None:
    parameter = machine.parameters.get(key)
    return None if parameter is None else parameter.value[0]


def _rounded(values: Any) -> list[float | None]:
    return [round(float(v), 5) if math.isfinite(v) else None for v in values]
