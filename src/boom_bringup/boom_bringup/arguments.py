"""Types of options shared by several commands; a wrong value ends with one line and status 2 before any work starts."""

from __future__ import annotations

import argparse
import math
import os

from boom_input.shown import typable

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


def tolerance(text: str) -> float:
    """A relative tolerance of the integration."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 1e-12 <= value <= 1e-3:
        raise argparse.ArgumentTypeError(f"{text} is not a tolerance: give 1e-12 .. 1e-3")
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


def named(text: str) -> str:
    """A name that is not empty."""
    if not text.strip():
        raise argparse.ArgumentTypeError("an empty name")
    return text


LIGHTEST = 1.0
"""kg. Lighter loads are tonnes."""


def load_mass(text: str) -> float:
    """A mass [kg] of 0 or more, or ``nan`` for one that is not known."""
    if text.lower() == "nan":
        return math.nan
    value = finite(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text} kg: a load is 0 or more, or nan where it is not known")
    if 0.0 < value < LIGHTEST:
        raise argparse.ArgumentTypeError(f"{text} kg: no load is that light; {1000 * value:g} for {text} t")
    return value


def add_recordings(parser: argparse.ArgumentParser) -> None:
    """Declare the recordings that a command works on."""
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recording: a rosbag2 folder or a .mcap file")


def add_machine(parser: argparse._ActionsContainer) -> None:
    """Declare the machine whose model is run."""
    parser.add_argument(
        "--machine",
        metavar="FILE",
        help="machine file, or the name of a shipped one (default: the machine that the recording names)",
    )


def add_documents(parser: argparse.ArgumentParser, command: str) -> None:
    """Declare where numbers and report go."""
    parser.add_argument("--json", metavar="F", help="write the numbers as a JSON document to F")
    report = parser.add_mutually_exclusive_group()
    report.add_argument("--report", metavar="F.html", help=f"path of the report (default: output/{command}-BAG.html)")
    report.add_argument("--no-report", action="store_true", help="write no report")


def option_words(args: argparse.Namespace, *names: str) -> list[str]:
    """The options with one value that were given, as words of a command line."""
    given = {name: getattr(args, name.replace("-", "_")) for name in names}
    return [word for name, value in given.items() if value is not None for word in (f"--{name}", str(value))]


def command_line(*words: str) -> str:
    """What somebody types: the program's name in front of the words, quoted for a shell."""
    return typable(os.environ.get("BOOM_PROGRAM", "boom"), *words)


def joint_names(text: str) -> dict[str, str]:
    """``PART=NAME,PART=NAME``: names in /joint_states of joints other than the boom's."""
    from boom_input.channels import JOINT_NAMES

    found = {}
    for entry in text.split(","):
        part, _, name = entry.partition("=")
        if part.strip() not in JOINT_NAMES or part.strip() in found or not name.strip():
            raise argparse.ArgumentTypeError(
                f"{text}: give PART=NAME,PART=NAME with the parts {', '.join(JOINT_NAMES)}, each once, e.g. outer_boom=arm_joint"
            )
        found[part.strip()] = name.strip()
    return found


def add_other_joints(parser: argparse.ArgumentParser) -> None:
    """Declare the names of the joints whose motion drives the model."""
    parser.add_argument(
        "--joints", type=joint_names, default={}, metavar="PART=NAME,...",
        help="names there of the other joints, which drive the model where they move: outer_boom, telescope (both stages "
        "together), slewing (default: outer_boom_joint, telescope_joint, slewing_joint)",
    )  # fmt: skip


def configuration_words(args: argparse.Namespace) -> list[str]:
    """The options of `add_configuration` that were given, as words of a command line."""
    return option_words(args, "q3", "q4", "load", "joint") + other_joints_words(args)


def other_joints_words(args: argparse.Namespace) -> list[str]:
    """The option of `add_other_joints`, if it was given, as words of a command line."""
    joints = ",".join(f"{part}={name}" for part, name in args.joints.items())
    return ["--joints", joints] if joints else []


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
    add_joint(group)


def add_joint(parser: argparse._ActionsContainer) -> None:
    """Declare the name of the boom's joint."""
    parser.add_argument(
        "--joint", type=named, metavar="NAME", help="the boom's joint in /joint_states (default: inner_boom_joint)"
    )
