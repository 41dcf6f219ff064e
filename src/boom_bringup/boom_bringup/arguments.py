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


def finite(text: str) -> float:
    """A number that is finite."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a number")
    return value


def positive(text: str) -> float:
    """A number above 0."""
    value = finite(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def load_mass(text: str) -> float:
    """A mass [kg] of 0 or more, or ``nan`` for one that is not known."""
    if text.lower() == "nan":
        return math.nan
    value = finite(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text} kg: a load is 0 or more, or nan where it is not known")
    return value


def configuration_words(args: argparse.Namespace) -> list[str]:
    """The options of `add_configuration` that were given, as words of a command line."""
    names = ("q3", "q4", "load", "joint")
    return [
        word for name in names if getattr(args, name) is not None for word in (f"--{name}", str(getattr(args, name)))
    ]


def add_configuration(parser: argparse.ArgumentParser) -> None:
    """Declare what a recording may lack: pose, load and the name of the boom's joint."""
    group = parser.add_argument_group("where the recording does not say it")
    group.add_argument(
        "--q3", type=finite, metavar="RAD", help="angle of the outer boom [rad]; replaces the recorded one"
    )
    group.add_argument("--q4", type=finite, metavar="M", help="length of the telescope [m]; replaces the recorded one")
    group.add_argument(
        "--load", type=load_mass, metavar="KG", help="load at the tip [kg], nan = not known; replaces the recorded one"
    )
    group.add_argument(
        "--joint", metavar="NAME", help="name of the boom's joint in /joint_states (default: inner_boom_joint)"
    )
