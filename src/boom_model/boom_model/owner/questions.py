"""The questions whose answers make a machine file. Standard library only: the command line is made from this table.

Answers are in the units of data sheets; the file is in SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from boom_model.errors import MachineError, nearest

Answer = float | str


@dataclass(frozen=True)
class Question:
    """One question.

    Attributes:
        key: of the answer, in a file of answers and as an option.
        text: what is asked, and how to find out.
        unit: of the answer; "" for a word.
        low, high: what a crane can have.
        proposal: what is taken without an answer; None: it has to be answered.
        words: the possible answers, if these are words.
        only: key and answer of another question, without which this one is not asked.
    """

    key: str
    text: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    proposal: Answer | None = None
    words: tuple[str, ...] = ()
    only: tuple[str, str] | None = None

    @property
    def option(self) -> str:
        """The option of the command line."""
        return "--" + self.key.replace("_", "-")

    @property
    def shown(self) -> str:
        """The proposal for people."""
        return f"{self.proposal:g}" if isinstance(self.proposal, float) else str(self.proposal)

    @property
    def is_number(self) -> bool:
        """Whether the answer is a number."""
        return self.high > self.low

    def asked(self, answers: Mapping[str, Answer]) -> bool:
        """Whether it is asked, with the answers before it."""
        return self.only is None or answers.get(self.only[0]) == self.only[1]

    def checked(self, given: Any) -> Answer:
        """The answer.

        Raises:
            MachineError: not a number in the range, or not one of the words.
        """
        if not self.is_number:
            # YAML reads yes and no as true and false
            word = ("no", "yes")[given] if isinstance(given, bool) and "yes" in self.words else str(given).strip()
            if self.words and word not in self.words:
                raise MachineError(f"{self.key}: {word!r} is not one of {', '.join(self.words)}")
            if not word:
                raise MachineError(f"{self.key}: no answer ({self.text})")
            return word
        try:
            value = float(str(given).strip().removesuffix(self.unit or "\n").replace(",", "."))
        except ValueError:
            value = float("nan")
        if isinstance(given, bool) or not isfinite(value):
            raise MachineError(
                f"{self.key}: {given} is no number of {self.low:g} .. {self.high:g} {self.unit}".rstrip()
            )
        if not self.low <= value <= self.high:
            meant = f"; did you mean {value / 1000:g} {self.unit}?" if self.low <= value / 1000 <= self.high else ""
            raise MachineError(
                f"{self.key}: {given} is not in {self.low:g} .. {self.high:g} {self.unit}{meant}".rstrip()
            )
        return value


_NUMBERS, _MASSES, _HOLDING = ("moments", "numbers"), ("moments", "masses"), ("cylinder_valve", "load_holding")
QUESTIONS: tuple[Question, ...] = (
    Question("name", "name of the crane, as recordings will have it", proposal="my_crane"),
    Question("foot_distance", "tape measure: boom joint to the cylinder's pin on the column", "m", 0.05, 10.0),
    Question("eye_distance", "tape measure: boom joint to the cylinder's pin on the boom", "m", 0.05, 10.0),
    Question("closed_length", "data sheet or tape measure: cylinder retracted, pin to pin", "m", 0.1, 20.0),
    Question("stroke", "data sheet: stroke of the cylinder", "m", 0.05, 10.0),
    Question("lowest_angle", "spirit level: angle of the boom with the cylinder retracted, 0 = level, + = up", "deg", -120.0, 80.0),
    Question("piston_diameter", "data sheet: piston", "mm", 20.0, 500.0),
    Question("rod_diameter", "data sheet: rod", "mm", 10.0, 450.0),
    Question("hose_length", "tape measure: hose from valve to cylinder, each side", "m", 0.1, 50.0, 2.5),
    Question("hose_bore", "printed on the hose: inner diameter", "mm", 4.0, 80.0, 19.0),
    Question(
        "moments", "inertia and first moments of what moves: from masses and lengths, from a URDF, or known as numbers",
        proposal="masses", words=("masses", "urdf", "numbers"),
    ),
    Question("inner_mass", "data sheet: inner boom", "kg", 1.0, 1e5, only=_MASSES),
    Question("inner_length", "tape measure: boom joint to the joint of the outer boom", "m", 0.1, 30.0, only=_MASSES),
    Question("outer_mass", "data sheet: outer boom with telescope; 0 without", "kg", 0.0, 1e5, 0.0, only=_MASSES),
    Question("outer_length", "tape measure: outer boom, as far out as in the recordings", "m", 0.0, 30.0, 0.0, only=_MASSES),
    Question("outer_angle", "outer against inner boom: 0 = in line, - = hangs down", "deg", -180.0, 180.0, 0.0, only=_MASSES),
    Question("tool_mass", "data sheet: what always hangs at the tip (rotator, grapple)", "kg", 0.0, 1e5, 0.0, only=_MASSES),
    Question("inertia", "about the boom joint, without load", "kg m^2", 1e-2, 1e8, only=_NUMBERS),
    Question("moment_x", "first moment of mass along the boom, without load", "kg m", -1e7, 1e7, only=_NUMBERS),
    Question("moment_y", "first moment of mass across the boom", "kg m", -1e7, 1e7, 0.0, only=_NUMBERS),
    Question("tip_x", "where a load hangs, along the boom from its joint", "m", -50.0, 50.0, only=_NUMBERS),
    Question("tip_y", "where a load hangs, across the boom", "m", -50.0, 50.0, 0.0, only=_NUMBERS),
    Question("q3", "what recordings call this angle of the outer boom", "rad", -10.0, 10.0, 0.0),
    Question("q4", "what recordings call this length of the telescope", "m", 0.0, 50.0, 0.0),
    Question("pump_pressure", "data sheet: pressure of the supply", "bar", 20.0, 500.0),
    Question("return_pressure", "gauge on the return line", "bar", 0.0, 50.0, 3.0),
    Question("compensator", "does the valve have a pressure compensator (load sensing)?", proposal="no", words=("yes", "no")),
    Question("opening_current", "current at which the boom begins to move", "A", 0.0, 3.0),
    Question("full_current", "data sheet: current at which the valve is fully open", "A", 0.01, 3.0),
    Question("response_time", "data sheet: step response of the spool, to 63 %", "ms", 1.0, 2000.0, 40.0),
    Question("lift_flow", "data sheet: flow of the fully open valve, lifting", "l/min", 0.5, 2000.0),
    Question("lower_flow", "data sheet: flow of the fully open valve, lowering", "l/min", 0.5, 2000.0),
    Question("flow_drop", "data sheet: pressure drop over one edge at which these flows hold", "bar", 0.5, 400.0, 5.0),
    Question(
        "cylinder_valve", "is a load-holding valve (over-centre, counterbalance) screwed to the cylinder?",
        proposal="none", words=("none", "load_holding"),
    ),
    Question("set_pressure", "data sheet: its set pressure", "bar", 10.0, 600.0, 180.0, only=_HOLDING),
    Question("pilot_ratio", "data sheet: its pilot ratio", "", 0.0, 20.0, 3.0, only=_HOLDING),
    Question(
        "neutral", "data sheet: ports of the main valve in neutral (symbol with A and B joined to T: vented)", proposal="shut",
        words=("shut", "vented"), only=_HOLDING,
    ),
    Question("seal_friction", "friction of the seals; 300 to 900 N are usual", "N", 1.0, 1e5, 500.0),
)  # fmt: skip
BY_KEY = {question.key: question for question in QUESTIONS}


def open_questions(answers: Mapping[str, Answer]) -> list[Question]:
    """What has to be asked yet, with the answers that are there; proposals count as answers where they decide what is asked."""
    proposed = {q.key: q.proposal for q in QUESTIONS if q.proposal is not None} | dict(answers)
    return [q for q in QUESTIONS if q.key not in answers and q.asked(proposed)]


def checked_answers(given: Mapping[str, Any], where: str) -> dict[str, Answer]:
    """Answers by key.

    Raises:
        MachineError: names the first that is no answer to a question.
    """
    for key in given:
        if key not in BY_KEY:
            raise MachineError(f"{where}: {key}: no such question{nearest(str(key), BY_KEY)}")
    return {key: BY_KEY[key].checked(value) for key, value in given.items()}
