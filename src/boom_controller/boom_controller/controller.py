"""Makes the control law of a mode."""

from __future__ import annotations

from boom_controller.errors import ControlError
from boom_controller.laws.cascade import Cascade
from boom_controller.laws.improved import Improved
from boom_controller.settings import Settings
from boom_controller.types import Controller
from boom_model.machine import Machine, Pose

MODES = ("thesis", "baseline", "improved")
"""``thesis``: chapter 6 as printed. ``baseline``: the least change of it that is stable. ``improved``: ours."""


def make_controller(mode: str, machine: Machine, pose: Pose, settings: Settings | None = None) -> Controller:
    """The controller of a mode for a machine in a pose; the pose's load is what the configuration tells.

    Raises:
        ControlError: no such mode, or the machine lacks what the mode needs.
    """
    chosen = settings if settings is not None else Settings()
    if mode in ("thesis", "baseline"):
        return Cascade(mode, machine, pose, chosen)
    if mode == "improved":
        return Improved(machine, pose, chosen)
    raise ControlError(f"mode {mode}: there is {', '.join(MODES)}")
