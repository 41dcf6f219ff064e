"""A pressure transducer reads with an offset or with another gain, each with its own."""

from boom_model.catalogue.effect import Effect, EffectParameter, parameter

# Accuracy of a transducer of 0 to 400 bar: 0.25 % of its range at nothing, and 0.5 % of what it reads.
_ACCURACY, _GAIN_ACCURACY = 1e5, 5e-3


def _offset(of: str) -> EffectParameter:
    meaning = f"offset of the {of} pressure transducer"
    return parameter(of, "Pa", 0.0, (-3e5, 3e5), (-5e6, 5e6), meaning, accuracy=_ACCURACY)


def _gain(of: str) -> EffectParameter:
    meaning = f"gain of the {of} pressure transducer"
    return parameter(f"{of}_gain", "-", 1.0, (0.95, 1.05), (0.1, 10.0), meaning, positive=True, accuracy=_GAIN_ACCURACY)


# A careless hand can do it at will, hence the margin.
EFFECT = Effect(
    "pressure_bias", "sensors", "ch. 4.2", "y = a p + b",
    ("a pressure transducer", "reads with an offset or another gain"), "level of one pressure, everywhere",
    (_offset("hose"), _offset("rod"), _gain("hose"), _gain("rod")),
    {
        "measured_hose_pressure": lambda pressure, own, at: own.hose_gain * pressure + own.hose,
        "measured_rod_pressure": lambda pressure, own, at: own.rod_gain * pressure + own.rod,
    },
    place=4, independent=True, margin=8.0,
)  # fmt: skip
