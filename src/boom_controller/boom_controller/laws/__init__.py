"""The control laws: each is a module of this folder and is found automatically.

A law's module holds

- ``LAWS``: name -> description in a phrase; plain strings, read without importing the module,
- ``SETTINGS``: the settings of the law, a frozen dataclass derived from :class:`boom_controller.settings.LawSettings`, whose
  fields become parameters of the node,
- ``make(name, machine, pose, settings)``: returns the law of that name, a :class:`boom_controller.types.Controller`.

Node, commands and documents read the choice of laws here. :mod:`boom_controller.controller` creates the laws.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

DEFAULT = "improved"


def described() -> dict[str, str]:
    """Name of every law -> description. Needs the standard library only: ``./boom COMMAND --help`` calls it before the set-up.

    Raises:
        TypeError: a module without ``LAWS``, or two laws with one name.
    """
    found: dict[str, str] = {}
    for name in _names():
        laws = _constant(Path(__file__).with_name(f"{name}.py"), "LAWS")
        if found.keys() & laws.keys():
            raise TypeError(f"two control laws are called {', '.join(found.keys() & laws.keys())}")
        found |= laws
    return found


def modules() -> list[ModuleType]:
    """The laws' modules, in the order of :func:`described`."""
    return [importlib.import_module(f"{__name__}.{name}") for name in _names()]


def _names() -> list[str]:
    return sorted(module.name for module in pkgutil.iter_modules(__path__))


def _constant(path: Path, name: str) -> dict[str, str]:
    for statement in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.Assign) and getattr(statement.targets[0], "id", "") == name:
            value: dict[str, str] = ast.literal_eval(statement.value)
            return value
    raise TypeError(f"control law {path.name} has no {name}")
