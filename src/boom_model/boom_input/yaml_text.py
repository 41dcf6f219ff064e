"""Reads all YAML: machine files, mappings, parameters, metadata of bags.

YAML can be written so that a kilobyte becomes a gigabyte (aliases), a stack overflows (nesting) or a constructor raises any
exception (dates, numbers of 5000 digits, tags). So the document is built here from the parser's events, in one pass and without
recursion: aliases and tags are refused; size, depth, digits and keys are limited; dates stay text; keys are always text; and a
key given twice, which would silently drop the first, is an error. Every error is one line with file and line number.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import SafeConstructor
from yaml.resolver import Resolver

from boom_input.files import TEXT_LIMIT, InputError, read_text
from boom_input.shown import quoted

try:
    from yaml import CSafeLoader as _Loader  # ten times faster, and the same
except ImportError:  # PyYAML built without libyaml
    from yaml import SafeLoader as _Loader  # type: ignore[assignment]

DEEPEST = 32
"""Levels of nesting; our own files have at most seven."""
MOST_VALUES = 100_000
LONGEST_NUMBER = 64
LONGEST_KEY = 200

_TAG = "tag:yaml.org,2002:"
_CONSTRUCT = {
    f"{_TAG}int": SafeConstructor.construct_yaml_int,
    f"{_TAG}float": SafeConstructor.construct_yaml_float,
    f"{_TAG}bool": SafeConstructor.construct_yaml_bool,
    f"{_TAG}null": SafeConstructor.construct_yaml_null,
}
_RESOLVERS = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag in _CONSTRUCT]  # dates and << stay text
    for first, resolvers in Resolver.yaml_implicit_resolvers.items()
}
_CONSTRUCTOR = SafeConstructor()
_NUMBER = re.compile(r"[-+.\d][-+.\d_:eExXoObBa-fA-F]*")
_OTHER_BASE = re.compile(r"[-+]?(0[0-7_]+|[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?)")
"""YAML 1.1 reads 017 as 15 and 1:30 as 90."""
_BINARY = re.compile(r"[-+]?0(b[01]|x[0-9a-fA-F])[0-9a-fA-F_]*")
_SHORT_FLOAT = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+")
"""YAML 1.1 reads 1.6e9 and 5e-05 as texts, and only 1.6e+9 and 5.0e-05 as numbers."""
_DIRECTIVE = re.compile(r"^%TAG", re.MULTILINE)
_TEXT_TAGS = (None, "!", f"{_TAG}str")
_UNWANTED = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff]")
"""Control characters except tab and line ends: they come from escapes such as "\\e" and act on a terminal."""


def read_yaml(path: str | Path, *, hexadecimal: bool = False) -> Any:
    """The document in a YAML file; ``hexadecimal``: as of `parse_yaml`.

    Raises:
        InputError: not a regular file of at most 1 MB, or as `parse_yaml`.
    """
    return parse_yaml(read_text(path), str(path), hexadecimal=hexadecimal)


def parse_yaml(text: str, name: str, *, hexadecimal: bool = False) -> Any:
    """The document in a YAML text; an error message begins with `name`.

    ``hexadecimal``: numbers such as 0x1F are read, as identifiers on a bus are written; elsewhere one is a slip.

    Raises:
        InputError: not YAML, or more than such a file can need (size, aliases, depth, digits, tags, a key given twice).
    """
    if len(text) > TEXT_LIMIT:
        raise InputError(f"{name}: it is larger than {TEXT_LIMIT / 1e6:g} MB, more than such a file can hold")
    if _DIRECTIVE.search(text):  # libyaml compares each with all before
        raise InputError(f"{name}: not readable as YAML: the directive %TAG is not known here, leave it out")
    try:
        return _build(yaml.parse(text, Loader=_Loader), hexadecimal=hexadecimal)
    except _RefusedError as refusal:
        raise InputError(f"{name}, line {refusal.line}: {refusal}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or error
        raise InputError(f"{name}{line}: not readable as YAML: {quoted(problem)}") from None


def line_of(text: str, keys: Sequence[str]) -> int | None:
    """The line that holds the last of these keys, or the last one that exists, in a text that `parse_yaml` has read."""
    places: dict[tuple[str, ...], int] = {}
    _build(yaml.parse(text, Loader=_Loader), places)
    return next((places[tuple(keys[:n])] for n in range(len(keys), 0, -1) if tuple(keys[:n]) in places), None)


class _RefusedError(Exception):
    def __init__(self, event: yaml.Event, problem: str) -> None:
        super().__init__(problem)
        self.line = getattr(event.start_mark, "line", 0) + 1


def _build(
    events: Iterable[Any], places: dict[tuple[str, ...], int] | None = None, *, hexadecimal: bool = False
) -> Any:
    """The document that the events tell of; `places` takes the line of every key, for a message."""
    builder = _Builder(places, hexadecimal)
    for count, event in enumerate(events, 1):
        if count > MOST_VALUES:
            raise _RefusedError(event, f"more than {MOST_VALUES} values")
        take = _TAKE.get(type(event))
        if take is not None:
            take(builder, event)
    return builder.root[0] if builder.root else None


class _Builder:
    """A document while it grows: the collection that is open, and in a mapping the key whose value comes next."""

    def __init__(self, places: dict[tuple[str, ...], int] | None, hexadecimal: bool) -> None:
        self.root: list[Any] = []
        self._places, self._hexadecimal = places, hexadecimal
        self._outer: list[tuple[Any, str | None]] = []  # innermost last
        self._current: Any = self.root
        self._key: str | None = None

    def document(self, event: Any) -> None:
        if self.root:
            raise _RefusedError(event, "a second document begins here: write one in a file")

    def alias(self, event: Any) -> None:
        raise _RefusedError(event, f"aliases such as *{quoted(event.anchor)} are not read: write the value out")

    def scalar(self, event: Any) -> None:
        if type(self._current) is not dict or self._key is not None:
            self._put(_scalar(event, self._hexadecimal))
            self._key = None
            return
        self._key = _key(event, self._current)
        if self._places is not None:
            path = (*(key for _, key in self._outer if key is not None), self._key)
            self._places[path] = event.start_mark.line + 1

    def collection(self, event: Any) -> None:
        if type(self._current) is dict and self._key is None:
            raise _RefusedError(event, "a key must be a single word")
        if len(self._outer) >= DEEPEST:
            raise _RefusedError(event, f"nested deeper than {DEEPEST} levels")
        if event.tag not in (None, "!", f"{_TAG}map", f"{_TAG}seq"):
            raise _RefusedError(event, f"the tag {quoted(event.tag)} is not read: write a plain value")
        made: Any = {} if type(event) is yaml.MappingStartEvent else []
        self._put(made)
        self._outer.append((self._current, self._key))
        self._current, self._key = made, None

    def end(self, _: Any) -> None:
        self._current, self._key = self._outer.pop()[0], None

    def _put(self, made: Any) -> None:
        if type(self._current) is dict:
            self._current[self._key] = made
        else:
            self._current.append(made)


_TAKE: dict[type, Callable[[_Builder, Any], None]] = {
    yaml.ScalarEvent: _Builder.scalar,
    yaml.MappingStartEvent: _Builder.collection,
    yaml.SequenceStartEvent: _Builder.collection,
    yaml.MappingEndEvent: _Builder.end,
    yaml.SequenceEndEvent: _Builder.end,
    yaml.AliasEvent: _Builder.alias,
    yaml.DocumentStartEvent: _Builder.document,
}


def _key(event: Any, mapping: dict[str, Any]) -> str:
    key = str(event.value)
    if event.tag not in _TEXT_TAGS:
        raise _RefusedError(event, f"the tag {quoted(event.tag)} is not read: write a plain key")
    if len(key) > LONGEST_KEY or not key.isprintable():
        raise _RefusedError(
            event, f"{quoted(key, 40)} cannot be a key: write one line of at most {LONGEST_KEY} characters"
        )
    if key in mapping:
        raise _RefusedError(event, f"{key} is given twice")
    return key


def _scalar(event: Any, hexadecimal: bool) -> Any:
    text = event.value
    if not text.isprintable() and (unwanted := _UNWANTED.search(text)):
        raise _RefusedError(event, f"the character {quoted(unwanted.group())} in a text: write printable ones")
    if not event.implicit[0]:  # quoted, or with a tag
        if event.tag not in _TEXT_TAGS:
            raise _RefusedError(event, f"the tag {quoted(event.tag)} is not read: write a plain value")
        return text
    if len(text) > LONGEST_NUMBER:
        if _NUMBER.fullmatch(text):
            raise _RefusedError(event, f"a number of {len(text)} digits: write at most {LONGEST_NUMBER}")
        return text
    if _OTHER_BASE.fullmatch(text) or (_BINARY.fullmatch(text) and not hexadecimal):
        base = "2 or 16" if _BINARY.fullmatch(text) else "8 or 60"
        raise _RefusedError(
            event, f"{text} would be read to the base of {base}: write a decimal number, or quote a text"
        )
    try:
        return _plain(text)
    except (ValueError, OverflowError) as error:  # 0x_ looks like a number and is none
        raise _RefusedError(event, f"not readable as YAML: {quoted(error)}") from None


@lru_cache(maxsize=4096)
def _plain(text: str) -> Any:
    """The value of a plain word: a number, a truth value, None, else the word itself."""
    if _SHORT_FLOAT.fullmatch(text):
        return float(text)
    tag = _tag(text)
    if tag in (f"{_TAG}int", f"{_TAG}float") and "_" in text:
        raise ValueError("a number with _ in it: leave it out, or quote a text")
    return text if tag is None else _CONSTRUCT[tag](_CONSTRUCTOR, yaml.ScalarNode(tag, text))


def _tag(text: str) -> str | None:
    return next((tag for tag, pattern in _RESOLVERS.get(text[:1], ()) if pattern.match(text)), None)
