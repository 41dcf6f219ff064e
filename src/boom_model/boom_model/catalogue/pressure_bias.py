"""A pressure transducer reads with an offset, each with its own."""

from boom_model.catalogue.effect import Effect, parameter

# Accuracy of a transducer of 0 to 400 bar: 0.25 % of its range.
_ACCURACY = 1e5
# A careless hand can do it at will, hence the margin.
EFFECT = Effect(
    "pressure_bias", "sensors", "ch. 4.2", "y = p + b",
    ("a pressure transducer", "reads with an offset"), "level of one pressure, everywhere",
    (
        parameter("hose", "Pa", 0.0, (-3e5, 3e5), (-5e6, 5e6), "offset of the hose pressure transducer",
                  accuracy=_ACCURACY),
        parameter("rod", "Pa", 0.0, (-3e5, 3e5), (-5e6, 5e6), "offset of the rod pressure transducer",
                  accuracy=_ACCURACY),
    ),
    {
        "measured_hose_pressure": lambda pressure, own, at: pressure + own.hose,
        "measured_rod_pressure": lambda pressure, own, at: pressure + own.rod,
    },
    place=3, independent=True, margin=8.0,
)  # fmt: skip
