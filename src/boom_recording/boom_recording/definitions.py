"""Message definitions and type hashes without ROS: common types from rosbags, others as installed."""

import functools
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from boom_recording.errors import RecordingError

_LONGEST = 20_000  # that of JointState has 2000 with its comments; the parser takes 0.3 s for so many


@functools.cache
def typestore() -> Typestore:
    """Types of ROS 2 Jazzy; others are added to it by `ensure`. Shared within the process."""
    return get_typestore(Stores.ROS2_JAZZY)


def full_name(name: str) -> str:
    """``pkg/Type`` as ``pkg/msg/Type``."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name


def parse(text: str, name: str, encoding: str = "ros2msg") -> dict[str, Any]:
    """Types that an embedded definition contains. Raises ValueError where it cannot be parsed, or takes long."""
    if len(text) > _LONGEST:
        raise ValueError(f"the definition of {name} has {len(text)} characters: none has so many")
    try:
        return dict(get_types_from_idl(text) if encoding == "ros2idl" else get_types_from_msg(text, full_name(name)))
    except Exception as error:  # rosbags raises several kinds from its parser
        raise ValueError(
            f"the definition of {name} cannot be parsed: {str(error).splitlines()[0] if str(error) else error!r}"
        ) from None


def ensure(name: str) -> None:
    """Make type `name` and what it contains known to `typestore`.

    Raises RecordingError where no installed package defines it.
    """
    name = full_name(name)
    store = typestore()
    if name in store.fielddefs:
        return
    package, kind, short = name.split("/")
    for folder in _shares():
        path = folder / package / kind / f"{short}.msg"
        if path.is_file():
            types = get_types_from_msg(path.read_text(encoding="utf-8"), name)
            for inner in _inner_names(types[name][1]):
                ensure(inner)
            store.register(types)
            return
    raise RecordingError(f"the definition of {name} is not installed: build or install the package {package}")


def definition(name: str) -> tuple[str, str]:
    """Text (with all it contains) and RIHS01 hash of type `name`. Raises RecordingError where it is unknown."""
    ensure(name)
    return typestore().generate_msgdef(full_name(name), ros_version=2)[0], typestore().hash_rihs01(full_name(name))


def _inner_names(fields: list[tuple[str, Any]]) -> Iterator[str]:
    for _, description in fields:
        while not isinstance(description[1], str):  # a sequence's description holds its element's
            if not isinstance(description[1][0], tuple):
                break
            description = description[1][0]
        if isinstance(description[1], str):
            yield description[1]


def _shares() -> Iterator[Path]:
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share"
    yield Path(sys.prefix) / "share"
    spec = find_spec("boom_interfaces")
    for place in (spec.submodule_search_locations or []) if spec else []:
        for parent in Path(place).parents:
            yield parent / "share"
