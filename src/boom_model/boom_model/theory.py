"""The tables of docs/theory.md, made from the data of the model: components, specifications, states, effects.

python -m boom_model.theory docs/theory.md           writes the tables between their markers
python -m boom_model.theory docs/theory.md --check   exit status 1 if they are not up to date
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable
from math import isfinite
from pathlib import Path

from boom_input.channels import PREDICTED
from boom_model.catalogue import CATALOGUE
from boom_model.equations import INPUTS, full_model, reduced_model
from boom_model.errors import ModelError
from boom_model.machine_file import load_machine, shipped_machines
from boom_model.slots import registered
from boom_model.specification import Specification
from boom_model.state import State
from boom_model.structure import SLOTS, structure

_MARK = "<!-- {name}: {end} (made by python -m boom_model.theory) -->"

_STATE_EQUATIONS = {
    "angle": "5.39a", "rate": "5.39a", "head_pressure": "5.39c, 5.47c", "rod_pressure": "5.39d, 5.47d",
    "hose_pressure": "5.39i", "accumulator_pressure_1": "5.39g", "accumulator_pressure_2": "5.39h",
    "spool_position": "5.39n", "spool_velocity": "5.39n,o", "pilot_retract": "5.39p", "pilot_extend": "5.39s",
}  # fmt: skip
_INPUT_SYMBOLS = ("i_+", "i_-")
_AUXILIARY = {
    "head_flow": ("q_a", "5.39f"), "hose_flow": ("q_h", "5.39l"), "rod_flow": ("q_b", "5.39m"),
    "pilot_pressure_difference": ("p_+ - p_-", "5.39r,u"), "piston_position": ("s_p", "3.13a"),
    "jacobian": ("J", "3.13b"), "piston_velocity": ("w_p", "3.13b"), "force": ("f_p", "3.12"),
    "friction_torque": ("tau_f", "5.39b"), "gravity_torque": ("g(q_2)", "5.39a"),
}  # fmt: skip


def all_specifications() -> tuple[Specification, ...]:
    """Every parameter of every structure, each once, in the order of the components."""
    found = {spec.key: spec for spec in structure().specifications()}
    for spec in (spec for slot in SLOTS for c in registered(slot) for spec in c.specifications):
        found.setdefault(spec.key, spec)
    return tuple(found.values())


def all_states() -> tuple[State, ...]:
    """Every state that the full model can have, those of the thesis' structure first."""
    thesis = structure()
    lagging = [effect for effect in CATALOGUE if effect.states]
    found = {state.name: state for state in full_model(thesis, [e.id for e in lagging if thesis.has(e.needs)]).states}
    for other in (thesis.with_component(c) for slot in SLOTS for c in registered(slot)[1:]):
        own = [effect.id for effect in lagging if not thesis.has(effect.needs) and other.has(effect.needs)]
        for state in full_model(other, own).states:
            found.setdefault(state.name, state)
    return tuple(found.values())


def symbols_table() -> str:
    """Symbol, code name, unit, equation, source, range of everything that the equations contain."""
    nominal, *examples = (load_machine(name) for name in sorted(shipped_machines(), key=lambda name: name != "tz17"))
    rows = []
    for name, symbol in zip(INPUTS, _INPUT_SYMBOLS, strict=True):
        rows.append((symbol, f"input `{name}`", "A", "5.39p,s", "measured", ""))
    reduced = set(reduced_model(structure()).state_names)
    for state in all_states():
        model = "full and reduced" if state.name in reduced else "full"
        rows.append(
            (
                state.symbol,
                f"state `{state.name}`",
                state.unit,
                _STATE_EQUATIONS.get(state.name, state.equation),
                model,
                _range(state.minimum, state.maximum),
            )
        )
    rows += [(sensor.symbol, f"output `{sensor.name}`", sensor.unit, "ch. 4.2", "measured", "") for sensor in PREDICTED]
    units = {k: unit for k, (unit, _) in full_model(structure()).auxiliary.items()}
    for name, unit in units.items():
        symbol, equation = _AUXILIARY[name]
        rows.append((symbol, f"inner `{name}`", unit, equation, "computed", ""))
    for spec in all_specifications():
        if spec.key.startswith("pose."):
            source = "tabulated or computed from `rigid_body`; load: configuration"
        elif spec.key in nominal.parameters:
            parameter = nominal.parameters[spec.key]
            source = parameter.source + (f", {parameter.confidence}" if parameter.confidence else "")
        else:
            having = next((m for m in examples if spec.key in m.parameters), None)
            told = (
                f"{having.parameters[spec.key].source} in {having.name}" if having else "in no machine that is shipped"
            )
            source = f"not in tz17; {told}" if having else told
        rows.append(
            (spec.symbol, f"`{spec.key}`", spec.unit, spec.equation, source, _range(spec.minimum, spec.maximum))
        )
    return _table(("symbol", "code name", "unit", "equation", "source", "range"), rows)


def components_table() -> str:
    """One row per component that a machine file can name."""
    rows = []
    for c in (c for slot in SLOTS for c in registered(slot)):
        name = str(c.name).lower() if isinstance(c.name, bool) else c.name
        rows.append((f"`{'.'.join(c.key)}: {name}`", c.equation, f"`{c.term}`", c.meaning))
    return _table(("in the machine file", "equation", "term", "component"), rows)


def effects_table() -> str:
    """One row per effect of the catalogue."""
    rows = []
    for effect in CATALOGUE:
        numbers = [
            f"`{row.name}` [{row.unit}] {row.meaning}: neutral {row.neutral:g}, range {row.low:.3g} .. {row.high:.3g}"
            for row in effect.parameters
        ]
        first, *more = numbers
        rows.append(
            (f"`{effect.id}`", f"`{effect.subsystem}`", effect.equation, f"`{effect.term}`", first, effect.regime)
        )
        rows += [("", "", "", "", further, "") for further in more]
    return _table(("effect", "subsystem", "equation", "term", "parameters", "shows"), rows)


TABLES = {"symbols": symbols_table, "effects": effects_table, "components": components_table}


def updated(text: str) -> str:
    """The document with its tables regenerated.

    Raises:
        ModelError: a marker is missing.
    """
    for name, make in TABLES.items():
        begin, end = (_MARK.format(name=name, end=word) for word in ("begin", "end"))
        pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
        if not pattern.search(text):
            raise ModelError(f"the markers of table {name} are missing: add the lines {begin} and {end}")
        before, after = pattern.split(text, maxsplit=1)
        text = f"{before}{begin}\n{make()}\n{end}{after}"
    return text


def main(argv: list[str] | None = None) -> int:
    """Write or check the tables; exit status 1: not up to date, 2: wrong input."""
    parser = argparse.ArgumentParser(
        prog="python -m boom_model.theory", description="Make the tables of docs/theory.md."
    )
    parser.add_argument("document", type=Path, help="Markdown file with the markers, docs/theory.md")
    parser.add_argument(
        "--check", action="store_true", help="change nothing; exit status 1 if a table is not up to date"
    )
    options = parser.parse_args(argv)
    try:
        before = options.document.read_text(encoding="utf-8")
        after = updated(before)
        if not options.check:
            options.document.write_text(after, encoding="utf-8")
    except OSError as error:
        print(f"theory: {options.document}: {error.strerror}", file=sys.stderr)
        return 2
    except ModelError as error:
        print(f"theory: {options.document}: {error}", file=sys.stderr)
        return error.exit_status
    if options.check and before != after:
        print(
            f"theory: {options.document} is not up to date: run python -m boom_model.theory {options.document}",
            file=sys.stderr,
        )
        return 1
    return 0


def _range(low: float, high: float) -> str:
    return f"{low:g} .. {high:g}" if isfinite(low) and isfinite(high) else ""


def _table(head: Iterable[str], rows: Iterable[tuple[str, ...]]) -> str:
    columns = list(head)
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
