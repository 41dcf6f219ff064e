"""A load that rests on the ground below a stroke is found with its mass and stroke, another one in each recording."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_samples import tz17
from test_diagnosis import noisy

from boom_diagnosis.onset import steps_in
from boom_diagnosis.own_loads import load_steps
from boom_diagnosis.run import diagnose
from boom_estimation.free_run import predict
from boom_recording.recording import Recording


def lifting(seed: int, mass: float, angle: float) -> tuple[Recording, float]:
    """A recording in which a load leaves the ground at an angle, and the stroke there."""
    machine = tz17()
    stroke = machine.piston_position(angle)
    return noisy(
        machine.with_effects({"payload_change": {"mass": mass, "t_g": -1.0, "s_g": stroke}}), 24.0, seed
    ), stroke


def test_a_load_that_leaves_the_ground_is_found_and_another_one_in_a_recording_of_the_same_name_that_is_held_out() -> (
    None
):
    first, stroke = lifting(1, 500.0, 0.57)
    second, _ = lifting(2, 250.0, 0.5)
    document = diagnose([first], tz17(), held_out=[second]).document
    assert (document.verdict, [f.effect for f in document.findings]) == ("identified", ["payload_change"])
    numbers = document.findings[0].parameters
    assert set(numbers) == {"mass", "s_g"}  # neither a time nor a second step
    np.testing.assert_allclose(numbers["mass"].value, 500.0, rtol=0.1)
    np.testing.assert_allclose(numbers["s_g"].value, stroke, atol=0.01)
    assert document.fit.held_out_bags == ("made (2)",)
    assert np.all(np.array(document.fit.held_out["explained"]) < 3.0 * np.array(document.fit.noise_floor))


def test_a_load_that_is_dropped_again_is_found_with_both_times_and_at_other_times_in_a_recording_that_is_held_out() -> (
    None
):
    machine = tz17()
    first, second = (
        noisy(machine.with_effects({"payload_change": {"mass": 300.0, "t_g": come, "t_r": gone}}), 24.0, seed)
        for seed, come, gone in ((1, 6.0, 12.0), (2, 9.0, 20.0))
    )
    second = replace(second, name="tuesday")
    result = diagnose([first], machine, held_out=[second])
    document = result.document
    assert (document.verdict, [f.effect for f in document.findings]) == ("identified", ["payload_change"])
    for recording in (first, second):  # the file that is handed out tells the loads of both
        found = predict(recording, result.explained, "full").metrics["angle_mae_rad"]
        assert found is not None and found < 3e-3
    numbers = document.findings[0].parameters
    assert [numbers[name].value for name in ("t_g", "t_r")] == pytest.approx([6.0, 12.0], abs=0.3)
    assert numbers["mass"].value == pytest.approx(300.0, rel=0.1)
    assert np.all(np.array(document.fit.held_out["explained"]) < 3.0 * np.array(document.fit.noise_floor))


@pytest.mark.parametrize(
    ("values", "steps"),
    [({"mass": 300.0, "t_g": 6.0, "t_r": 12.0}, [{"mass": 300.0, "time": 6.0}, {"mass": -300.0, "time": 12.0}]),
     ({"mass": 300.0, "t_g": -1.0}, [{"mass": 300.0, "time": 0.0}]),
     ({"mass": 300.0, "t_g": -1.0, "s_g": 0.4, "mass_2": 50.0, "s_2": 0.5},
      [{"mass": 300.0, "stroke": 0.4}, {"mass": 50.0, "stroke": 0.5}]),
     ({"mass": 300.0, "t_g": 6.0, "s_g": 0.4}, [])],
)  # fmt: skip
def test_a_machine_file_tells_a_load_as_steps_where_it_can(
    values: dict[str, float], steps: list[dict[str, float]]
) -> None:
    assert load_steps("payload_change", values) == steps


def test_a_load_acts_by_stroke_where_a_stroke_is_told() -> None:
    p = "effects.payload_change."
    timed = {p + "mass": 100.0, p + "t_g": 3.0, p + "s_g": -1.0, p + "mass_2": 0.0, p + "s_2": 10.0}
    assert steps_in(timed) == []
    assert steps_in(timed | {p + "s_g": 0.3}) == [(p + "mass", p + "s_g")]
    assert steps_in(timed | {p + "s_g": 0.3, p + "s_2": 0.2}) == [(p + "mass", p + "s_g"), (p + "mass_2", p + "s_2")]
