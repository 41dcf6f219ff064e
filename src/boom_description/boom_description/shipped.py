"""The robot description of a machine: only tz17 has one, and a wrong geometry is worse than none."""

from __future__ import annotations

from pathlib import Path

DESCRIBED = {"tz17": "epsilon_tz17.urdf"}
"""``meta.name`` of a machine file -> file in the folder ``urdf``."""


def urdf_text(machine: str) -> str:
    """The URDF of a machine, by its ``meta.name``; empty if there is none."""
    path = robot_description(machine)
    return Path(path).read_text(encoding="utf-8") if path else ""


def robot_description(machine: str) -> str:
    """Path of the URDF of a machine, by its ``meta.name``; empty if there is none."""
    name = DESCRIBED.get(machine)
    return str(Path(__file__).with_name("urdf") / name) if name else ""
