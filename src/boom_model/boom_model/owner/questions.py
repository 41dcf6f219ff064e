"""The questions whose answers make a machine file. Standard library only: the command line is made from this table.

Answers are in the units of data sheets; the file is in SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, radians
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
        only: key of another question and its answers with which this one is asked; always if empty.
    """

    key: str
    text: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    proposal: Answer | None = None
    words: tuple[str, ...] = ()
    only: tuple[str, ...] = ()

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
        return not self.only or answers.get(self.only[0]) in self.only[1:]

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
            other = radians(value) if self.unit == "rad" else value / 1000  # degrees, or mm and mA
            meant = f"; did you mean {other:.3g} {self.unit}?" if self.low <= other <= self.high else ""
            raise MachineError(
                f"{self.key}: {given} is not in {self.low:g} .. {self.high:g} {self.unit}{meant}".rstrip()
            )
        return value


_NUMBERS, _MASSES = ("moments", "numbers"), ("moments", "masses")
_HOLDING, _BURST = ("cylinder_valve", "load_holding"), ("cylinder_valve", "hose_burst")
_LENGTHS, _BARS = ("linkage", "lengths"), ("linkage", "four_bar")
_DRAWN = ("linkage", "pins", "four_bar")
_PILOT, _ACCUMULATORS = ("spool", "pilot"), ("accumulators", "hose")
QUESTIONS: tuple[Question, ...] = (
    Question("name", "name of the crane, as recordings will have it", proposal="my_crane"),
    Question(
        "linkage", "cylinder pinned to the boom, known by lengths or by the pins of a drawing, or through a four-bar linkage",
        proposal="lengths", words=("lengths", "pins", "four_bar"),
    ),
    Question("foot_distance", "tape measure: boom joint to the cylinder's pin on the column", "m", 0.05, 10.0, only=_LENGTHS),
    Question("eye_distance", "tape measure: boom joint to the cylinder's pin on the boom", "m", 0.05, 10.0, only=_LENGTHS),
    Question("foot_x", "drawing: cylinder's pin on the column, from the boom joint outward", "m", -10.0, 10.0, only=_DRAWN),
    Question("foot_y", "the same upward, - = below the joint", "m", -10.0, 10.0, only=_DRAWN),
    Question("eye_x", "drawing: pin of cylinder or short bar on the boom, along it from its joint", "m", -10.0, 10.0, only=_DRAWN),
    Question("eye_y", "the same across the boom, - = below its line", "m", -10.0, 10.0, only=_DRAWN),
    Question("pivot_x", "drawing: pin of the long bar on the column, from the boom joint outward", "m", -10.0, 10.0, only=_BARS),
    Question("pivot_y", "the same upward", "m", -10.0, 10.0, only=_BARS),
    Question(
        "long_bar", "tape measure: bar from the column to the rod's pin, which lies below the line of the other pins of both bars",
        "m", 0.01, 10.0, only=_BARS,
    ),
    Question("short_bar", "tape measure: bar from the boom to the rod's pin", "m", 0.01, 10.0, only=_BARS),
    Question("closed_length", "data sheet or tape measure: cylinder retracted, pin to pin", "m", 0.1, 20.0),
    Question("stroke", "data sheet: stroke of the cylinder", "m", 0.05, 10.0),
    Question(
        "lowest_angle", "spirit level: angle of the boom with the cylinder retracted, 0 = level, + = up", "deg", -120.0, 80.0,
        only=_LENGTHS,
    ),
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
    Question(
        "spool", "what moves the spool: the currents directly (on-board electronics), or two pilot pressures?", proposal="direct",
        words=("direct", "pilot"),
    ),
    Question("opening_pressure", "pilot pressure at the opening current", "bar", 0.5, 60.0, 6.0, only=_PILOT),
    Question("full_pressure", "pilot pressure at the full current", "bar", 2.0, 100.0, 22.0, only=_PILOT),
    Question("lift_flow", "data sheet: flow of the fully open valve, lifting: P-A, B-T", "l/min", 0.5, 2000.0),
    Question("lower_flow", "data sheet: flow of the fully open valve, lowering: P-B, and half of it A-T", "l/min", 0.5, 2000.0),
    Question("flow_drop", "data sheet: pressure drop over one edge at which these flows hold", "bar", 0.5, 400.0, 5.0),
    Question(
        "cylinder_valve", "is a load-holding valve (over-centre, counterbalance) or a hose burst valve screwed to the cylinder?",
        proposal="none", words=("none", "load_holding", "hose_burst"),
    ),
    Question("limit_flow", "data sheet: flow out of the cylinder from which on it throttles", "l/min", 1.0, 2000.0, only=_BURST),
    Question("set_pressure", "data sheet: its set pressure", "bar", 10.0, 600.0, 180.0, only=_HOLDING),
    Question("pilot_ratio", "data sheet: its pilot ratio", "", 0.0, 20.0, 3.0, only=_HOLDING),
    Question(
        "neutral", "data sheet: ports of the main valve in neutral (symbol with A and B joined to T: vented)", proposal="shut",
        words=("shut", "vented"), only=_HOLDING,
    ),
    Question("accumulators", "are two accumulators at the hose of the head side?", proposal="none", words=("none", "hose")),
    Question("gas_volume", "data sheet: gas volume of each", "l", 0.01, 50.0, 0.32, only=_ACCUMULATORS),
    Question("precharge_1", "data sheet: pre-charge of the first", "bar", 2.0, 350.0, only=_ACCUMULATORS),
    Question("precharge_2", "data sheet: pre-charge of the second", "bar", 2.0, 350.0, only=_ACCUMULATORS),
    Question("orifice_1", "bore of the orifice before the first", "mm", 0.1, 40.0, 2.0, only=_ACCUMULATORS),
    Question("orifice_2", "bore of the orifice before the second", "mm", 0.1, 40.0, 2.0, only=_ACCUMULATORS),
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
