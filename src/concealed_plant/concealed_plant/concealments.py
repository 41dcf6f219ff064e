"""All concealments in one register: importing this module fills it."""

from __future__ import annotations

from concealed_plant import conceal_hydraulics, conceal_mechanics, conceal_sensors
from concealed_plant.hidden import REGISTER, Concealment

_FILLED_BY = (conceal_mechanics, conceal_hydraulics, conceal_sensors)

CONCEALMENTS: dict[str, Concealment] = dict(REGISTER)
KNOWN: tuple[str, ...] = tuple(name for name, row in CONCEALMENTS.items() if row.known)
OUTSIDE: tuple[str, ...] = tuple(name for name, row in CONCEALMENTS.items() if not row.known)
