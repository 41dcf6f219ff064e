"""The reference, made from the code: commands, topics, parameters of the nodes, modules of the packages."""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from boom_bringup import cli
from boom_input.channels import of_topic
from boom_node.parameters import ParameterSpec
from boom_recording.channels import TYPES

ROOT = Path(__file__).resolve().parents[1]
_MADE = "Made by `./boom python docs/build.py` from the code: edit that. Terms: [glossary](../glossary.md)."
LONGEST = 158
"""Characters of a cell."""


def _cell(text: str) -> str:
    """Text that a table can hold: one line, no bar, not too long."""
    flat = " ".join(text.replace("%%", "%").split()).replace("|", "\\|").replace("<", "&lt;")
    return flat if len(flat) <= LONGEST else flat[: LONGEST - 2].rsplit(" ", 1)[0] + " …"


def _table(heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return [*lines, *("| " + " | ".join(_cell(cell) for cell in row) + " |" for row in rows), ""]


def _options(parser: argparse.ArgumentParser) -> list[tuple[str, ...]]:
    rows = []
    for action in parser._actions:
        if isinstance(action, argparse._HelpAction) or action.help is argparse.SUPPRESS:
            continue
        value = action.metavar or ("" if action.nargs == 0 else action.dest.upper())
        value = " ".join(value) if isinstance(value, tuple) else value
        if action.choices is not None and action.metavar is None:
            value = "{" + ",".join(map(str, action.choices)) + "}"
        name = " ".join([", ".join(action.option_strings), str(value)]).strip()
        rows.append((f"`{name}`", (action.help or "").replace("%(default)s", str(action.default))))
    return rows


def commands() -> str:
    """All commands with their options."""
    lines = [
        "# Commands",
        _MADE,
        "",
        "Each has `--help`. Exit status: 0 done, 1 done with a negative result, 2 wrong input, 130 Ctrl-C.",
        "",
    ]
    for name in cli.command_names():
        module = importlib.import_module(f"boom_bringup.commands.{cli.module_name(name)}")
        parser = argparse.ArgumentParser(prog=name, add_help=True)
        module.add_arguments(parser)
        lines += [f"## {name}", f"{module.HELP[0].upper()}{module.HELP[1:]}.", ""]
        rows = _options(parser)
        lines += _table(("option", "meaning"), rows) if rows else []
    return "\n".join(lines)


def topics() -> str:
    """All topics of recordings with their channels."""
    lines = ["# Topics and channels", _MADE, "", "QoS, rates and other topics: [integration](../integration.md).", ""]
    rows = []
    for topic, kind in TYPES.items():
        for channel in of_topic(topic) or (None,):
            what = (
                ("", "", "")
                if channel is None
                else (f"`{channel.name}`", f"`{channel.field}`", f"{channel.low:g} .. {channel.high:g} {channel.unit}")
            )
            rows.append((f"`{topic}`", kind, *what))
    return "\n".join([*lines, *_table(("topic", "type", "signal", "field", "plausible"), rows)])


def _parameters_of(module: Any) -> list[ParameterSpec]:
    own = getattr(module, "PARAMETERS", None) or getattr(getattr(module, "settings", None), "PARAMETERS", ())
    return [spec for spec in own if isinstance(spec, ParameterSpec)]


def parameters() -> str:
    """The parameters of all nodes with units, ranges and defaults."""
    lines = [
        "# Parameters of the nodes",
        _MADE,
        "",
        "Given as `--ros-args -p name:=value`; a misspelt one is refused.",
        "",
    ]
    for file in sorted((ROOT / "src").glob("boom_*/boom_*/*_node.py")):
        module = importlib.import_module(f"{file.parent.name}.{file.stem}")
        specs = _parameters_of(module)
        if specs:
            lines += [f"## {file.parent.name}.{file.stem}", (inspect.getdoc(module) or "").split("\n")[0], ""]
            rows = [(f"`{spec.name}`", str(spec.default), spec.label()) for spec in specs]
            lines += _table(("parameter", "default", "meaning"), rows)
    return "\n".join(lines)


def _modules(package: Path) -> Iterator[tuple[str, ast.Module]]:
    for file in sorted(package.rglob("*.py")):
        if not file.name.startswith("_") and not file.name.endswith(".launch.py"):
            yield (
                file.relative_to(package).with_suffix("").as_posix().replace("/", "."),
                ast.parse(file.read_text("utf-8")),
            )


def _public(tree: ast.Module) -> list[str]:
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    return [node.name for node in tree.body if isinstance(node, kinds) and not node.name.startswith("_")]


def modules() -> str:
    """The modules of each package, what they are for, and their public names."""
    lines = ["# Packages and modules", _MADE, "", "Equations, shapes and units are in the docstrings of the names.", ""]
    for package in sorted(path for path in (ROOT / "src").glob("*/*") if (path / "__init__.py").is_file()):
        said = ast.get_docstring(ast.parse((package / "__init__.py").read_text("utf-8"))) or ""
        lines += [f"## {package.name}", said.split("\n")[0], ""]
        rows = []
        for name, tree in _modules(package):
            names = ", ".join(f"`{one}`" for one in _public(tree))
            rows.append((f"`{name}`", (ast.get_docstring(tree) or "").split("\n")[0], names))
        lines += _table(("module", "for", "public names"), rows)
    return "\n".join(lines)


INDEX = f"""# Reference
{_MADE}

- [Commands](commands.md) and their options
- [Topics and channels](topics.md) of recordings
- [Parameters](parameters.md) of the nodes
- [Packages and modules](modules.md)
- [Components, symbols, states and effects](../theory.md) of the model, with equations
- [Machine file](../machine_file.md)
"""
PAGES = {"index": lambda: INDEX, "commands": commands, "topics": topics, "parameters": parameters, "modules": modules}
"""Name of the page in docs/reference -> what makes it."""
