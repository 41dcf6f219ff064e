"""Loads and the structure that carries them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from unseen_plant.families import Array, Laid, Site, among, decades, family, side
from unseen_plant.layout import (
    BASE,
    BASE_RATE,
    BEND,
    BEND_RATE,
    E_BASE,
    E_BEND,
    E_GROUND,
    E_SEAT,
    E_STOP,
    E_SWING,
    SEAT,
    SWING,
    SWING_RATE,
    U_LOAD,
    U_TILT,
)  # fmt: skip


@family(
    "payload", "load", "5.39a", "kg", (2.0, 2500.0),
    "at the tip; further in or out along the arm; held off the tip's axis; a long log, gripped stiffly; a heap beside the tip",
    stretched=True,
    twins=("load",),
)  # fmt: skip
def payload(size: float, form: int, r: Array, site: Site) -> Laid:
    """Mass that the configuration does not tell."""
    changes = {}
    if form in (2, 5):
        changes["load_reach"] = among(r[0], 0.8, 1.1)
    if form in (3, 5):
        changes |= {"load_off_x": among(r[1], -0.4, 0.4), "load_off_y": among(r[2], -0.4, 0.4)}
    if form == 4:
        changes["load_gyration"] = among(r[3], 0.5, 1.6)
    return Laid(changes, courses={U_LOAD: np.full(len(site.time), size)}, parameters={"mass": size})


@family(
    "payload_change", "load", "5.39a", "kg", (2.0, 2500.0),
    "at once; taken up evenly; taken up in an S; in two steps; let go in an exponential",
    stretched=True,
    twins=("load",),
)  # fmt: skip
def payload_change(size: float, form: int, r: Array, site: Site) -> Laid:
    """Grasped, or released, once."""
    onset = among(site.late[0], 0.2, 0.75) * site.duration
    since = (site.time - onset) / among(r[0], 0.1, 0.8)
    course = {
        1: (since > 0).astype(float),
        2: np.clip(since, 0.0, 1.0),
        3: 0.5 * (1.0 + np.tanh(2.0 * np.clip(since, -50.0, 50.0))),
        4: 0.6 * (since > 0) + 0.4 * (since > 1.0),
        5: np.where(since > 0, 1.0 - np.exp(-2.0 * np.maximum(since, 0.0)), 0.0),
    }[form]
    mass = size if r[1] < 0.6 else -size
    held = course * size if mass > 0 else (1.0 - course) * size
    return Laid(courses={U_LOAD: held}, parameters={"mass": mass, "t_g": onset}, onset=onset)


@family(
    "swinging_load", "load", "5.39a", "kg", (1.0, 2000.0),
    "viscous hinge; air and brush (square of the speed); dry hinge; stiff rotator",
    stretched=True, coupled=True,
)  # fmt: skip
def swinging_load(size: float, form: int, r: Array, _site: Site) -> Laid:
    """A body that hangs at the tip, its own inertia included."""
    length = among(r[0], 0.8, 3.0)
    row = (float(form), size, length, decades(r[1], 0.005, 0.05), among(r[2], 0.0, 0.5), among(r[3], 0.2, 1.0))
    return Laid(rows={E_SWING: row}, moving=(SWING, SWING_RATE), parameters={"mass": size, "length": length})


@family(
    "boom_flexibility", "structure", "5.39a", "rad/(N m)", (1e-9, 3e-6),
    "straight spring; stiffening; softening; damping that grows with the bend; joint with play",
    stretched=True, coupled=True,
)  # fmt: skip
def boom_flexibility(size: float, form: int, r: Array, site: Site) -> Laid:
    """The outer boom behind a spring of compliance ``size``; the bending acts back on the cylinder."""
    bend = abs(site.torque) * size
    row = (float(form), 1.0 / size, 0.0, decades(r[0], 0.01, 0.06), among(r[1], 0.08, 0.3), max(bend, 1e-4))
    return Laid(rows={E_BEND: row}, moving=(BEND, BEND_RATE))


@family(
    "ground_contact", "load structure", "5.39a", "N m/rad", (1e3, 1e7),
    "spring; Hertz with Hunt-Crossley damping; soft soil; rubber; mud",
    known=False,
)  # fmt: skip
def ground_contact(size: float, form: int, r: Array, site: Site) -> Laid:
    """Below an angle the boom rests on something."""
    return Laid(rows={E_GROUND: (float(form), size, site.angle(among(r[0], 0.15, 0.45)), r[1])})


@family(
    "mechanical_stop", "structure cylinder", "5.39a", "N m/rad", (1e2, 1e7),
    "spring; Hertz with Hunt-Crossley damping; crushed wood; rubber; a slow damper",
    known=False,
)  # fmt: skip
def mechanical_stop(size: float, form: int, r: Array, site: Site) -> Laid:
    """Above an angle something is in the way."""
    return Laid(rows={E_STOP: (float(form), size, site.angle(among(r[0], 0.55, 0.85)), r[1])})


@family(
    "giving_base", "structure", "5.39a", "rad/(N m)", (1e-10, 1e-6),
    "springs; outriggers that stiffen; play between pads and ground; ground that softens; a base that slowly tilts",
    known=False,
)  # fmt: skip
def giving_base(size: float, form: int, r: Array, site: Site) -> Laid:
    """The base leans under the cylinder's torque, and the boom with it."""
    if form == 5:
        lean = side(r[0]) * size * abs(site.torque) * 3.0
        profile = np.clip(site.time / site.duration, 0.0, 1.0) ** among(r[1], 0.5, 2.0)

        def leaning(outputs: Array) -> Array:
            shown = outputs.copy()
            shown[:, 0] += lean * profile[: len(outputs)]
            return shown

        return Laid(courses={U_TILT: lean * profile}, senses=(leaning,))
    omega, zeta = 2.0 * np.pi * among(r[0], 0.6, 2.5), decades(r[1], 0.02, 0.2)
    row = (float(form), size, omega, zeta, site.torque, size * abs(site.torque) * 0.5)
    return Laid(rows={E_BASE: row}, moving=(BASE, BASE_RATE))


@family(
    "slack_bush", "structure cylinder", "5.39c,d", "m", (2e-6, 0.03),
    "play taken up softly; play with hard ends; a bush that gives ever less; rubber that gives",
    known=False,
)  # fmt: skip
def slack_bush(size: float, form: int, r: Array, site: Site) -> Laid:
    """The pin between cylinder and linkage moves in its bush as the force changes."""
    force = abs(site.torque) / 0.42
    where = among(r[1], 0.6, 1.4) * force
    return Laid(rows={E_SEAT: (float(form), size, decades(r[0], 0.05, 0.5) * max(force, 3e4), where)}, moving=(SEAT,))


@family(
    "side_wind", "load structure", "5.39a", "kg", (0.5, 600.0),
    "gusts; short gusts; one that comes and goes; steps",
    known=False, stretched=True,
)  # fmt: skip
def side_wind(size: float, form: int, r: Array, site: Site) -> Laid:
    """Something pulls at the tip now and then, as strongly as a mass of ``size``: wind, or a branch that drags."""
    makers: dict[int, Callable[[], Array]] = {
        1: lambda: site.wander(among(r[0], 1.0, 3.0)),
        2: lambda: site.wander(among(r[0], 0.15, 0.5)),
        3: lambda: np.sin(2.0 * np.pi * (site.time / among(r[0], 4.0, 12.0) + site.late[1])),
        4: lambda: site.switching(among(r[0], 2.0, 6.0)) * 2.0,
    }
    course = makers[form]()
    return Laid(courses={U_LOAD: size * course})
