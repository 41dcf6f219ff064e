"""Measures the age of messages when a subscriber receives them.

    python -m boom_node.latency_node --ros-args -p duration:=20.0

Age = time of receipt minus header.stamp, both of the system clock, so it is valid for a real-time simulation on the same
computer. The age of /boom/tip_pose counts from the joint state it was computed from, so that it includes the way
through the perception example.
"""

from __future__ import annotations

from boom_node import early  # noqa: F401  isort: skip  (signals and environment, before rclpy is imported)

import sys
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from sensor_msgs.msg import FluidPressure, JointState

from boom_input.channels import PREDICTED
from boom_interfaces.msg import SolenoidCurrents
from boom_node import parameters, qos, shell, stamps
from boom_node.node import Node
from boom_node.parameters import ParameterSpec

TOPICS: dict[str, Any] = {
    "/joint_states": JointState,
    **{sensor.topic: FluidPressure for sensor in PREDICTED if sensor.is_pressure},
    "/boom/solenoid_currents": SolenoidCurrents,
    "/boom/tip_pose": PoseStamped,
}
PARAMETERS = (ParameterSpec("duration", 20.0, "duration of the measurement", "s", 1.0, 3600.0, read_only=True),)


class LatencyNode(Node):
    """Records the age of every message and prints a table at the end."""

    def __init__(self) -> None:
        super().__init__("boom_latency")
        values = parameters.declare(self, PARAMETERS)
        self._ages: dict[str, list[int]] = {topic: [] for topic in TOPICS}
        for topic, kind in TOPICS.items():
            self.create_subscription(kind, topic, partial(self._note, topic), qos.BY_TOPIC.get(topic, qos.SENSOR_DATA))
        self.create_timer(values.duration, shell.finish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _note(self, topic: str, message: Any) -> None:
        self._ages[topic].append(self.get_clock().now().nanoseconds - stamps.to_ns(message.header.stamp))

    def close(self) -> None:
        """Print the table."""
        print(f"{'topic':26} {'messages':>8} {'median [ms]':>12} {'99 % [ms]':>10} {'largest [ms]':>13}")
        for topic, ages in self._ages.items():
            print(table_row(topic, ages))


def table_row(topic: str, ages_ns: list[int]) -> str:
    """One line of the table from ages in ns."""
    if not ages_ns:
        return f"{topic:26} {0:8d}   no message came: is its publisher running?"
    middle, high, largest = np.percentile(np.array(ages_ns) / 1e6, [50, 99, 100])
    return f"{topic:26} {len(ages_ns):8d} {middle:12.2f} {high:10.2f} {largest:13.2f}"


def main() -> int:
    """Measure, print, end. Returns the exit status."""
    return shell.run(LatencyNode)


if __name__ == "__main__":
    sys.exit(main())
