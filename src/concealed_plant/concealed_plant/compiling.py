"""Passes functions to numba and keeps their types for the type checker."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import IndexDataCacheFile

from boom_input.cache import cache_folder

_FREE = {"contract", "nsz", "arcp", "reassoc"}
"""Floating-point optimisations of the compiler: a sixth faster; NaN and infinity keep their meaning."""

F = TypeVar("F", bound=Callable[..., Any])


class _Damaged(IndexDataCacheFile):  # type: ignore[misc]
    """A file of numba's cache that cannot be read, e.g. cut short when the power failed, counts as missing."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # unpickling raises what it likes
            return {}

    def _load_data(self, name: str) -> Any:
        try:
            return super()._load_data(name)
        except Exception as error:
            raise OSError(f"{name} is damaged") from error


def compiled(function: F) -> F:
    """The function as machine code; kept on disk, so that only the first process compiles.

    Raises:
        InputError: the cache folder cannot be used, see ``boom_input.cache``.
    """
    # What lies there is unpickled and run: in the user's own folder, not beside the sources where others may write.
    folder = cache_folder() / "numba" / _sources(Path(inspect.getfile(function)).parent)
    folder.mkdir(exist_ok=True, mode=0o700, parents=True)
    numba.config.CACHE_DIR = str(folder)
    dispatcher = numba.njit(function, cache=True, error_model="numpy", fastmath=_FREE)
    dispatcher._cache._cache_file.__class__ = _Damaged
    return cast(F, dispatcher)


@lru_cache
def _sources(folder: Path) -> str:
    """Digest of all sources beside a function: numba looks at the function's own file, not at those whose functions it calls."""
    total = hashlib.sha256()
    for path in sorted(folder.glob("*.py")):
        total.update(path.read_bytes())
    return total.hexdigest()[:16]
