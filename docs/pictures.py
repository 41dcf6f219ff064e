"""The pictures of these pages, drawn from the code: `./boom python docs/build.py`."""

from __future__ import annotations

import ast
import re
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
from drawing import Drawing, Point, alone

from boom_controller.supervision import state_machine
from boom_diagnosis.document import SUBSYSTEMS
from boom_estimation.free_run import predict
from boom_model.catalogue import CATALOGUE
from boom_model.machine_file import shipped_machine
from boom_recording.loading import load
from boom_report.scheme import scheme

ROOT = Path(__file__).resolve().parents[1]
LAG = ROOT / "bags" / "explained" / "hose_burst_valve_lag_b"


def crane() -> str:
    """The crane with its hydraulic scheme, as the diagnosis report colours it."""
    made = str(scheme(shipped_machine("tz17"), dict.fromkeys(SUBSYSTEMS, 0.0) | {"hose_burst_valve": 0.98}))
    svg = made[made.index("<svg") : made.index("</svg>") + 6].replace("<svg ", '<svg class="scheme" width="560" ', 1)
    css = files("boom_report").joinpath("scheme.css").read_text("utf-8")
    rules = "\n".join(line for line in css.splitlines() if line.startswith((".scheme", ".heat-")) and "svg" not in line)
    return alone(svg, rules + "\n.scheme { background: var(--paper); }")


def way() -> str:
    """From a recording to a report."""
    d = Drawing(920, 330, "From a recording to a posterior and a report")
    d.box(20, 40, 150, 70, "recording", ("a bag, or imported", "./boom import"), "strong")
    d.box(210, 40, 160, 70, "doubts", ("signs, units, clocks", "./boom chain"))
    d.box(410, 40, 160, 70, "free run", ("currents in, motion out", "./boom validate"))
    d.box(650, 40, 240, 70, "agrees within noise", ("the machine is as its file says",), "strong")
    d.box(
        410,
        175,
        160,
        84,
        "hypotheses",
        (f"{len(CATALOGUE)} effects, tolerances,", "clocks, sensors", "./boom diagnose"),
    )
    d.box(210, 175, 160, 84, "observer", ("predicts each sample", "from those before"))
    d.box(650, 175, 240, 84, "posterior", ("a probability for each", "hypothesis, judged on", "held-out data"))
    d.arrow((170, 75), (208, 75))
    d.arrow((370, 75), (408, 75))
    d.arrow((570, 75), (648, 75), label="noise")
    d.arrow((490, 110), (490, 173), label="more than noise", at=(498, 146), kind="small")
    d.arrow((410, 217), (372, 217))
    d.arrow((290, 259), (290, 292), (610, 292), (610, 230), (648, 230), label="innovations", at=(450, 286))
    d.arrow((570, 205), (648, 205))
    d.arrow((770, 259), (770, 284))
    d.text(770, 304, "report.html, machine.yaml,", "middle")
    d.text(770, 320, "next_experiment", "middle")
    d.text(20, 304, "machine file: every number with", "small")
    d.text(20, 319, "unit, source and tolerance", "small")
    d.arrow((100, 290), (100, 150), (440, 150), (440, 112), label="", at=None)
    return d.svg()


def processes() -> str:
    """Processes of a demo, with the topics and frames between them."""
    d = Drawing(920, 372, "Processes, topics and the CAN bus")
    d.box(20, 30, 150, 62, "replay", ("a recording again",))
    d.box(20, 130, 150, 72, "your stack", ("plans a motion;", "tip pose comes back"), "strong")
    d.box(20, 240, 150, 62, "recorder", ("MCAP, all topics",))
    d.box(
        330, 110, 190, 100, "controller", ("trajectory generator,", "law, observers,", "supervision: 100 Hz"), "strong"
    )
    d.box(330, 260, 190, 62, "watch", ("alarm beyond tolerance",))
    d.box(690, 30, 200, 72, "CAN bridge", ("checks every frame,", "publishes topics"))
    d.box(690, 150, 200, 52, "CAN bus", ("DBC and mapping files",), "soft")
    d.box(690, 250, 200, 72, "ECU and crane", ("or their stand-in: the", "simulated crane"), "strong")
    d.arrow((170, 61), (688, 61), label="/boom/current_command (replayed)", at=(430, 54))
    d.arrow((170, 154), (328, 154), label="/boom/joint_trajectory", at=(249, 147))
    d.arrow((328, 184), (172, 184), label="controller_state", at=(249, 199))
    d.arrow((520, 140), (600, 140), (600, 80), (688, 80), label="current_", at=(560, 116))
    d.text(560, 130, "command", "small middle")
    d.arrow((688, 94), (640, 94), (640, 180), (522, 180), label="/joint_states,", at=(579, 173))
    d.text(579, 195, "pressures, currents", "small middle")
    d.arrow((640, 180), (640, 291), (522, 291))
    d.arrow((640, 291), (640, 344), (95, 344), (95, 304), label="everything", at=(300, 338))
    d.arrow((790, 102), (790, 148), label="commands", at=(797, 130), kind="small")
    d.arrow((790, 202), (790, 248))
    for top in (150, 250):
        d.arrow((770, top), (770, top - 46))
    d.text(703, 130, "sensors", "small")
    d.text(797, 230, "frames", "small")
    d.text(690, 352, "without a bus: the simulated crane", "small")
    d.text(690, 366, "directly on the topics", "small")
    return d.svg()


@cache
def imports() -> dict[str, set[str]]:
    """Package -> packages of this tree that it imports, but for type checking and the blind plants."""
    packages = {
        path.name: path / path.name for path in (ROOT / "src").iterdir() if (path / path.name / "__init__.py").is_file()
    }
    found = {}
    for name, folder in packages.items():
        seen: set[str] = set()
        for file in folder.rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                seen |= {word.split(".")[0] for word in names}
        found[name] = (seen & set(packages)) - {name}
    return found


def floors() -> str:
    """The packages, each above all that it imports."""
    uses = imports()

    @cache
    def level(name: str) -> int:
        return 1 + max((level(other) for other in uses[name]), default=-1)

    rows: dict[int, list[str]] = {}
    for name in uses:
        rows.setdefault(level(name), []).append(name)
    height = 50 * len(rows) + 40
    d = Drawing(920, height, "Packages: each imports only from the floors below it")
    for k, row in sorted(rows.items()):
        y = height - 50 * (k + 1)
        d.text(20, y + 21, str(k), "small")
        width = min(210.0, (850.0 - 12 * (len(row) - 1)) / len(row))
        for j, name in enumerate(sorted(row)):
            d.box(
                48 + j * (width + 12), y, width, 34, name.removeprefix("boom_"), (), "strong" if k == max(rows) else ""
            )
    d.text(48, 22, "each package imports only from floors below its own; names without boom_", "small")
    return d.svg()


def states() -> str:
    """The controller's states; events from the table of its module."""
    rows = re.findall(r"^\| ([a-z, ]+) \| (.+?) \| ([a-z]+) \|$", str(state_machine.__doc__), re.MULTILINE)
    known = {state.value for state in state_machine.MotionState}
    moves = [(one, event, after) for before, event, after in rows for one in before.split(", ") if one in known]
    assert {one for move in moves for one in (move[0], move[2])} == known
    d = Drawing(920, 340, "States of the controller")
    place: dict[str, Point] = {
        "idle": (140, 60),
        "track": (400, 60),
        "hold": (710, 60),
        "stopping": (555, 240),
        "stopped": (140, 240),
    }
    for name, (x, y) in place.items():
        closed = name in ("track", "hold")
        said = {"idle": "currents zero", "stopped": "currents zero", "stopping": "comes to rest"}.get(
            name, "the law commands"
        )
        d.box(x, y, 120, 50, name, (said,), "strong" if closed else "")
    ways: dict[tuple[str, str], tuple[Point, ...]] = {
        ("idle", "track"): ((260, 85), (398, 85)), ("track", "hold"): ((520, 74), (708, 74)),
        ("hold", "track"): ((708, 100), (522, 100)),
        ("idle", "stopped"): ((180, 110), (180, 238)), ("stopped", "idle"): ((222, 238), (222, 112)),
        ("track", "stopping"): ((460, 110), (590, 238)), ("hold", "stopping"): ((770, 110), (650, 238)),
        ("stopping", "stopped"): ((555, 265), (262, 265)),
    }  # fmt: skip
    labels: dict[tuple[str, str], tuple[Point, str]] = {
        ("idle", "track"): ((330, 78), "small middle"), ("track", "hold"): ((615, 42), "small middle"),
        ("hold", "track"): ((615, 118), "small middle"), ("idle", "stopped"): ((172, 176), "small end"),
        ("stopped", "idle"): ((230, 176), "small"), ("track", "stopping"): ((500, 180), "small end"),
        ("hold", "stopping"): ((722, 180), "small"), ("stopping", "stopped"): ((408, 258), "small middle"),
    }  # fmt: skip
    for before, event, after in moves:
        d.arrow(*ways[before, after])
        at, kind = labels[before, after]
        for k, line in enumerate(_folded(event, 24 if kind != "small middle" else 44)):
            d.text(at[0], at[1] + 14 * k, line, kind)
    return d.svg(".end { text-anchor: end; }")


def _folded(text: str, width: int) -> list[str]:
    lines = [""]
    for word in text.replace("`", "").split():
        if len(lines[-1]) + len(word) > width and lines[-1]:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def diagnosis() -> str:
    """Rod pressure of a recording: measured, before and after the diagnosis named what was left out."""
    recording = load(LAG)
    machine = shipped_machine("tz17")
    after = machine.with_effects({"hose_burst_valve_lag": {"tau": 0.09}})
    signal = recording.signals["rod_pressure"]
    begin, end, low, high = 13.5, 17.5, -5.0, 0.0
    shown = (signal.time > begin) & (signal.time < end)
    time = signal.time[shown]
    lines = {"measured": signal.values, "other": predict(recording, machine, "full").values["rod_pressure"],
             "model": predict(recording, after, "full").values["rod_pressure"]}  # fmt: skip
    bar = {kind: 1e-5 * np.asarray(values)[shown] for kind, values in lines.items()}
    high = 1.06 * max(float(np.nanmax(values)) for values in bar.values())
    d = Drawing(920, 330, "One diagnosis: rod pressure measured, before and after")

    def at(t: float, p: float) -> Point:
        return 70 + (t - begin) / (end - begin) * 820, 270 - (p - low) / (high - low) * 215

    for level in np.arange(0.0, high, 20.0):
        (x0, y), (x1, _) = at(begin, level), at(end, level)
        d.parts.append(f'<path class="soft" d="M{x0:g} {y:.1f}H{x1:g}"/>')
        d.text(62, y + 4, f"{level:g}", "small end")
    for second in np.arange(14.0, end, 1.0):
        d.text(at(second, low)[0], 288, f"{second:g}", "small middle")
    d.text(480, 310, "time since the start of the recording [s]", "small middle")
    d.text(20, 24, "rod pressure [bar]", "title")
    for k, (kind, words) in enumerate((
        ("measured", "measured"), ("other", "before: the machine file"), ("model", "after: with hose burst valve lag, 90 ms"))
    ):  # fmt: skip
        x = (200, 310, 520)[k]
        d.curve([(x, 20), (x + 26, 20)], kind)
        d.text(x + 33, 24, words)
    for kind, values in bar.items():
        d.curve([at(t, p) for t, p in zip(time[::2], values[::2], strict=True) if np.isfinite(p)], kind)
    return d.svg(".end { text-anchor: end; }")


ALL = {"crane": crane, "way": way, "processes": processes, "floors": floors, "states": states, "diagnosis": diagnosis}
"""Name of the file in docs/pictures -> what draws it."""
SIMULATED = frozenset({"diagnosis"})
"""Those that need the model to run."""
