"""The crane of one recording moving in the report, beside the model before and after the diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from boom_diagnosis.document import BagResult, DiagnosisResult
from boom_input.channels import CURRENTS, SENSORS
from boom_recording.recording import Recording
from boom_report.diagnosis.figure import STAGES
from boom_report.templates import render
from boom_report.view.page import stage
from boom_report.view.scene import scene
from boom_report.view.series import Series, limits, on_grid

PERIOD = 0.02
"""s. Half of the samples: the charts below hold the peaks of all."""
MOST = 6000
"""Samples a channel: two minutes; a report is to be mailed."""


def section(result: DiagnosisResult, recordings: Sequence[Recording]) -> Markup:
    """HTML of the whole section: the first recording that nothing was fitted to, else the first one; empty without recordings.

    recordings: those of ``result.bags``, in their order.
    """
    if len(recordings) != len(result.bags) or not recordings:
        return Markup()
    chosen = next((k for k, bag in enumerate(result.bags) if bag.held_out), 0)
    bag, recording = result.bags[chosen], recordings[chosen]
    c = recording.configuration
    pose = result.explained.pose(
        c.outer_boom_angle, c.telescope_length, 0.0 if math.isnan(c.load_mass) else c.load_mass
    )
    drawn = stage(scene(result.explained, pose), _series(bag, recording, result))
    return render("boom_report/diagnosis/replay.html", bag=bag, stage=drawn)


def _series(bag: BagResult, recording: Recording, result: DiagnosisResult) -> Series:
    count = max(2, int(bag.duration / PERIOD) + 1)
    there = [recording.signals[c.name] for c in (*SENSORS, *CURRENTS) if c.name in recording.signals]
    times = {signal.name: signal.time for signal in there}
    values = {signal.name: np.where(signal.valid, signal.values, np.nan) for signal in there}
    models = {}
    for key, label, _ in STAGES:
        stages = {name: channel.stages[key] for name, channel in bag.channels.items() if key in channel.stages}
        if stages and key != "parameters_only":
            own = {name: bag.channels[name].time for name in stages}
            models[label] = on_grid(own, {n: v for n, v in stages.items() if n != "rate"}, PERIOD, count)
    measured = on_grid(times, values, PERIOD, count)
    measured.pop("rate", None)  # the page draws no rate
    return Series(bag.name, PERIOD, measured, models, limits(result.machine)).thinned(MOST)
