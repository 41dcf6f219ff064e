"""Declares a node's parameters from a table with unit and range; refuses impossible and misspelt ones at start.

rclpy ignores a parameter that was never declared, and a section of a parameter file whose name is not exactly the
node's. Both are errors here, with the nearest name, because a machine that runs with other numbers than its file says
is worse than one that does not run.
"""

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from boom_input.files import InputError
from boom_input.shown import quoted
from boom_input.yaml_text import read_yaml
from boom_node.errors import HelpError, StartError

if TYPE_CHECKING:
    from rclpy.node import Node

Value = bool | int | float | str | Sequence[str] | Sequence[float]

process_arguments: list[str] = []  # what `boom_node.shell.run` was called with; tells which parameter files were given


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter of a node.

    name         as in ``-p name:=value``
    default      its type is the parameter's type (bool, int, float, str, list of str, list of float)
    description  one sentence; the unit is added
    unit         SI unit, "" where there is none
    minimum, maximum   allowed range of a number, None = unbounded; both included
    choices      allowed values of a text
    read_only    True: cannot be changed while the node runs
    """

    name: str
    default: Value
    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False

    def label(self) -> str:
        """Description with unit and range, for the descriptor and error messages."""
        text = self.description + (f" [{self.unit}]" if self.unit else "")
        if self.minimum is not None or self.maximum is not None:
            text += f", {self.allowed()}"
        return text

    def allowed(self) -> str:
        """The allowed values in words."""
        unit = f" {self.unit}" if self.unit else ""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.minimum is not None and self.maximum is not None:
            return f"{self.minimum:g} to {self.maximum:g}{unit}"
        if self.minimum is not None:
            return f"at least {self.minimum:g}{unit}"
        if self.maximum is not None:
            return f"at most {self.maximum:g}{unit}"
        return f"a {_type_name(self.default)}"

    def problem(self, value: Any) -> str | None:
        """Why `value` is refused, in one line, or None if it is valid."""
        wanted = _type_name(self.default)
        if isinstance(self.default, float) and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if _type_name(value) != wanted and not (wanted.startswith("list") and list(value or []) == []):
            return f"parameter '{self.name}' is {quoted(repr(value))}: give a {wanted} ({self.allowed()})"
        if isinstance(value, float) and not math.isfinite(value):
            return f"parameter '{self.name}' is {value}: give a finite number ({self.allowed()})"
        number = isinstance(value, int | float) and not isinstance(value, bool)
        low, high = self.minimum, self.maximum
        outside = number and ((low is not None and value < low) or (high is not None and value > high))
        if outside or (self.choices and value not in self.choices):
            return f"parameter '{self.name}' is {quoted(repr(value))}: allowed is {self.allowed()}"
        return None


def declare(node: "Node", specs: Sequence[ParameterSpec]) -> SimpleNamespace:
    """Declare `specs` on `node` and return their values as attributes (a dot in a name becomes an underscore).

    Raises StartError for a value of another type or outside its range, for an override that names no parameter of the
    node, and for a parameter file without a section for the node. Later changes from outside are refused for the same
    reasons. Raises HelpError where the process was started with ``--help``.
    """
    if {"-h", "--help"} & set(process_arguments):
        raise HelpError("\n".join(_explained(specs)))
    check_files(process_arguments, node.get_fully_qualified_name())
    by_name = {spec.name: spec for spec in specs}
    overrides: Mapping[str, Any] = node._parameter_overrides
    for name in overrides:
        if name not in by_name and not node.has_parameter(name) and not name.startswith("qos_overrides."):
            raise StartError(f"{node.get_name()} has no parameter '{name}'{nearest(name, by_name)}")
    values = SimpleNamespace()
    for spec in specs:
        setattr(values, spec.name.replace(".", "_"), _declare_one(node, spec, overrides))
    node.add_on_set_parameters_callback(_guard(by_name))
    return values


def _explained(specs: Sequence[ParameterSpec]) -> Iterator[str]:
    yield "parameters, each with -p name:=value behind --ros-args, or --params-file FILE:"
    for spec in specs:
        yield f"  {spec.name}  {spec.label()}" + (f"; one of {', '.join(spec.choices)}" if spec.choices else "")
        yield f"      {'cannot change while the node runs; ' if spec.read_only else ''}default {spec.default!r}"


def nearest(name: str, names: Any) -> str:
    """Part of a sentence that proposes the most similar of `names`, or lists them all if none is similar."""
    names = sorted(names)
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    if close:
        return f": did you mean '{close[0]}'?"
    return f"; it has: {', '.join(names)}" if names else ""


def check_files(arguments: Sequence[str], node_name: str) -> None:
    """Check that each parameter file named in the ROS arguments has a section for `node_name` (fully qualified).

    Raises StartError if a file cannot be read, is no parameter file or has no section for the node.
    """
    for path, sections in read_files(arguments).items():
        if not any(_matches(section, node_name) for section in sections):
            raise StartError(
                f"parameter file {path} has nothing for {node_name}, only for {quoted(', '.join(sections))}: "
                f"name the section '{node_name}' or '/**'"
            )


def read_files(arguments: Sequence[str]) -> dict[Path, list[str]]:
    """The node names for which the parameter files named in the ROS arguments have sections.

    Raises StartError if a file cannot be read or is no parameter file.
    """
    files = [Path(arguments[i + 1]) for i, argument in enumerate(arguments[:-1]) if argument == "--params-file"]
    return {path: _read_sections(path) for path in files}


def _read_sections(path: Path) -> list[str]:
    try:
        document = read_yaml(path, hexadecimal=True)
    except InputError as error:
        raise StartError(f"parameter file {error}") from None
    sections = sorted(set(_sections(document, "")))
    if not sections:
        raise StartError(
            f"parameter file {path} has no 'ros__parameters': write a node's name and below it 'ros__parameters:'"
        )
    return sections


def _sections(document: Any, prefix: str) -> Iterator[str]:
    if not isinstance(document, dict):
        return
    for key, value in document.items():
        if key == "ros__parameters":
            yield prefix or "/"
        else:
            yield from _sections(value, f"{prefix}/{key.strip('/')}")


def _matches(section: str, node_name: str) -> bool:
    pattern, name = section.strip("/").split("/"), node_name.strip("/").split("/")

    def match(i: int, j: int) -> bool:
        if i == len(pattern):
            return j == len(name)
        if pattern[i] == "**":
            return any(match(i + 1, k) for k in range(j, len(name) + 1)) or (i + 1 == len(pattern))
        return j < len(name) and pattern[i] in ("*", name[j]) and match(i + 1, j + 1)

    return match(0, 0)


def _declare_one(node: "Node", spec: ParameterSpec, overrides: Mapping[str, Any]) -> Any:
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
    from rclpy.parameter import Parameter

    descriptor = ParameterDescriptor(description=spec.label(), read_only=spec.read_only)
    if spec.minimum is not None and spec.maximum is not None:
        if isinstance(spec.default, float):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=spec.minimum, to_value=spec.maximum, step=0.0)
            ]
        elif isinstance(spec.default, int):
            descriptor.integer_range = [IntegerRange(from_value=int(spec.minimum), to_value=int(spec.maximum), step=1)]
    value: Any = spec.default
    if spec.name in overrides:
        value = overrides[spec.name].value
        problem = spec.problem(value)
        if problem:
            raise StartError(problem)
        if isinstance(spec.default, float):
            value = float(value)
    default = list(value) if isinstance(value, tuple | list) else value
    if default == []:
        kind = (
            Parameter.Type.STRING_ARRAY if _type_name(spec.default) == "list of texts" else Parameter.Type.DOUBLE_ARRAY
        )
        node.declare_parameter(spec.name, kind, descriptor, ignore_override=True)
        node.set_parameters([Parameter(spec.name, kind, [])]) if not spec.read_only else None
        return []
    declared = node.declare_parameter(spec.name, default, descriptor, ignore_override=True).value
    return list(declared) if isinstance(default, list) else declared


def _guard(by_name: Mapping[str, ParameterSpec]) -> Any:
    from rcl_interfaces.msg import SetParametersResult

    def guard(changed: Sequence[Any]) -> Any:
        for parameter in changed:
            spec = by_name.get(parameter.name)
            problem = spec.problem(parameter.value) if spec else None
            if problem:
                return SetParametersResult(successful=False, reason=problem)
        return SetParametersResult(successful=True)

    return guard


def _type_name(value: Any) -> str:
    if isinstance(value, bool):
        return "truth value (true or false)"
    if isinstance(value, int):
        return "whole number"
    if isinstance(value, float):
        return "number"
    if isinstance(value, str):
        return "text"
    try:
        items = list(value)
    except TypeError:
        return f"{type(value).__name__}"
    if all(isinstance(item, str) for item in items):
        return "list of texts"
    return "list of numbers"
