"""What moves between cylinder and IMU (the boom bends), as the effects of the machine file tell it.

The effects' own terms and states act, whatever they are: q_2'' = through("angular_acceleration"), what the IMU shows = through(
"seen_angle"), through("seen_rate"), z' = the rates of their states z. Together with the load observer (q_2', d an acceleration that
the model misses, from which the load follows) that is a Kalman filter with constant gain:

    q_2'' = a(z, torque) + d,   d' = noise,   z' = r(z, q_2'', ..),   y = seen rate + noise

The gain is that of the boom at rest in the middle of its stroke, from the Riccati equation. Without such an effect it is the load
observer's own.

A wanted angle is one that the IMU shows, and the law moves the boom at the cylinder: it follows q_2* with q_2* + eta x(q_2*) the
wanted angle, x at rest (the boom's sag), without the swings around it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from scipy.linalg import solve_continuous_are

from boom_controller.types import Reference
from boom_model.catalogue import EFFECTS
from boom_model.catalogue.terms import Terms
from boom_model.components.equation_of_motion import gravity_torque
from boom_model.machine import Machine, Pose
from boom_model.regularisation import Expression
from boom_model.state import State

QUANTITIES = frozenset({"seen_angle", "seen_rate"})
"""Effects that change these bring the modes, with what else they change."""
STEPS = 3
"""Fixed-point steps from the angle shown to that at the cylinder; each is some 20 times nearer, for a sag of 50 mrad."""
DRIVEN, OWN = 3.0, 1.0
"""1/s. How quickly the gyro corrects the filter where the acceleration and where a mode differs from its model."""


class Seen(NamedTuple):
    """At one point: q_2'' [rad/s^2]; what the IMU shows beyond angle [rad] and rate [rad/s]."""

    acceleration: Expression
    angle: Expression
    rate: Expression


class ModeGain(NamedTuple):
    """Of the innovation [rad/s]: on q_2' [1/s], on d [1/s^2], on each z."""

    rate: float
    missing: float
    states: tuple[float, ...]


class _States:
    """Takes the states that the effects ask for."""

    def __init__(self) -> None:
        self.symbols: dict[str, Any] = {}
        self.rates: dict[str, Any] = {}

    def add_state(self, state: State) -> Any:
        return self.symbols.setdefault(state.name, ca.SX.sym(state.name))


class Modes:
    """The modes of a machine in a pose; ``p`` its numbers.

    Attributes:
        names: of the states z.
    """

    def __init__(self, machine: Machine, pose: Pose, p: Any) -> None:
        mine = {name: values for name, values in machine.effects.items() if QUANTITIES & set(EFFECTS[name].terms)}
        self._inertia = pose.D0 + pose.load * (pose.tip[0] ** 2 + pose.tip[1] ** 2)
        self._middle = 0.5 * sum(machine.angle_limits)
        states = _States()
        self._inputs = [ca.SX.sym(name) for name in ("angle", "rate", "inertia", "torque", "missing")]
        self._function = self._built(mine, states, p)
        self.names = tuple(states.symbols)
        self._rest = self._resting(mine, p)
        self._found: dict[float, ModeGain] = {}

    def _built(self, effects: Mapping[str, Mapping[str, float]], states: _States, p: Any) -> Any:
        angle, rate, inertia, torque, missing = self._inputs
        e = Terms(effects, states)
        drive = torque + gravity_torque(angle, p.pose.load, p, e)
        acceleration = missing + e.through(
            "angular_acceleration", torque / inertia,
            angle=angle, rate=rate, inertia=inertia, torque=torque, drive=drive, p=p,
        )  # fmt: skip
        seen_angle = e.through("seen_angle", angle)
        seen_rate = e.through("seen_rate", rate)
        z = ca.vertcat(ca.SX(0, 1), *states.symbols.values())
        rates = ca.vertcat(ca.SX(0, 1), *(states.rates[name] for name in states.symbols))
        slopes = ca.jacobian(rates, z)
        values = ca.vertcat(acceleration, seen_angle - angle, seen_rate - rate)
        return ca.Function("modes", [z, ca.vertcat(*self._inputs)], [values, rates, slopes])

    def _resting(self, effects: Mapping[str, Mapping[str, float]], p: Any) -> Any:
        """(angle shown [rad], load beyond the pose's [kg]) -> (q_2 [rad], its slope and curvature over the former, z) at rest."""
        shown, further = ca.SX.sym("shown"), ca.SX.sym("further")
        e = Terms(effects)

        def bent(angle: Any) -> tuple[Any, Any]:
            values = {"angle": angle, "load": p.pose.load + further}
            for settle in filter(None, (EFFECTS[name].at_rest for name in effects)):
                values |= settle(values, p, e)
            z = [values.get(name, 0.0) for name in self.names]
            return self.at(tuple(z), angle, 0.0, 1.0, 0.0, 0.0).angle, z

        angle = shown
        for _ in range(STEPS if effects else 0):
            angle = shown - bent(angle)[0]
        slope = ca.jacobian(angle, shown)
        values = ca.vertcat(angle, slope, ca.jacobian(slope, shown), *bent(angle)[1])
        return ca.Function("rest", [shown, further], [values])

    def at_rest(self, shown: float) -> tuple[float, tuple[float, ...]]:
        """q_2 [rad] and z of a boom that rests with the pose's load where the IMU shows this angle [rad]."""
        angle, _, _, *z = self._rest(shown, 0.0).full().ravel().tolist()
        return angle, tuple(z)

    def wanted(self, shown: Reference, load: Expression) -> Reference:
        """The reference at the cylinder for one of the angle that the IMU shows, with so much load [kg] beyond the pose's."""
        if not self.names:
            return shown
        angle, slope, curvature, *_ = ca.vertsplit(self._rest(shown.angle, load))
        faster = curvature * shown.rate
        return Reference(
            angle, slope * shown.rate, slope * shown.acceleration + faster * shown.rate,
            slope * shown.jerk + 3 * faster * shown.acceleration,
        )  # fmt: skip

    def at(self, z: tuple[Expression, ...], *inputs: Expression) -> Seen:
        """At z and (q_2 [rad], q_2' [rad/s], D [kg m^2], torque [N m], d [rad/s^2]); expressions."""
        values, _, _ = self._function(ca.vertcat(ca.SX(0, 1), *z), ca.vertcat(*inputs))
        acceleration, angle, rate = ca.vertsplit(values)
        return Seen(acceleration, angle, rate)

    def after(
        self,
        z: tuple[Expression, ...],
        gain: tuple[Expression, ...],
        innovation: Expression,
        t: float,
        *inputs: Expression,
    ) -> tuple[Expression, ...]:
        """One sample time t [s], trapezoidal rule linearised: stable, and true to oscillations."""
        if not z:
            return ()
        _, rates, slopes = self._function(ca.vertcat(*z), ca.vertcat(*inputs))
        step = ca.solve(ca.SX.eye(len(z)) - 0.5 * t * slopes, t * (rates + innovation * ca.vertcat(*gain)))
        return tuple(z[k] + step[k] for k in range(len(z)))

    def gain(self, pole: float) -> ModeGain:
        """Constant gain with which d follows as quickly as without modes with both poles at -``pole`` [1/s]."""
        if not self.names:
            return ModeGain(2.0 * pole, pole * pole, ())
        if pole not in self._found:  # settings that change gradually come here in every cycle
            self._found[pole] = self._riccati(pole)
        return self._found[pole]

    def _riccati(self, pole: float) -> ModeGain:
        count = len(self.names)
        z, u = ca.SX.sym("z", count), ca.SX.sym("u", len(self._inputs))
        values, rates, _ = self._function(z, u)
        x = ca.vertcat(u[1], u[4], z)
        point = [np.zeros(count), [self._middle, 0.0, self._inertia, 0.0, 0.0]]
        a = np.zeros((count + 2, count + 2))
        a[0] = np.array(ca.Function("a", [z, u], [ca.jacobian(values[0], x)])(*point))
        a[2:] = np.array(ca.Function("z", [z, u], [ca.jacobian(rates, x)])(*point))
        c = np.array(ca.Function("y", [z, u], [ca.jacobian(values[2] + u[1], x)])(*point))
        driven = a[:, 1:2] * DRIVEN  # noise on the acceleration, which drives the modes too
        noise = driven @ driven.T + np.diag([0.0, pole**4, *[OWN**2] * count])
        covariance = solve_continuous_are(a.T, c.T, noise, np.eye(1))
        found = (covariance @ c.T).ravel().tolist()
        return ModeGain(found[0], found[1], tuple(found[2:]))
