"""All concealments in one register: importing this module fills it from every file ``conceal_*.py`` of the package."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

from concealed_plant.hidden import REGISTER, Concealment

for _file in sorted(module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)])):
    if _file.startswith("conceal_"):
        importlib.import_module(f"concealed_plant.{_file}")

CONCEALMENTS: dict[str, Concealment] = dict(REGISTER)
KNOWN: tuple[str, ...] = tuple(name for name, row in CONCEALMENTS.items() if row.known)
OUTSIDE: tuple[str, ...] = tuple(name for name, row in CONCEALMENTS.items() if not row.known)
