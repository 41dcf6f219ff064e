"""The C source of an FMU: the generated model, its integrator, the tables of its variables, the interface. One file."""

from __future__ import annotations

from importlib.resources import files

import casadi as ca

from boom_model import rest
from boom_model.codegen.compiled import c_text, model_source
from boom_model.codegen.source import Further
from boom_model.fmu.variables import FmuVariable, c_array
from boom_model.plant import FIRST_STEP, LARGEST_SPOOL, ORDER_3_ABOVE, Plant
from boom_model.sensors import PRESSURES
from boom_model.state import ELAPSED_TIME

TOLERANCE, FINEST, COARSEST = 1e-9, 1e-12, 1e-3
"""Relative tolerance of the integration unless the importer gives one, and what is taken of what it gives."""
_COINCIDENT = 1e-12
_HEADER = """/* A crane boom as an FMU for co-simulation, made by ./boom export-fmu.
   Any C11 compiler builds the library from this file alone. */
#if defined(_MSC_VER) && !defined(__clang__)
#define __attribute__(x)
#endif
"""


def fmu_source(plant: Plant, rows: list[FmuVariable], version: int, token: str) -> str:
    """The source of one machine for FMI ``version`` 2 or 3; ``token`` ties it to its model description."""
    m = plant.equations
    s, state = rest.start_state(m)
    inner = ca.vertcat(*(value for _, value in m.auxiliary.values()))
    model = model_source(m, further=(Further("rest", s, state), Further("inner", m.x, inner)))
    interface = files("boom_model.fmu")
    parts = (
        _HEADER, model, c_text("integrator.c"), _tables(plant, rows, token),
        *(interface.joinpath(name).read_text() for name in ("machine.c", f"fmi{version}.c")),
    )  # fmt: skip
    return "\n".join(parts)


def _tables(plant: Plant, rows: list[FmuVariable], token: str) -> str:
    states, names = plant.equations.states, plant.state_names
    inputs = [row for row in rows if row.causality == "input"]
    numbers = [row for row in rows if row.causality == "parameter"]
    start = len(rest.START)
    elapsed = names.index(ELAPSED_TIME.name) if ELAPSED_TIME.name in names else -1
    constants = {
        "NA": len(plant.equations.auxiliary), "NS": start, "ELAPSED": elapsed,
        "SPOOL_STROKE": plant.parameter_names.index("main_valve_spool.s_max"), "LARGEST_SPOOL": LARGEST_SPOOL,
        "TOLERANCE": TOLERANCE, "FINEST": FINEST, "COARSEST": COARSEST, "ORDER_3_ABOVE": ORDER_3_ABOVE,
        "FIRST_STEP": FIRST_STEP, "COINCIDENT": _COINCIDENT, "TOKEN": f'"{token}"',
    }  # fmt: skip
    command, pressures = plant.delay_indices
    tables = (
        c_array("X_SCALE", plant.scale.tolist()), c_array("X_MINIMUM", plant.minimum.tolist()),
        c_array("X_MAXIMUM", plant.maximum.tolist()), c_array("IS_SPOOL", [state.is_spool for state in states], "int"),
        c_array("X_NAMES", [f"{state.name} ({state.symbol})" for state in states], "char *const"),
        c_array("X_UNITS", [state.unit for state in states], "char *const"),
        c_array("IS_PRESSURE", PRESSURES.tolist(), "int"),
        _table("U", inputs), c_array("U_START", [row.start or 0.0 for row in inputs]),
        _table("N", numbers), c_array("N_FIXED", [row.variability == "fixed" for row in numbers], "int"),
        c_array("P_START", [row.start or 0.0 for row in numbers[:-start]]),
        c_array("START_START", [row.start or 0.0 for row in numbers[-start:]]),
        c_array("COMMAND_DELAYS", [*command, -1], "int"), c_array("PRESSURE_DELAYS", [*pressures, -1], "int"),
    )  # fmt: skip
    return "".join(f"#define {name} {value}\n" for name, value in constants.items()) + "".join(tables)


def _table(prefix: str, rows: list[FmuVariable]) -> str:
    """Names, units and limits of what the importer gives."""
    return (
        c_array(f"{prefix}_NAMES", [row.name for row in rows], "char *const")
        + c_array(f"{prefix}_UNITS", ["" if row.unit == "-" else row.unit for row in rows], "char *const")
        + c_array(f"{prefix}_MINIMUM", [row.minimum for row in rows])
        + c_array(f"{prefix}_MAXIMUM", [row.maximum for row in rows])
    )
