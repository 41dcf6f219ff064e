"""The angle sensor is mounted askew."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "angle_offset", "sensors", "ch. 4.2", "y = q_2 + b",
    ("the angle sensor", "is mounted askew"), "gravity mismatch over the angle",
    (parameter("b", "rad", 0.0, (-0.035, 0.035), (-0.5, 0.5), "IMU mounted askew"),),
    {"measured_angle": lambda angle, own, at: angle + own.b},
    place=1,
)  # fmt: skip
