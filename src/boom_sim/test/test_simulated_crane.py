"""The simulated crane without ROS: commands, load, sensors, reproducibility, failures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from boom_model.errors import ModelError, SimulationError
from boom_model.machine import Machine
from boom_model.machine_file import load_machine
from boom_model.sensors import IDEAL, SensorNoise
from boom_sim.simulated_crane import PERIOD, CommandError, CraneSample, CraneStart, SimulatedCrane


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine("tz17")


def crane(
    machine: Machine, noise: SensorNoise = IDEAL, seed: int = 0, angle: float = 0.3, load: float = 0.0
) -> SimulatedCrane:
    return SimulatedCrane(machine, machine.pose(0.28, 2.2, load), CraneStart(angle), noise, seed)


def run(simulated: SimulatedCrane, seconds: float) -> list[CraneSample]:
    return [simulated.advance() for _ in range(round(seconds / PERIOD))]


def test_without_a_command_the_boom_rests(machine: Machine) -> None:
    samples = run(crane(machine), 5.0)
    assert max(abs(s.angle - 0.3) for s in samples) < 1e-5
    assert max(abs(s.rate) for s in samples) < 1e-5


def test_extend_current_lifts_and_retract_current_lowers(machine: Machine) -> None:
    simulated = crane(machine)
    simulated.command(0.0, 0.5)
    lifted = run(simulated, 2.0)[-1].angle
    simulated.command(0.5, 0.0)
    assert lifted > 0.4
    assert run(simulated, 2.0)[-1].angle < lifted - 0.1


def test_same_seed_and_commands_give_the_same_bits(machine: Machine) -> None:
    def once(seed: int) -> list[CraneSample]:
        simulated = crane(machine, SensorNoise(), seed)
        simulated.command(0.0, 0.5, at=0.004)
        return run(simulated, 1.0)

    assert once(7)[1:] == once(7)[1:]
    assert once(7)[50] != once(8)[50]


def test_reset_begins_again_with_the_same_noise(machine: Machine) -> None:
    simulated = crane(machine, SensorNoise(), 3)
    first = run(simulated, 0.5)
    simulated.set_load(500.0)
    simulated.command(0.0, 0.5)
    run(simulated, 0.5)
    simulated.reset()
    assert simulated.time == 0.0
    assert simulated.load == 0.0
    assert run(simulated, 0.5) == first


def test_command_inside_a_period_acts_from_its_time_on(machine: Machine) -> None:
    """The first order of the pilot stage sees the current for 4 ms of the 10."""
    simulated = crane(machine)
    simulated.command(0.0, 0.5, at=0.006)
    simulated.advance()
    names, values, _ = simulated.truth
    a = 19.67
    expected = 0.5 / a * (1 - math.exp(-a * 0.004))
    assert values[names.index("pilot_extend")] == pytest.approx(expected, rel=1e-4)


def test_measured_current_is_stamped_from_when_it_acts(machine: Machine) -> None:
    simulated = crane(machine)
    assert math.isnan(simulated.sample.current_time)
    simulated.command(0.0, 0.5, at=0.006)
    assert simulated.advance().current_time == pytest.approx(0.006)
    following = simulated.advance()
    assert following.current_time == pytest.approx(0.01)
    assert following.extend_current == 0.5


@pytest.mark.parametrize("delay", [{}, {"command_delay": {"T": 0.037}}])
def test_of_several_commands_in_a_period_the_last_acts_and_is_measured(
    machine: Machine, delay: dict[str, dict[str, float]]
) -> None:
    many, one = crane(machine.with_effects(delay)), crane(machine.with_effects(delay))
    for k in range(20):
        for at, current in ((0.001, 0.2), (0.003, 0.5), (0.006, 0.3)):
            many.command(0.0, current + 0.01 * k, at=many.time + at)
        one.command(0.0, 0.3 + 0.01 * k, at=one.time + 0.006)
        assert many.advance() == one.advance()


def test_command_delay_shifts_the_motion_but_not_the_measured_current(machine: Machine) -> None:
    delayed = crane(machine.with_effects({"command_delay": {"T": 0.037}}))
    plain = crane(machine)
    for simulated, at in ((delayed, 0.003), (plain, 0.040)):
        simulated.command(0.0, 0.45, at=at) if at < PERIOD else [simulated.advance() for _ in range(4)]
    plain.command(0.0, 0.45)
    for _ in range(4):
        delayed.advance()
    assert delayed.sample.extend_current == 0.45
    assert np.allclose(run(delayed, 0.5)[-1].angle, run(plain, 0.5)[-1].angle, atol=1e-6)


def test_pressure_delay_shows_the_pressures_of_earlier(machine: Machine) -> None:
    late, now = crane(machine.with_effects({"pressure_delay": {"T": 0.03}})), crane(machine)
    for simulated in (late, now):
        simulated.command(0.0, 0.5)
    delayed, direct = run(late, 1.0), run(now, 1.0)
    assert delayed[60].hose_pressure == pytest.approx(direct[57].hose_pressure, rel=1e-3)
    assert delayed[60].angle == pytest.approx(direct[60].angle, abs=1e-6)


def test_grasped_log_raises_the_head_pressure_and_dropped_log_lowers_it(machine: Machine) -> None:
    simulated = crane(machine)
    before = simulated.sample.hose_pressure
    simulated.set_load(300.0)
    held = run(simulated, 4.0)[-1].hose_pressure
    simulated.set_load(0.0)
    assert held > before + 5e5
    assert run(simulated, 6.0)[-1].hose_pressure < held - 3e5


@pytest.mark.parametrize("mass", [math.nan, math.inf, -1.0, 1e9])
def test_impossible_load_is_refused_and_changes_nothing(machine: Machine, mass: float) -> None:
    simulated = crane(machine, load=100.0)
    with pytest.raises(CommandError, match="load"):
        simulated.set_load(mass)
    assert simulated.load == 100.0


@pytest.mark.parametrize("current", [math.nan, math.inf, -0.1, 5.0])
def test_impossible_current_is_refused(machine: Machine, current: float) -> None:
    with pytest.raises(CommandError, match="retract current"):
        crane(machine).command(current, 0.0)


def test_command_of_another_clock_acts_at_once(machine: Machine) -> None:
    simulated = crane(machine)
    simulated.command(0.0, 0.5, at=1.7e9)
    assert run(simulated, 1.0)[-1].angle > 0.31


def test_stroke_end_is_an_error_that_names_state_and_time_and_the_crane_stays(machine: Machine) -> None:
    simulated = crane(machine, angle=1.5)
    simulated.command(0.0, 0.55)
    with pytest.raises(SimulationError, match=r"at \d+\.\d+ s angle \(q_2\) left its range") as caught:
        run(simulated, 10.0)
    assert caught.value.state == "angle"
    assert simulated.sample.angle < machine.angle_limits[1]
    assert simulated.truth[1][0] < machine.angle_limits[1]


@pytest.mark.parametrize("load", [0.0, 205.0, 1500.0])
def test_a_boom_that_is_let_go_while_it_falls_pulls_the_oil_apart_and_the_crane_goes_on(
    machine: Machine, load: float
) -> None:
    """It stood within seconds of a lever thrown to and fro, as the rod side fell below vacuum."""
    simulated = crane(machine, load=load, angle=0.6)
    lowest = 0.0
    for _ in range(10):
        simulated.command(0.55, 0.0)
        falling = run(simulated, 0.3)
        simulated.command(0.0, 0.0)
        lowest = min(lowest, *(s.rod_pressure for s in (*falling, *run(simulated, 0.7))))
    assert -101_325.0 < lowest < -7e4


def test_start_outside_the_stroke_is_refused(machine: Machine) -> None:
    with pytest.raises(ModelError, match="initial angle"):
        crane(machine, angle=2.0)


def test_sensor_noise_has_the_spread_and_steps_of_chapter_6_4(machine: Machine) -> None:
    samples = run(crane(machine, SensorNoise(), 1), 20.0)
    hose = np.array([s.hose_pressure for s in samples])
    angle = np.array([s.angle for s in samples])
    assert np.std(hose) == pytest.approx(math.hypot((3e6 / 0.01) ** 0.5, 1e4 / 12**0.5), rel=0.05)
    assert np.allclose(hose / 1e4, np.round(hose / 1e4))
    assert np.allclose(angle / (2 * math.pi / 2**14), np.round(angle / (2 * math.pi / 2**14)))
