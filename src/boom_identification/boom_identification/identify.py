"""Chapter 5 from any given inputs: oscilloscope traces, recordings of the machine, data-sheet points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from boom_identification import hose_burst_valve, machine_output
from boom_identification.estimate import Identified, NotDetermined
from boom_identification.friction import FrictionResult, identify_friction
from boom_identification.hose_burst_valve import HoseBurstValveResult
from boom_identification.main_valve import MainValveResult, identify_main_valve
from boom_identification.pilot_valve import PilotValves, identify_pilot_valves
from boom_identification.spool import SpoolNumbers, spool_of
from boom_identification.stationary import Points, pose_of, stationary_points
from boom_identification.validation import BagValidation, validate
from boom_model.machine import Machine, Pose
from boom_recording import loading, oscilloscope
from boom_recording.oscilloscope import OscilloscopeTrace
from boom_recording.recording import Recording

Progress = Callable[[str], None]


class Refined(Protocol):
    """Result of a refinement (all numbers together)."""

    @property
    def estimates(self) -> Sequence[Identified]:
        """The determined parameters."""

    @property
    def not_determined(self) -> Sequence[NotDetermined]:
        """The others, with reasons."""

    def document(self) -> dict[str, Any]:
        """For ``identify --json``."""


Refiner = Callable[[Sequence[Recording], Machine, Progress], Refined]


@dataclass(frozen=True)
class Inputs:
    """The inputs, sorted by content."""

    traces: tuple[OscilloscopeTrace, ...] = ()
    recordings: tuple[Recording, ...] = ()


@dataclass(frozen=True)
class Identification:
    """All results; None without a suitable input.

    Attributes:
        machine: before. identified: with all determined numbers.
        inputs: the inputs.
        pilot: ch. 5.1. points: stationary points of the recordings. main_valve, hose_burst_valve, friction: ch. 5.2, 5.3.
        spool: constants from data sheet values. refined: all recordings at once.
        estimates: the final numbers, one for each key: refined ones have priority over those of stationary points.
        not_determined: numbers that were sought and that the inputs do not determine.
        validation: free runs of the identified machine over the recordings, Figs. 5.12-5.19.
    """

    machine: Machine
    identified: Machine
    inputs: Inputs
    pilot: PilotValves | None = None
    points: Points | None = None
    main_valve: MainValveResult | None = None
    hose_burst_valve: HoseBurstValveResult | None = None
    friction: FrictionResult | None = None
    spool: SpoolNumbers | None = None
    refined: Refined | None = None
    estimates: tuple[Identified, ...] = ()
    not_determined: tuple[NotDetermined, ...] = ()
    validation: tuple[BagValidation, ...] = ()

    @property
    def unexcited(self) -> tuple[str, ...]:
        """Keys that stay unknown for lack of motion, not for lack of sensors."""
        return tuple(n.parameter for n in self.not_determined if n.excitation)

    def reasons(self) -> dict[str, list[str]]:
        """Reason -> keys that are not determined for it."""
        result: dict[str, list[str]] = {}
        for missing in self.not_determined:
            result.setdefault(missing.why, []).append(missing.parameter)
        return result

    def document(self) -> dict[str, Any]:
        """``identify --json`` (contract): parameters, pilot_valve, not_determined; and data for a controller."""
        result: dict[str, Any] = {
            "machine": self.machine.name,
            "bags": [t.name for t in self.inputs.traces] + [r.name for r in self.inputs.recordings],
            "parameters": {e.key: e.document() for e in self.estimates},
            "not_determined": [n.document() for n in self.not_determined],
        }
        if self.pilot is not None and self.pilot.joint is not None:
            curve, model = self.pilot.joint
            result["pilot_valve"] = {
                "pole_1_s": model.continuous[0],
                "h_coefficients": list(curve.h),
                "current_range_a": list(curve.current_range),
                "discrete": dict(zip(("a1_d", "b0_d", "b1_d"), model.discrete, strict=True)),
                "sample_period_s": model.period,
                "arx_pole_1_s": {v.valve: v.arx.continuous[0] for v in self.pilot.valves},
                "output_error_pole_1_s": {v.valve: v.model.continuous[0] for v in self.pilot.valves},
                "validation": [
                    {"bag": c.trace, "valve": c.valve, "held_out": c.held_out,
                     "pressure_rmse_pa": c.rms, "pressure_rmse_with_ripple_pa": c.rms_raw}
                    for c in self.pilot.checks
                ],
            }  # fmt: skip
        if self.main_valve is not None:
            result["main_valve"] = self.main_valve.document()
        if self.points is not None:
            result["stationary_points"] = {"used": len(self.points), "excluded": dict(self.points.excluded)}
        if self.refined is not None:
            result["refinement"] = self.refined.document()
        return result


def read_inputs(
    paths: Sequence[str | Path],
    progress: Progress = lambda _: None,
    load: Callable[[str | Path], Recording] = loading.load,
) -> Inputs:
    """Sort bags by content; `load` reads a recording of the machine.

    Raises:
        RecordingError: a bag cannot be read, or is of neither kind.
    """
    traces: list[OscilloscopeTrace] = []
    recordings: list[Recording] = []
    for path in paths:
        progress(f"reading {path}")
        found = oscilloscope.load_traces(path)
        if found:
            traces += found
        else:
            recordings.append(load(path))
    return Inputs(tuple(traces), tuple(recordings))


def identify(
    inputs: Inputs,
    machine: Machine,
    *,
    curve: Path | None = None,
    smoothing: float | None = None,
    refiner: Refiner | None = None,
    progress: Progress = lambda _: None,
) -> Identification:
    """Identify everything that the inputs determine about a machine.

    Args:
        inputs: traces and recordings.
        machine: prior values.
        curve: CSV file of the hose burst valve's data sheet.
        smoothing: lambda of the P-splines; None: cross-validation.
        refiner: estimates all parameters at once from the recordings; None: skipped.
        progress: called with the current step.

    Raises:
        MachineError: a pose or load that the machine cannot have.
        CurveError: the CSV file cannot be used.
    """
    result = Identification(machine, machine, inputs)
    has = machine.structure.has
    if inputs.traces and has("pilot_valves"):
        pilot = identify_pilot_valves(inputs.traces, progress)
        result = _with(replace(result, pilot=pilot), pilot.estimates(), pilot.not_determined)
    pose = _any_pose(inputs, machine)
    if machine.structure.spool.invertible:
        result = replace(result, spool=spool_of(result.identified, pose))
    if curve is not None and has("hose_burst_valve"):
        drop, flow = hose_burst_valve.read_curve(curve)
        try:
            valve = hose_burst_valve.from_curve(drop, flow, curve.name)
        except ValueError as error:
            raise hose_burst_valve.CurveError(f"{curve}: {error}") from None
        result = _with(replace(result, hose_burst_valve=valve), valve.estimates, valve.not_determined)
    if inputs.recordings:
        result = _from_recordings(result, pose, smoothing, refiner, progress)
    return result


def _from_recordings(
    result: Identification, pose: Pose, smoothing: float | None, refiner: Refiner | None, progress: Progress
) -> Identification:
    recordings = result.inputs.recordings
    known = result.identified  # what other bags have told; the recordings' own findings do not feed each other
    progress("stationary points of the recordings")
    points = stationary_points(recordings, known)
    result = replace(result, points=points)
    if known.structure.has("hose_burst_valve") and result.hose_burst_valve is None:
        valve = hose_burst_valve.from_recordings(points, known, pose)
        result = _with(replace(result, hose_burst_valve=valve), valve.estimates, valve.not_determined)
    progress("friction")
    friction = identify_friction(points, known, pose)
    result = _with(replace(result, friction=friction), friction.estimates, friction.not_determined)
    if known.structure.metering.law:
        progress("orifice areas of the main valve")
        areas = identify_main_valve(points, known, pose, smoothing)
        result = _with(replace(result, main_valve=areas), areas.estimates, areas.not_determined)
    if refiner is not None:
        refined = refiner(recordings, known, progress)
        result = _with(replace(result, refined=refined), refined.estimates, refined.not_determined)
    validation = []
    for recording in recordings:
        progress(f"free runs over {recording.name}")
        validation.append(validate(recording, result.identified))
    return replace(result, validation=tuple(validation))


def _with(result: Identification, found: Sequence[Identified], missing: Sequence[NotDetermined]) -> Identification:
    """Replace older results of the same key by new ones; a number found is no longer missing."""
    good = []
    for estimate in found:
        reason = machine_output.fits(result.machine, estimate)
        if reason:
            missing = [
                *missing,
                NotDetermined(estimate.key, f"the best value is impossible: {reason}", excitation=False),
            ]
        else:
            good.append(estimate)
    keys = {estimate.key for estimate in good}
    estimates = (*(e for e in result.estimates if e.key not in keys), *good)
    known = {e.key for e in estimates}
    listed = {n.parameter: n for n in (*result.not_determined, *missing) if n.parameter not in known}
    identified = machine_output.machine_with(result.machine, estimates)
    return replace(result, estimates=estimates, not_determined=tuple(listed.values()), identified=identified)


def _any_pose(inputs: Inputs, machine: Machine) -> Pose:
    """Any pose, for results that do not depend on it."""
    if inputs.recordings:
        return pose_of(inputs.recordings[0], machine)
    body = next(iter(machine.document["rigid_body"]["configs"].values()))
    return machine.pose(float(body["q3"]), float(body["q4"]))
