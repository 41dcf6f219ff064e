"""Folders by URL (fsspec): of this computer, or of a store that speaks s3; bags are read from one, results are kept in one."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from boom_fleet.scratch import scratch
from boom_input.whole import write_whole

METADATA = "metadata.yaml"
ENDINGS = (".mcap", ".mcap.zstd")
MACHINE_FILE = "machine.yaml"


class StoreError(ValueError):
    """A folder, bag or table cannot be read or written; one line that says what to do."""

    exit_status = 2


class Store:
    """A folder in which results are kept.

    Args:
        url: path, or URL such as ``s3://bucket/folder``.

    Raises:
        StoreError: no package serves this kind of URL, or the store does not answer.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self._fs, self._root = _opened(url)

    @property
    def local(self) -> Path | None:
        """The folder on this computer, None for one elsewhere."""
        return Path(self._root) if _is_local(self._fs) else None

    def read(self, name: str) -> bytes | None:
        """Content of a file, None where there is none."""
        try:
            return bytes(self._fs.cat_file(self._path(name)))
        except FileNotFoundError:
            return None
        except Exception as error:
            raise StoreError(f"{self._path(name)}: cannot be read: {error}") from None

    def write(self, name: str, data: bytes) -> None:
        """Write a file completely or not at all."""
        path = self._path(name)
        try:
            if _is_local(self._fs):
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                write_whole(path, data)
            else:
                self._fs.pipe_file(path, data)
        except Exception as error:
            why = getattr(error, "strerror", None) or error
            raise StoreError(
                f"{path}: cannot be written: {why}: what is done stays; mend this and give the same command again to resume"
            ) from None

    def names(self, folder: str) -> set[str]:
        """Names of the files in a folder of it."""
        try:
            found = self._fs.ls(self._path(folder), detail=False, refresh=True)
        except FileNotFoundError:
            return set()
        return {PurePosixPath(str(path)).name for path in found}

    def remove(self, name: str) -> None:
        """Remove a file that exists."""
        self._fs.rm_file(self._path(name))

    def _path(self, name: str) -> str:
        return f"{self._root.rstrip('/')}/{name}"


@dataclass(frozen=True)
class FoundBag:
    """A bag below one of the folders.

    Attributes:
        url: of it. machine: name of the folder that holds it. recording: its own name.
        key: of its files, as far as their names, sizes and times tell. own: whether its folder has a machine file; its URL.
    """

    url: str
    machine: str
    recording: str
    key: str
    machine_file: str


def find_bags(folder: str) -> list[FoundBag]:
    """Bags at any depth below a folder, in the order of their names.

    Raises:
        StoreError: there is no such folder, or no bag in it.
    """
    fs, root = _opened(folder)
    try:
        files: Mapping[str, Any] = fs.find(root, detail=True)
    except Exception as error:
        raise StoreError(f"{folder}: cannot be read: {error}") from None
    if not files:
        raise StoreError(f"{folder}: there is no such folder, or it is empty: give a folder of bags or a URL of one")
    by_folder: dict[str, dict[str, Any]] = {}
    for path, info in files.items():
        place = PurePosixPath(path)
        by_folder.setdefault(str(place.parent), {})[place.name] = info
    found = []
    for place_name, inside in by_folder.items():
        data = sorted(name for name in inside if name.endswith(ENDINGS))
        holds_others = any(other.startswith(f"{place_name}/") for other in by_folder)
        if METADATA in inside or (len(data) == 1 and not holds_others and place_name != root.rstrip("/")):
            found.append(_bag(fs, place_name, data + [n for n in inside if n == METADATA], inside, by_folder, root))
        else:
            found += [_bag(fs, f"{place_name}/{name}", [name], inside, by_folder, root) for name in data]
    if not found:
        raise StoreError(f"{folder}: there is no bag in it: give a folder in which each machine has a folder of bags")
    return sorted(found, key=lambda bag: bag.url)


def _bag(
    fs: Any, path: str, names: list[str], inside: Mapping[str, Any], folders: Mapping[str, Any], root: str
) -> FoundBag:
    place = PurePosixPath(path)
    above = place.parent if str(place) != root.rstrip("/") else place
    facts = [(n, inside[n].get("size"), str(inside[n].get("ETag") or inside[n].get("mtime"))) for n in sorted(names)]
    key = hashlib.sha256(repr((above.name, place.name, facts)).encode()).hexdigest()[:16]
    own = f"{above}/{MACHINE_FILE}" if MACHINE_FILE in folders.get(str(above), {}) else ""
    return FoundBag(
        str(fs.unstrip_protocol(path)) if not _is_local(fs) else path, above.name, place.name, key,
        own if _is_local(fs) or not own else str(fs.unstrip_protocol(own)),
    )  # fmt: skip


@contextmanager
def at_hand(url: str) -> Iterator[Path]:
    """A bag as a path of this computer: itself, or a copy that lasts as long as the context.

    Raises:
        StoreError: it cannot be fetched.
    """
    fs, path = _opened(url)
    if _is_local(fs):
        yield Path(path)
        return
    with scratch() as folder:
        here = folder / PurePosixPath(path).name
        try:
            fs.get(path, str(here), recursive=True)
        except Exception as error:
            raise StoreError(f"{url}: cannot be fetched: {error}") from None
        yield here


def read_file(url: str) -> bytes:
    """Content of a file by path or URL. Raises StoreError."""
    fs, path = _opened(url)
    try:
        return bytes(fs.cat_file(path))
    except Exception as error:
        raise StoreError(f"{url}: cannot be read: {error}") from None


def machine_table(url: str) -> dict[str, str]:
    """Machine -> its file, from a CSV table with the columns ``machine`` and ``file``; a relative file lies beside the table.

    Raises:
        StoreError: it cannot be read, or lacks a column.
    """
    rows = list(csv.DictReader(io.StringIO(read_file(url).decode("utf-8-sig", "replace"))))
    if not rows or not {"machine", "file"} <= {str(name).strip() for name in rows[0]}:
        raise StoreError(f"{url}: not a table of machines: its first line has to name the columns machine,file")
    result = {}
    for row in rows:
        file = (row["file"] or "").strip()
        beside = "://" not in file and not file.startswith("/") and file.endswith((".yaml", ".yml"))
        result[(row["machine"] or "").strip()] = f"{url.rpartition('/')[0] or '.'}/{file}" if beside else file
    return result


def _opened(url: str) -> tuple[Any, str]:
    import fsspec

    if not url:
        raise StoreError("the name of a folder is empty: give a path or a URL such as s3://bucket/folder")
    if "://" not in url:
        url = str(Path(url).absolute())
    try:
        fs, path = fsspec.core.url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise StoreError(f"{url}: {error}") from None
    return fs, str(path)


def _is_local(fs: Any) -> bool:
    protocol = fs.protocol
    return "file" in ((protocol,) if isinstance(protocol, str) else tuple(protocol))
