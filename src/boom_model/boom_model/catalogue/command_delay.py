"""The command arrives late at the valve: the integrator delays its input (``boom_model.plant``).

A running simulation or controller takes a negative one, of a log that shows currents late, as none.
"""

from boom_model.catalogue.effect import Effect, parameter

EFFECT = Effect(
    "command_delay", "pilot_valves", "5.39p,s", "i(t - T)",
    ("the command", "arrives late at the valve"), "follows the edges of the command",
    (
        parameter("T", "s", 0.0, (0.005, 0.1), (-0.1, 1.0), "dead time between command and valve; below 0 where a log samples the "
                  "currents, and shows them late", starts=(0.01, 0.04, 0.08)),
    ),
    place=2, delays="command", watched=False,
)  # fmt: skip
