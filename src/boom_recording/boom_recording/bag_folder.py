"""Finds the MCAP files of a bag: a bare file, or a rosbag2 directory with or without a usable metadata.yaml."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from boom_recording.errors import RecordingError

METADATA = "metadata.yaml"
_SPLIT = re.compile(r"^(.*)_(\d+)\.mcap(\.zstd)?$")


@dataclass
class BagFiles:
    """The .mcap files of one bag in order, and what its metadata.yaml promised (None where there is none)."""

    name: str
    files: list[Path]
    promised_messages: int | None = None
    promised_duration_s: float | None = None
    warnings: list[str] = field(default_factory=list)


def find(path: Path) -> BagFiles:
    """The bag at `path`. Raises RecordingError (with the path) where there is none, or more, or another kind."""
    if path.is_dir():
        return _directory(path)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file or folder: give a rosbag2 directory or a .mcap file")
    if path.suffix == ".db3":
        raise _sqlite(path)
    if path.name == METADATA:
        return _directory(path.parent)
    if not path.is_file():
        raise RecordingError(f"{path}: it is neither a file nor a folder: give a rosbag2 directory or a .mcap file")
    if path.stat().st_size == 0:
        raise RecordingError(f"{path}: the file is empty (0 bytes): record again, or give another bag")
    return BagFiles(path.stem, [path])


def _sqlite(path: Path) -> RecordingError:
    return RecordingError(
        f"{path}: it is a sqlite3 bag: convert it to MCAP ('ros2 bag convert', storage_id mcap) and give the result"
    )


def _directory(path: Path) -> BagFiles:
    bag = BagFiles(path.resolve().name, [])
    metadata = path / METADATA
    if metadata.is_file():
        try:
            _from_metadata(bag, path, metadata)
        except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError, ValueError):
            bag.warnings.append("metadata.yaml cannot be read; the .mcap files beside it were taken")
    if not bag.files:
        bag.files = _without_metadata(path)
        if not metadata.is_file():
            bag.warnings.append(
                "metadata.yaml is missing (the recorder did not end properly?); the .mcap file was taken"
            )
    return bag


def _from_metadata(bag: BagFiles, path: Path, metadata: Path) -> None:
    document: Any = yaml.safe_load(metadata.read_text(encoding="utf-8"))
    information = document["rosbag2_bagfile_information"]
    if information.get("storage_identifier") == "sqlite3":
        raise _sqlite(path)
    if information.get("compression_mode", "").upper() == "MESSAGE":
        raise RecordingError(
            f"{path}: its messages are compressed one by one: convert it ('ros2 bag convert') to a plain MCAP bag"
        )
    names = [str(name) for name in information["relative_file_paths"]]
    files = [path / Path(name).name for name in names]
    missing = [file.name for file in files if not file.is_file()]
    if missing and len(missing) < len(files):
        bag.warnings.append(f"{', '.join(missing)} named in metadata.yaml is missing; what it held is lost")
    bag.files = [file for file in files if file.is_file()]
    if missing and not bag.files:
        bag.warnings.append(
            f"metadata.yaml names {missing[0]}, which is not there; the .mcap files beside it were taken"
        )
    bag.promised_messages = int(information["message_count"])
    bag.promised_duration_s = int(information["duration"]["nanoseconds"]) / 1e9


def _without_metadata(path: Path) -> list[Path]:
    try:
        entries = sorted(path.iterdir())
    except OSError as error:
        raise RecordingError(f"{path}: the folder cannot be read: {error.strerror}") from None
    files = [entry for entry in entries if entry.name.endswith((".mcap", ".mcap.zstd")) and entry.is_file()]
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
        raise RecordingError(f"{path}: it is no bag, but holds one: give {path / inner[0]}")
    if inner:
        raise RecordingError(f"{path}: the folder holds several bags ({_some(inner)}): give one of them")
    raise RecordingError(f"{path}: there is no .mcap file in this folder: give a rosbag2 directory or a .mcap file")


def _some(names: list[str]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
