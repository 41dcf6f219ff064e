"""The FMU as a file: model description, C source and a library for this platform, zipped."""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import zipfile
from dataclasses import dataclass

from boom_model.codegen.compiled import FLAGS, compiled
from boom_model.errors import ModelError
from boom_model.fmu.description import SOURCE, FmuTitle, build_description, description
from boom_model.fmu.source import fmu_source
from boom_model.fmu.variables import FmuVariable, variables
from boom_model.plant import Plant

_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_FMI2 = {"x86_64-linux": "linux64", "x86_64-darwin": "darwin64", "x86_64-windows": "win64"}
_EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Date of the files in the archive: the same machine gives the same bytes."""


@dataclass(frozen=True)
class Exported:
    """An FMU: its bytes, and its variables in the order of their value references."""

    data: bytes
    variables: list[FmuVariable]


def platform_folder(version: int) -> tuple[str, str]:
    """Folder of this platform's library below ``binaries``, and the library's suffix.

    Raises:
        ModelError: FMI has no name for this platform.
    """
    system, suffix = _SYSTEMS.get(sys.platform, ("", ""))
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    if not system:
        raise ModelError(f"FMI has no name for the platform {sys.platform}: export on Linux, macOS or Windows")
    folder = f"{machine}-{system}"
    return (_FMI2.get(folder, folder) if version == 2 else folder), suffix


def export(plant: Plant, angle: float, *, version: int = 3, program: str = "") -> Exported:
    """The FMU of a machine in a pose.

    Args:
        plant: the machine in its pose; its effects and learnt terms are in the equations, its numbers are parameters.
        angle: boom angle at the start [rad], where the boom is at rest.
        version: of FMI, 2 or 3.
        program: version of the program that writes it.

    Raises:
        BuildError: no C compiler.
        ModelError: an angle outside the stroke, or a platform that FMI does not know.
    """
    plant.check_angle(angle)
    folder, suffix = platform_folder(version)
    rows = variables(plant, angle)
    about = FmuTitle(plant.machine.name, meaning(plant), program)
    blank = fmu_source(plant, rows, version, "") + description(about, rows, version, "").decode()
    digest = hashlib.sha256(blank.encode()).hexdigest()
    token = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
    source = fmu_source(plant, rows, version, token)
    content = {
        "modelDescription.xml": description(about, rows, version, token),
        f"sources/{SOURCE}": source.encode(),
        f"binaries/{folder}/{about.identifier}{suffix}": compiled(source, (*FLAGS, "-fvisibility=hidden")),
    }
    if version == 3:
        content["sources/buildDescription.xml"] = build_description(about)
    return Exported(_zipped(content), rows)


def meaning(plant: Plant) -> str:
    """What the FMU is, in a sentence."""
    pose, machine = plant.pose, plant.machine
    added = [*machine.effects, *(f"a learnt term in {term.equation}" for term in machine.learned)]
    physics = f"; with {', '.join(name.replace('_', ' ') for name in added)}" if added else ""
    where = f"q3 = {pose.outer_boom_angle:g} rad, q4 = {pose.telescope_length:g} m, load {pose.load:g} kg"
    return f"boom of the crane {machine.name}, {where}{physics}"


def _zipped(content: dict[str, bytes]) -> bytes:
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, _EARLIEST)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o755 << 16
            archive.writestr(entry, data)
    return memory.getvalue()
