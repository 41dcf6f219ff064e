"""Where the numbers come from: machine file, recordings with their checksums, version, command."""

from __future__ import annotations

import hashlib
from collections import Counter
from html import escape
from importlib.resources import files
from pathlib import Path

from boom_identification.validation import Validation
from boom_model.machine import Machine
from boom_recording import bag_folder
from boom_recording.errors import RecordingError
from boom_recording.recording import Recording

INFERRED = (
    "The numbers of this machine come from the thesis, from public descriptions of an Epsilon crane of the same "
    "institute, and from literature; that it is the thesis' crane is inferred (same institute, fold angle, reach and "
    "gripper), not stated anywhere."
)


def section(validation: Validation, machine: Machine | None, machine_source: str | Path | None) -> str:
    """HTML: inputs with checksums, and every number of the machine with source and confidence."""
    rows = [
        (bag.recording.name, file, checksum)
        for bag in validation.bags
        for file, checksum in recording_files(bag.recording)
    ]
    if machine_source is not None:
        rows.append((f"machine {validation.machine}", *machine_file(machine_source)))
    return f"{files_table(rows)}{'' if machine is None else machine_section(machine)}"


def files_table(rows: list[tuple[str, str, str]]) -> str:
    """HTML: (what it is, file, sha256) of each input."""
    listed = "".join(
        f"<tr><td>{escape(what)}</td><td>{escape(file)}</td><td><code class=hash>{checksum}</code></td></tr>"
        for what, file, checksum in rows
    )
    return (
        "<h3>Files</h3><div class=scroll><table><thead><tr><th>input</th><th>file</th><th>sha256</th></tr></thead>"
        f"<tbody>{listed}</tbody></table></div>"
    )


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


def machine_section(machine: Machine) -> str:
    """HTML: every number of a machine with source and confidence, and the effects that it carries."""
    parameters = machine.parameters.values()
    sure = Counter(p.confidence or "not rated" for p in parameters)
    counted = ", ".join(f"{count} {name}" for name, count in sorted(sure.items(), key=lambda item: -item[1]))
    inferred = any("literature(R1)" in p.source for p in parameters)
    effects = "".join(
        f"<li>effect <code>{escape(name)}</code>: {escape(', '.join(f'{k} = {v:g}' for k, v in values.items()))}</li>"
        for name, values in machine.effects.items()
    )
    rows = "".join(
        f"<tr><td><code>{escape(key)}</code></td><td class=n>{escape(', '.join(f'{v:g}' for v in p.value))}</td>"
        f"<td>{escape(p.specification.unit)}</td><td>{escape(p.source)}</td><td>{escape(p.confidence)}</td></tr>"
        for key, p in machine.parameters.items()
    )
    return (
        f"<h3>Machine {escape(machine.name)}</h3>{f'<p>{escape(INFERRED)}</p>' if inferred else ''}"
        f"{f'<p>It carries:</p><ul>{effects}</ul>' if effects else ''}"
        f"<p>{len(machine.parameters)} parameters; confidence in them: {counted}.</p><details><summary>All "
        "parameters with unit, source "
        "and confidence</summary><div class=scroll><table class=compact><thead><tr><th>key</th><th "
        "class=n>value</th><th>unit</th><th>source</th>"
        f"<th>confidence</th></tr></thead><tbody>{rows}</tbody></table></div></details>"
    )
