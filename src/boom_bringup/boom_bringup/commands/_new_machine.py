"""What `./boom new-machine` reads, computes and prints: recordings, what they tell, the manoeuvre to record next."""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boom_bringup.cli import UsageError
from boom_bringup.commands._manoeuvre import Manoeuvre, best_manoeuvre
from boom_bringup.outputs import write_text
from boom_bringup.showing import diagnose_next, progress
from boom_input.shown import typable
from boom_model.owner.questions import Answer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from boom_checks.doubts import FirstLook
    from boom_identification.foresight import NumberForesight, NumberInformation
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

    Array = NDArray[np.float64]

_DEGREE = math.pi / 180
_LISTED = 6
"""Numbers that a sentence lists."""


def read(args: argparse.Namespace, answers: dict[str, Answer]) -> dict[str, Recording]:
    """The recordings by the names under which the user knows them; their pose and machine are taken as answers.

    Raises:
        UsageError: recordings of several poses, or one given twice.
        RecordingError: as `boom_recording.loading.load`.
    """
    from boom_bringup.given import load_given, refuse_repeated, sha256

    wanted = argparse.Namespace(q3=answers.get("q3"), q4=answers.get("q4"), load=args.load, joint=args.joint, joints={})
    recordings = {bag: load_given(bag, wanted) for bag in args.bags}
    refuse_repeated(list(recordings), [sha256(recording.path) for recording in recordings.values()])
    poses = {(r.configuration.outer_boom_angle, r.configuration.telescope_length) for r in recordings.values()}
    if len(poses) > 1:
        listed = "; ".join(f"q3 = {q3:g} rad, q4 = {q4:g} m" for q3, q4 in sorted(poses))
        raise UsageError(f"recordings of several poses ({listed}): a first machine file is for one; give those of one")
    for q3, q4 in poses:
        answers["q3"], answers["q4"] = float(q3), float(q4)
    named = {r.configuration.machine for r in recordings.values()} - {""}
    if len(named) == 1:
        answers.setdefault("name", named.pop())
    return recordings


def sensors(recordings: Iterable[Recording]) -> dict[str, float]:
    """Section ``control`` of a machine file: resolution and noise of the sensors, as the recordings show them; coarsest ones.

    The noise of the angle counts as a resolution of the same variance.
    """
    from boom_recording.measurement import measurements

    found: dict[str, list[float]] = {}
    for recording in recordings:
        for name, channel in measurements(recording).items():
            if not channel.independent or not math.isfinite(channel.sigma):
                continue
            if name == "angle":
                found.setdefault("Ts", []).append(channel.period)
                found.setdefault("q2_quant", []).append(math.sqrt(12.0) * channel.deviation)
            elif name in ("hose_pressure", "rod_pressure"):
                found.setdefault("p_quant", []).append(channel.quantum)
                found.setdefault("p_noise_psd", []).append(channel.sigma**2 * channel.period)
    return {key: max(values) for key, values in found.items()}


def checked_machine(text: str, path: Path) -> Machine:
    """The machine of a file that is to be written.

    Raises:
        UsageError: the answers make no machine.
    """
    from boom_input.yaml_text import parse_yaml
    from boom_model.machine_check import check

    machine, faults = check(parse_yaml(text, str(path)))
    if machine is None:
        raise UsageError(f"these answers make no crane: {faults[0]}")
    return machine


def show_machine(path: Path, machine: Machine) -> None:
    """What the numbers mean, for comparison with the data sheet."""
    from boom_model.derived import quantities
    from boom_report.console import console_for

    console = console_for()
    table = _table(f"{path}: machine {machine.name}, compare with the data sheet", "quantity", "value")
    for row in quantities(machine):
        if not row.meaning.startswith("tolerance"):
            table.add_row(row.meaning, row.value)
    console.print(table)


def show_assumed(proposed: Collection[str]) -> None:
    """What no answer told, so that nobody takes a proposal for the data sheet's number."""
    from boom_model.owner.questions import QUESTIONS
    from boom_report.console import console_for

    taken = [f"{q.key} {q.shown} {q.unit}".strip() for q in QUESTIONS if q.key in proposed]
    if taken:
        console_for().print(
            f"taken as proposed, as no answer told it: {', '.join(taken)}", soft_wrap=True, highlight=False
        )


def tell(machine: Machine, recordings: dict[str, Recording], manoeuvre: Path | None, *, search: bool) -> dict[str, Any]:
    """Print what recordings tell of a machine and, with ``search``, what to record next; the same as a document."""
    if not recordings and not search:
        return {"recordings": [], "told": [], "manoeuvre": None}
    from boom_checks.doubts import first_look
    from boom_identification.foresight import information

    with progress(2 * len(recordings) + 1) as step:
        looks = {}
        for bag, recording in recordings.items():
            step(f"a first look at {recording.name}", 1)
            looks[bag] = first_look(recording, machine)
        sound = [r for bag, r in recordings.items() if not any(check.spoils for check in looks[bag].checks)]
        step("what the recordings tell", len(recordings))
        now = information(sound, machine) if sound else None
        step("what to record next", 1)
        following = best_manoeuvre(machine, sound, now) if search else None
    covered = {bag: _coverage(recording, machine) for bag, recording in recordings.items()}
    _print_looks(looks, covered)
    if now is not None:
        _print_told(now.numbers())
    if following:
        _print_manoeuvre(following, now)
        if manoeuvre:
            write_text(manoeuvre, following.csv())
    return {
        "recordings": [{"bag": bag, **looks[bag].document(), "coverage": covered[bag]} for bag in recordings],
        "told": now.document() if now else [], "manoeuvre": following.document() if following else None,
    }  # fmt: skip


def show_next(path: Path, bags: Sequence[str]) -> None:
    """The commands that come next."""
    program = os.environ.get("BOOM_PROGRAM", "boom")
    words = [*bags, "--machine", str(path)] if bags else ["BAG", "--machine", str(path)]
    print(f"next: {typable(program, 'check-machine', str(path))}")
    print(f"next: {typable(program, 'validate', *words)}")
    print(*diagnose_next(bags or ["BAG"], str(path)), sep="\n")


def _coverage(recording: Recording, machine: Machine) -> list[str]:
    """Sentences on where and how the recording moves the boom, and on sensors that are not there."""
    from boom_recording.measurement import measurements

    low, high = (limit / _DEGREE for limit in machine.angle_limits)
    signal = recording.signals["angle"]
    seen = signal.values[signal.valid] / _DEGREE
    if not len(seen):
        return ["no sample of the angle is plausible: it is in degrees where rad are due, or was not measured"]
    begin, end = float(seen.min()), float(seen.max())
    share = 100 * (end - begin) / (high - low)
    said = [f"angle {begin:.1f} .. {end:.1f} deg of {low:.1f} .. {high:.1f} deg, {share:.0f} % of the range"]
    if begin < low - 0.5 or end > high + 0.5:
        said.append("the angle leaves what the linkage allows: measure lowest_angle, closed_length and stroke again")
    for name, measured in measurements(recording).items():
        label = name.replace("_", " ")
        if measured.samples == 0:
            said.append(f"no {label}: what only it shows cannot be told")
        elif measured.derived_from:
            said.append(f"the {label} is computed from the {measured.derived_from}: both count as one")
    return said


def _table(title: str, *headings: str) -> Any:
    from rich.table import Table

    table = Table(title=title, box=None, title_justify="left", pad_edge=False)
    for heading in headings:
        table.add_column(heading, overflow="fold", no_wrap=heading == headings[0])
    return table


def _print_looks(looks: dict[str, FirstLook], covered: dict[str, list[str]]) -> None:
    from boom_report.console import console_for

    console = console_for()
    for bag, look in looks.items():
        console.print(f"\n{bag}", soft_wrap=True, markup=False)
        for check in look.checks:
            use = "repair it first; not used below" if check.spoils else "a remark"
            console.print(f"  doubt: {check.sentence} ({use})", soft_wrap=True, markup=False)
        for sentence in covered[bag]:
            console.print(f"  {sentence}", soft_wrap=True, markup=False)


_WORDS = {
    "told": "told", "only together": "told only together with others", "hardly": "hardly told", "not": "not told",
}  # fmt: skip


def _print_told(numbers: Sequence[NumberForesight]) -> None:
    from boom_report.console import console_for

    console = console_for()
    title = "before anything is fitted: what the recordings tell, if the physics is that of the file"
    table = _table(title, "number", "value", "unit", "tolerance left", "is")
    for row in numbers:
        partners = ", ".join(row.partners)
        word = _WORDS[row.word] if not (row.word == "only together" and partners) else f"told only with {partners}"
        table.add_row(row.name, f"{row.value:.4g}", row.unit, f"{100 * row.stays:.0f} %", word)
    console.print("")
    console.print(table)


def _print_manoeuvre(following: Manoeuvre, now: NumberInformation | None) -> None:
    from boom_identification.foresight import WELL
    from boom_report.console import console_for

    before = {row.name: row.stays for row in now.numbers()} if now else {}
    better = [
        f"{row.name} {100 * before.get(row.name, 1.0):.0f} -> {100 * row.stays:.0f} %"
        for row in following.told.numbers()
        if before.get(row.name, 1.0) > WELL and row.stays < 0.8 * before.get(row.name, 1.0)
    ]
    more = f" and {len(better) - _LISTED} more" if len(better) > _LISTED else ""
    text = ", ".join(better[:_LISTED]) + more or "no number much better than now"
    console = console_for()
    console.print(f"\nrecord next: {following.sentence}", soft_wrap=True, markup=False)
    console.print(f"  tolerance left then: {text}", soft_wrap=True, markup=False)
