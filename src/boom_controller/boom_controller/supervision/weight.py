"""Do the pressures carry the boom? Found where they cannot: swapped, in another unit, or of a dead transducer. No ROS.

While the piston extends against the weight, the hose is the head side whatever valve stands between them, and friction and any load
only add to what is needed. Over a window from w_0 to w the cylinder gave at most the impulse that it measured, and needed at least

    min(D_0 (w - w_0), 0) + integral of g_0(q_2) dt,        measured: integral of J (p_h A_a - p_b A_b) dt

with inertia D_0 and torque g_0 of the boom without any load, in the pose that the configuration tells. What speeding up takes is
left out: it would be the pressures' fault that a gyro jumps.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from boom_controller.types import MOVES
from boom_model.catalogue.terms import Terms
from boom_model.components import equation_of_motion
from boom_model.equations import namespace
from boom_model.machine import Machine, Pose

WINDOW = 0.2
"""s."""
LEAST = 0.3
"""Share of the weight's torque that has to be seen: the other joints may have folded the boom, and masses are known to a share."""
LOADED = 0.3
"""Share of the largest weight from which on it presses on the head side for certain."""
_POINTS = 65


class CarriedWeight:
    """Follows the balance in every cycle.

    Args:
        machine, pose: of which boom; the load that the pose tells may have been put down.
    """

    def __init__(self, machine: Machine, pose: Pose) -> None:
        p, none = namespace(machine.values(pose)), Terms({})
        low, high = machine.angle_limits
        self._angles = np.linspace(low, high, _POINTS)
        step = 0.5 * (high - low) / (_POINTS - 1)
        ends = np.clip(np.stack([self._angles - step, self._angles + step]), low, high)
        moved = [machine.piston_position(b) - machine.piston_position(a) for a, b in ends.T]
        self._lever = np.array(moved) / (ends[1] - ends[0])
        self._weight = np.array([float(equation_of_motion.gravity_torque(q, 0.0, p, none)) for q in self._angles])
        self._clear = LOADED * float(np.abs(self._weight / self._lever).max())
        self._inertia, self._areas = float(p.pose.D0), (float(p.cylinder.A_a), float(p.cylinder.A_b))
        self.reset()

    def reset(self) -> None:
        """Start again."""
        self._seen: deque[tuple[float, float, float, float]] = deque()
        self._given = self._needed = 0.0

    def lacks(self, time: float, angle: float, rate: float, hose: float, rod: float) -> bool:
        """Whether the cylinder gave too little for the motion of the last window; SI, p_h and p_b in Pa gauge."""
        lever = float(np.interp(angle, self._angles, self._lever))
        weight = float(np.interp(angle, self._angles, self._weight))
        if lever * rate <= MOVES * abs(lever) or weight / lever < self._clear:
            self.reset()
            return False
        dt = time - self._seen[-1][0] if self._seen else 0.0
        given = lever * (hose * self._areas[0] - rod * self._areas[1]) * dt
        self._seen.append((time, rate, given, LEAST * weight * dt))
        self._given += given
        self._needed += LEAST * weight * dt
        if time - self._seen[0][0] < WINDOW:
            return False
        sign = np.sign(lever)
        slowed = min(sign * self._inertia * (rate - self._seen[0][1]), 0.0)
        lacking = slowed + sign * (self._needed - self._given)
        self._seen.popleft()
        self._given -= self._seen[0][2]
        self._needed -= self._seen[0][3]
        return bool(lacking > 0.0)
