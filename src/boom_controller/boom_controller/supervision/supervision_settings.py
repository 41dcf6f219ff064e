"""Settings of the supervision, the references and the action in one table, like ``settings`` for the control laws."""

from __future__ import annotations

from dataclasses import dataclass

from boom_controller.errors import ControlError
from boom_controller.settings import Tunables, specifications, tunable
from boom_model.machine import Machine, Pose


@dataclass(frozen=True)
class SupervisionSettings(Tunables):
    """Limits and times of the supervision, SI; ranges and meaning in ``SUPERVISION``.

    Raises:
        ControlError: a number that is not finite or outside its range.
    """

    sensor_timeout: float = tunable(0.05, "s", 0.02, 0.5, "age from which a sensor counts as gone")
    bad_samples: int = tunable(3, "", 1, 20, "wrong samples in a row of one sensor that stop the boom")
    largest_rate: float = tunable(
        0.6, "rad/s", 0.05, 2.0, "speed from which the boom is stopped; references stay below"
    )
    largest_pressure: float = tunable(3.5e7, "Pa", 1.0e6, 6.0e7, "gauge pressure from which the boom is stopped")
    lowest_angle: float = tunable(-1.6, "rad", -3.2, 3.2, "lowest angle of the boom; never below the machine's stroke")
    highest_angle: float = tunable(
        3.2, "rad", -3.2, 3.2, "highest angle of the boom; never beyond the machine's stroke"
    )
    angle_margin: float = tunable(0.01, "rad", 0.0, 0.5, "distance that references keep from both limits")
    largest_disagreement: float = tunable(
        0.05, "rad", 0.005, 1.0, "angle against integrated rate, within about 1 s; a quarter of it at once"
    )
    largest_angle_error: float = tunable(0.2, "rad", 0.01, 1.5, "distance from the reference that counts as divergence")
    persistence: float = tunable(0.05, "s", 0.0, 1.0, "how long a limit of speed or pressure must be exceeded")
    longest_stall: float = tunable(1.0, "s", 0.2, 10.0, "how long the valve may be wide open while the boom stands")
    longest_cycle: float = tunable(0.05, "s", 0.02, 1.0, "time between two cycles from which a deadline was missed")
    most_missed: int = tunable(20, "", 1, 100, "periods without a cycle within one second that stop the boom")
    current_error: float = tunable(0.15, "A", 0.01, 3.0, "measured against commanded current: largest difference")
    current_timeout: float = tunable(
        0.5, "s", 0.05, 10.0, "how long the currents may differ, in all within twice as long"
    )
    current_ramp: float = tunable(0.1, "s", 0.01, 0.5, "time in which a stop brings the currents to zero")
    stop_deceleration: float = tunable(1.5, "rad/s^2", 0.1, 20.0, "largest deceleration of the ramp to rest")
    stop_settling: float = tunable(0.2, "s", 0.0, 1.0, "time at rest before a stop ramps the currents to zero")
    longest_stop: float = tunable(1.5, "s", 0.2, 5.0, "latest time after which a stop ramps the currents to zero")
    reference_timeout: float = tunable(0.1, "s", 0.02, 5.0, "silence of /boom/reference after which the boom holds")
    start_tolerance: float = tunable(0.05, "rad", 0.001, 0.5, "largest distance between boom and reference at a start")
    blend: float = tunable(0.4, "s", 0.05, 3.0, "time in which a change of reference or mode fades")
    path_tolerance: float = tunable(0.1, "rad", 0.0, 1.5, "action: largest angle error on the way; 0 = none")
    goal_tolerance: float = tunable(0.005, "rad", 0.0, 1.5, "action: largest angle error at the end; 0 = none")
    goal_time_tolerance: float = tunable(1.0, "s", 0.0, 60.0, "action: how much later the goal may be reached")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.highest_angle - self.lowest_angle <= 2 * self.angle_margin:
            raise ControlError("highest_angle has to be above lowest_angle by more than twice the angle_margin")

    def angles(self, machine: tuple[float, float]) -> tuple[float, float]:
        """Lowest and highest angle [rad] of a machine whose stroke ends at `machine`.

        Raises:
            ControlError: they leave no room for motion.
        """
        low, high = max(machine[0], self.lowest_angle), min(machine[1], self.highest_angle)
        if high - low <= 2 * self.angle_margin:
            given = f"lowest_angle {self.lowest_angle:g} rad and highest_angle {self.highest_angle:g} rad"
            raise ControlError(
                f"{given} leave nothing of this boom's {machine[0]:.3f} to {machine[1]:.3f} rad: change them"
            )
        return low, high

    def check(self, used: tuple[Machine, Pose] | None) -> None:
        """Raise what :meth:`angles` does where they do not fit the machine that is used, if there is one."""
        if used is not None:
            self.angles(used[0].angle_limits)


SUPERVISION = specifications(SupervisionSettings)
"""Name, default, description, unit, range of every field of :class:`SupervisionSettings`."""
