"""What one period of the control loop knew, wanted and did."""

from __future__ import annotations

from dataclasses import dataclass

from boom_controller.supervision.state_machine import MotionState
from boom_controller.supervision.tracking_goal import Ending
from boom_controller.types import ControlOutput, Measurement, Reference


@dataclass(slots=True)
class Cycle:
    """What one cycle knew, wanted and did.

    Attributes:
        time: stamp of the angle that was used [s].
        state: of the motion.
        retract, extend: commanded currents [A].
        reference, measurement, output: as in ``controller``; the output's quantities are NaN while nothing is controlled.
        status: ok, warning, error or stopped. reason: one sentence, empty while ok.
        load: estimated load at the tip [kg], NaN where it is not known.
        endings: trajectories that ended, by their number.
        duration: wall time of the computation [s].
    """

    time: float
    state: MotionState
    retract: float
    extend: float
    reference: Reference
    measurement: Measurement
    output: ControlOutput
    status: str
    reason: str
    load: float
    endings: list[tuple[int, Ending]]
    duration: float
