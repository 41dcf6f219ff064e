"""The numbers that decide a diagnosis by one likelihood; numerical settings stand with their algorithm."""

from __future__ import annotations

from boom_estimation.search import Assumed

EFFECT_LOG_ODDS = -4.0
"""nats. Prior odds of one effect of the catalogue against nothing: with thirty of them, half a machine in thirty has each."""
SIZES = Assumed()
"""Of discrepancies where nothing is missing, where an effect's form is not exactly known, and where physics is unknown."""
NAMED_FROM = 0.55
"""Probability from which on a finding counts as identified, not as one of several."""
MOST_CERTAIN = 0.99
"""No more is claimed of anything: the model of the sensors and of the currents is never exactly right."""
SURE = 0.9
"""Probability that needs free runs near the noise floor, or what remains in the same sentence."""
NEAR_FLOOR, FAR_FROM_FLOOR = 3.0, 9.0
"""Errors of held-out free runs over those that noise alone leaves: up to which an explanation is whole, and from which on it is not
said that nothing is missing."""
OPEN = 3.0
"""Standard deviations that free runs may err by because the recordings leave numbers open: no sign of physics."""
AT_FLOOR = 1.5
"""The same up to which an error is one that noise makes: neither worse than another nor a sign of physics."""
SHOWN = 0.5
"""Share of the noise's error that an effect must take from free runs to show there."""
WORSE = 1.1
"""Held-out error of a channel over that of parameters only from which on an explanation is unproved."""
UNPROVED = 0.8
"""At most this is claimed of an effect with which a channel is worse by that, or far from the floor: 9 of 11 such were right in
cases for development."""
MOVED = 1.0
"""Standard deviations a tolerance has to move to be listed."""
