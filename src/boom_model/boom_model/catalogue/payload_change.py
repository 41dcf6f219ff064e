"""A load that is grasped or released during the recording, at a time, or that leaves the ground at a stroke, in every cycle.

At t_g it is attached at the tip's speed, within some 10 ms or as gradually as a grapple takes a bundle up, and dropped at t_r at
once. Below the piston position s_g it rests on the ground; it may leave the ground in two steps. With tau above 1 s, 2 s from a
tenth to nine tenths, it is no grasp: something else drifts. What hangs may run out as slowly as it will.
"""

from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components.payload import GRASP_TIME, on_the_hook
from boom_model.regularisation import Expression
from boom_model.state import ELAPSED_TIME

MUD = 5.0
"""kg, on the grapple of the crane of the thesis: so much bark, snow and water come and go, and oil in other cylinders."""


def _load(mass: Expression, own: Any, at: Any) -> Expression:
    held = on_the_hook(own.time(), own.t_g, "time", own.tau) * (1 - on_the_hook(own.time(), own.t_r, "time"))
    first = own.mass * held * on_the_hook(at.position, own.s_g, "stroke")
    return mass + first + own.mass_2 * on_the_hook(at.position, own.s_2, "stroke")


EFFECT = Effect(
    "payload_change", "load", "5.39a",
    "m (1 + tanh((t - t_g) / tau)) / 2 (1 + tanh((s_p - s_g) / 5 mm)) / 2 at the tip until t_r; so does m_2 from s_2 on",
    ("a load", "was grasped, released or lifted off the ground during the recording"),
    "static head pressure steps, with the lever arm",
    (
        parameter("mass", "kg", 0.0, (50.0, 2000.0), (-2000.0, 5000.0), "mass grasped (released: negative)",
                  ordinary=MUD),
        parameter("t_g", "s", 20.0, (5.0, 50.0), (-1e5, 1e5), "when, since the start of the run"),
        parameter("s_g", "m", -1.0, (0.0, 1.0), (-1.0, 10.0), "piston position below which it rests on the ground; -1: none"),
        parameter("mass_2", "kg", 0.0, (50.0, 2000.0), (-2000.0, 5000.0), "mass that leaves the ground at another stroke",
                  ordinary=MUD),
        parameter("s_2", "m", 10.0, (0.0, 1.0), (-1.0, 10.0), "piston position below which that rests on the ground; 10: none"),
        parameter("t_r", "s", 1e4, (5.0, 60.0), (-1e5, 1e5), "when the mass grasped is dropped again; 10000: never"),
        parameter("tau", "s", GRASP_TIME, (GRASP_TIME, 6.0), (5e-3, 20.0), "how gradually it is grasped", positive=True, of="t_g",
                  starts=(GRASP_TIME, 3.0), possible=(0.0, 1.0), possible_less=(0.0, 20.0)),
    ),
    {"load_mass": _load},
    place=2, states=(ELAPSED_TIME,), load=True, onset="t_g", release="t_r", lasting="payload", watched=False,
    steps=(("mass", "s_g"), ("mass_2", "s_2")),
)  # fmt: skip
