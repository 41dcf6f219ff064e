"""Renders the HTML of the reports: templates beside the modules that fill them, every value escaped where it is put in.

A section is a template. A function may give a fragment of its own (`Markup`) where it is one element, or a drawing that is
computed from coordinates.
"""

from __future__ import annotations

from functools import cache
from math import isfinite
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from boom_input.shown import printable
from boom_report.channels import number


def render(template: str, **values: Any) -> Markup:
    """HTML of a template, e.g. "boom_report/validation/report.html"; what is no `Markup` among the values is escaped."""
    package, _, path = template.partition("/")
    return Markup(_environment(package).get_template(path).render(values))


@cache
def _environment(package: str) -> Environment:
    environment = Environment(
        loader=PackageLoader(package, "."),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(number=number, fixed=_fixed, general=_general, finite=isfinite)
    return environment


def _shown(value: Any) -> Any:
    """Foreign text without control characters: a terminal that shows a page would obey them."""
    return printable(value) if type(value) is str else value


def _fixed(value: float, places: int) -> str:
    return f"{value:.{places}f}"


def _general(value: float, digits: int = 6) -> str:
    return f"{value:.{digits}g}"
