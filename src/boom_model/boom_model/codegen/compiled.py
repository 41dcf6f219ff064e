"""Compiles a model's C once, keeps the library in the user's cache folder, and calls it through ctypes (no GIL held)."""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from threading import Lock

from boom_input.cache import cache_folder, is_whole, keep
from boom_input.files import InputError
from boom_model.codegen.source import Further, derivatives, generate
from boom_model.equations import Equations
from boom_model.errors import BuildError

THOROUGH, QUICK = "-O3", "-Og"
"""How far to optimise: for what runs for minutes; for what is called once a cycle, and whose user waits for it."""
FLAGS = (THOROUGH, "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast", "-shared", "-fPIC", "-std=c11")
_WIDE = {"avx2": "-mavx2", "fma": "-mfma", "bmi2": "-mbmi2"}
"""Processor flags -> compiler flags; together they make a run a third faster. They are part of the cache key, so that a cache
folder shared by several computers has one library for each kind."""
LANES = 4
"""Number of runs that are integrated side by side: four doubles fill a register of today's processors."""


def _compiler() -> str:
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        if name and shutil.which(name):
            return name
    raise BuildError("no C compiler found (cc, gcc or clang): install one, e.g. apt install build-essential")


@lru_cache(maxsize=1)
def _flags() -> tuple[str, ...]:
    """Compiler flags for this computer."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return FLAGS
    able = next((set(line.split()) for line in lines if line.startswith("flags")), set())
    return (*FLAGS, *_WIDE.values()) if set(_WIDE) <= able else FLAGS


@lru_cache(maxsize=256)
def load_c(source: str, optimised: str = THOROUGH) -> ctypes.CDLL:
    """The library compiled from C source, from the cache if it is there.

    Raises:
        BuildError: no compiler, refused source, or the cache folder is not writable or not the user's own.
    """
    compiler, flags = _compiler(), (optimised, *_flags()[1:])
    key = hashlib.sha256("\n".join((compiler, *flags, source)).encode()).hexdigest()[:24]
    try:
        folder = cache_folder()
        library = folder / f"model-{key}.so"
        with _lock(key):
            if not is_whole(library):
                keep(library, compiled(source, flags))
    except InputError as error:
        raise BuildError(str(error)) from None
    except OSError as error:
        raise BuildError(f"cannot write the compiled model to {folder}: {error.strerror}; set BOOM_CACHE") from error
    try:
        return ctypes.CDLL(str(library))
    except OSError as error:
        library.unlink(missing_ok=True)
        raise BuildError(
            f"cannot load the compiled model {library.name}: {error}; run again to build it anew"
        ) from error


@lru_cache(maxsize=256)
def _lock(_: str) -> Lock:
    """One for each library: two threads that need the same one compile it once."""
    return Lock()


def compiled(source: str, flags: Sequence[str] = FLAGS) -> bytes:
    """The shared library of C source; by default for any processor of this kind, not just this one.

    Raises:
        BuildError: no compiler, or it refused the source.
    """
    compiler = _compiler()
    with tempfile.TemporaryDirectory(prefix="boom-") as scratch:
        text, built = Path(scratch) / "model.c", Path(scratch) / "model.so"
        text.write_text(source)
        command = [compiler, *flags, "-o", str(built), str(text), "-lm"]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            said = result.stderr.splitlines() or [f"status {result.returncode}"]
            cause = next((line for line in said if "error" in line), said[0])
            raise BuildError(f"{compiler} could not build the model: {cause}")
        return built.read_bytes()


def model_source(equations: Equations, lanes: int = 1, further: tuple[Further, ...] = ()) -> str:
    """C of a model's functions and ``further`` ones, for one parameter vector or ``lanes`` of them at once."""
    return f"#define LANES {lanes}\n" + c_text("lanes.c") + generate(equations, further)


def build(equations: Equations, lanes: int = 1) -> ctypes.CDLL:
    """The compiled integrator of a model, from the cache if it is there.

    lanes: 1, or ``LANES`` for the observer that predicts with as many parameter vectors at once.

    Raises:
        BuildError: no compiler, or the cache folder is not writable.
    """
    return load_c(model_source(equations, lanes) + c_text("integrator.c") + c_text("runs.c") + c_text("observer.c"))


def build_sensitive(equations: Equations) -> ctypes.CDLL:
    """The compiled observer of a model with its derivatives, from the cache if it is there.

    Raises:
        BuildError: no compiler, or the cache folder is not writable.
    """
    places, functions = derivatives(equations)
    parts = (c_text(name) for name in ("sensitivity.c", "integrator.c", "observer.c"))
    return load_c(model_source(equations, further=functions) + places + "".join(parts))


def c_text(name: str) -> str:
    """A C file of this package."""
    return files("boom_model.codegen").joinpath(name).read_text()
