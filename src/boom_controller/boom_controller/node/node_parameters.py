"""Parameters of the node in one table: its own, those of the control laws and those of the supervision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from boom_controller import laws
from boom_controller.controller import MODES, SETTINGS, Settings
from boom_controller.supervision.supervision_settings import SUPERVISION, SupervisionSettings
from boom_node.parameters import ParameterSpec
from boom_node.publishers import PARAMETER as SHARED_TOPICS

OWN = (
    ParameterSpec("mode", laws.DEFAULT, "control law: " + ", ".join(MODES), choices=MODES),
    ParameterSpec("machine", "", "machine file, name or path; empty: the one that the configuration names", read_only=True),
    ParameterSpec("joint_name", "inner_boom_joint", "name of the boom's joint in all messages", read_only=True),
    ParameterSpec("time", "real_time", "time base", choices=("real_time", "lockstep"), read_only=True),
    ParameterSpec("lockstep_reference", False, "lockstep: each cycle waits for the reference of its tick", read_only=True),
    ParameterSpec(
        "lockstep_delay", 0.0, "lockstep: age of the samples at their tick; 0.01 over CAN", "s", 0.0, 0.1, read_only=True
    ),
    ParameterSpec("wait_for", 1, "lockstep: subscribers of the commands to wait for", "", 1, 100, read_only=True),
    ParameterSpec("autostart", True, "configure and activate at the start, without a lifecycle manager", read_only=True),
    ParameterSpec("feedback_rate", 20.0, "how often the action sends feedback", "Hz", 1.0, 100.0),
    ParameterSpec("realtime_priority", 0, "SCHED_FIFO priority, and cores that stay awake; 0: neither", "", 0, 90, read_only=True),
    ParameterSpec("realtime_core", -1, "core that the process keeps to; -1: any", "", -1, 1023, read_only=True),
    SHARED_TOPICS,
)  # fmt: skip

# Everything else is computed for one sample time.
PARAMETERS = (
    *OWN,
    *(replace(spec, read_only=spec.name == "sample_time") for spec in SETTINGS),
    *SUPERVISION,
)


def settings_of(values: Mapping[str, Any]) -> Settings:
    """Settings of the control law from parameter values by name.

    Raises:
        ControlError: values that exclude each other.
    """
    return Settings(**{spec.name: values[spec.name] for spec in SETTINGS})


def supervision_of(values: Mapping[str, Any]) -> SupervisionSettings:
    """Settings of the supervision from parameter values by name.

    Raises:
        ControlError: values that exclude each other.
    """
    return SupervisionSettings(**{spec.name: values[spec.name] for spec in SUPERVISION})
