"""The plants that a trial can conceal physics in. One more is one more row of ``PLANTS``."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from boom_input.whole import write_whole
from boom_model.catalogue import EFFECTS
from boom_recording import writing
from concealed_plant.cases import cases
from concealed_plant.concealments import CONCEALMENTS
from concealed_plant.generator import ANSWER, HOLD_OUT, RECORDING, make_case
from unseen_plant.families import FAMILIES, gather
from unseen_plant.generator import make
from unseen_plant.lots import Lot, lots

MACHINE = "machine.yaml"
"""In the folder of a case whose crane has a machine file of its own."""


class CaseOfTrial(Protocol):
    """A case before it is made."""

    @property
    def name(self) -> str:
        """Of its folder."""


@dataclass(frozen=True)
class ConcealedForm:
    """For people: form and unit of the size of an effect; whether the catalogue of the diagnosis has it."""

    text: str
    unit: str
    known: bool


@dataclass(frozen=True)
class TrialPlant:
    """A plant of trials.

    Attributes:
        title: in tables.
        structures: kinds of machines that it can have, the default first.
        cases: (seed, count, structures) -> its cases.
        make: (case, machine file, folder of blind sides, folder of sealed sides) -> path of the answer.
        forms: name of each effect -> its form.
    """

    title: str
    structures: tuple[str, ...]
    cases: Callable[[int, int, str], Sequence[CaseOfTrial]]
    make: Callable[..., Path]
    forms: Callable[[], Mapping[str, ConcealedForm]]


def make_unseen_case(lot: Lot, machine: Path, blind: Path, sealed: Path) -> Path:
    """Write a case of plant q as ``concealed_plant.generator.make_case`` writes one of plant p.

    Raises:
        CaseError: it cannot be made.
    """
    answer = sealed / lot.name / ANSWER
    if answer.exists():
        return answer
    for folder in (blind / lot.name, sealed / lot.name):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    case = make(lot, machine)
    writing.write(blind / lot.name / RECORDING, case.first)
    writing.write(sealed / lot.name / HOLD_OUT, case.second)
    if case.machine is not None:
        write_whole(blind / lot.name / MACHINE, case.machine)
    write_whole(answer, json.dumps(case.truth, indent=1, sort_keys=True) + "\n")
    return answer


def _concealed_forms() -> dict[str, ConcealedForm]:
    return {name: ConcealedForm(row.form, row.unit, row.known) for name, row in CONCEALMENTS.items()}


def _unseen_forms() -> dict[str, ConcealedForm]:
    gather()
    return {
        name: ConcealedForm(f"{len(row.forms)} forms: {'; '.join(row.forms)}", row.unit, row.known and name in EFFECTS)
        for name, row in FAMILIES.items()
    }


PLANTS: dict[str, TrialPlant] = {
    "p": TrialPlant(
        "concealed_plant", ("tz17",), lambda seed, count, structures: cases(seed, count), make_case, _concealed_forms
    ),
    "q": TrialPlant(
        "unseen_plant", ("tz17", "any"), lambda seed, count, structures: lots(seed, count, structures == "any"),
        make_unseen_case, _unseen_forms,
    ),
}  # fmt: skip
