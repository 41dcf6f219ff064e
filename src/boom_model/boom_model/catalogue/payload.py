"""A load at the tip that the configuration does not tell."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "payload", "load", "5.39a", "D += m |tip|^2, g += m g_0 (t_x cos q_2 - t_y sin q_2)",
    ("an unknown load", "hangs at the boom tip"), "static head pressure, with the lever arm",
    (parameter("mass", "kg", 0.0, (50.0, 2000.0), (-500.0, 5000.0), "mass at the tip beyond the configuration's",
               starts=(100.0, 400.0, 1200.0)),),  # where it rests against the weight decides what is seen of it
    {"load_mass": lambda mass, own, at: mass + own.mass},
    place=1, changes=("pose.Sx", "pose.Sy", "pose.load"), load=True,
    says_less=("the load at the boom tip", "is lighter than the configuration tells"),
)  # fmt: skip
