"""Every reason to stop the boom in one table, used by the supervision, the README's test and the diagnostics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Reaction = Literal["reference", "currents"]
"""``reference``: the loop continues, its reference comes to rest by a ramp, then the currents are ramped to zero.
``currents``: the loop is not trusted any more, and the currents are ramped to zero at once, which closes the valve."""


@dataclass(frozen=True)
class Reason:
    """A reason to stop: its name, what it means, how the boom is brought to rest, and what to do before it may continue."""

    id: str
    cause: str
    reaction: Reaction
    remedy: str


REASONS: dict[str, Reason] = {
    reason.id: reason
    for reason in (
        Reason("emergency_stop", "/boom/emergency_stop is true, or ~/emergency_stop was called", "currents",
               "clear the danger, publish false on the topic"),
        Reason("sensor_old", "no good sample of a sensor for longer than its time-out", "currents",
               "restore the sensor, the bus or the clocks"),
        Reason("clock_set", "stamps left the steady clock by more than 10 ms from one sample to the next; with `use_sim_time`: "
               "/clock began again", "currents", "let no clock be set while the boom moves"),
        Reason("sensor_not_a_number", "a sensor sent NaN or infinity several times in a row", "currents",
               "restore the sensor"),
        Reason("sensor_out_of_range", "a sensor sent impossible values several times in a row", "currents",
               "restore the sensor"),
        Reason("sensor_stuck", "gyro or angle repeats its value for longer than noise or motion let it", "currents",
               "restore the sensor"),
        Reason("sensors_disagree", "angle and rate contradict each other, at once or by 10 mrad/s for longer", "currents",
               "find out which of the two is wrong"),
        Reason("pressures_impossible", "the boom is lifted with less force than its own weight needs", "currents",
               "look whether the pressures are swapped, in another unit, or of a dead transducer"),
        Reason("angle_limit", "the boom is outside its angles and moves further out", "reference",
               "give a reference that leads back inside"),
        Reason("speed_limit", "the boom moves faster than allowed", "currents",
               "find out why: valve, load, parameters"),
        Reason("pressure_limit", "a pressure is above what is allowed", "reference",
               "reduce the load or the speed, once both pressures are known to be right"),
        Reason("pressure_stays", "a pressure stays above what is allowed although the boom is being brought to rest", "currents",
               "look whether both pressures can be right before reducing the load or the speed"),
        Reason("missed_deadlines", "cycles came too late or not at all", "currents",
               "free the processor, or run the node with realtime_priority; sensors slower than `sample_time` need a longer one"),
        Reason("divergence", "the boom is far from its reference, or the control law gave no number", "currents",
               "look at the last motion before the next one"),
        Reason("no_motion", "the valve is wide open and the boom does not move", "currents",
               "look whether the pump runs, the valve moves, and the sensor of the angle is alive"),
        Reason("load_not_held", "the load is heavier than the supply can hold, or a sensor says so", "currents",
               "set the load down; without a load look whether the sensor of angle and rate is alive"),
        Reason("oscillation", "the boom oscillates although the gains were lowered", "currents",
               "lower the gains, or tell the machine file what was left out"),
        Reason("currents_not_followed", "the solenoids do not get the commanded current", "currents",
               "enable the motion on the bridge, look at its diagnostics"),
        Reason("configuration_changed", "machine, pose or load changed in the configuration during a motion", "reference",
               "move with the new configuration"),
        Reason("two_publishers", "more than one node publishes commands or a sensor", "currents",
               "end all but one; the publisher of a killed process disappears within 10 s"),
        Reason("internal_error", "a callback of the node raised an exception", "currents",
               "report the traceback in the log; restart the node"),
    )
}  # fmt: skip


@dataclass(frozen=True)
class StopCause:
    """A reason that holds now, with the numbers in one sentence for the operator."""

    reason: str
    text: str
