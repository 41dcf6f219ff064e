"""What the motion of the other joints does to the boom: slewing q_1, outer boom q_3, telescope q_4 as measured inputs.

With r_i(q_3, q_4) the centre of body i in the boom's frame, theta_i its turn against the boom, W = q_1' and X the distance from
the slewing axis, Lagrange's equation of the boom's angle q_2 is

    D q_2'' + D' q_2' + H' + g(q_2) - W^2 C(q_2) = J f_p - tau_f
    D = sum_i (m_i |r_i|^2 + I_i)        H = sum_i (m_i r_i x r_i' + I_i theta_i')
    C = d/dq_2 int X^2/2 dm = (J_yy - J_xx) sin cos - J_xy (cos^2 - sin^2) - x_0 (S_x sin q_2 + S_y cos q_2)

D' q_2' is the Coriolis torque, H' that of the joints' own accelerations, W^2 C that of the centrifugal forces; J_xx = int x^2 dm
and so on along the boom's axes, x_0 the boom joint's distance from the slewing axis. An acceleration of the slewing acts across the
boom's plane and not on q_2, because all bodies lie in that plane. The load is a point mass at the tip and moves with it; its own
share of each term is formed with the mass that the model has at that moment, so only the tip's motion is an input.

The inputs are differences to the pose that the configuration tells (what ``pose.D0`` and its companions mean stays as it is) and
are zero without motion. The sums and their exact derivatives come from the bodies of ``rigid_body`` as CasADi expressions.
Source: Lagrange II for prescribed joints; the bodies are those of the machine file. Not in the thesis, which locks these joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_input.channels import JOINT_NAMES
from boom_model.errors import MachineError
from boom_model.rigid_body import entry, place_bodies, tip_point, vector

Array = NDArray[np.float64]

JOINTS = tuple(JOINT_NAMES)
"""q_3 [rad], q_4 [m], q_1 [rad]: the order of the columns of positions, velocities and accelerations."""
RESTING_TIP = 5e-3
"""m/s or rad/s: slower, the tip stands still in the boom's frame, and the crane does not turn."""
INPUTS = (
    "added_D0", "added_Sx", "added_Sy", "added_tip_x", "added_tip_y", "D0_rate", "spin_rate",
    "tip_rate_x", "tip_rate_y", "tip_acceleration_x", "tip_acceleration_y",
    "slewing_squared", "slewing_offset", "slewing_difference", "slewing_product",
)  # fmt: skip
"""Of the model: D_0, S, tip beyond the pose; D_0' [kg m^2/s], H' [N m]; tip' [m/s], tip'' [m/s^2]; W^2 [1/s^2],
W^2 x_0 [m/s^2], W^2 (J_yy - J_xx) and W^2 J_xy [N m]; without load."""


def apply(p: Any, u: Any) -> Any:
    """The pose of the parameters ``p`` moved by the inputs ``u`` (len(INPUTS),); returns the inputs by name."""
    by_name = SimpleNamespace(**{name: u[k] for k, name in enumerate(INPUTS)})
    p.pose.D0 = p.pose.D0 + by_name.added_D0
    p.pose.Sx = p.pose.Sx + by_name.added_Sx
    p.pose.Sy = p.pose.Sy + by_name.added_Sy
    p.pose.tip = (p.pose.tip[0] + by_name.added_tip_x, p.pose.tip[1] + by_name.added_tip_y)
    return by_name


def torque(u: Any, angle: Any, rate: Any, load: Any, p: Any) -> Any:
    """W^2 C - D' q_2' - H' [N m] at q_2 [rad] and q_2' [rad/s] with the load [kg], from the inputs by name."""
    cos, sin = ca.cos(angle), ca.sin(angle)
    x, y = p.pose.tip
    inertia_rate = u.D0_rate + 2 * load * (x * u.tip_rate_x + y * u.tip_rate_y)
    spin_rate = u.spin_rate + load * (x * u.tip_acceleration_y - y * u.tip_acceleration_x)
    difference = u.slewing_difference + load * u.slewing_squared * (y * y - x * x)
    product = u.slewing_product + load * u.slewing_squared * x * y
    outward = (p.pose.Sx + load * x) * sin + (p.pose.Sy + load * y) * cos
    centrifugal = difference * sin * cos - product * (cos * cos - sin * sin) - u.slewing_offset * outward
    return centrifugal - inertia_rate * rate - spin_rate


def known(document: Mapping[str, Any]) -> bool:
    """Whether a machine file tells the bodies that joints move."""
    return "planar" in document["rigid_body"]


def still(values: Array) -> NDArray[np.bool_]:
    """(n,) whether the joints stand still under inputs (n, len(INPUTS))."""
    column = {name: values[:, k] for k, name in enumerate(INPUTS)}
    tip = np.hypot(column["tip_rate_x"], column["tip_rate_y"])
    return np.asarray((tip < RESTING_TIP) & (column["slewing_squared"] < RESTING_TIP**2))


def inputs(
    document: Mapping[str, Any], pose: tuple[float, float], position: Array, velocity: Array, acceleration: Array
) -> Array:
    """The inputs (n, len(INPUTS)) of joints (n, len(JOINTS)) with these positions, velocities and accelerations [SI].

    document: of the machine file; pose: q_3 [rad], q_4 [m] of the configuration.

    Raises:
        MachineError: the file does not tell the bodies.
    """
    if not known(document):
        raise MachineError("rigid_body.planar is missing: without the bodies nothing is known of joints that move")
    function = _function(_Section(document["rigid_body"]))
    n = len(position)
    q, v, a = (np.asarray(part, dtype=float).T for part in (position, velocity, acceleration))
    values = np.asarray(function.map(n)(q[:2], v[:2], a[:2], v[2:]), dtype=float).T
    at_pose = np.asarray(function(np.array(pose), np.zeros(2), np.zeros(2), np.zeros(1)), dtype=float).ravel()
    values[:, :5] -= at_pose[:5]
    return np.ascontiguousarray(values)


class _Section:
    """A section of a machine file as a cache's key: itself, not its content."""

    def __init__(self, body: Mapping[str, Any]) -> None:
        self.body = body

    def __hash__(self) -> int:
        return id(self.body)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Section) and other.body is self.body


@lru_cache(maxsize=8)
def _function(section: _Section) -> Any:
    """(q, q', q'' of outer boom and telescope, W) -> the inputs with absolute D_0, S and tip."""
    body = section.body
    q, v, a, turn = ca.SX.sym("q", 2), ca.SX.sym("v", 2), ca.SX.sym("a", 2), ca.SX.sym("W")
    bodies, (tip_x, tip_y) = place_bodies(body, q[0], q[1]), tip_point(body, q[0], q[1])

    def rate(expression: Any) -> Any:
        return ca.jtimes(expression, ca.vertcat(q, v), ca.vertcat(v, a))

    D0: Any = 0.0
    Sx: Any = 0.0
    Sy: Any = 0.0
    spin: Any = 0.0
    difference: Any = 0.0
    product: Any = 0.0
    for part in bodies:
        x, y, m = part.x + ca.SX(0), part.y + ca.SX(0), part.mass
        D0 += m * (x * x + y * y) + part.inertia
        Sx += m * x
        Sy += m * y
        spin += m * (x * rate(y) - y * rate(x)) + part.inertia * rate(part.angle + ca.SX(0))
        difference += m * (y * y - x * x) + part.spread[1] - part.spread[0]
        product += m * x * y + part.spread[2]
    offset = 0.0
    if "boom_joint" in body["planar"]:
        offset = float(vector(entry(body["planar"], "rigid_body.planar", "boom_joint"), "boom_joint", 2)[0])
    tip = ca.vertcat(tip_x, tip_y)
    tip_rate = rate(tip)
    found = ca.vertcat(
        D0, Sx, Sy, tip, rate(D0), rate(spin), tip_rate, rate(tip_rate),
        turn**2, turn**2 * offset, turn**2 * difference, turn**2 * product,
    )  # fmt: skip
    return ca.Function("joint_motion", [q, v, a, turn], [found])
