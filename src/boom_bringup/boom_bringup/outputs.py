"""Files that commands write: refused before the work starts if they cannot be written; one line if writing fails."""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_bringup.cli import UsageError
from boom_input.shown import quoted
from boom_input.whole import one_writer, write_new, write_whole

if TYPE_CHECKING:
    from boom_recording.recording import Recording


PAGE = """content="default-src 'none'; """
"""In every page that a command writes, and hardly in another: what it may load."""


def checked_json(given: str | None, *keys: str) -> Path | None:
    """The path of a JSON document, ``--json``; a file there has to hold its ``keys``. Raises UsageError as `checked`."""
    return checked(given, "--json", *(f'\n  "{key}": ' for key in keys))


def checked(given: str | None, option: str, *marks: str) -> Path | None:
    """The path of an output file; None if none was requested.

    Args:
        given: the path.
        option: that gives it.
        marks: texts in every such file; one that lacks them is of another kind and must not be lost.

    Raises:
        UsageError: it could not be written, or would replace a file of another kind.
    """
    if given is None:
        return None
    if given == "-":
        raise UsageError(f"{option} -: a file is due here, and nothing is written to the terminal: give a name")
    path = Path(given)
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        raise UsageError(f"{option} {quoted(given, 80)}: {error.strerror}: give another path") from None
    except ValueError:  # a null character
        raise UsageError(f"{option} {quoted(given, 80)}: no file can have this name: give another path") from None
    if not given or path.is_dir():
        raise UsageError(f"{option} {given or '(empty)'}: this is a folder, give the name of a file in it")
    if not path.parent.is_dir():
        raise UsageError(f"{option} {given}: there is no folder {path.parent}: create it first")
    _try(path, f"{option} {given}")
    content = path.read_bytes() if path.is_file() and marks else b""
    if content and not all(mark.encode() in content for mark in marks):
        raise UsageError(
            f"{option} {given}: the file there is no earlier result of this kind and would be lost: give another path"
        )
    return path


def _try(path: Path, named: str) -> None:
    """Raises UsageError where `write_whole` could not write."""
    try:
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if path.is_file() or not path.exists():
            with tempfile.TemporaryFile(dir=os.path.dirname(os.path.realpath(path))):
                pass
    except OSError as error:
        raise UsageError(f"{named}: may not be written ({error.strerror}): give another path") from None


_LONGEST = 200
"""Bytes of a name; file systems take 255, endings and the names of files that are being written included."""
_ANYBODYS = frozenset(("recording", "bag", "rosbag", "rosbag2", "data", "log", "run"))
"""Names that recordings of many cranes have."""
_INITIAL = 2
"""Letters of names like a, b, r1, which they have, too."""


def default_report(command: str, bags: Sequence[str] = ()) -> Path:
    """The default path of a command's report, called after the first of its recordings; creates the folder ``output``.

    Raises:
        UsageError: the folder cannot be created.
    """
    folder = Path("output")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"cannot create the folder output here ({error.strerror}): give --report FILE or --no-report"
        ) from None
    names = [_name(Path(bag)) for bag in bags]
    name = "-".join([command, *names[:1]])
    twice = any(other == names[0] for other in names[1:])
    # names that recordings of every crane have: the folder tells which
    if twice or (names and (len(names[0]) <= _INITIAL or names[0].lower() in _ANYBODYS)):
        name = f"{command}-{os.path.basename(os.path.realpath(Path(bags[0]).parent))}-{names[0]}"
    more = f"-and-{len(bags) - 1}-more" if len(bags) > 1 else ""
    path = checked(str(folder / f"{_short(name)}{more}.html"), "report", PAGE)
    assert path is not None
    return path


def _short(name: str) -> str:
    """A name that a file system takes; of a longer one the beginning and what tells it from others."""
    encoded = os.fsencode(name)
    return name if len(encoded) <= _LONGEST else f"{name[: _LONGEST // 4]}-{sha256(encoded).hexdigest()[:12]}"


def _name(bag: Path) -> str:
    return bag.stem if bag.suffix in (".mcap", ".zstd", ".yaml") else os.path.basename(os.path.realpath(bag))


def write(path: Path, action: Callable[[], Any]) -> None:
    """Run the action that writes ``path``.

    Raises:
        UsageError: it failed, e.g. because the disk is full.
    """
    try:
        action()
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror or error}") from None


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording as a bag, with the robot description of its machine where there is one.

    Raises:
        RecordingError: it cannot be written.
    """
    from boom_description.shipped import urdf_text
    from boom_recording import writing

    told = recording.stored_configuration
    writing.write(path, recording, robot_description=urdf_text(told.machine) if told else "")


def write_text(path: Path, text: str) -> None:
    """Write a file completely or not at all.

    Raises:
        UsageError: it failed.
    """
    write(path, lambda: write_whole(path, text))


def write_new_text(path: Path, text: str) -> None:
    """Write a file that nobody has written meanwhile.

    Raises:
        UsageError: it exists, or writing failed.
    """
    try:
        write(path, lambda: write_new(path, text))
    except UsageError:
        refuse_existing(path)
        raise


@contextmanager
def held(given: str | Path, said: str | Path = "") -> Iterator[Path]:
    """The folder of a command's results, created if missing and locked against a second command until the end.

    Where it was created and nothing was written, it goes again. ``said``: what messages call it, if not that.

    Raises:
        UsageError: it cannot be created or written.
        InUseError: another command uses it.
    """
    path = Path(given)
    made = not path.exists()
    try:
        path.mkdir(parents=True, exist_ok=True)
        lock = one_writer(path, said)
        lock.__enter__()
    except OSError as error:
        raise UsageError(
            f"--output {said or given}: cannot be created: {error.strerror}: give another folder"
        ) from None
    try:
        if not os.access(path, os.W_OK):
            raise UsageError(f"--output {said or given}: may not be written by this user: give another folder")
        yield path
    finally:
        if made:
            with suppress(OSError):  # of a command that was refused or stopped before it wrote anything
                path.rmdir()
        lock.__exit__(None, None, None)


def refuse_existing(path: Path) -> None:
    """Raises UsageError where there is something."""
    if os.path.lexists(path):
        raise UsageError(f"{path} exists already: give another --output, nothing is overwritten")


@contextmanager
def new_bag(path: Path) -> Iterator[Path]:
    """A path for writing a bag, which is moved into place when complete; locked against a second command until then.

    The next command removes what a killed one left.

    Args:
        path: of the new bag; must not exist.

    Raises:
        UsageError: it exists or its folder cannot be created.
        InUseError: another command is writing it.
    """
    from boom_recording.errors import RecordingError  # not there before the set-up

    refuse_existing(path)
    with held(path.absolute().parent / f".{path.name}.new", path) as place:
        refuse_existing(path)  # the command that held it before may have finished it
        made = place / path.name
        shutil.rmtree(made, ignore_errors=True)
        try:
            try:
                yield made
            except RecordingError as error:
                said, mine = str(error), f"{made}: "
                if not said.startswith(mine):
                    raise
                reason = said.removeprefix(mine).partition(";")[0]  # what was written goes with the path
                raise UsageError(f"{path}: nothing is written: {reason}") from None
            if made.exists():
                write(path, lambda: made.rename(path))
        finally:
            shutil.rmtree(place, ignore_errors=True)


def json_text(document: dict[str, Any]) -> str:
    """A document as JSON, with null for numbers that are not finite, because JSON has no NaN."""
    return json.dumps(_finite(document), indent=2, allow_nan=False) + "\n"


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a document as JSON.

    Raises:
        UsageError: it failed.
    """
    write_text(path, json_text(document))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
