"""One link of the chain after the other, each driven by what was measured: which link breaks.

    motion -> rate                       kinematics
    pressures, motion -> pressure        mechanics: the pressure that the boom needs
    motion, hose pressure -> head flow   the main valve's edges at port a, hose, accumulators and valve at the cylinder
    motion, rod pressure -> rod flow     the main valve's edges at port b

Every link is fed with measurements on both sides, so an error stays where it arises. Its size is compared with what the sensors'
noise and the tolerances of the machine file leave.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_checks.check import IntervalValue, RecordingCheck
from boom_checks.cylinder_valve import FOLLOWS, ValveData, ValveLaw, joined, valve_laws
from boom_checks.doubts import ALL, checks_of, lacking
from boom_checks.even_series import PERIOD, EvenSeries, even_series
from boom_checks.forced import ForcedRun, forced_run
from boom_checks.mechanics import Mechanics, mechanics, piston_only
from boom_checks.readings import Z_90
from boom_checks.statics import Statics, statics_of
from boom_identification.stationary import pose_of
from boom_identification.validation import at_rest
from boom_model.component_numbers import component_parameters
from boom_model.components import cylinder
from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.plant import Plant
from boom_model.prior import prior_of
from boom_recording.recording import Recording

Array = NDArray[np.float64]

BETTER = 0.8
"""A law of the valve is better than a simpler one if its error is below that share of the simpler one's."""
ALIKE = 1.1
"""Laws whose errors differ by less are not told apart."""
ALTERNATING = 5.0
"""s. Parts of a single recording on which the valve is fitted and judged in turn: halves may be lifting and lowering."""
LASTING = 0.5
"""s. Over which the flow that a port lacks is averaged."""


@dataclass(frozen=True)
class ChainLink:
    """One link: what it gives from measurements against what was measured.

    Attributes:
        name, driven_by: for people. unit: of the values.
        time, model, measured: (n,).
        tolerance: rms that noise and the machine file's tolerances leave [unit]; infinite where nothing says.
    """

    name: str
    driven_by: str
    unit: str
    time: Array
    model: Array
    measured: Array
    tolerance: float

    @property
    def error(self) -> IntervalValue:
        """Rms error with its interval; errors last a second."""
        square = (self.model - self.measured)[self._known] ** 2
        if len(square) == 0:
            return IntervalValue(self.name, math.nan, self.unit, (math.nan, math.nan))
        middle, seconds = float(np.mean(square)), max(len(square) * PERIOD, 1.0)
        half = Z_90 * float(np.std(square)) / math.sqrt(seconds)
        low, high = math.sqrt(max(middle - half, 0.0)), math.sqrt(middle + half)
        return IntervalValue(f"rms error of the {self.name}", math.sqrt(middle), self.unit, (low, high))

    @property
    def nrmse(self) -> float:
        """Rms error over the standard deviation of what was measured."""
        spread = float(np.std(self.measured[self._known])) if self._known.any() else 0.0
        return self.error.value / spread if spread > 0.0 else math.nan

    @property
    def ratio(self) -> float:
        """Error over tolerance: above 1 the link is not as the machine file says."""
        return self.error.value / self.tolerance if self.tolerance > 0.0 else math.inf

    @property
    def _known(self) -> NDArray[np.bool_]:
        return np.isfinite(self.model) & np.isfinite(self.measured)

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "link": self.name, "driven_by": self.driven_by, "error": self.error.document(), "nrmse": self.nrmse,
            "tolerance": self.tolerance, "ratio": self.ratio,
        }  # fmt: skip


@dataclass(frozen=True)
class RecordingChain:
    """The links of one recording.

    Attributes:
        missing: (link, why it cannot be driven).
        valve: data of the valve at the cylinder; None where the cylinder's pressure is neither measured nor known.
        measured_head: whether the cylinder's pressure was measured; else it is what the boom needs.
    """

    recording: Recording
    checks: tuple[RecordingCheck, ...]
    links: tuple[ChainLink, ...]
    missing: tuple[tuple[str, str], ...]
    statics: Statics | None
    valve: ValveData | None
    time: Array
    measured_head: bool

    @property
    def sentence(self) -> str:
        """Which link breaks."""
        spoilt = [check for check in self.checks if check.spoils]
        if spoilt:
            return f"the recording first: {spoilt[0].topic}: {spoilt[0].sentence}"
        if not self.links:
            return (
                "the hydraulics at the cylinder alone" if self.valve else f"no link can be driven: {self.missing[0][1]}"
            )
        angle = self.recording.signals["angle"]
        if still := at_rest(angle.values[angle.valid]):
            return f"nothing drives the links: {still}"
        broken = sorted((link for link in self.links if link.ratio > 1.0), key=lambda link: -link.ratio)
        if not broken:
            why = "noise and the file's tolerances explain every error"
            untold = ", ".join(dict.fromkeys(name for name, _ in self.missing))
            return (
                f"no link that can be driven breaks: {why}; not driven: {untold}"
                if untold
                else f"no link breaks: {why}"
            )
        each = " and ".join(f"{link.name} ({link.ratio:.1f} times what noise and tolerances leave)" for link in broken)
        return f"the chain breaks at the {each}"

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "bag": self.recording.name, "sentence": self.sentence, "warnings": list(self.recording.warnings),
            "checks": [c.document() for c in self.checks],
            "links": [link.document() for link in self.links],
            "missing": [{"link": name, "why": why} for name, why in self.missing],
            "statics": self.statics.document() if self.statics else None,
        }  # fmt: skip


@dataclass(frozen=True)
class ChainStudy:
    """All recordings, and what the valve at the cylinder is opened by: fitted on ``fitted``, judged on ``held_out``."""

    chains: tuple[RecordingChain, ...]
    laws: tuple[ValveLaw, ...]
    fitted: str
    held_out: str

    @property
    def valve_sentence(self) -> str:
        """What opens the valve at the cylinder; empty where nothing can be said."""
        best = self.best
        if best is None:
            return (
                "nothing can be said of it: motion and all pressures are hardly ever known together"
                if self.fitted
                else ""
            )
        static = next(law for law in self.laws if not law.opened_by)
        if best.opened_by:
            beside = f"NRMSE of its flow on {self.held_out} {best.held_out:.2f}, static curve {static.held_out:.2f}"
            alike = [
                v
                for v in self.laws
                if v.opened_by not in ("", FOLLOWS) and v is not best and v.held_out < ALIKE * best.held_out
            ]
            others = f"; not told apart from {' and '.join(law.words for law in alike)}" if alike else ""
            return f"the valve at the cylinder is {best.words} ({beside}){others}"
        return (
            f"the flow at the cylinder follows a static curve as well as any opened valve (NRMSE {static.held_out:.2f})"
        )

    @property
    def best(self) -> ValveLaw | None:
        """The simplest law that no other is clearly better than."""
        laws = [law for law in self.laws if law.opened_by != FOLLOWS]
        if not laws:
            return None
        chosen = next(law for law in laws if not law.opened_by)
        for law in sorted(laws, key=lambda law: bool(law.opened_by) + bool(law.ratio)):
            if law.held_out < BETTER * chosen.held_out or (
                law.held_out < chosen.held_out and chosen.opened_by and not law.ratio
            ):
                chosen = law
        return chosen

    def document(self) -> dict[str, Any]:
        """The document of ``chain --json``."""
        return {
            "bags": [chain.document() for chain in self.chains],
            "valve": {
                "sentence": self.valve_sentence, "fitted": self.fitted, "held_out": self.held_out,
                "laws": [law.document() for law in self.laws],
            },
        }  # fmt: skip


VALVE, DRAWS, MOST = "main_valve_orifices.", 6, 0.8
"""Numbers whose tolerances count for the flows of the main valve; machines that are drawn with them; share that is nearer."""
INNER = ("piston_position", "hose_flow", "rod_flow", "jacobian")
"""What the links of the ports take from the forced model."""
HELD = "the machine file's valve holds the load: the hose pressure is not the cylinder's"


def chain_of_machine(recording: Recording, machine: Machine) -> RecordingChain:
    """The links of a recording of a machine.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    series, boom = even_series(recording), mechanics(machine, recording)
    found, repaired = checks_of(recording, series, boom, machine)
    links: list[ChainLink] = []
    missing: list[tuple[str, str]] = []
    still = None
    if repaired.known("angle", "rate") and any(check.kind == "derived_rate" for check in found):
        repaired = repaired.with_columns({"rate": repaired.smooth("angle", 1)})  # what is logged is filtered, and lags
        missing.append(("kinematics", "the recorded rate is derived from the angle, not measured"))
    elif repaired.known("angle", "rate"):
        links.append(_kinematics(repaired, machine))
    else:
        missing.append(("kinematics", _why(recording, repaired, ("angle", "rate"))))
    if repaired.known(*ALL):
        if machine.holds:
            missing.append(("mechanics", HELD))
        else:
            still = statics_of(repaired, boom)
            links.append(_mechanics(repaired, boom, still, machine))
        plant = Plant(machine, pose_of(recording, machine))
        # the law of a valve that holds the load is known to a factor: on a measured drop its flow is off by that
        driven = repaired.without("head_pressure") if machine.holds else repaired
        links += _ports(driven, forced_run(driven, plant, INNER), plant)
    else:
        missing += [(name, _why(recording, repaired, ALL)) for name in ("mechanics", "head flow", "rod flow")]
    return _chain(recording, repaired, boom, tuple(found), tuple(links), tuple(missing), still)


def _why(recording: Recording, series: EvenSeries, names: Sequence[str]) -> str:
    """Why what needs these signals cannot be driven."""
    return lacking(recording, [n for n in names if not series.known(n)] or list(names), "it needs")


def chain_of_cylinder(recording: Recording, head_area: float, rod_area: float) -> RecordingChain:
    """The hydraulics at the cylinder alone: the recorded joint is the piston [m], the areas [m^2] are all that is known."""
    series, boom = even_series(recording), piston_only(head_area, rod_area)
    if "angle" in series:
        series = series.with_columns({"rate": series.smooth("angle", 1)})  # a logged speed is filtered, and lags
    return _chain(
        recording, series, boom, (), (), (("kinematics, mechanics and main valve", "there is no machine file"),), None
    )


def _chain(
    recording: Recording, series: EvenSeries, boom: Mechanics, found: tuple[RecordingCheck, ...], links: tuple[ChainLink, ...],
    missing: tuple[tuple[str, str], ...], still: Statics | None,
) -> RecordingChain:  # fmt: skip
    measured = series.known("head_pressure")
    breaks = any(link.name == "mechanics" and link.ratio > 1.0 for link in links)
    known = series.known("angle", "rate", "hose_pressure", "rod_pressure")
    valve = _valve_data(series, boom, still, breaks) if known else None
    return RecordingChain(recording, found, links, missing, still, valve, series.time, measured)


def study(chains: Sequence[RecordingChain]) -> ChainStudy:
    """What opens the valve at the cylinder: fitted on all recordings but the last, or on every other part of the only one."""
    known = [(chain, chain.valve) for chain in chains if chain.valve is not None]
    if not known:
        return ChainStudy(tuple(chains), (), "", "")
    (last, judge), first = known[-1], known[:-1]
    if first:
        fitted, names = joined([valve for _, valve in first]), ", ".join(chain.recording.name for chain, _ in first)
        return ChainStudy(tuple(chains), tuple(valve_laws(fitted, judge)), names, last.recording.name)
    even = (last.time // ALTERNATING) % 2 == 0.0
    laws = valve_laws(judge.where(even), judge.where(~even))
    name = f"every other {ALTERNATING:g} s of {last.recording.name}"
    return ChainStudy(tuple(chains), tuple(laws), name, "the seconds between")


def _kinematics(series: EvenSeries, machine: Machine) -> ChainLink:
    noise = machine.sensor_noise()
    slope = series.smooth("angle", 1)
    left = noise.rate_sigma + noise.angle_quantum / PERIOD / 10  # the smoothed derivative of a rounded angle
    usual = 0.05 * float(np.sqrt(np.nanmean(slope**2)))  # a gyro's gain
    return ChainLink("kinematics", "angle", "rad/s", series.time, slope, series.smooth("rate"), math.hypot(left, usual))


def _mechanics(series: EvenSeries, boom: Mechanics, still: Statics, machine: Machine) -> ChainLink:
    angle, rate = series.smooth("angle"), series.smooth("rate")
    masses = boom.tolerance * boom.static_need(angle)
    friction = max(q.tolerance for key, q in machine.parameters.items() if key.startswith("friction."))
    losses = friction * boom.known_losses(angle, rate)
    noise = machine.sensor_noise().pressure_sigma
    left = math.sqrt(float(np.nanmean(masses**2 + losses**2)) + noise**2)
    return ChainLink(
        "mechanics", "angle, rate, rod pressure", "Pa", series.time, still.need, series.smooth("hose_pressure"), left
    )


def _ports(series: EvenSeries, run: ForcedRun, plant: Plant) -> list[ChainLink]:
    """Flow out of the main valve into either port against the flow that motion and pressures ask for."""
    p, _ = component_parameters(plant.machine, plant.pose)
    position = run.inner["piston_position"]
    separates = plant.machine.separates
    head = np.full(len(position), p.cylinder.V_h) if separates else cylinder.head_volume(position, p) + p.cylinder.V_h
    volumes = {"hose_pressure": head, "rod_pressure": np.asarray(cylinder.rod_volume(position, p))}
    states = {"hose_pressure": "hose_pressure" if separates else "head_pressure", "rod_pressure": "rod_pressure"}
    inner = {"hose_pressure": "hose_flow", "rod_pressure": "rod_flow"}
    names = {"hose_pressure": "head flow", "rod_pressure": "rod flow"}
    others = [
        forced_run(series, plant.with_numbers(other, plant.pose), INNER).inner for other in _within(plant.machine)
    ]
    noise = (
        plant.machine.sensor_noise().rate_sigma * float(np.nanmax(run.inner["jacobian"], initial=0.0)) * p.cylinder.A_a
    )
    links = []
    for channel, name in inner.items():
        flow = run.inner[name]
        short = (series.smooth(channel, 1) - run.rates[states[channel]]) * volumes[channel] / p.fluid.beta
        needed = flow + _lasting(short)
        if not np.isfinite(flow).any():
            continue
        apart = [v for other in others if np.isfinite(v := np.nanmean((other[name] - flow) ** 2))]
        left = math.hypot(math.sqrt(float(np.quantile(apart or np.nanmean(flow**2), MOST))), noise)
        driven = f"currents, motion, {channel.replace('_', ' ')}"
        links.append(ChainLink(names[channel], driven, "m^3/s", series.time, flow, needed, left))
    return links


def _within(machine: Machine) -> list[Machine]:
    """``DRAWS`` machines with the numbers of the main valve's edges at either end of their tolerances, drawn.

    Not the largest difference tells what they leave: all ends together may open a valve beyond all that it can.
    """
    random = np.random.default_rng(0)
    known = {key: q for key, q in machine.parameters.items() if key.startswith(VALVE)}
    drawn = []
    for _ in range(DRAWS):
        values = {}
        for key, q in known.items():
            priors = [prior_of(machine, component) for component in q.specification.components]
            ends = random.choice((-2.0, 2.0), len(priors))
            away = [
                min(max(prior.away(value, z), prior.low), prior.high)
                for prior, value, z in zip(priors, q.value, ends, strict=True)
            ]
            values[key] = tuple(away)
        with suppress(MachineError):  # no machine has all of these
            drawn.append(machine.with_values(values))
    return drawn


def _lasting(flow: Array) -> Array:
    """Mean over ``LASTING`` (n,): roots of small pressure drops make flows of the sensors' noise, which do not last."""
    known = np.isfinite(flow)
    window = np.ones(round(LASTING / PERIOD))
    share = np.convolve(known, window, "same")
    return np.where(known, np.convolve(np.where(known, flow, 0.0), window, "same") / np.maximum(share, 1.0), np.nan)


def _valve_data(series: EvenSeries, boom: Mechanics, still: Statics | None, breaks: bool) -> ValveData | None:
    """Flow and pressures at the valve beside the cylinder; its pressure is measured, or what the boom needs.

    Where it is not measured, and the hose pressure is what the boom needs, there is nothing to explain.
    """
    angle, rate = series.smooth("angle"), series.smooth("rate")
    if series.known("head_pressure"):
        head, slope = series.smooth("head_pressure"), series.smooth("head_pressure", 1)
    elif still is not None and breaks:
        head = still.need - boom.valve_drop(angle, rate)
        slope = np.gradient(head, PERIOD)
    else:
        return None
    displaced = boom.lever(angle) * rate * boom.A_a
    return ValveData(displaced, series.smooth("hose_pressure"), head, series.smooth("rod_pressure"), slope)
