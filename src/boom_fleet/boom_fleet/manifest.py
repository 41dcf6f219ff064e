"""Which files of an output are those of ``boom fleet``, and of which folders: the next run replaces these and no others."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from boom_fleet.store import Store, StoreError
from boom_fleet.table import FOLDER, file_of

FILE = "work/manifest.json"
REPORT = "report.html"


@dataclass(frozen=True)
class Manifest:
    """What a run writes; kept in the output.

    Attributes:
        store: the output. folders: whose results it holds. files: that this run writes. outdated: those of earlier ones besides.
    """

    store: Store
    folders: tuple[str, ...]
    files: frozenset[str]
    outdated: frozenset[str]

    def settle(self) -> None:
        """Remove what is outdated, after all has been written. Raises StoreError."""
        for name in self.outdated:
            self.store.remove(name)
        _write(self.store, self.folders, self.files)


def claim(store: Store, folders: Sequence[str], machines: Iterable[str]) -> Manifest:
    """Before the work: the files that a run is going to write become its own.

    Raises:
        StoreError: the output holds the results of other folders, a file of somebody else would be lost, or it cannot be written.
    """
    kept = _read(store)
    given = tuple(_absolute(folder) for folder in folders)
    lost = next((old for old in kept["folders"] if not any(f"{old}/".startswith(f"{new}/") for new in given)), None)
    if lost is not None:
        raise StoreError(
            f"{store.url}: holds the results of {lost}, which would be lost: give another --output, or that folder, too"
        )
    there = {REPORT} & store.names() | {f"{FOLDER}/{name}" for name in store.names(FOLDER)}
    files, earlier = frozenset({REPORT, *map(file_of, machines)}), there & set(kept["files"])
    foreign = next(iter(sorted(files & there - earlier)), None)
    if foreign is not None:
        raise StoreError(
            f"{store.url}/{foreign}: is not known to be of `boom fleet` and would be lost: move it away, or give another --output"
        )
    _write(store, given, files | earlier)
    return Manifest(store, given, files, frozenset(earlier - files))


def _read(store: Store) -> dict[str, Any]:
    data = store.read(FILE)
    try:
        kept = json.loads(data or b"{}")
        return {name: [str(entry) for entry in kept.get(name, [])] for name in ("folders", "files")}
    except (AttributeError, TypeError, ValueError):  # damaged: nothing is known to be ours
        return {"folders": [], "files": []}


def _write(store: Store, folders: Sequence[str], files: Iterable[str]) -> None:
    data = json.dumps({"folders": folders, "files": sorted(files)}, indent=2).encode()
    if data != store.read(FILE):
        store.write(FILE, data)


def _absolute(folder: str) -> str:
    return folder.rstrip("/") if "://" in folder else os.path.realpath(folder)
