"""Pilot valves: h and its inverse, the split of the pressures, and the stage's lag against the model's own equation."""

from __future__ import annotations

import pytest
from scipy.integrate import solve_ivp

from boom_controller.blocks.pilot_stage import PilotState, PilotValve, StaticPilot, require_pilot_stage
from boom_controller.errors import ControlError
from boom_model.component_numbers import component_parameters
from boom_model.components import pilot_valve
from boom_model.machine_file import load_machine

MACHINE = load_machine("tz17")
P, E = component_parameters(MACHINE, MACHINE.pose(0.28, 2.2))
PILOT = StaticPilot(P, E)


@pytest.mark.parametrize("pressure", [4e5, 5e5, 1e6, 2e6])
def test_the_current_brings_the_pressure_for_which_it_is(pressure: float) -> None:
    nu = PILOT.current(pressure)
    # stationary: nu is the current itself
    gain = P.pilot_valves.b0_s / -P.pilot_valves.a1_s + P.pilot_valves.b1_s
    state = nu / gain / -P.pilot_valves.a1_s
    assert pilot_valve.pressure(state, nu / gain, P, E) == pytest.approx(pressure, rel=1e-9)


def test_no_current_is_negative() -> None:
    assert PILOT.current(-1e6) >= 0.0


@pytest.mark.parametrize("difference", [-1.0, -0.4, 0.0, 0.3, 1.0])
def test_both_pressures_have_the_wanted_difference_and_start_at_neutral(difference: float) -> None:
    plus, minus = PILOT.split(difference * PILOT.largest, 5e5)
    assert plus - minus == pytest.approx(difference * PILOT.largest)
    assert min(float(plus), float(minus)) == pytest.approx(5e5 * (1 - abs(difference)))


def test_the_lag_is_that_of_the_model() -> None:
    valve, x = PilotValve(P, E, 0.01), PilotState()
    state = 0.0
    for current in (0.4, 0.1, 0.55):
        x = valve.after(x, current)
        rate = lambda _t, x, i=current: pilot_valve.state_rate(x, i, P, E)  # noqa: E731
        state = float(solve_ivp(rate, (0.0, 0.01), [state], rtol=1e-10, atol=1e-14).y[0, -1])
    assert x.state == pytest.approx(state, rel=1e-7)


def test_the_inverse_reaches_its_value_at_the_end_of_the_sample_time() -> None:
    valve, x = PilotValve(P, E, 0.01), PilotState(0.01, 0.3)
    x = valve.after(x, valve.current_for(x, 0.42))
    assert valve.output(x) == pytest.approx(0.42)


def test_a_machine_without_pilot_valves_is_refused() -> None:
    other = load_machine("triangle_direct")
    with pytest.raises(ControlError, match="pilot"):
        require_pilot_stage(other, "improved")
