"""Load, structure, friction: the concealed forms."""

from __future__ import annotations

import numpy as np

from concealed_plant.hidden import Array, Hidden, Scene, conceals, within
from concealed_plant.plant import Courses


@conceals(
    "payload",
    "load",
    "kg",
    (2.0, 3000.0),
    "a stiffly held log with an inertia of its own, not a point mass",
    twins=("load",),
    tolerance=20.0,
)
def payload(size: float, r: Array, _scene: Scene) -> Hidden:
    """A mass present throughout."""
    changes = {"extra_load": size, "load_gyration": size * within(r[0], 0.3, 1.3)}
    return Hidden(changes, parameters={"mass": size})


@conceals("payload_change", "load", "kg", (2.0, 3000.0), "lifted off the ground over 0.3 s, with an inertia of its own")
def payload_change(size: float, r: Array, scene: Scene) -> Hidden:
    """A mass that is grasped during the recording."""
    ramp = 0.3
    begin = within(r[1], 0.2, 0.6) * scene.duration
    course = np.clip((scene.milliseconds - begin) / ramp, 0.0, 1.0)
    changes = {"extra_load": size, "load_gyration": size * within(r[0], 0.3, 1.3)}
    middle = begin + ramp / 2
    return Hidden(changes, Courses(load=course), parameters={"mass": size, "t_g": middle}, onset=middle)


@conceals(
    "swinging_load",
    "load",
    "kg",
    (2.0, 2500.0),
    "a pendulum of any swing with a drag that grows with it, pulling along its rope",
    stretched=True,
)
def swinging_load(size: float, r: Array, _scene: Scene) -> Hidden:
    """A load on a rope."""
    length = within(r[0], 0.8, 3.0)
    changes = {"pendulum_mass": size, "pendulum_length": length, "pendulum_drag": within(r[1], 0.01, 0.05)}
    return Hidden(changes, parameters={"mass": size, "length": length})


@conceals(
    "boom_flexibility",
    "structure",
    "-",
    (0.003, 1.5),
    "the mode acts back on the boom, its damping grows with its speed",
)
def boom_flexibility(size: float, r: Array, _scene: Scene) -> Hidden:
    """An elastic mode."""
    frequency = within(r[0], 1.2, 5.0)
    changes = {"bend_share": size, "bend_frequency": frequency, "bend_loss": within(r[1], 0.01, 0.05)}
    return Hidden(changes, parameters={"f": frequency})


@conceals(
    "stribeck_friction", "friction", "N m", (20.0, 12000.0), "falls off as 1 / (1 + (w / w_s)^2), not as a bell curve"
)
def stribeck_friction(size: float, r: Array, _scene: Scene) -> Hidden:
    """Break-away above sliding friction."""
    return Hidden({"stiction": size, "stiction_rate": within(r[0], 0.008, 0.05)})


@conceals(
    "presliding_friction",
    "friction",
    "-",
    (0.003, 1.0),
    "four elastic sliders side by side that break loose one by one",
)
def presliding_friction(size: float, r: Array, _scene: Scene) -> Hidden:
    """Hysteresis before sliding; the size is the share of the Coulomb torque with this behaviour."""
    return Hidden({"slider_share": size, "slider_stiffness": 10.0 ** within(r[0], 5.3, 7.0)})


@conceals("position_dependent_friction", "friction", "-", (0.01, 8.0), "a raised cosine with unequal flanks")
def position_dependent_friction(size: float, r: Array, scene: Scene) -> Hidden:
    """A tight spot."""
    middle = scene.between(within(r[0], 0.25, 0.75))
    width = within(r[1], 0.06, 0.3)
    below = width * within(r[2], 0.6, 1.4)
    changes = {"tight": size, "tight_angle": middle, "tight_below": below, "tight_above": 2.0 * width - below}
    return Hidden(changes, parameters={"q_c": middle})


@conceals("friction_drift", "friction", "-", (0.01, 6.0), "a straight course that ends, not an exponential")
def friction_drift(size: float, r: Array, scene: Scene) -> Hidden:
    """Friction that changes as it warms."""
    final = 1.0 + size if r[0] < 0.5 else 1.0 / (1.0 + size)
    begin, length = 0.1 * r[1] * scene.duration, within(r[2], 0.4, 0.9) * scene.duration
    course = 1.0 + (final - 1.0) * np.clip((scene.milliseconds - begin) / length, 0.0, 1.0)
    return Hidden(courses=Courses(warmth=course))


# ------------------------------------------------------------------------------------------------- outside the catalogue


@conceals(
    "resting_on_something",
    "structure load",
    "N m/rad",
    (2e2, 3e7),
    "a stiff one-sided support below an angle",
    known=False,
)
def resting_on_something(size: float, r: Array, scene: Scene) -> Hidden:
    """The boom comes to rest on a log or the cab."""
    return Hidden({"rest_angle": scene.between(within(r[0], 0.2, 0.4)), "rest_stiffness": size})


@conceals(
    "base_rocking",
    "structure load",
    "rad/(N m)",
    (1e-11, 1e-6),
    "the carrier rocks on its tyres; the IMU sees it",
    known=False,
)
def base_rocking(size: float, r: Array, _scene: Scene) -> Hidden:
    """The base moves."""
    return Hidden(
        {"rock_compliance": size, "rock_frequency": within(r[0], 0.6, 1.6), "rock_loss": within(r[1], 0.03, 0.1)}
    )


@conceals(
    "linkage_play",
    "structure cylinder",
    "m",
    (5e-5, 0.04),
    "a worn pin: the piston moves free when the force turns",
    known=False,
)
def linkage_play(size: float, _r: Array, _scene: Scene) -> Hidden:
    """Play between piston rod and boom."""
    return Hidden({"play": size})
