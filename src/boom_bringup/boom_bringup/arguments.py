"""Types of options shared by several commands; a wrong value ends with one line and status 2 before any work starts."""

from __future__ import annotations

import argparse
import math

LONGEST_RUN = 3600.0
"""s. A simulated hour at 100 Hz fills 0.1 GB; more is taken for a typing error."""


def seed(text: str) -> int:
    """The seed of a noise generator: a whole number of 0 or more."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is not a seed: give a whole number of 0 or more")
    return value


def duration(text: str) -> float:
    """A time to simulate [s], above 0 and up to an hour."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= LONGEST_RUN:
        raise argparse.ArgumentTypeError(f"{text} is not a duration: give above 0 and up to {LONGEST_RUN:g} s")
    return value
