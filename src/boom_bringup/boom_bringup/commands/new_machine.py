"""Write a machine file for a new crane, and say what recordings can tell about it before anything is fitted.

Asks what a data sheet, a URDF and a tape measure can answer, in their units, and proposes a value where most cranes have one. Every
answer may also be an option or stand in a file of answers (--answers, YAML: key: answer). Without a terminal nothing is asked:
what has a proposal gets it, and what lacks one is listed. The file has a tolerance with every number; check it, edit it.

With recordings it is said, before anything is fitted: whether they are sound, which numbers they tell and which not, and which
manoeuvre to record next.

  ./boom new-machine --output my_crane.yaml
  ./boom new-machine --answers answers.yaml --output my_crane.yaml my_recording
  ./boom new-machine --answers answers.yaml --urdf crane.urdf --position outer_joint=0.3 --output my_crane.yaml my_recording

The crane: a cylinder pinned to column and boom or acting through a four-bar linkage, a valve with four edges whose spool the
currents command directly or through pilot pressures, with or without a load-holding or hose burst valve and accumulators.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.outputs import checked, checked_json, refuse_existing, write_json, write_new_text
from boom_bringup.showing import asked
from boom_model.owner.questions import BY_KEY, QUESTIONS, Answer, checked_answers, open_questions

if TYPE_CHECKING:
    from boom_model.rigid_body import LockedBody

_OF_URDF = ("position", "urdf_joint", "urdf_tip", "downwards")
_FARTHEST = 100.0
"""rad or m. Of a joint without limits."""
HELP = "write a machine file for a new crane and say what recordings can tell about it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "bags", nargs="*", metavar="BAG", help="recordings of the crane; their q3, q4 and name are taken"
    )
    parser.add_argument("--output", metavar="FILE", required=True, help="the machine file; must not exist")
    parser.add_argument("--answers", metavar="FILE", help="YAML with answers, key: answer; options have precedence")
    parser.add_argument("--yes", action="store_true", help="ask nothing: take the proposals")
    parser.add_argument(
        "--manoeuvre", metavar="F.csv", help="write the currents of the manoeuvre to record next to F.csv"
    )
    parser.add_argument("--no-manoeuvre", action="store_true", help="do not look for the manoeuvre to record next")
    parser.add_argument("--json", metavar="F", help="write answers, doubts and what the recordings tell to F")
    urdf = parser.add_argument_group("moments from a URDF")
    urdf.add_argument("--urdf", metavar="FILE", help="robot description of the crane")
    urdf.add_argument("--urdf-joint", metavar="NAME", help="the boom's joint (default: inner_boom_joint)")
    urdf.add_argument("--urdf-tip", metavar="NAME", help="the link where a load hangs (default: boom_tip)")
    urdf.add_argument(
        "--position", metavar="JOINT=VALUE", action="append", default=[],
        help="position of another joint [rad, m] (default: 0); of the boom's joint: where the boom is level; repeatable",
    )  # fmt: skip
    urdf.add_argument(
        "--downwards", action="store_true", help="the value of the boom's joint grows when the boom is lowered"
    )
    group = parser.add_argument_group("answers")
    for question in QUESTIONS:
        kind = "|".join(question.words) or question.unit.upper() or ("NUMBER" if question.is_number else "TEXT")
        proposed = "" if question.proposal is None else f" (proposed: {question.shown})"
        text = (question.text + proposed).replace("%", "%%")
        group.add_argument(question.option, dest=question.key, metavar=kind, help=text)
    known = parser.add_argument_group("where a recording does not say it")
    known.add_argument("--load", type=arguments.load_mass, metavar="KG", help="load at the tip [kg], nan = not known")
    arguments.add_joint(known)


def run(args: argparse.Namespace) -> int:
    """Write the file, and tell what recordings tell; returns 0."""
    output, manoeuvre = (
        checked(args.output, "--output"),
        checked(args.manoeuvre, "--manoeuvre", "time_s,retract_a,extend_a\n"),
    )
    json_path = checked_json(args.json, "machine", "answers")
    assert output is not None
    refuse_existing(output)
    if manoeuvre and args.no_manoeuvre:
        raise UsageError("--manoeuvre and --no-manoeuvre contradict each other: leave one out")
    answers = _given(args)
    from boom_bringup.commands import _new_machine

    recordings = _new_machine.read(args, answers)
    ask = not args.yes and _at_terminal()
    proposed = _answer(answers, ask=ask)
    _refuse_unasked(args, answers, said_only=ask)
    from boom_model.owner import draft

    text = draft.text(answers, _body(args, answers), _new_machine.sensors(recordings.values()), proposed)
    machine = _new_machine.checked_machine(text, output)
    write_new_text(output, text)
    _new_machine.show_machine(output, machine)
    if not ask:
        _new_machine.show_assumed(proposed)
    told = _new_machine.tell(machine, recordings, manoeuvre, search=not args.no_manoeuvre)
    if json_path:
        write_json(json_path, {"machine": str(output), "answers": answers, **told})
    _new_machine.show_next(output, args.bags)
    return 0


def _given(args: argparse.Namespace) -> dict[str, Answer]:
    """Answers of file and options."""
    answers: dict[str, Answer] = {}
    if args.answers:
        from boom_input.yaml_text import read_yaml

        listed = read_yaml(Path(args.answers))
        if not isinstance(listed, dict):
            raise UsageError(f"--answers {args.answers}: expected lines such as piston_diameter: 140")
        answers = checked_answers(listed, f"--answers {args.answers}")
    options = {q.key: getattr(args, q.key) for q in QUESTIONS if getattr(args, q.key) is not None}
    answers |= checked_answers(options, "options")
    if args.urdf:
        if args.moments not in (None, "urdf"):
            raise UsageError(f"--moments {args.moments} and --urdf contradict each other: leave one out")
        answers["moments"] = "urdf"
    elif answers.get("moments") == "urdf":
        raise UsageError("moments: urdf needs the robot description: give --urdf FILE")
    elif useless := [name for name in _OF_URDF if getattr(args, name)]:
        raise UsageError(
            f"--{useless[0].replace('_', '-')} says something of a robot description: give its --urdf FILE, too"
        )
    return answers


def _refuse_unasked(args: argparse.Namespace, answers: dict[str, Answer], *, said_only: bool) -> None:
    """Raises UsageError for an option that would be lost, as its question is not asked with the other answers.

    said_only: it is only told, as answers that were typed would be lost with it.
    """
    for question in QUESTIONS:
        if getattr(args, question.key) is not None and not question.asked(answers):
            key, *words = question.only
            goes = f"{question.option} goes with {BY_KEY[key].option} {' or '.join(words)}"
            if not said_only:
                raise UsageError(f"{goes}: give that, or leave it out")
            print(f"not used: {goes}")


def _at_terminal() -> bool:
    import sys

    return sys.stdin.isatty() and sys.stdout.isatty()


def _answer(answers: dict[str, Answer], *, ask: bool) -> set[str]:
    """Complete the answers, by asking or with the proposals; the questions for which the proposal was taken.

    Raises:
        UsageError: questions without an answer and without a proposal.
    """
    if not ask:
        missing = [q for q in open_questions(answers) if q.proposal is None]
        if missing:
            listed = "; ".join(f"{q.option} [{q.unit}]" for q in missing)
            raise UsageError(f"no answer to {listed}: give them as options, in --answers FILE, or answer on a terminal")
    given = set(answers)
    while left := open_questions(answers):
        question = left[0]
        answers[question.key] = _asked(question.key) if ask else question.checked(question.proposal)
    return {key for key in answers.keys() - given if answers[key] == BY_KEY[key].proposal}


def _asked(key: str) -> Answer:
    """The answer typed on the terminal; an empty line takes the proposal."""
    from boom_model.errors import MachineError

    question = BY_KEY[key]
    hints = [
        " / ".join(question.words),
        question.unit,
        f"Enter: {question.shown}" if question.proposal is not None else "",
    ]
    hint = ", ".join(text for text in hints if text)
    for _ in range(5):
        try:
            typed = asked(f"{question.text} [{hint}]: ")
        except EOFError:
            break
        if not typed and question.proposal is not None:
            return question.checked(question.proposal)
        try:
            answer = question.checked(typed)
        except MachineError as error:
            print(error)
            continue
        if (key, answer) != ("moments", "urdf"):
            return answer
        print("moments: urdf needs the robot description, --urdf FILE of the command line: choose another answer here")
    raise UsageError(f"{key}: no answer; give {question.option}")


def _body(args: argparse.Namespace, answers: dict[str, Answer]) -> LockedBody:
    from boom_model.owner.moments import of_masses
    from boom_model.rigid_body import LockedBody

    if answers["moments"] == "numbers":
        x, y = float(answers["tip_x"]), float(answers["tip_y"])
        inertia, along, across = (float(answers[key]) for key in ("inertia", "moment_x", "moment_y"))
        return LockedBody(inertia, along, across, (x, y))
    if answers["moments"] == "masses":
        return of_masses(answers)
    from boom_description.tip_pose import TipKinematics
    from boom_input.files import read_text

    joint, tip = args.urdf_joint or "inner_boom_joint", args.urdf_tip or "boom_tip"
    kinematics = TipKinematics(read_text(Path(args.urdf)), tip)
    if joint not in kinematics.joint_names:
        raise UsageError(_no_joint(args.urdf, joint, tip, kinematics.joint_names))
    limits = dict(kinematics.limits) | {
        joint: (-2.0 * math.pi, 2.0 * math.pi)
    }  # where it is level, it need not come to
    positions = dict.fromkeys(kinematics.joint_names, 0.0)
    given = [_position(text) for text in args.position]
    for k, (name, value) in enumerate(given):
        if name not in positions:
            raise UsageError(_no_joint(args.urdf, name, tip, kinematics.joint_names))
        if name in dict(given[:k]):
            raise UsageError(f"--position {name}={value:g}: its position is given twice: leave one out")
        low, high = (max(limits[name][0], -_FARTHEST), min(limits[name][1], _FARTHEST))
        if not low <= value <= high:
            raise UsageError(
                f"--position {name}={value:g}: it moves from {low:g} to {high:g} rad or m: give a value between"
            )
        positions[name] = value
    found = kinematics.carried(joint, positions, -1.0 if args.downwards else 1.0)
    return LockedBody(found.D0, found.Sx, found.Sy, found.tip)


def _no_joint(urdf: str, name: str, tip: str, there: Sequence[str]) -> str:
    return f"--urdf {urdf}: no joint {name or '(empty)'} on the way to {tip}; there are {', '.join(there) or 'none'}"


def _position(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not name or not math.isfinite(number):
        raise UsageError(f"--position {text}: expected JOINT=NUMBER, e.g. outer_boom_joint=0.28")
    return name, number
