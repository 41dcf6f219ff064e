"""Damages machine files, CAN mappings, DBC files, parameter files and metadata of bags, and has them read.

    python benchmarks/fuzz_yaml.py --cases 5000 --seed 1

Half of the damage is done to the text or its bytes, half to the document: a value becomes a hostile one of another kind, an
entry is left out, renamed, repeated or moved, a learned term is made up. What is read nevertheless is used: a machine is explained
(`./boom check-machine`), posed, made a URDF, read by the concealed plant, and one in a hundred runs; a mapping encodes and decodes
frames. A refusal must be the error of its package and one line that names the file.
"""

from __future__ import annotations

import contextlib
import copy
import io
import sys
from collections.abc import Callable
from functools import cache
from importlib import resources
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import yaml
from fuzzing import FLOATS, NUMBERS, TEXTS, Outcome, main, mutate, mutate_text

from boom_bringup import cli
from boom_can_bridge.codec import Codec
from boom_can_bridge.errors import CanConfigurationError, FrameError
from boom_description import make_urdf
from boom_model import learned
from boom_model.errors import ModelError
from boom_model.machine_file import load_machine
from boom_model.plant import Plant
from boom_node.errors import StartError
from boom_node.parameters import read_files
from boom_recording import bag_folder
from boom_recording.errors import RecordingError
from concealed_plant import machine as concealed

LONGEST = 600
"""Characters of a refusal."""
BOMBS = (
    "a: &a [x, x]\n" + "".join(f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]\n" for i in range(24)),
    "[" * 50_000, "{a: " * 50_000, "- " * 50_000, "a: " + "9" * 5000, "a: !!python/object:os.system x", "a: 2024-13-45",
    "? [a, b]\n: 1\n", "a: 1\na: 2\n", "a: 1\n---\nb: 2\n", "<<: {a: 1}\n", "a: 0x_\n", "%YAML 9.9\n---\na: 1\n",
    "a: .inf\nb: .nan\n",
)  # fmt: skip
"""Put in front of a file, or in its place."""
VALUES: tuple[Any, ...] = (
    None, True, False, *NUMBERS, *FLOATS, *TEXTS, 10**40, -(10**40), [], {}, [[]], [None], {"a": 1}, [1, 2, 3, 4], ["x", "y"],
    {"value": 1}, {"value": []}, {"value": None, "unit": 5}, {"value": "1e999", "unit": ["m"], "conf": {}},
)  # fmt: skip
"""What stands in the place of a value."""
_EXPRESSIONS = (
    "plus(angle, 1e999)", "angle", "lag(rate, 1e-320)", "bump(rate, 0, 1e-9)", "sign(rate)*", "*" * 5000,
    "abs(" * 10_000 + "rate" + ")" * 10_000,
    "rate^3*" * 2000 + "rate", "plus(angle,)", "plus(angle, 1, 2)", "system(rate)",
    "rate; #include </dev/zero>", "above(angle, 0.2)",
)  # fmt: skip


def _kinds() -> dict[str, tuple[str, str]]:
    """Kind -> (name of the file, its text)."""
    machines = resources.files("boom_model") / "machines"
    dbc = resources.files("boom_can_bridge") / "dbc"
    config = resources.files("boom_bringup") / "config"
    bag = Path(__file__).parents[1] / "bags" / "healthy" / "extended" / "metadata.yaml"
    return {
        "machine": ("m.yaml", (machines / "tz17.yaml").read_text("utf-8")),
        "machine, other make": ("m.yaml", (machines / "triangle_direct.yaml").read_text("utf-8")),
        "mapping": ("tz17.yaml", (dbc / "tz17.yaml").read_text("utf-8")),
        "mapping, pages": ("other_machine.yaml", (dbc / "other_machine.yaml").read_text("utf-8")),
        "DBC": ("tz17.dbc", (dbc / "tz17.dbc").read_text("utf-8")),
        "DBC, pages": ("other_machine.dbc", (dbc / "other_machine.dbc").read_text("utf-8")),
        "parameters": ("p.yaml", (config / "simulation.yaml").read_text("utf-8")),
        "metadata": ("metadata.yaml", bag.read_text("utf-8")),
    }


KINDS = _kinds()


@cache
def _document(kind: str) -> Any:
    return yaml.safe_load(KINDS[kind][1])


def _damage(random: Random, kind: str) -> tuple[str, bytes]:
    text = KINDS[kind][1]
    way = random.random()
    if way < 0.05:
        bomb = random.choice(BOMBS)
        return "bomb", (bomb if random.random() < 0.5 else f"{bomb}\n{text}").encode()
    if way < 0.25:
        return mutate(random, text.encode())
    if way < 0.5 or kind.startswith("DBC"):
        what, damaged = mutate_text(random, text)
        return what, damaged.encode("utf-8", "surrogatepass")
    document = copy.deepcopy(_document(kind))
    what = ""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        what = random.choice(_STRUCTURAL)(random, document)
    return what, yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=200).encode(
        "utf-8", "surrogatepass"
    )


def _places(node: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) below a node."""
    found: list[tuple[Any, Any]] = []
    pending = [node]
    while pending:
        container = pending.pop()
        for key in list(container) if isinstance(container, dict) else range(len(container)):
            found.append((container, key))
            if isinstance(container[key], dict | list):
                pending.append(container[key])
    return found


def _place(random: Random, document: Any) -> tuple[Any, Any]:
    return random.choice(_places(document) or [({"a": 1}, "a")])


def _replace(random: Random, document: Any) -> str:
    container, key = _place(random, document)
    container[key] = copy.deepcopy(random.choice(VALUES))
    return "value replaced"


def _scale(random: Random, document: Any) -> str:
    numbers = [(c, k) for c, k in _places(document) if isinstance(c[k], int | float) and not isinstance(c[k], bool)]
    if numbers:
        container, key = random.choice(numbers)
        container[key] = container[key] * random.choice((-1, 0, 1e-12, 1e-3, 0.5, 2, 10, 1e3, 1e12, 1e200))
    return "number scaled"


def _leave_out(random: Random, document: Any) -> str:
    container, key = _place(random, document)
    del container[key]
    return "entry left out"


def _rename(random: Random, document: Any) -> str:
    named = [(c, k) for c, k in _places(document) if isinstance(c, dict)]
    if named:
        container, key = random.choice(named)
        new = random.choice((*TEXTS, *NUMBERS, None, True, str(key) + "x", random.choice(named)[1]))
        container[new] = container.pop(key)
    return "key renamed"


def _move(random: Random, document: Any) -> str:
    (one, a), (other, b) = _place(random, document), _place(random, document)
    one[a] = copy.deepcopy(other[b])
    return "entry moved"


def _deepen(random: Random, document: Any) -> str:
    container, key = _place(random, document)
    for _ in range(random.choice((1, 5, 40))):
        container[key] = {"value": container[key]} if random.random() < 0.5 else [container[key]]
    return "nested deeper"


def _learn(random: Random, document: Any) -> str:
    """A learned term, of true and of hostile parts; in a document of another kind an unknown section."""
    variable = random.choice(list(learned.VARIABLES))
    basis = [
        random.choice((*_EXPRESSIONS, variable, f"sign({variable})", f"{variable}^2"))
        for _ in range(random.choice((1, 2, 40)))
    ]
    used = random.sample(list(learned.VARIABLES), random.randint(1, 3))
    place = random.choice(list(learned.PLACES))
    ranges = ([0.0, 1.0], [-0.1, 0.1], [1e6, 2e7], [1, 0], [float("-inf"), float("inf")], 5)
    entry = {
        "equation": place, "basis": basis, "coefficients": [random.choice((1.0, -0.1, *FLOATS)) for _ in basis],
        "unit": f"{learned.PLACES[place].scale:g} {learned.PLACES[place].unit}",
        "validity": {name: random.choice(ranges) for name in used},
    }  # fmt: skip
    if isinstance(document, dict):
        document["learned"] = [entry] * random.choice((1, 1, 30))
    return "learned term"


_STRUCTURAL: tuple[Callable[[Random, Any], str], ...] = (
    _replace,
    _replace,
    _scale,
    _leave_out,
    _rename,
    _move,
    _deepen,
    _learn,
)


# ------------------------------------------------------------------------------------------------------------- judging


def case(random: Random, folder: Path) -> Outcome:
    """Damage one file and have it read."""
    kind = random.choice(list(KINDS))
    name, _ = KINDS[kind]
    what, damaged = _damage(random, kind)
    path = folder / name
    path.write_bytes(damaged)
    try:
        answer, fault = _read(kind.split(",")[0], path, random)
    except (ModelError, CanConfigurationError, StartError, RecordingError, concealed.MachineFileError) as error:
        return Outcome(kind, what, "refused", fault=_no_plain_line(str(error), path))
    return Outcome(kind, what, answer, fault=fault)


def _read(kind: str, path: Path, random: Random) -> tuple[str, str]:
    """Read a file and use what was read; gives the answer, and what is wrong with what was said, "" where nothing is."""
    if kind == "machine":
        fault = _explained(path)
        machine = load_machine(path)
        for pose in ((4.59, 0.0), (0.28, 2.2), (1.5, 1.0)):
            with contextlib.suppress(ModelError):
                machine.pose(*pose, random.choice((0.0, 300.0)))
        machine.sensor_noise()
        with contextlib.suppress(ModelError):
            make_urdf.make_urdf(make_urdf.load_machine(path))
        with contextlib.suppress(concealed.MachineFileError):
            told = concealed.MachineFile.read(path)
            concealed.quantities(told, concealed.Posture(0.28, 2.2, 0.0))
            concealed.linkage(told, 11)
        if random.random() < 0.01 or machine.learned:
            plant = Plant(machine, machine.tabulated[0])
            with contextlib.suppress(ModelError):
                plant.run([0.0], [[0.0, 0.5]], np.linspace(0.0, 0.1, 11), plant.equilibrium(0.1))
        return "whole", fault
    if kind in ("mapping", "DBC"):
        dbc = Path(str(resources.files("boom_can_bridge"))) / "dbc" / f"{path.stem}.dbc"
        codec = Codec.load(path if kind == "DBC" else dbc, path if kind == "mapping" else dbc.with_suffix(".yaml"))
        command = codec.command
        identifier, payload = codec.encode(command.name, dict.fromkeys(command.fields, 0.0))
        codec.decode(identifier, payload, extended=command.is_extended)
        for spec in codec.incoming:
            with contextlib.suppress(FrameError):  # random bytes are seldom a frame
                codec.decode(spec.arbitration_id, random.randbytes(spec.length), extended=spec.is_extended)
    elif kind == "parameters":
        read_files(["--params-file", str(path)])
    else:
        (path.parent / "extended.mcap").write_bytes(b"\x89MCAP0")  # only which files belong to the bag is asked
        warnings = bag_folder.find(path.parent).warnings
        odd = [text for text in warnings if not text.isprintable() or len(text) > LONGEST]
        return "told" if warnings else "whole", f"no plain warning: {odd[0][:60]!a}" if odd else ""
    return "whole", ""


def _explained(path: Path) -> str:
    """What `./boom check-machine` says: a table and status 0, or a line for each fault and status 2."""
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        status = cli.main(["check-machine", str(path)])
    lines = errors.getvalue().splitlines()
    if status == 0:
        return "" if not lines and out.getvalue() else "check-machine: status 0 and complaints"
    if status != 2 or not lines or out.getvalue():
        return f"check-machine: status {status}, {len(lines)} lines"
    odd = [line for line in lines if _no_plain_line(line.removeprefix("boom: "), path)]
    return f"check-machine: {odd[0][:60]!a}" if odd else ""


def _no_plain_line(text: str, path: Path) -> str:
    if not text.isprintable() or len(text) > LONGEST + len(str(path)):
        return f"no plain line: {text[:60]!a}"
    beside = str(
        resources.files("boom_can_bridge")
    )  # a DBC file and its mapping are told by the one that names the other
    return "" if str(path.parent) in text or beside in text else f"does not name the file: {text[:60]!a}"


if __name__ == "__main__":
    sys.exit(main(__doc__, case, 500))
