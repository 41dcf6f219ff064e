"""Mode ``simple``: P controller with velocity feedforward, the yardstick.

    v = J(q*) q*' - k_p e,   e = s_p - s_p*,   Sigma = K v  ->  s_s* by (6.23)  ->  currents by (6.24)-(6.26)

The reference is taken ``simple_preview`` ahead, about the lag of pilot stage and spool. No observer, no model of the valve's
dynamics, and nothing that the gyro measures: what is better has to be worth its parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from boom_controller.blocks.control_model import ControlModel, OperatingPoint
from boom_controller.blocks.flat import FlatLaw
from boom_controller.blocks.pilot_stage import StaticPilot, require_pilot_stage
from boom_controller.blocks.valve_map import ValveMap
from boom_controller.errors import ControlError
from boom_controller.settings import LawSettings, tunable
from boom_controller.types import Controller, ControlOutput, Measurement, Reference
from boom_model.machine import Machine, Pose
from boom_model.regularisation import Expression

LAWS = {"simple": "P controller with velocity feedforward through the valve's static map: the yardstick"}


@dataclass(frozen=True)
class SimpleSettings(LawSettings):
    """Gain and lead."""

    simple_gain: float = tunable(2.0, "1/s", 0.1, 20.0, "position gain k_p, simple")
    simple_preview: float = tunable(0.15, "s", 0.0, 0.4, "lead of the reference over the valve's lag, simple")
    simple_dead_zone_speed: float = tunable(
        1.0e-3, "m/s", 1e-4, 0.02, "piston speed below which the spool stays inside its dead zone, simple"
    )


SETTINGS = SimpleSettings


def make(_mode: str, machine: Machine, pose: Pose, settings: SimpleSettings) -> Controller:
    """See :mod:`boom_controller.laws`."""
    return Simple(machine, pose, settings)


class SimpleState(NamedTuple):
    """Nothing is remembered; a law has at least one number."""

    nothing: Expression = 0.0


class Simple:
    """See the module."""

    mode = "simple"

    def __init__(self, machine: Machine, pose: Pose, settings: SimpleSettings) -> None:
        require_pilot_stage(machine, self.mode)
        self._model = ControlModel(machine, pose)
        p, e = self._model.p, self._model.e
        self._area_a, self._area_b = float(p.cylinder.A_a), float(p.cylinder.A_b)
        self._map = ValveMap(machine.structure, p, e)
        self._stroke = float(p.main_valve_spool.s_max)
        self._pilot = StaticPilot(p, e)
        self._settings = settings
        self._law = FlatLaw(self.mode, SimpleState(), self._after, SETTINGS, settings)

    def reset(self, _measurement: Measurement) -> None:
        """There is nothing to begin with."""
        self._law.start(SimpleState())

    def step(self, reference: Reference, measurement: Measurement) -> ControlOutput:
        """One sample time."""
        return ControlOutput.of(self._law.step(reference, measurement))

    def change(self, settings: SimpleSettings) -> None:
        """Change everything except the sample time.

        Raises:
            ControlError: another sample time.
        """
        if settings.sample_time != self._settings.sample_time:
            raise ControlError("sample_time cannot change while running: stop the controller and start it again")
        self._law.change(settings)
        self._settings = settings

    def _after(self, x: SimpleState, r: Reference, m: Measurement, s: Any) -> tuple[SimpleState, list[Expression]]:
        """The law as expressions: ``ControlOutput`` up to the pilot pressures."""
        m = self._model.sample(m)
        q = self._model.expressions(
            OperatingPoint(m.angle, m.rate, m.hose_pressure, m.rod_pressure, *r, 0.0)
        )  # fmt: skip
        ahead = r.ahead(s.simple_preview + m.age + self._model.command_delay)
        error = q.position - q.reference_position
        wanted = self._model.coming(ahead, 0.0).jacobian * ahead.rate - s.simple_gain * error
        a, b = self._area_a * q.stiffness_line, self._area_b * q.stiffness_rod
        sigma = (a * self._area_a + b * self._area_b) * wanted
        flows = self._map.flows(m.hose_pressure, m.rod_pressure, (q.rod_cushion, q.hose_cushion))
        spool = flows.spool(sigma, a, b, s.largest_spool_position * self._stroke)
        spool = self._map.through_dead_zone(spool, wanted, s.simple_dead_zone_speed)
        plus, minus = self._pilot.split(self._pilot.stiffness * spool, s.neutral_pressure)
        retract, extend = (ca.fmin(self._pilot.current(side), s.largest_current) for side in (plus, minus))
        return x, [
            retract, extend, r.angle - m.angle, -error, q.feedforward_force - q.force,
            q.feedforward_force, 0.0, q.feedforward_force, q.force, spool, plus, minus,
        ]  # fmt: skip
