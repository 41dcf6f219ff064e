"""The spool of the main valve is off-centre in neutral: its edges stand at s_s + x_n s_max."""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "neutral_offset", "main_valve", "5.39l,m", "metering edges at s_s + x_n s_max",
    ("the spool of the main valve", "is off-centre in neutral"), "opens early to one side and late to the other",
    (parameter("x_n", "-", 0.0, (-0.06, 0.06), (-0.3, 0.3), "over full stroke, positive: towards lowering"),),
    {"metering_position": lambda spool, own, at: spool + own.x_n * at.p.main_valve_spool.s_max},
    place=7,
)  # fmt: skip
