"""Bodies whose joints move, as particles: Newton's law for each, its moment about the boom joint.

Every body is a dumbbell of two equal masses on its long axis that has its mass and inertia. With z(t) a particle's place in the
boom's frame as a complex number, p = z exp(i q_2) and X = x_0 + Re p its distance from the slewing axis,

    a = (z'' + 2 i w z' + i w' z - w^2 z) exp(i q_2) - W^2 X

is its acceleration in the boom's plane, and sum m Im(conj(p) a) the torque that the boom joint has to give beside that of gravity.
Here are the sums that do not depend on the boom: the kernel turns them with q_2 and adds the load, a particle at the tip. z' and
z'' are differences over the milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from concealed_plant.machine import placed_bodies

Array = NDArray[np.float64]

SHAFT = -0.18
"""m. The boom joint's distance from the slewing axis."""
COLUMNS = (
    "inertia", "moment_x", "moment_y", "tip_x", "tip_y", "pushed", "carried", "tip_vx", "tip_vy", "tip_ax", "tip_ay",
    "slewing", "shaft", "square_re", "square_im",
)  # fmt: skip
"""sum m |z|^2, sum m z, tip; sum m Im(conj(z) z''), sum m Re(conj(z) z'); tip', tip''; W, x_0, sum m z^2."""


@dataclass(frozen=True)
class JointCourses:
    """Outer boom [rad], telescope [m] and slewing [rad] in each millisecond (n,)."""

    outer_boom: Array
    telescope: Array
    slewing: Array


def columns(joints: JointCourses, moment: float = 1.0, inertia: float = 1.0) -> Array:
    """The table (n, len(COLUMNS)); ``moment`` and ``inertia``: factors of a specimen's first and second moments."""
    bodies, tip = placed_bodies(np.exp(1j * joints.outer_boom), joints.telescope)
    masses, places = [], []
    for mass, at, own, axis in bodies:
        reach = np.sqrt(own / mass) * axis
        for end in (at + reach, at - reach):
            masses.append(0.5 * mass)
            places.append(np.broadcast_to(end, tip.shape))
    m, z = np.array(masses)[:, None], np.array(places)
    v, a = _rates(z)
    tip_v, tip_a = _rates(tip)
    first, square = moment * (m * z).sum(axis=0), inertia * (m * z * z).sum(axis=0)
    slewing = np.gradient(joints.slewing, 1e-3)
    table = (
        inertia * (m * abs(z) ** 2).sum(axis=0), first.real, first.imag, tip.real, tip.imag,
        inertia * (m * (z.conj() * a).imag).sum(axis=0), inertia * (m * (z.conj() * v).real).sum(axis=0),
        tip_v.real, tip_v.imag, tip_a.real, tip_a.imag, slewing, np.full(len(tip), SHAFT), square.real, square.imag,
    )  # fmt: skip
    return np.stack(table, axis=-1)


def _rates(z: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """z' and z'' over the milliseconds, the last axis; none at the very ends."""
    v, a = np.zeros_like(z), np.zeros_like(z)
    v[..., 1:-1] = (z[..., 2:] - z[..., :-2]) / 2e-3
    a[..., 1:-1] = np.diff(z, 2, axis=-1) / 1e-6
    return v, a
