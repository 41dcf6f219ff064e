"""The gyro has another gain."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "rate_scale", "sensors", "ch. 4.2", "y = a q_2'",
    ("the gyro", "has another gain"), "integrated rate against angle, without any hydraulics",
    (parameter("a", "-", 1.0, (0.95, 1.05), (0.1, 10.0), "gain of the gyro", positive=True,
               accuracy=0.01),),  # sensitivity of a calibrated MEMS gyro
    {"measured_rate": lambda rate, own, at: rate * own.a},
    place=2,
)  # fmt: skip
