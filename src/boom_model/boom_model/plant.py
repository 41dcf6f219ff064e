"""A machine in a pose, compiled: runs, single steps, batches of parameter sets. The numerical interface of the package.

Currents are held: u[k] acts from its time to the next one's, before the first and behind the last the nearest. Effects that delay
the command shift the input's times, those that delay the pressures the times at which these are sampled.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boom_model import rest
from boom_model.catalogue import EFFECTS
from boom_model.compiled_model import CompiledModel, pointer
from boom_model.components import oil
from boom_model.delayed import delayed
from boom_model.equations import LOWEST_PRESSURE, Kind, valve_holds
from boom_model.errors import ModelError, SimulationError
from boom_model.machine import Machine, Pose
from boom_model.sensors import OUTPUTS, PRESSURES
from boom_model.state import ELAPSED_TIME

Array = NDArray[np.float64]

ORDER_3_ABOVE = 5e-7
"""At coarser tolerances the method of order 3 is faster, at finer ones that of order 4 (measured)."""
FIRST_STEP = 1e-4
"""s."""
FAST, FINE = 1e-4, 1e-6
"""Tolerances of the error control. Measured over a 60 s recording they give errors of about the same size."""
LARGEST_SPOOL = 4.0
"""Times s_max: beyond, a run ends with an error. The spool has no end stop in the equations; 0.7 A push it to 1.6 s_max."""


@dataclass(frozen=True)
class Trajectory:
    """A run: time (n,) [s], states (n, NX), outputs (n, NY) in the order of ``OUTPUTS``; SI. ``steps`` of the integrator."""

    time: Array
    states: Array
    outputs: Array
    state_names: tuple[str, ...]
    final_state: Array
    steps: int
    rejected: int
    evaluations: int

    def state(self, name: str) -> Array:
        """One state over time, by name."""
        return self.states[:, self.state_names.index(name)]

    def output(self, name: str) -> Array:
        """One of ``OUTPUTS`` over time."""
        return self.outputs[:, OUTPUTS.index(name)]


class Plant(CompiledModel):
    """Runs and single steps of a compiled model."""

    def __init__(self, machine: Machine, pose: Pose, kind: Kind = "full", *, discrepancies: bool = False) -> None:
        super().__init__(machine, pose, kind, discrepancies=discrepancies)
        states = self.equations.states
        self.scale: Array = np.array([s.scale for s in states])
        self.minimum: Array = np.array([s.minimum for s in states])
        self.maximum: Array = np.array([s.maximum for s in states])
        self.minimum[0], self.maximum[0] = machine.angle_limits
        stroke = LARGEST_SPOOL * machine.numbers.main_valve_spool.s_max
        spools = [state.is_spool for state in states]
        self.minimum[spools], self.maximum[spools] = -stroke, stroke
        self.holds = valve_holds(self.equations.structure, self.equations.effects)
        self.delay_indices = tuple(self._delaying(what) for what in ("command", "pressures"))
        self.command_delay, self.pressure_delay = np.maximum(self.delays(self.p), 0.0).tolist()

    def with_numbers(self, machine: Machine, pose: Pose) -> Plant:
        """The same compiled model with the numbers of another machine of this structure and these effects, at no cost.

        Raises:
            ModelError: the machine has other components or other active effects.
        """
        own = self.machine
        if (machine.structure, set(machine.effects), machine.still) != (own.structure, set(own.effects), own.still):
            raise ModelError(f"machine {machine.name} has other components or effects: make a new Plant")
        other = copy(self)
        other.machine, other.pose = machine, pose
        values = machine.values(pose)
        other.p = np.array([values[name] for name in self.parameter_names])
        other.minimum, other.maximum = self.minimum.copy(), self.maximum.copy()
        other.minimum[0], other.maximum[0] = machine.angle_limits
        other.command_delay, other.pressure_delay = np.maximum(other.delays(other.p), 0.0).tolist()
        return other

    def lowest(self, pressure: float = oil.LOWEST_CORRECTED) -> Array:
        """(NX,) Least states to which somebody may correct: ``minimum``, and of pressures ``pressure`` [Pa gauge]."""
        return np.where(self.minimum == LOWEST_PRESSURE, pressure, self.minimum)

    def check_angle(self, angle: float) -> None:
        """Raises ModelError: an angle [rad] at the start that is outside the stroke."""
        low, high = self.machine.angle_limits
        if not low <= angle <= high:
            raise ModelError(f"initial angle of {angle:g} rad is outside the stroke, {low:.3f} .. {high:.3f} rad")

    # ------------------------------------------------------------------------------------------------ initial states

    def rest_state(
        self, angle: float, hose_pressure: float, rod_pressure: float, parameters: Array | None = None,
        inputs: ArrayLike | None = None,
    ) -> Array:  # fmt: skip
        """State of a boom that has rested: p_a = p_h, p_o,i = max(p_h, p_g0,i), spool and pilot states zero (notes).

        Behind a valve that holds the load p_a is what carries the boom, at least p_h.

        angle [rad]; hose_pressure, rod_pressure [Pa gauge], NaN: not measured; parameters (NP,) other numbers than the machine's;
        inputs (NU,) that act, by default none: they tell where the other joints stand. One pressure that was not measured balances
        the other one; behind a valve that holds the load, and where none was measured, it is that of the tank.
        """
        p = self.p if parameters is None else parameters
        hose_pressure, rod_pressure = self._balanced(angle, hose_pressure, rod_pressure, p, inputs)
        head = max(self._carrying(angle, rod_pressure, p, inputs), hose_pressure) if self.holds else hose_pressure
        return rest.evaluated(rest.settled_function(self.equations), [angle, hose_pressure, head, rod_pressure], p)

    def _balanced(
        self, angle: float, hose: float, rod: float, parameters: Array, inputs: ArrayLike | None
    ) -> tuple[float, float]:
        """p_h, p_b [Pa], of which one that is NaN follows from the other one."""
        if isfinite(hose) and isfinite(rod):
            return hose, rod
        p = dict(zip(self.parameter_names, parameters, strict=True))
        tank = float(p["fluid.p_t"])
        if not isfinite(rod):
            lacking = hose - self._carrying(angle, 0.0, parameters, inputs)  # of p_a: what p_b holds against
            known = isfinite(hose) and not self.holds
            rod = max(lacking * float(p["cylinder.A_a"] / p["cylinder.A_b"]), 0.0) if known else tank
        if not isfinite(hose):
            hose = tank if self.holds else max(self._carrying(angle, rod, parameters, inputs), 0.0)
        return hose, rod

    def _carrying(
        self, angle: float, rod_pressure: float, parameters: Array | None = None, inputs: ArrayLike | None = None
    ) -> float:
        """:func:`rest.carrying` [Pa] at an angle [rad] and a rod pressure [Pa]."""
        u = np.zeros(len(self.machine.structure.inputs)) if inputs is None else np.asarray(inputs)
        p = self.p if parameters is None else parameters
        return float(rest.evaluated(rest.carrying_function(self.equations), [angle, rod_pressure], p, u)[0])

    def rest_state_measured(
        self, angle: float, hose_pressure: float, rod_pressure: float, parameters: Array | None = None,
        inputs: ArrayLike | None = None,
    ) -> Array:  # fmt: skip
        """:meth:`rest_state` in which the sensors show this [rad, Pa gauge], whatever lies between them and the states.

        An offset, the scale of a transducer, or a boom that bends under its weight.
        """
        return rest.shown(self, np.array([angle, hose_pressure, rod_pressure]), parameters, inputs)

    def equilibrium(self, angle: float, rod_pressure: float = 1.0e6, inputs: ArrayLike | None = None) -> Array:
        """Rest state in which the pressures carry the boom without friction: p_a A_a = g / J + p_b A_b."""
        head = self._carrying(angle, rod_pressure, inputs=inputs)
        if self.machine.structure.neutral.vents and self.holds:
            tank = float(self.p[self.parameter_names.index("fluid.p_t")])
            return self.rest_state(angle, tank, tank, inputs=inputs)
        if head < 0.0:  # the boom hangs: the rod side carries it
            area_a, area_b = (self.machine.parameters[f"cylinder.{k}"].value[0] for k in ("A_a", "A_b"))
            rod_pressure, head = rod_pressure - head * area_a / area_b, 0.0
        return self.rest_state(angle, head, rod_pressure, inputs=inputs)

    # ---------------------------------------------------------------------------------------------------------- runs

    def run(
        self,
        input_time: ArrayLike,
        currents: ArrayLike,
        output_time: ArrayLike,
        initial_state: ArrayLike,
        *,
        start: float | None = None,
        tolerance: float = 1e-5,
        parameters: Array | None = None,
        order: int | None = None,
        stop: ctypes.c_int | None = None,
    ) -> Trajectory:
        """Integrates from ``start`` (default: first output) to the last output.

        Args:
            input_time: (m,) [s], ascending: from when each current acts.
            currents: (m, NU): retract i_+, extend i_- [A], and the pressures [Pa] that drive the model (``Structure.inputs``).
            output_time: (n,) [s], ascending, not before ``start``.
            initial_state: (NX,) at ``start``.
            start: [s].
            tolerance: relative error of a step, per state, against the larger of its size and its usual range.
            parameters: (NP,) other numbers than the machine's, in the order of ``parameter_names``.
            order: 3 or 4, order of the Rosenbrock method; by default the faster one at this tolerance.
            stop: set to non-zero from another thread to end the run.

        Raises:
            SimulationError: a state left its range or the step size vanished; names state and time.
            ModelError: shapes that do not fit, values that are not finite.
        """
        t_out = np.ascontiguousarray(output_time, dtype=float)
        begin = float(t_out[0]) if start is None and len(t_out) else float(start or 0.0)
        states, outputs, x, report = self.integrate(
            input_time, currents, t_out, initial_state, begin,
            tolerance=tolerance, parameters=parameters, order=order, stop=stop,
        )  # fmt: skip
        self._raise(report)
        steps, rejected, evaluations = (int(v) for v in report[3:6])
        return Trajectory(t_out, states, outputs, self.state_names, x, steps, rejected, evaluations)

    def integrate(
        self,
        input_time: ArrayLike,
        currents: ArrayLike,
        output_time: Array,
        initial_state: ArrayLike,
        start: float,
        *,
        tolerance: float = 1e-5,
        parameters: Array | None = None,
        order: int | None = None,
        stop: ctypes.c_int | None = None,
    ) -> tuple[Array, Array, Array, Array]:
        """As :meth:`run`, but a failed run is not an error: values after the failure are NaN.

        Returns:
            States (n, NX), outputs (n, NY), final state (NX,) and the integrator's report: status (0: good), time [s]
            and state of the failure, steps, rejected ones, evaluations.

        Raises:
            ModelError: shapes that do not fit, values that are not finite.
        """
        p = self.p if parameters is None else np.ascontiguousarray(parameters, dtype=float)
        if p.shape != (len(self.parameter_names),):
            raise ModelError(f"parameters must be {len(self.parameter_names)} numbers, not {p.shape}")
        command_delay, pressure_delay = self.delays(p)
        t_in, u = np.asarray(input_time, dtype=float), np.ascontiguousarray(currents, dtype=float)
        x = np.array(initial_state, dtype=float)
        self._check(t_in, u, output_time, x, start)
        t_in, u = delayed(t_in, u, command_delay)
        self.set_time(x, start)
        sampled, late = self._sampling(output_time, pressure_delay)
        states, outputs, report = self._call(t_in, u, sampled, x, p, start, tolerance, order, stop)
        if report[0] != 0:
            reached = int(report[7])
            states[reached:], outputs[reached:] = np.nan, np.nan
        if late is not None:
            states, outputs = states[late[0]], np.where(PRESSURES, outputs[late[1]], outputs[late[0]])
        return states, outputs, x, report

    def delays(self, parameters: Array) -> tuple[float, float]:
        """Dead times of command and pressures [s] of a parameter vector (NP,); that of a command is below 0 in a log that lags."""
        command, pressures = (sum(float(parameters[k]) for k in index) for index in self.delay_indices)
        return command, pressures

    def stepper(self, initial_state: ArrayLike, *, tolerance: float = 1e-5) -> Stepper:
        """Single steps from a state, for real time and lockstep."""
        return Stepper(self, np.array(initial_state, dtype=float), tolerance)

    # ------------------------------------------------------------------------------------------------------ internals

    def _delaying(self, what: str) -> tuple[int, ...]:
        """Where the dead times of ``what`` stand in the parameter vector."""
        delays = (EFFECTS[name] for name in self.equations.effects if EFFECTS[name].delays == what)
        return tuple(self.parameter_names.index(f"effects.{e.id}.{e.parameters[0].name}") for e in delays)

    def set_time(self, x: Array, begin: float) -> None:
        """The elapsed time, where an effect needs it as a state, is the time of the run itself."""
        if ELAPSED_TIME.name in self.state_names:
            x[self.state_names.index(ELAPSED_TIME.name)] = begin

    def _sampling(self, t_out: Array, delay: float) -> tuple[Array, tuple[NDArray[np.int64], NDArray[np.int64]] | None]:
        """Times at which the run is sampled, and where among them the outputs and the delayed pressures are."""
        if delay == 0.0:
            return t_out, None
        both = np.concatenate((t_out, np.maximum(t_out - delay, t_out[0])))
        sampled, where = np.unique(both, return_inverse=True)
        n = len(t_out)
        return sampled, (where[:n], where[n:])

    def _check(self, t_in: Array, u: Array, t_out: Array, x: Array, begin: float) -> None:
        inputs = len(self.machine.structure.inputs)
        if u.ndim != 2 or u.shape != (len(t_in), inputs) or len(t_in) == 0:
            raise ModelError(
                f"currents must have shape (m, {inputs}) with m input times, not {u.shape} with {len(t_in)}"
            )
        if x.shape != (len(self.state_names),):
            raise ModelError(f"the initial state must have {len(self.state_names)} numbers, not {x.shape}")
        for name, values in (("input times", t_in), ("currents", u), ("output times", t_out), ("initial state", x)):
            if not np.isfinite(values).all():
                raise ModelError(f"{name}: not all numbers are finite")
        if (np.diff(t_in) < 0).any() or (np.diff(t_out) < 0).any():
            raise ModelError("times must ascend")
        if len(t_out) and t_out[0] < begin:
            raise ModelError("output times must not lie before the start")

    def _call(
        self, t_in: Array, u: Array, t_out: Array, x: Array, p: Array, begin: float, tolerance: float,
        order: int | None, stop: ctypes.c_int | None,
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        states, outputs = np.empty((len(t_out), len(x))), np.empty((len(t_out), len(OUTPUTS)))
        report = np.zeros(8)
        method = order or (3 if tolerance > ORDER_3_ABOVE else 4)
        end = float(t_out[-1]) if len(t_out) else begin
        self._library.boom_run(
            pointer(p), pointer(x), ctypes.c_double(begin), ctypes.c_double(end), pointer(t_in), pointer(u),
            ctypes.c_long(len(t_in)), pointer(t_out), ctypes.c_long(len(t_out)), pointer(states), pointer(outputs),
            ctypes.c_double(tolerance), ctypes.c_int(method), pointer(self.scale), pointer(self.minimum),
            pointer(self.maximum), ctypes.c_double(FIRST_STEP), ctypes.byref(stop) if stop is not None else None,
            pointer(report),
        )  # fmt: skip
        return states, outputs, report

    def _raise(self, report: Array, offset: float = 0.0) -> None:
        status, time, index = int(report[0]), float(report[1]) + offset, int(report[2])
        if status == 0:
            return
        if status == 2:
            state = self.equations.states[index]
            raise SimulationError(
                f"at {time:.3f} s {state.name} ({state.symbol}) left its range of "
                f"{self.minimum[index]:g} .. {self.maximum[index]:g} {state.unit}",
                time,
                state.name,
            )
        if status == 3:
            raise SimulationError(f"stopped at {time:.3f} s", time, None)
        raise SimulationError(
            f"at {time:.3f} s the step size vanished: the equations have no solution there", time, None
        )


class Stepper:
    """Steps a plant with held currents. One step of 10 ms costs a few microseconds.

    Attributes:
        state: (NX,), changed in place by every step; may be written.
        time: [s] since the start.
    """

    def __init__(self, plant: Plant, state: Array, tolerance: float) -> None:
        self.plant = plant
        self.state = np.ascontiguousarray(state)
        self.time = 0.0
        self._u = np.zeros(len(plant.machine.structure.inputs))
        self._y, self._report = np.empty(len(OUTPUTS)), np.zeros(8)
        self._c = np.empty(max(1, plant._library.boom_sizes(4)))
        self._h = np.array([FIRST_STEP])
        self._tolerance = ctypes.c_double(tolerance)
        self._order = ctypes.c_int(3 if tolerance > ORDER_3_ABOVE else 4)
        function = plant._library.boom_step
        plant._library.boom_prepare(pointer(plant.p), pointer(self._c))
        head = (pointer(self._c), pointer(self.state), pointer(self._u))
        tail = (
            pointer(self._y), self._tolerance, self._order, pointer(plant.scale), pointer(plant.minimum),
            pointer(plant.maximum), pointer(self._h), pointer(self._report),
        )  # fmt: skip

        def call(duration: float) -> int:
            return int(function(*head, ctypes.c_double(duration), *tail))

        self._call: Callable[[float], int] = call

    def step(self, retract: float, extend: float, duration: float = 0.01) -> Array:
        """Advances by ``duration`` [s] with both currents [A] held; returns y (NY,), overwritten by the next step.

        Raises:
            SimulationError: a state left its range; the state stays as at the failure.
        """
        self._u[0], self._u[1] = retract, extend
        if self._call(duration):
            self.plant._raise(self._report, self.time)
        self.time += duration
        return self._y

    def change_parameters(self, values: Array) -> None:
        """Goes on with other parameters (NP,), e.g. when a log is grasped."""
        self.plant._library.boom_prepare(pointer(np.ascontiguousarray(values, dtype=float)), pointer(self._c))
