"""Folders by URL (fsspec): of this computer, or of a store that speaks s3; bags are read from one, results are kept in one."""

from __future__ import annotations

import csv
import hashlib
import io
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from boom_fleet.scratch import scratch
from boom_input.files import is_below
from boom_input.whole import write_whole
from boom_model.machine_file import shipped_machines

PATIENCE = 14.0
"""s until a store that does not answer is given up. Of each answer, not of a whole file: large ones may take longer."""
METADATA = "metadata.yaml"
ENDINGS = (".mcap", ".mcap.zstd")
MACHINE_FILE = "machine.yaml"
MACHINE_FILE_ENDINGS = (".yaml", ".yml")


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
        with _told(f"{self.url}/{name}: cannot be read"):
            try:
                return bytes(self._fs.cat_file(self._path(name)))
            except FileNotFoundError:
                return None

    def write(self, name: str, data: bytes) -> None:
        """Write a file completely or not at all."""
        path = self._path(name)
        resume = "what is done stays; mend this and give the same command again to resume"
        with _told(f"{path}: cannot be written", resume):
            if _is_local(self._fs):
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                write_whole(path, data)
            else:
                self._fs.pipe_file(path, data)

    def names(self, folder: str = "") -> set[str]:
        """Names of the files in a folder of it, or in itself."""
        with _told(f"{self.url}: cannot be read"):
            try:
                found = self._fs.ls(self._path(folder), detail=False, refresh=True)
            except FileNotFoundError:
                return set()
        return {PurePosixPath(str(path)).name for path in found}

    def remove(self, name: str) -> None:
        """Remove a file that exists."""
        with _told(f"{self.url}/{name}: cannot be removed"):
            self._fs.rm_file(self._path(name))

    def _path(self, name: str) -> str:
        return f"{self._root.rstrip('/')}/{name}".rstrip("/")


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


def find_bags(folder: str, results: str = "") -> list[FoundBag]:
    """Bags at any depth below a folder, in the order of their names; those of the local folder ``results`` below it not.

    Raises:
        StoreError: there is no such folder, or no bag in it.
    """
    fs, root = _opened(folder)
    files: Mapping[str, Any] = {}
    with _told(f"{folder}: cannot be read"), suppress(FileNotFoundError):
        fs.ls(root, detail=False)  # find() takes what does not answer for empty
        files = fs.find(root, detail=True)
    if not files:
        raise StoreError(f"{folder}: there is no such folder, or it is empty: give a folder of bags or a URL of one")
    if results and _is_local(fs) and is_below(results, root) and not is_below(root, results):
        files = {path: info for path, info in files.items() if not is_below(path, results)}
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
        with _told(f"{url}: cannot be fetched"):
            fs.get(path, str(here), recursive=True)
        yield here


def read_file(url: str) -> bytes:
    """Content of a file by path or URL. Raises StoreError."""
    fs, path = _opened(url)
    with _told(f"{url}: cannot be read"):
        return bytes(fs.cat_file(path))


def machine_table(url: str) -> dict[str, str]:
    """Machine -> its file, from a CSV table with the columns ``machine`` and ``file``; a relative file lies beside the table.

    Raises:
        StoreError: it cannot be read, lacks a column or a value, names a machine twice or a shipped one that there is not.
    """
    result: dict[str, str] = {}
    for line, row in _table_rows(url):
        machine, file = ((row[name] or "").strip() for name in ("machine", "file"))
        if not machine or not file:
            raise StoreError(
                f"{line}: the {'file' if machine else 'machine'} is missing: give both, or leave the line out"
            )
        if machine in result:
            raise StoreError(f"{line}: machine {machine} has a line already: leave one of the two")
        if not file.endswith(MACHINE_FILE_ENDINGS):
            if file not in shipped_machines():
                raise StoreError(
                    f"{line}: {file}: no such machine; shipped are {', '.join(shipped_machines())}, or give a .yaml file"
                )
        elif "://" not in file and not file.startswith("/"):
            file = f"{url.rpartition('/')[0] or '.'}/{file}"
        result[machine] = file
    return result


def _table_rows(url: str) -> Iterator[tuple[str, dict[str, str | None]]]:
    """Rows of a table of machines, each with where it is."""
    reader = csv.DictReader(io.StringIO(read_file(url).decode("utf-8-sig", "replace")))
    try:
        reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
        if not {"machine", "file"} <= set(reader.fieldnames):
            raise StoreError(f"{url}: not a table of machines: its first line has to name the columns machine,file")
        for row in reader:
            yield f"{url}, line {reader.line_num}", row
    except csv.Error as error:
        raise StoreError(f"{url}, line {reader.line_num + 1}: not a table of machines: {error}") from None


def _opened(url: str) -> tuple[Any, str]:
    import fsspec

    if not url:
        raise StoreError("the name of a folder is empty: give a path or a URL such as s3://bucket/folder")
    protocol, is_url, _ = url.partition("://")
    if is_url and ("::" in url or protocol in ("libarchive", "tar", "zip")):
        raise StoreError(f"{url}: archives and chained URLs are not read: unpack it and give the folder")
    with _told(f"{url}: cannot be read", "give a path or a URL such as s3://bucket/folder"):
        fs, path = fsspec.core.url_to_fs(url if is_url else str(Path(url).absolute()), **_impatient(protocol))
    if protocol in ("s3", "s3a"):
        fs.retries = 2
    return fs, str(path)


def _impatient(protocol: str) -> dict[str, Any]:
    """Options of fsspec with which a store that does not answer is given up after ``PATIENCE``."""
    if protocol == "ftp":
        return {"timeout": PATIENCE}
    if protocol in ("http", "https"):
        from fsspec.implementations.http import aiohttp

        return {"client_kwargs": {"timeout": aiohttp.ClientTimeout(sock_connect=PATIENCE, sock_read=PATIENCE)}}
    if protocol in ("s3", "s3a"):  # half of it: tried twice
        limits = {"connect_timeout": PATIENCE / 2, "read_timeout": PATIENCE / 2, "retries": {"total_max_attempts": 1}}
        return {"config_kwargs": limits}
    return {}


@contextmanager
def _told(what: str, to_do: str = "") -> Iterator[None]:
    """Raises StoreError: what a package said of a store, in one line: these packages raise anything."""
    try:
        yield
    except StoreError:
        raise
    except Exception as error:
        raise StoreError(": ".join(filter(None, (what, _why(error), to_do)))) from None


def _why(error: Exception) -> str:
    if isinstance(error, (AttributeError, NotImplementedError, TypeError)):  # of one that wants more than an address
        return "no folder can be told by a URL of this kind"
    if isinstance(error, TimeoutError):
        return "no answer"
    if isinstance(error, FileNotFoundError):
        return "there is no such file"
    code = getattr(error, "errno", None) or 0
    return os.strerror(code) if code > 0 else str(error).partition("\n")[0] or type(error).__name__


def _is_local(fs: Any) -> bool:
    protocol = fs.protocol
    return "file" in ((protocol,) if isinstance(protocol, str) else tuple(protocol))
