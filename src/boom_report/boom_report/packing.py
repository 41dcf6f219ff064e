"""Numbers and libraries inside a page: small enough to mail, and safe whatever their strings hold.

Arrays become differences of whole steps, which deflate to a quarter of their bytes; ``packing.js`` turns them back.
"""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEPS = 1 << 14
"""Steps over the range of a signal: finer than any pixel."""
TIME_STEPS = 1 << 17
"""Steps over the range of an abscissa: half a millisecond in a minute."""


def steps(values: Array, count: int = STEPS) -> dict[str, Any]:
    """Values (n,) in ``count`` steps over their range: ``low``, ``step``, differences ``d``; index ranges ``gaps`` that are NaN."""
    known = np.isfinite(values)
    if not known.any():
        return {"low": 0.0, "step": 1.0, "n": len(values), "d": None}
    low, high = float(np.min(values[known])), float(np.max(values[known]))
    step = (high - low) / count or 1.0
    whole = np.round((np.where(known, values, low) - low) / step).astype(np.int64)
    index = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))  # a gap repeats the value before it
    differences = np.diff(whole[index], prepend=0)
    return {"low": low, "step": step, "n": len(values), "d": differences.tolist(), "gaps": runs(~known)}


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Index ranges [a, b) in which flags (n,) are set."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def compressed(document: Any) -> str:
    """JSON, deflated, as base64 text."""
    return deflated(json.dumps(document, separators=(",", ":"), allow_nan=False))


def deflated(text: str) -> str:
    """Text, deflated, as base64 text: no character of it means anything in HTML."""
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode("ascii")


def inflated(text: str) -> str:
    """The text that :func:`deflated` was given."""
    return zlib.decompress(base64.b64decode(text)).decode()


def stepped(spec: Any, key: str = "") -> Any:
    """A chart as plotly.js takes it with its packed arrays (``panels.packed``) in steps; maps keep theirs."""
    if isinstance(spec, dict):
        if spec.get("dtype") == "f4" and "shape" not in spec:
            values = np.frombuffer(base64.b64decode(spec["bdata"]), "<f4").astype(float)
            return {"steps": steps(values, TIME_STEPS if key == "x" else STEPS)}
        return {name: stepped(value, name) for name, value in spec.items()}
    return [stepped(value, key) for value in spec] if isinstance(spec, list) else spec
