"""Where the numbers come from: machine file, recordings with their checksums, version, command."""

from __future__ import annotations

import hashlib
from collections import Counter
from importlib.resources import files
from pathlib import Path

from markupsafe import Markup

from boom_identification.validation import Validation
from boom_model.machine import Machine
from boom_recording import bag_folder
from boom_recording.errors import RecordingError
from boom_recording.recording import Recording
from boom_report.templates import render

INFERRED = (
    "The numbers of this machine come from the thesis, from public descriptions of an Epsilon crane of the same "
    "institute, and from literature; that it is the thesis' crane is inferred (same institute, fold angle, reach and "
    "gripper), not stated anywhere."
)


def section(validation: Validation, machine: Machine | None, machine_source: str | Path | None) -> Markup:
    """HTML: inputs with checksums, and every number of the machine with source and confidence."""
    rows = [
        (bag.recording.name, file, checksum)
        for bag in validation.bags
        for file, checksum in recording_files(bag.recording)
    ]
    if machine_source is not None:
        rows.append((f"machine {validation.machine}", *machine_file(machine_source)))
    return files_table(rows) + (Markup() if machine is None else machine_section(machine))


def files_table(rows: list[tuple[str, str, str]]) -> Markup:
    """HTML: (what it is, file, sha256) of each input."""
    return render("boom_report/files.html", rows=rows)


def recording_files(recording: Recording) -> list[tuple[str, str]]:
    """(file name, sha256) of the files a recording was read from; none where it was made in memory."""
    return bag_files(recording.path)


def bag_files(path: Path) -> list[tuple[str, str]]:
    """(file name, sha256) of the files of a bag; none where there is none."""
    try:
        found = bag_folder.find(path).files
    except RecordingError:
        return []
    return [(file.name, _sha256(file)) for file in found]


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        return f"not readable any more: {error.strerror}"


def machine_file(source: str | Path) -> tuple[str, str]:
    """(file name, sha256) of a machine file, given as a path or as the name of a shipped one."""
    shipped = files("boom_model").joinpath("machines", f"{source}.yaml")
    if not Path(source).is_file() and shipped.is_file():
        return f"{source}.yaml (shipped)", hashlib.sha256(shipped.read_bytes()).hexdigest()
    return Path(source).name, _sha256(Path(source))


def machine_section(machine: Machine) -> Markup:
    """HTML: every number of a machine with source and confidence, and the effects that it carries."""
    parameters = machine.parameters.values()
    sure = Counter(p.confidence or "not rated" for p in parameters)
    return render(
        "boom_report/machine.html",
        machine=machine,
        inferred=INFERRED if any("literature(R1)" in p.source for p in parameters) else "",
        confidence=", ".join(f"{count} {name}" for name, count in sorted(sure.items(), key=lambda item: -item[1])),
    )
