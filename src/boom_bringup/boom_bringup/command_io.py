"""What commands share that read recordings and write documents: which machine, where outputs go, JSON, progress."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup.cli import UsageError

if TYPE_CHECKING:
    from boom_model.machine import Machine
    from boom_recording.recording import Recording

_QUIET = 10.0  # s: so long nothing is said in a log file


def machine_for(wanted: str | None, bags: list[str], recordings: list[Recording]) -> tuple[Machine, str]:
    """The machine to run, and its name or path: the one asked for, or the one that all recordings name.

    Raises:
        UsageError: the recordings name different machines, or one that is not shipped.
        MachineError: the file cannot be used.
    """
    from boom_model.machine_file import load_machine

    if wanted:
        return load_machine(wanted), wanted
    named = {recording.configuration.machine: bag for bag, recording in zip(bags, recordings, strict=True)}
    if len(named) > 1:
        each = ", ".join(f"{bag} ({name or 'no name'})" for name, bag in named.items())
        raise UsageError(f"the recordings are of different machines: {each}: take them apart, or give one --machine")
    name, bag = next(iter(named.items()))
    shipped = shipped_machines()
    if name not in shipped:
        raise UsageError(
            f"{bag}: recorded on machine '{name}', for which no file is shipped (there is {', '.join(shipped)}): "
            "give its file with --machine FILE"
        )
    return load_machine(name), name


def shipped_machines() -> list[str]:
    """Names of the machine files that come with boom_model."""
    from importlib.resources import files

    entries = files("boom_model").joinpath("machines").iterdir()
    return sorted(entry.name.removesuffix(".yaml") for entry in entries if entry.name.endswith(".yaml"))


def checked_path(given: str | None, option: str) -> Path | None:
    """The path of an output, None where none is given; refused before the work where it could not be written.

    Raises:
        UsageError: it is a folder, its folder is not there, or may not be written.
    """
    if given is None:
        return None
    path = Path(given)
    if not given or path.is_dir():
        raise UsageError(f"{option} {given or '(empty)'}: this is a folder, give the name of a file in it")
    if not path.parent.is_dir():
        raise UsageError(f"{option} {given}: there is no folder {path.parent}: create it first")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise UsageError(f"{option} {given}: may not be written by this user: give another path")
    return path


def default_report(command: str, bags: list[str]) -> Path:
    """Where the report of a command goes that was not told; makes the folder ``output``.

    Raises:
        UsageError: the folder cannot be made.
    """
    folder = Path("output")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"folder output cannot be made here ({error.strerror}): give --report FILE or --no-report"
        ) from None
    first = Path(bags[0])
    name = first.stem if first.suffix in (".mcap", ".zstd", ".yaml") else first.resolve().name
    more = f"-and-{len(bags) - 1}-more" if len(bags) > 1 else ""
    path = checked_path(str(folder / f"{command}-{name}{more}.html"), "report")
    assert path is not None
    return path


def write(path: Path, action: Callable[[], Any]) -> None:
    """Run what writes a file.

    Raises:
        UsageError: it cannot be written.
    """
    try:
        action()
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None


def json_text(document: dict[str, Any]) -> str:
    """A document as JSON; null for what is no finite number."""
    return json.dumps(_finite(document), indent=2, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    """The same document with null for what is no finite number: JSON knows no NaN."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def progress(total: int) -> Iterator[Callable[[str, int], None]]:
    """Shows on stderr what is being done: a bar on a terminal, elsewhere a line for what begins after some seconds."""
    if not sys.stderr.isatty():
        begin = time.monotonic()

        def say(text: str, _: int) -> None:
            if text and time.monotonic() - begin > _QUIET:
                print(f"boom: {text}", file=sys.stderr, flush=True)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)

        def show(text: str, done: int) -> None:
            bar.update(task, advance=done, description=text or None)

        yield show
