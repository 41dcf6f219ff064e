"""Creates the control law of a mode, for all laws that :mod:`boom_controller.laws` finds."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import cast

from boom_controller import laws
from boom_controller.errors import ControlError
from boom_controller.settings import LawSettings, specifications
from boom_controller.types import Controller
from boom_model.machine import Machine, Pose

MODES = tuple(laws.described())
"""Names of the control laws."""

_MODULE_OF = {name: module for module in laws.modules() for name in module.LAWS}


def _kinds() -> list[type[LawSettings]]:
    """The settings classes of the laws, the last first, because a dataclass has the fields of its last base first.

    Raises:
        TypeError: one name has two meanings.
    """
    kinds = list(dict.fromkeys(module.SETTINGS for module in _MODULE_OF.values()))
    told: dict[str, object] = {}
    for kind in kinds:
        for entry in fields(kind):
            here = (entry.default, entry.metadata)
            if told.setdefault(entry.name, here) != here:
                raise TypeError(f"{kind.__module__}: another law has a setting {entry.name}, with another meaning")
    return [kind for kind in reversed(kinds) if kind is not LawSettings]


@dataclass(frozen=True)
class Settings(*_kinds()):  # type: ignore[misc]
    """Settings of a controller, that is, of all control laws, SI; ranges and meaning in ``SETTINGS``.

    Raises:
        ControlError: a number that is not finite or outside its range.
    """


SETTINGS = specifications(Settings)
"""Name, default, description, unit, range of every field of :class:`Settings`."""


def make_controller(mode: str, machine: Machine, pose: Pose, settings: Settings | None = None) -> Controller:
    """The controller of a mode for a machine in a pose; the pose includes the configured load.

    Raises:
        ControlError: no such mode, or the machine lacks a component that the mode needs.
    """
    if mode not in MODES:
        raise ControlError(f"mode {mode}: there is {', '.join(MODES)}")
    return cast(Controller, _MODULE_OF[mode].make(mode, machine, pose, Settings() if settings is None else settings))
