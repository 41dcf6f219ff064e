"""The parts of chapter 5, each on data whose answer is known exactly."""

from pathlib import Path

import numpy as np
import pytest
from diagnosis_samples import tz17
from scipy.interpolate import make_lsq_spline

from boom_identification import estimate, hose_burst_valve, pilot_dynamics, signals, splines
from boom_identification.estimate import Identified
from boom_identification.machine_output import document_with, vector_values, write_machine
from boom_identification.spool import spool_of
from boom_model.component_numbers import component_parameters
from boom_model.components import hose_burst_valve as component
from boom_model.components import main_valve_spool
from boom_model.errors import MachineError
from boom_model.machine_file import load_machine, machine_from

PERIOD = 0.16e-3


class TestFilters:
    def test_the_average_over_a_fractional_window_removes_its_ripple(self) -> None:
        k = np.arange(5_000)
        wave = np.sin(2 * np.pi * k / 62.5)
        assert np.ptp(signals.moving_average(wave, 62.5)[100:-100]) < 0.002
        assert np.ptp(signals.moving_average(wave, 64.0)[100:-100]) > 0.04

    def test_a_ramp_passes_the_average_unchanged(self) -> None:
        ramp = np.arange(500.0)
        assert signals.moving_average(ramp, 62.5)[50:-50] == pytest.approx(ramp[50:-50])

    def test_the_pwm_period_is_found_between_the_samples(self) -> None:
        voltage = np.where(np.mod(np.arange(100_000) / 62.5, 1.0) < 0.4, 24.0, 0.0)
        assert signals.pwm_period(voltage) == pytest.approx(62.5, abs=1e-3)
        assert signals.pwm_period(np.full(1000, 24.0)) is None

    def test_the_smoothed_derivative_of_a_cubic_is_exact(self) -> None:
        t = np.arange(200) * 0.01
        assert signals.smoothed(t**3, 0.01, 0.25, 1) == pytest.approx(3 * t**2, abs=1e-9)


class TestLinearPart:
    TRUE = (-0.996857755, -0.0270016, 0.0301438)  # the thesis' (5.7b) by Tustin at 0.16 ms

    def pair(self, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        t = np.arange(40_000) * PERIOD
        current = 0.42 + 0.1 * np.sin(2 * np.pi * (0.2 * t + 0.3 * t**2))
        model = pilot_dynamics.FirstOrder(self.TRUE, PERIOD, np.zeros((3, 3)), 0.0)
        nu = model.simulate(current, 0.42)
        return current, nu + noise * np.random.default_rng(1).standard_normal(len(t))

    def test_tustin_and_state_space_give_the_thesis_numbers(self) -> None:
        assert pilot_dynamics.tustin(np.array(self.TRUE), PERIOD) == pytest.approx((19.67, -0.0286, 19.67), rel=2e-3)
        assert pilot_dynamics.state_space(np.array(self.TRUE), PERIOD) == pytest.approx(
            (-19.67, 20.23, -0.0286), rel=2e-3
        )

    def test_arx_finds_the_model_exactly_without_noise(self) -> None:
        found = pilot_dynamics.first_order_arx([self.pair()], PERIOD)
        assert found.discrete == pytest.approx(self.TRUE, rel=1e-6)

    def test_noise_on_the_output_biases_arx_and_not_the_output_error(self) -> None:
        pair = self.pair(noise=1e-3)
        biased = pilot_dynamics.first_order_arx([pair], PERIOD)
        found = pilot_dynamics.output_error([pair], PERIOD, biased)
        assert biased.continuous[0] > 1.2 * 19.67
        assert found.continuous[0] == pytest.approx(19.67, rel=0.01)
        low, high = found.intervals()[0]
        assert low < found.state_space[0] < high

    def test_a_delay_and_a_second_order_are_fitted_too(self) -> None:
        current, nu = self.pair()
        late = np.concatenate((np.full(30, nu[0]), nu[:-30]))
        right = pilot_dynamics.arx([(current, late)], 1, 1, 30)
        wrong = pilot_dynamics.arx([(current, late)], 1, 1, 0)
        assert right.stable
        assert right.one_step < 1e-9 < wrong.one_step


class TestSplines:
    def test_the_penalty_is_the_integral_of_the_squared_curvature(self) -> None:
        nodes = splines.dead_zone_nodes(-1.0, 1.0, 0.28)
        x = np.linspace(-1.0, 1.0, 400)
        b = make_lsq_spline(x, 3.0 * x**2, nodes, splines.DEGREE).c
        assert b @ splines.curvature(nodes) @ b == pytest.approx(6.0**2 * 2.0, rel=1e-6)

    def test_much_smoothing_leaves_straight_lines_beside_the_dead_zone(self) -> None:
        x = np.concatenate((np.linspace(-1.0, -0.28, 200), np.linspace(0.28, 1.0, 200)))
        groups = np.repeat(np.arange(20), 20)
        nodes = splines.dead_zone_nodes(-1.0, 1.0, 0.28)
        fitted = splines.monotone_fit(x, (np.abs(x) - 0.28) ** 2, groups, nodes, 0.28, smoothing=1e6)
        assert np.ptp(fitted(x)) < 1e-3  # zero value and slope at the dead zone: of straight lines only zero is left

    def test_areas_are_zero_in_the_dead_zone_and_never_fall_away_from_it(self) -> None:
        rng = np.random.default_rng(2)
        x = rng.uniform(-1.0, 1.0, 900)
        area = np.maximum((np.abs(x) - 0.28) / 0.72, 0.0) ** 1.5
        groups = np.repeat(np.arange(30), 30)
        nodes = splines.dead_zone_nodes(-1.0, 1.0, 0.28)
        fitted = splines.monotone_fit(x, area + 0.02 * rng.standard_normal(900), groups, nodes, 0.28)
        assert len(fitted.coefficients) == 15
        inside, right = np.linspace(-0.28, 0.28, 101), np.linspace(0.28, 1.0, 301)
        assert np.abs(fitted(inside)).max() < 1e-12
        assert (np.diff(fitted(right)) > -1e-12).all()
        assert (np.diff(fitted(-right)) > -1e-12).all()
        assert np.abs(fitted(right) - ((right - 0.28) / 0.72) ** 1.5).max() < 0.03
        assert fitted.smoothing in fitted.scores

    def test_a_polygon_goes_through_its_own_values(self) -> None:
        nodes = np.array([0.3, 0.5, 0.8, 1.0])
        x = np.linspace(0.3, 1.0, 200)
        wanted = np.array([0.0, 1.0, 1.5, 4.0])
        assert splines.piecewise_linear(x, np.interp(x, nodes, wanted), nodes.tolist()) == pytest.approx(wanted)


class TestHoseBurstValve:
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        machine = tz17()
        p, e = component_parameters(machine, machine.pose(4.59, 0.0))
        p.hose_burst_valve.dp_lin = 0.0
        drop = np.concatenate((np.linspace(-60.0, -0.5, 60), np.linspace(0.2, 12.0, 30)))
        return drop, np.asarray(component.flow(drop * 1e5, p, e), float).ravel() / p.hose_burst_valve.unit_flow

    def test_the_data_sheet_s_curve_gives_the_coefficients_back(self) -> None:
        drop, flow = self.points()
        _, node = component.smooth_node(8.24, -80.3, 0.84)
        found = hose_burst_valve.constrained_fit(drop, flow, node)
        assert found == pytest.approx([3.67, 29.2, 8.24, 0.1704857, -80.3, 0.84], rel=1e-5)

    def test_the_branches_meet_smoothly_whatever_the_noise(self) -> None:
        drop, flow = self.points()
        noisy = flow + np.random.default_rng(3).normal(0.0, 3.0, len(flow))
        a = hose_burst_valve.constrained_fit(drop, noisy)
        node = hose_burst_valve.NODE_BAR
        assert a[2] * node + a[3] * node**2 == pytest.approx(a[4] + a[5] * node)
        assert a[2] + 2 * a[3] * node == pytest.approx(a[5])

    def test_the_fit_is_the_model_s_own_curve(self) -> None:
        drop, flow = self.points()
        found = hose_burst_valve.from_curve(drop, flow, "made")
        assert {e.key.rpartition(".")[2] for e in found.estimates} == {"a11", "a12", "a21", "a30", "a31"}
        assert found.node_bar == pytest.approx(component.smooth_node(8.24, -80.3, 0.84)[1], abs=0.01)
        assert found.flow(drop) == pytest.approx(flow, abs=1e-3)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("dp,q\n1,2\n", "the first line must be pressure_drop_bar,flow_lpm"),
            ("pressure_drop_bar,flow_lpm\n1,x\n", "line 2: expected two numbers"),
            ("pressure_drop_bar,flow_lpm\n1,2\n2,3\n", "2 points"),
        ],
    )
    def test_a_file_that_cannot_be_used_is_told_in_one_line(self, text: str, message: str, tmp_path: Path) -> None:
        (tmp_path / "curve.csv").write_text(text)
        with pytest.raises(hose_burst_valve.CurveError, match=message):
            hose_burst_valve.read_curve(tmp_path / "curve.csv")


class TestIntervals:
    def test_alike_samples_count_once(self) -> None:
        rng = np.random.default_rng(4)
        level = rng.standard_normal(50)
        once = estimate.least_squares(np.ones((50, 1)), level, np.arange(50))[1][0, 0]
        copies = estimate.least_squares(np.ones((500, 1)), np.repeat(level, 10), np.repeat(np.arange(50), 10))[1][0, 0]
        assert copies == pytest.approx(once)

    def test_one_stretch_alone_tells_no_error(self) -> None:
        with pytest.raises(ValueError, match="one stretch"):
            estimate.least_squares(np.ones((5, 1)), np.arange(5.0), np.zeros(5, int))

    def test_columns_alike_cannot_be_told_apart(self) -> None:
        with pytest.raises(ValueError, match="do not separate the unknowns"):
            estimate.least_squares(np.ones((50, 2)), np.arange(50.0), np.arange(50))


class TestSpool:
    def test_the_catalogue_values_agree_with_the_machine_file(self) -> None:
        machine = tz17()
        spool = spool_of(machine, machine.pose(4.59, 0.0))
        known = {c.symbol: c for c in spool.constants}
        for symbol in ("A_s", "k", "d_v"):
            assert known[symbol].computed == pytest.approx(known[symbol].stated, rel=1e-3)

    def test_friction_is_that_of_the_model_and_the_step_ends_at_the_spring(self) -> None:
        machine = tz17()
        p, e = component_parameters(machine, machine.pose(4.59, 0.0))
        spool = spool_of(machine, machine.pose(4.59, 0.0))
        s = p.main_valve_spool
        assert spool.friction[-1] == pytest.approx(
            s.d_v * spool.speed[-1] + s.f_c * np.tanh(spool.speed[-1] / s.sigma_s)
        )
        assert spool.position[-1] == pytest.approx(1e5 * s.A_s / s.k, rel=0.01)
        still = main_valve_spool.acceleration(spool.position[-1], 0.0, 1e5, 0.0, p, e)
        assert abs(float(still)) < 1.0


class TestMachineOutput:
    FOUND = (
        Identified("friction.tau_C_pos", 3900.0, "N m", (3850.0, 3950.0), "(5.38)"),
        Identified("pilot_valves.h.0", 75.0, "bar/A^2", (74.0, 76.0), "(5.2)"),
        Identified("main_valve_orifices.A_ta_law.c1", -0.25, "-", (-0.3, -0.2), "(5.17)"),
        Identified("hose_burst_valve.a21", 8.0, "l/min/bar", (7.9, 8.1), "(5.36)"),
    )

    def test_what_was_found_is_read_again_and_the_rest_is_as_it_was(self, tmp_path: Path) -> None:
        write_machine(tmp_path / "new.yaml", tz17(), self.FOUND, command="./boom identify x")
        machine = load_machine(tmp_path / "new.yaml")
        expected = {k: p.value for k, p in tz17().parameters.items()}
        expected |= {k: v if isinstance(v, tuple) else (v,) for k, v in vector_values(tz17(), self.FOUND).items()}
        assert {k: p.value for k, p in machine.parameters.items()} == expected
        assert (tmp_path / "new.yaml").read_text().startswith("# Identified on ")
        assert not list(tmp_path.glob("*.new"))

    def test_source_and_confidence_come_from_the_identification(self) -> None:
        found = machine_from(document_with(tz17(), self.FOUND)).parameters["friction.tau_C_pos"]
        assert found.source == "identified: (5.38)"
        assert found.confidence == "high"
        assert "before: 4000" in found.note

    def test_what_follows_from_the_hose_burst_valve_s_coefficients_follows(self) -> None:
        section = document_with(tz17(), self.FOUND)["hose_burst_valve"]
        a22, node = component.smooth_node(8.0, -80.3, 0.84)
        assert section["a22_c1"]["value"] == pytest.approx(a22)
        assert section["node"]["value"] == pytest.approx(node)

    def test_an_impossible_value_is_refused(self) -> None:
        with pytest.raises(MachineError, match=r"friction\.tau_C_pos"):
            document_with(tz17(), [Identified("friction.tau_C_pos", -5.0, "N m", (-6.0, -4.0), "")])

    def test_a_number_of_a_group_goes_to_its_own_key(self) -> None:
        """The area of the anti-cavitation valves was written beside itself, and no command read it."""
        key = "main_valve_orifices.anti_cavitation.A_ac"
        document = document_with(tz17(), [Identified(key, 2e-5, "m^2", (1e-5, 3e-5), "free run")])
        assert machine_from(document).parameters[key].value == (2e-5,)
        assert "value" not in document["main_valve_orifices"]["anti_cavitation"]
