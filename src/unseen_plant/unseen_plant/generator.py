"""Makes a case: two recordings of one crane at different work, and the truth about it.

The first recording is for the diagnosis. The second is for judging its model, with the oracle's error, which none can beat: a free
run of the true crane on the second recording's measured currents.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from boom_recording.recording import Configuration, Recording
from unseen_plant.families import FAMILIES, Family, Laid, Site, gather, whole
from unseen_plant.layout import P_A, P_B, P_H, RATE
from unseen_plant.lots import Lot, redrawn
from unseen_plant.machine import DRAWN, LockedPose, Owner, crane
from unseen_plant.mechanics import linkage
from unseen_plant.operator import STYLES, drive
from unseen_plant.running import OutOfRangeError, rest, run, seen
from unseen_plant.sensing import SEEN, Fitting, fitted, held, recorded
from unseen_plant.structures import restructured
from unseen_plant.visibility import NotVisibleError, Visibility, Work, sensed, size_at_once

Array = NDArray[np.float64]

DURATION = 60.0
ATTEMPTS = 60
"""Cranes, operators and forms that are drawn before a case is given up."""
REDRAWN = 6
"""Attempts after which another effect of the same kind and class, or another pair, is drawn: some show in few cranes."""
_POSES = ((4.59, 0.0), (0.28, 2.2), (0.28, 2.8))
_ROOMS = {"ends": (-0.8, 1.5), "rocking": (0.1, 1.0)}


class CaseError(RuntimeError):
    """A case could not be made in the allowed attempts."""

    exit_status = 2


@dataclass(frozen=True)
class Concealed:
    """An effect of a case, as the truth tells it: its family and form, and its size. Times [s], None: it acts throughout."""

    effect: str
    known: bool
    subsystems: tuple[str, ...]
    equation: str
    form: str
    strength: float
    detectable: float | None
    size: float
    unit: str
    parameters: dict[str, float]
    onset_s: float | None
    hold_out_onset_s: float | None
    shown: float | None


@dataclass(frozen=True)
class MadeCase:
    """A case as it was made.

    Attributes:
        first, second: recordings for the diagnosis and for the judge.
        truth: the answer, a JSON document.
        machine: the owner's machine file as YAML text; None: the one that the trial was started with.
    """

    first: Recording
    second: Recording
    truth: dict[str, Any]
    machine: str | None


@dataclass(frozen=True)
class _Drawn:
    """A crane with its sensors: as the owner believes it, and as it is."""

    believed: Owner
    own: Owner
    told: LockedPose
    fitting: Fitting
    wrong: Mapping[str, float]


def make(lot: Lot, machine: str | Path) -> MadeCase:
    """The case of a lot around a machine file; the same lot gives the same case.

    Raises:
        CaseError: it could not be made in ``ATTEMPTS`` attempts.
        InputError, UnreadableMachineError: the machine file cannot be read, or lacks a number.
    """
    gather()
    owner = Owner.read(machine)
    reason = ""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([*lot.seed, attempt, int(lot.anything), 0x51])
        try:
            return _attempt(redrawn(lot, attempt // REDRAWN), owner, rng, attempt)
        except (OutOfRangeError, NotVisibleError) as error:
            reason = str(error)
    raise CaseError(f"case {lot.name} ({lot.kind}) could not be made in {ATTEMPTS} attempts: {reason}")


def _attempt(lot: Lot, owner: Owner, rng: np.random.Generator, attempt: int) -> MadeCase:
    families = [FAMILIES[name] for name, _ in lot.effects]
    drawn = _crane(lot, families, owner, rng)
    style = next((f.style for f in families if f.style), str(rng.choice(STYLES[:5])))
    start, work = _at_work(drawn, (), style, rng)
    site = _site(work, start, rng)
    plans = [(family, whole(rng.uniform(), len(family.forms)), rng.uniform(size=8)) for family in families]
    sizes, laid = [], []
    visibility = Visibility(work, rng) if plans else None
    for (family, form, draws), (_, strength) in zip(plans, lot.effects, strict=True):
        assert visibility is not None
        once = size_at_once(family, form, draws, site, visibility)
        if strength * once > family.high:
            raise NotVisibleError(f"{family.name} of {strength:g} x would be none any more")
        sizes.append((once, strength * once))
        laid.append(family.lay(strength * once, form, draws, site))
    shown = _still_seen(visibility, laid, lot) if visibility is not None else []
    configuration = Configuration(drawn.believed.name, drawn.told.q3, drawn.told.q4, drawn.told.load)
    first, _ = _recording("recording", drawn, laid, style, configuration, rng)
    other = replace(site, late=rng.uniform(size=4), noise=int(rng.integers(2**31)))
    again = [
        family.lay(size, form, draws, other) for (family, form, draws), (_, size) in zip(plans, sizes, strict=True)
    ]
    second, oracle = _recording("hold_out", drawn, again, _other_style(style, families, rng), configuration, rng)
    effects = [
        Concealed(
            family.name, family.known, family.subsystems, family.equation, family.forms[form - 1], strength, once, size,
            family.unit, dict(now.parameters), now.onset, later.onset, energy,
        )
        for (family, form, _), (_, strength), (once, size), now, later, energy in zip(
            plans, lot.effects, sizes, laid, again, shown, strict=True
        )
    ]  # fmt: skip
    truth = {
        "name": lot.name, "kind": lot.kind, "plant": "q", "effects": [asdict(effect) for effect in effects],
        "wrong": dict(drawn.wrong), "oracle": oracle, "pose": [drawn.told.q3, drawn.told.q4, drawn.told.load],
        "structure": _structure(drawn), "style": style, "sensors": asdict(drawn.fitting), "attempts": attempt + 1,
    }  # fmt: skip
    text = yaml.safe_dump(dict(drawn.believed.document), sort_keys=False) if lot.anything else None
    return MadeCase(first, second, truth, text)


def _crane(lot: Lot, families: Sequence[Family], owner: Owner, rng: np.random.Generator) -> _Drawn:
    """A crane in a pose that suits the case, scattered within its owner's tolerances."""
    fitting = fitted(rng, lot.anything)
    needs = {need for family in families for need in family.needs}
    believed = restructured(owner, needs, fitting, rng) if lot.anything else owner
    posed = rng.uniform()
    if any(family.stretched for family in families) or posed < 0.5:
        q3, q4 = _POSES[int(rng.integers(1, 3))]
    elif posed < 0.7:
        q3, q4 = _POSES[0]
    else:
        q3, q4 = float(rng.uniform(0.1, 1.5)), float(rng.uniform(0.5, 3.0))
    if believed.entry("rigid_body.planar") is None:
        configs = list((believed.entry("rigid_body.configs") or {}).values())
        told = configs[int(rng.integers(len(configs)))]
        q3, q4 = float(told["q3"]), float(told["q4"])
    pose = LockedPose(q3, q4, float(np.round(rng.uniform(100.0, 350.0))) if rng.uniform() < 0.25 and q4 > 0.0 else 0.0)
    wrong = {}
    if lot.kind == "parameters":
        keys = [key for key in DRAWN if believed.has(key) and believed.tolerance(key, pose)]
        for key in rng.choice(keys, size=int(rng.integers(2, 6)), replace=False):
            wrong[str(key)] = float(rng.uniform(1.2, 2.0) * rng.choice([-1.0, 1.0]))
    twins = {key: 0.0 for family in families for key in family.twins}
    factors = believed.drawn(rng, pose, float(rng.uniform(0.2, 0.7)), {**twins, **wrong})
    return _Drawn(believed, replace(believed, factors=factors), pose, fitting, wrong)


def _at_work(drawn: _Drawn, laid: Sequence[Laid], style: str, rng: np.random.Generator) -> tuple[Array, Work]:
    """An operator works the crane with what is laid into it: states (n, STATES), and the work with his currents."""
    c = crane(drawn.own, drawn.told)
    low, high = _ROOMS.get(style, (0.0, 1.1))
    limits = (max(low, c.q_low + 0.12), min(high, c.q_high - 0.06))
    start = (
        float(rng.uniform(*(limits[0] + np.array([0.25, 0.6]) * (limits[1] - limits[0])))),
        float(rng.uniform(5e5, 16e5)),
    )
    empty = Work(drawn.own, drawn.told, start, np.zeros((0, 2)), drawn.fitting)
    m = empty.machinery(laid)
    currents, states = drive(m, rest(m, *start), style, limits, DURATION, rng)
    return states, replace(empty, currents=currents)


def _site(work: Work, states: Array, rng: np.random.Generator) -> Site:
    c = crane(work.owner, work.pose)
    angle, hose = states[:, 0], states[:, P_H]
    torque = [linkage(float(y[0]), c)[1] * (y[P_A] * c.A_a - y[P_B] * c.A_b) for y in states[:: len(states) // 50]]
    flow = np.array([linkage(float(y[0]), c)[1] * y[RATE] for y in states[::20]])
    peak = max(float(np.max(flow)) * c.A_a, -float(np.min(flow)) * c.A_b, 1e-4)
    quantiles = np.quantile(hose, (0.1, 0.5, 0.9))
    return Site(
        c, DURATION, float(np.quantile(angle, 0.01)), float(np.quantile(angle, 0.99)),
        (float(quantiles[0]), float(quantiles[1]), float(quantiles[2])), float(np.mean(torque)), peak,
        rng.uniform(size=4), int(rng.integers(2**31)),
    )  # fmt: skip


def _still_seen(visibility: Visibility, laid: Sequence[Laid], lot: Lot) -> list[float]:
    """E of each effect beside the others. Raises NotVisibleError where one of a pair hides the other."""
    if len(laid) == 1:
        return [visibility.energy(laid)]
    found = [visibility.energy([one], [other for other in laid if other is not one]) for one in laid]
    if min(found) < 1.0:
        hidden = lot.effects[int(np.argmin(found))][0]
        raise NotVisibleError(f"{hidden} is not seen beside the other")
    return found


def _other_style(style: str, families: Sequence[Family], rng: np.random.Generator) -> str:
    """The second recording shows other work, unless an effect shows in one kind only."""
    return style if any(family.style for family in families) else str(rng.choice(STYLES[:5]))


def _recording(
    name: str, drawn: _Drawn, laid: Sequence[Laid], style: str, configuration: Configuration, rng: np.random.Generator
) -> tuple[Recording, list[float | None]]:
    """The crane worked and recorded; with the oracle's normalised errors. Raises OutOfRangeError."""
    _, work = _at_work(drawn, laid, style, rng)
    outputs = work.shown(laid)
    if len(outputs) < len(work.currents):
        raise OutOfRangeError("the boom left its linkage")
    recording = recorded(name, outputs, work.currents, configuration, drawn.fitting, rng)
    m = work.machinery(laid)
    applied = held(recording, len(outputs))
    for change in (change for each in laid for change in each.currents):
        applied = change(applied)
    free = sensed(seen(run(m, rest(m, *work.start), applied)), laid)
    return recording, _errors(free, recording)


def _errors(free: Array, recording: Recording) -> list[float | None]:
    """Normalised rms error per channel: rms(free - measured) / standard deviation of the measured; None: it stood still."""
    result: list[float | None] = []
    time = np.arange(1, len(free) + 1) * 0.005
    for k, name in enumerate(SEEN):
        signal = recording.signals[name]
        inside = signal.time <= time[-1]
        spread = float(np.std(signal.values))
        error = np.interp(signal.time[inside], time, free[:, k]) - signal.values[inside]
        result.append(float(np.sqrt(np.mean(error**2))) / spread if spread > 0.0 else None)
    return result


def _structure(drawn: _Drawn) -> dict[str, str]:
    """The components by which this crane may differ from the TZ17."""
    believed = drawn.believed
    compensated = (believed.entry("main_valve_orifices") or {}).get("compensator", True) is True
    return {
        "kinematics": believed.kind("kinematics", "four_bar"),
        "hose_burst_valve": believed.kind("hose_burst_valve", "flow_limiting"),
        "accumulators": believed.kind("accumulators", "two_diaphragm"),
        "main_valve_spool": believed.kind("main_valve_spool", "pilot_operated"),
        "compensator": "yes" if compensated else "no",
    }
