"""Warm-up cycle between two cycles, which keeps code and data of a cycle in the processor's caches. No ROS.

Between two cycles of 10 ms other programs, and other tenants of the computer, displace code and data of the control law from the
caches. A cycle then takes five times as long as in a loop without pauses. So a second loop with its own states computes a cycle
just before. Its results are not used.
"""

from __future__ import annotations

from typing import Any

from boom_controller.controller import Settings
from boom_controller.loop.control_loop import ControlLoop
from boom_controller.loop.law_in_use import LawInUse, PreparedLaws
from boom_controller.supervision.sensor_set import SensorSet
from boom_controller.supervision.supervision_settings import SupervisionSettings
from boom_model.machine import Machine, Pose


class Rehearsal:
    """The second loop. Arguments, ``law``, :meth:`use`, :meth:`configure` and :meth:`change` are those of :class:`ControlLoop`."""

    def __init__(self, mode: str, settings: Settings, supervision: SupervisionSettings) -> None:
        self._loop = ControlLoop(mode, settings, supervision)

    @property
    def law(self) -> LawInUse:
        """Its own laws."""
        return self._loop.law

    def use(self, laws: PreparedLaws) -> None:
        """Use such laws from now on."""
        self._loop.use(laws)

    def configure(self, machine: Machine, pose: Pose) -> None:
        """Set the machine and its pose."""
        self._loop.configure(machine, pose)

    def change(self, **changes: Any) -> None:
        """Change settings."""
        self._loop.change(**changes)

    def run(self, sensors: SensorSet, now: float) -> str:
        """One cycle from rest with the newest samples; ``now`` [s]. Returns the state that it ended in."""
        loop, newest = self._loop, sensors.newest()
        retract, extend = sensors.currents.values
        loop.joint(newest.angle, newest.rate, newest.time, now)
        loop.hose_pressure(newest.hose_pressure, newest.time, now)
        loop.rod_pressure(newest.rod_pressure, newest.time, now)
        loop.currents(retract, extend, newest.time, now)
        loop.resume(now)  # after whatever stopped the one before
        loop.stream(newest.angle, now)
        state = loop.cycle(now).state
        loop.drop(now)
        return state.value
