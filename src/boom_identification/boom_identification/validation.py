"""Runs the full and the reduced model on the recorded currents and compares: ch. 5.6, Tables 5.1 and 5.2."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boom_estimation.free_run import FreeRun, Metrics, metrics, predict
from boom_input.channels import PREDICTED
from boom_model.machine import Machine
from boom_model.sensors import OUTPUTS
from boom_recording.measurement import measurements
from boom_recording.recording import Recording

ANGLE_LIMIT = 1.0e-3
"""rad. Largest mean angle error of a right model: accumulated noise of the currents."""
NOISE_FACTOR = 2.0
"""Multiple of the sensors' noise: largest rms error of a right model."""
SHORTEST = 5.0
"""s. Shorter recordings do not test a model."""
LEAST_MOTION = 0.02
"""rad. A boom that moves less is at rest, which hardly tests a model."""


@dataclass(frozen=True)
class BagValidation:
    """One recording with both predictions; ``limits`` are the errors up to which a model counts as right."""

    recording: Recording
    full: FreeRun
    reduced: FreeRun
    reduced_vs_full_angle_mae_rad: float | None
    limits: Metrics

    @property
    def mismatches(self) -> list[str]:
        """Metrics in which the error of the full model exceeds noise; "stopped" if it did not finish.

        Sensors that were not recorded count only where that leaves no angle.
        """
        names = []
        if self.full.stopped:
            names.append("stopped")
        for name, limit in self.limits.document().items():
            value = self.full.metrics[name]
            if name in self._scarce:
                continue
            if limit is not None and (name not in self._absent if value is None else value > limit):
                names.append(name)
        return names

    @property
    def _absent(self) -> set[str]:
        others = (sensor for sensor in PREDICTED[1:] if not self.recording.signals[sensor.name].valid.any())
        return {sensor.metric(statistic) for sensor in others for statistic in sensor.statistics}

    @property
    def _scarce(self) -> set[str]:
        return {s.metric(statistic) for s in PREDICTED if self.scarce(s.name) is not None for statistic in s.statistics}

    def scarce(self, channel: str) -> float | None:
        """Time [s] for which a channel is compared, where that is too little to judge it and the angle's is enough; else None."""
        seconds = self._seconds(channel)
        return seconds if 0.0 < seconds < SHORTEST <= self.compared_s else None

    @property
    def compared_s(self) -> float:
        """Time for which the angle is both measured and predicted [s]."""
        return self._seconds("angle")

    def _seconds(self, channel: str) -> float:
        signal = self.recording.signals[channel]
        time = signal.time[signal.valid & np.isfinite(self.full.values[channel])]
        return float(len(time) * np.median(np.diff(time))) if len(time) > 1 else 0.01 * len(time)

    @property
    def too_little(self) -> str:
        """Why the recording does not test the model; empty if it does."""
        if self.full.stopped or self.mismatches:
            return ""
        if self.compared_s < SHORTEST:
            return f"{self.compared_s:.2g} s are too few, at least {SHORTEST:g} s are needed"
        return at_rest(self.recording.signals["angle"].values[self._compared])

    @property
    def agrees(self) -> bool:
        """Whether the recording tests the model, and the model is right as far as noise lets that be told."""
        return not self.mismatches and not self.too_little

    @property
    def _compared(self) -> NDArray[np.bool_]:
        return self.recording.signals["angle"].valid & np.isfinite(self.full.values["angle"])

    def document(self) -> dict[str, Any]:
        """As in ``validate --json``."""
        result: dict[str, Any] = {
            "bag": self.recording.name,
            "duration_s": self.recording.duration,
            "samples": max(len(s.time) for s in self.recording.signals.values()),
            "full": self.full.metrics.document(),
            "reduced": self.reduced.metrics.document(),
            "reduced_vs_full": {"angle_mae_rad": self.reduced_vs_full_angle_mae_rad},
            "events": [
                {
                    "kind": str(e.kind),
                    "topic": e.topic,
                    "start_s": e.start_s,
                    "end_s": e.end_s,
                    "count": e.count,
                    "detail": e.detail,
                }
                for e in self.recording.events
            ],
            "compared_s": self.compared_s,
            "agrees": self.agrees,
            "warnings": list(self.recording.warnings),
        }
        for prediction in (self.full, self.reduced):
            said = {"stopped": prediction.stopped, "evaporated": prediction.evaporated}
            result[prediction.label] |= {key: words for key, words in said.items() if words}
        return result


@dataclass(frozen=True)
class Validation:
    """Several recordings, one machine."""

    machine: str
    bags: list[BagValidation] = field(default_factory=list)

    def document(self) -> dict[str, Any]:
        """The document of ``validate --json`` (contract)."""
        return {"machine": self.machine, "bags": [bag.document() for bag in self.bags]}


def validate(recording: Recording, machine: Machine, *, simulated: Recording | None = None) -> BagValidation:
    """Compare one recording with the models of ``machine`` in the recording's pose.

    A channel that is the derivative of another is not judged: its noise is that of the other, through an unknown filter.

    simulated: a bag with the full model's prediction, recorded by ROS processes, instead of a run in this process.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    full = predict(recording, machine, "full") if simulated is None else from_bag(recording, simulated)
    reduced = predict(recording, machine, "reduced")
    both = full.values["angle"] - reduced.values["angle"]
    compared = both[np.isfinite(both)]
    difference = float(np.mean(np.abs(compared))) if len(compared) else None
    limits = noise_limits(machine, both=simulated is not None)
    told = measurements(recording)
    derived = [sensor.judging for sensor in PREDICTED if told[sensor.name].derived_from]
    limits = Metrics({**limits.document(), **dict.fromkeys(derived)})
    return BagValidation(recording, full, reduced, difference, limits)


def at_rest(angle: NDArray[np.float64]) -> str:
    """That a boom with these angles (n,) [rad] did not move, in words; empty if it did."""
    moved = float(np.ptp(angle)) if len(angle) else 0.0
    return (
        f"the boom did not move (by {moved:.2g} rad, at least {LEAST_MOTION:g} rad are needed)"
        if moved < LEAST_MOTION
        else ""
    )


def noise_limits(machine: Machine, *, both: bool = False) -> Metrics:
    """Errors up to which a model counts as right: twice the sensors' noise, of the angle at least ``ANGLE_LIMIT``.

    both: the prediction has its own sensor noise, so that two independent noises add.
    """
    noise = machine.sensor_noise()
    factor = NOISE_FACTOR * (math.sqrt(2.0) if both else 1.0)
    limits: dict[str, float | None] = {}
    for sensor in PREDICTED:
        limits |= dict.fromkeys(sensor.metric(statistic) for statistic in sensor.statistics)
        own = factor * noise.deviation(sensor)
        limits[sensor.judging] = max(ANGLE_LIMIT, own) if sensor.name == "angle" else own
    return Metrics(limits)


def from_bag(recording: Recording, simulated: Recording) -> FreeRun:
    """A prediction from a bag of a simulation: interpolated, with both times counted from their beginning."""
    values = {}
    for name in OUTPUTS:
        time, other = recording.signals[name].time, simulated.signals[name]
        own, samples = other.time[other.valid], other.values[other.valid]
        predicted = np.interp(time, own, samples, left=np.nan, right=np.nan) if len(own) else np.full(len(time), np.nan)
        gaps = np.flatnonzero(np.diff(own) > 0.05)
        for k in gaps:
            predicted[(time > own[k]) & (time < own[k + 1])] = np.nan
        values[name] = predicted
    return FreeRun("full", values, metrics(recording, values), (f"simulated by other processes: {simulated.name}",))
