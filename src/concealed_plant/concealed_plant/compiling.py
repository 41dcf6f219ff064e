"""The one place where functions are handed to numba, with their types kept for the type checker."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_FREE = {"contract", "nsz", "arcp", "reassoc"}
"""What the compiler may do to sums and quotients: a sixth faster; NaN and infinity stay what they are."""

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """The function as machine code; kept on disk, so that only the first process pays for it."""
    return cast(F, numba.njit(function, cache=True, error_model="numpy", fastmath=_FREE))
