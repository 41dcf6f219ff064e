"""Finds the MCAP files of a bag: a bare file, or a rosbag2 directory with or without a usable metadata.yaml."""

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from boom_input.files import InputError, opened, read_text
from boom_input.shown import printable, quoted, typable
from boom_input.yaml_text import parse_yaml
from boom_recording.errors import RecordingError

METADATA = "metadata.yaml"
_ENDINGS = (".mcap", ".mcap.zstd")
_CAN_LOGS = (".blf", ".asc", ".trc")
_SPLIT = re.compile(r"^(.*)_(\d+)\.mcap(\.zstd)?$")


@dataclass
class BagFiles:
    """The .mcap files of one bag in order, and what its metadata.yaml promises (None if missing)."""

    name: str
    files: list[Path]
    promised_messages: int | None = None
    promised_duration_s: float | None = None
    warnings: list[str] = field(default_factory=list)


def find(path: Path) -> BagFiles:
    """The bag at `path`. Raises RecordingError (with the path) if there is none, more than one, or one of another kind."""
    if path.is_dir():
        return _directory(path)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file or folder: give a rosbag2 directory or a .mcap file")
    if path.name == METADATA:
        return _directory(path.parent)
    if not path.is_file():
        raise RecordingError(f"{path}: it is neither a file nor a folder: give a rosbag2 directory or a .mcap file")
    if path.stat().st_size == 0:
        raise RecordingError(f"{path}: the file is empty (0 bytes): record again, or give another bag")
    if path.suffix == ".db3":
        raise _sqlite(path)
    if path.suffix in _CAN_LOGS:
        raise RecordingError(f"{path}: it is a CAN log: ./boom import-can turns it into a bag")
    if not path.name.endswith(_ENDINGS) and not _begins_like_one(path):
        raise RecordingError(f"{path}: it is not an MCAP file: {import_line(path)}")
    return BagFiles(printable(path.stem), [path])


def _name(path: Path) -> str:
    return printable(os.path.basename(os.path.realpath(path)))


def import_line(path: Path) -> str:
    """What to type where a recording is not of this workspace's form."""
    return f"import it: {typable('./boom', 'import', str(path), '--output', f'output/{path.stem}')}"


def _begins_like_one(path: Path) -> bool:
    with opened(path) as file:
        return file.read(4) in (b"\x89MCA", b"\x28\xb5\x2f\xfd")


def _sqlite(path: Path) -> RecordingError:
    return RecordingError(f"{path}: it is a sqlite3 bag: {import_line(path)}")


def _directory(path: Path) -> BagFiles:
    bag = BagFiles(_name(path), [])
    metadata = path / METADATA
    there = metadata.exists()
    if there:
        try:
            _from_metadata(bag, path, parse_yaml(read_text(metadata), METADATA))
        except InputError as error:
            reason = str(error).replace(str(metadata), METADATA, 1)
            bag.warnings.append(f"metadata.yaml is not used; the .mcap files beside it were read ({reason})")
    if not bag.files:
        bag.files = _without_metadata(path)
        if not there:
            bag.warnings.append(
                "metadata.yaml is missing (the recorder did not end properly?); the .mcap file was read"
            )
    return bag


def _from_metadata(bag: BagFiles, path: Path, document: Any) -> None:
    """Read a rosbag2 metadata document. Raises InputError if it is not one, RecordingError for another kind of bag."""
    information = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    names = information.get("relative_file_paths") if isinstance(information, dict) else None
    if information is None or not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise InputError(f"{METADATA}: it names no files (rosbag2_bagfile_information: relative_file_paths)")
    if information.get("storage_identifier") == "sqlite3":
        raise _sqlite(path)
    if str(information.get("compression_mode")).upper() == "MESSAGE":
        raise RecordingError(f"{path}: its messages are compressed one by one: {import_line(path)}")
    beside = {entry.name for entry in _entries(path) if entry.is_file()}
    named = list(dict.fromkeys(Path(name).name for name in names))
    missing = quoted(", ".join(name for name in named if name not in beside))
    bag.files = [path / name for name in named if name in beside]
    unnamed = sorted(name for name in beside - set(named) if name.endswith(_ENDINGS))
    if missing and bag.files:
        bag.warnings.append(f"{missing} named in metadata.yaml is missing; its content is lost")
    elif missing:
        bag.warnings.append(f"metadata.yaml names {missing}, which is missing; the .mcap files beside it were read")
    if unnamed and bag.files:
        bag.warnings.append(f"{_some(unnamed)} is not named in metadata.yaml and was not read")
    messages, duration = information.get("message_count"), information.get("duration")
    span = duration.get("nanoseconds") if isinstance(duration, dict) else None
    if isinstance(messages, int) and isinstance(span, int):
        bag.promised_messages, bag.promised_duration_s = messages, span / 1e9
    else:
        bag.warnings.append("metadata.yaml does not state the number of messages: a loss may go unnoticed")


def _entries(path: Path) -> list[Path]:
    try:
        return sorted(path.iterdir())
    except OSError as error:
        raise RecordingError(f"{path}: the folder cannot be read: {error.strerror}") from None


def _without_metadata(path: Path) -> list[Path]:
    entries = _entries(path)
    files = [entry for entry in entries if entry.name.endswith(_ENDINGS) and entry.is_file()]
    if len(files) == 1:
        return files
    if files:
        splits = [_SPLIT.match(file.name) for file in files]
        if all(splits) and len({match.group(1) for match in splits if match}) == 1:
            return sorted(files, key=lambda file: int(_SPLIT.match(file.name).group(2)))  # type: ignore[union-attr]  # all match
        raise RecordingError(
            f"{path}: the folder holds several bags ({_some([f.name for f in files])}): give one of them"
        )
    if any(entry.suffix == ".db3" for entry in entries):
        raise _sqlite(path)
    inner = [
        entry.name
        for entry in entries
        if entry.is_dir() and ((entry / METADATA).is_file() or any(entry.glob("*.mcap")))
    ]
    if len(inner) == 1:
        raise RecordingError(f"{path}: this folder is not a bag, but holds one: give {path / inner[0]}")
    if inner:
        raise RecordingError(f"{path}: the folder holds several bags ({_some(inner)}): give one of them")
    raise RecordingError(f"{path}: there is no .mcap file in this folder: give a rosbag2 directory or a .mcap file")


def _some(names: list[str]) -> str:
    return quoted(", ".join(names[:4])) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
