"""D_0, S_x, S_y and the tip of what the boom joint carries, from masses and lengths. Booms count as uniform rods.

D_0 = sum_i (m_i |r_i|^2 + I_i)        (S_x, S_y) = sum_i m_i r_i        I_i = m_i l_i^2 / 12
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from boom_model.owner.questions import Answer
from boom_model.rigid_body import LockedBody


def of_masses(answers: Mapping[str, Answer]) -> LockedBody:
    """From the answers that begin with ``inner_``, ``outer_`` and ``tool_mass``."""

    def number(key: str) -> float:
        return float(answers[key])

    inner, outer, turn = number("inner_length"), number("outer_length"), math.radians(number("outer_angle"))
    along = np.array([math.cos(turn), math.sin(turn)])
    elbow = np.array([inner, 0.0])
    tip = elbow + outer * along
    bodies = (
        (number("inner_mass"), elbow / 2, inner), (number("outer_mass"), elbow + outer * along / 2, outer),
        (number("tool_mass"), tip, 0.0),
    )  # fmt: skip
    moment = sum((mass * centre for mass, centre, _ in bodies), np.zeros(2))
    inertia = sum(mass * (float(centre @ centre) + length**2 / 12) for mass, centre, length in bodies)
    return LockedBody(float(inertia), float(moment[0]), float(moment[1]), (float(tip[0]), float(tip[1])))
