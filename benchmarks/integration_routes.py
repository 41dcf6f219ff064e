"""The ways of integrating that benchmarks/integration.py compares, each on the same equations and inputs.

Every route takes a tolerance and gives the states (n, NX) at the n sample times; all control their error on states
divided by their usual size (``State.scale``), so that a tolerance means the same everywhere.
"""

from __future__ import annotations

import ctypes
import math
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from boom_model.codegen.compiled import model_source
from boom_model.plant import Plant

Array = NDArray[np.float64]
PERIOD = 0.01
"""s, for which an input is held."""

_WRAPPER = """
#define PERIOD 0.01
/* data: NC prepared constants, NX scales, the number of inputs, the inputs. z = x / scale. */
static const double *held(double t, const double *data) {
  const long n = (long)data[NC + NX];
  long k = (long)floor(t / PERIOD + 1e-9);
  if (k < 0) k = 0;
  if (k >= n) k = n - 1;
  return data + NC + NX + 1 + NU * k;
}
void scaled_rhs(double t, double *z, double *dz, double *data) {
  const double *scale = data + NC;
  double x[NX];
  for (int i = 0; i < NX; i++) x[i] = z[i] * scale[i];
  model_f(x, held(t, data), data, dz);
  for (int i = 0; i < NX; i++) dz[i] /= scale[i];
}
void scaled_jacobian(double t, double *z, double *J, double *data) {
  const double *scale = data + NC;
  double x[NX], f[NX];
  for (int i = 0; i < NX; i++) x[i] = z[i] * scale[i];
  for (int i = 0; i < NX * NX; i++) J[i] = 0.0;
  model_fj(x, held(t, data), data, f, J);
  for (int i = 0; i < NX; i++) for (int j = 0; j < NX; j++) J[i * NX + j] *= scale[j] / scale[i];
}
void prepare(const double *p, double *c) { model_prepare(p, c); }
int constants(void) { return NC; }
"""

_DOUBLE = ctypes.POINTER(ctypes.c_double)


class Case:
    """A model, its start and its inputs: what every route integrates."""

    def __init__(self, plant: Plant, start: Array, currents: Array) -> None:
        self.plant, self.start, self.currents = plant, start, np.ascontiguousarray(currents)
        self.time = np.arange(len(currents)) * PERIOD
        self.scale = plant.scale
        self.library = self._compile()
        constants = np.zeros(self.library.constants())
        self.library.prepare(_pointer(plant.p), _pointer(constants))
        self.data = np.concatenate((constants, self.scale, [float(len(currents))], self.currents.ravel()))

    def _compile(self) -> ctypes.CDLL:
        with tempfile.TemporaryDirectory() as folder:
            source, library = Path(folder) / "routes.c", Path(folder) / "routes.so"
            source.write_text(model_source(self.plant.equations) + _WRAPPER)
            flags = ("-O2", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC", "-std=c11")
            subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
            return ctypes.CDLL(str(library))

    # ------------------------------------------------------------------------------------------------------- ours

    def ours(self, order: int) -> Callable[[float], Array]:
        """The integrator of this project."""

        def run(tolerance: float) -> Array:
            return self.plant.run(
                self.time, self.currents, self.time, self.start, tolerance=tolerance, order=order
            ).states

        return run

    # ----------------------------------------------------------------------------------------------- scipy, LSODA

    def lsoda_python(self) -> Callable[[float], Array]:
        """LSODA of scipy, right-hand side in Python: straight-line code on floats, quicker than numpy on 11 numbers."""
        f = python_right_hand_side(self.plant)
        scale, inputs, last = self.scale, self.currents.tolist(), len(self.currents) - 1

        def rhs(t: float, z: Array) -> Array:
            u = inputs[min(max(int(t / PERIOD + 1e-9), 0), last)]
            return np.array(f((z * scale).tolist(), u)) / scale

        return self._odeint(rhs, None)

    def lsoda_compiled(self, jacobian: bool = True) -> Callable[[float], Array]:
        """Scipy's LSODA with the compiled right-hand side and, if wanted, the compiled Jacobian."""
        n = len(self.scale)
        out, matrix = np.empty(n), np.empty((n, n))
        data, out_pointer, matrix_pointer = _pointer(self.data), _pointer(out), _pointer(matrix)
        right, left = self.library.scaled_rhs, self.library.scaled_jacobian

        def rhs(t: float, z: Array) -> Array:
            right(ctypes.c_double(t), _pointer(z), out_pointer, data)
            return out

        def derivative(t: float, z: Array) -> Array:
            left(ctypes.c_double(t), _pointer(z), matrix_pointer, data)
            return matrix

        return self._odeint(rhs, derivative if jacobian else None)

    def _odeint(self, rhs: Callable[..., Array], jacobian: Callable[..., Array] | None) -> Callable[[float], Array]:
        from scipy.integrate import odeint

        def run(tolerance: float) -> Array:
            z = odeint(
                rhs, self.start / self.scale, self.time, Dfun=jacobian, tfirst=True,
                rtol=tolerance, atol=tolerance, hmax=PERIOD, mxstep=100_000,
            )  # fmt: skip
            return np.asarray(z) * self.scale

        return run

    # ------------------------------------------------------------------------------------------------- numbalsoda

    def numbalsoda(self) -> Callable[[float], Array]:
        """LSODA in C++ with the compiled right-hand side. Raises ImportError where it is not installed."""
        import numbalsoda

        address = ctypes.cast(self.library.scaled_rhs, ctypes.c_void_p).value

        def run(tolerance: float) -> Array:
            z, success = numbalsoda.lsoda(
                address, self.start / self.scale, self.time, self.data, rtol=tolerance, atol=tolerance, mxstep=100_000
            )
            return z * self.scale if success else np.full((len(self.time), len(self.scale)), np.nan)

        return run

    # --------------------------------------------------------------------------------------------- CasADi, CVODES

    def cvodes(self) -> Callable[[float], Array]:
        """CasADi's CVODES, called for each held input (mapaccum: the loop over the inputs is compiled code)."""
        m = self.plant.equations
        z = ca.SX.sym("z", len(self.scale))
        scale = ca.DM(self.scale)
        rate = ca.substitute(m.derivative, ca.vertcat(m.x, m.p), ca.vertcat(z * scale, ca.DM(self.plant.p))) / scale
        problem = {"x": z, "p": m.u, "ode": rate}
        cache: dict[float, Any] = {}

        def run(tolerance: float) -> Array:
            if tolerance not in cache:
                options = {"abstol": tolerance, "reltol": tolerance, "max_num_steps": 100_000}
                one = ca.integrator("interval", "cvodes", problem, 0.0, PERIOD, options)
                u, start = ca.MX.sym("u", 2), ca.MX.sym("z0", len(self.scale))
                step = ca.Function("step", [start, u], [one(x0=start, p=u)["xf"]])
                cache[tolerance] = step.mapaccum(len(self.time) - 1)
            ends = np.asarray(cache[tolerance](self.start / self.scale, self.currents[:-1].T)).T
            return np.vstack((self.start / self.scale, ends)) * self.scale

        return run


def python_right_hand_side(plant: Plant) -> Callable[[list[float], list[float]], list[float]]:
    """f(x, u) as Python source made from CasADi's instructions, the parameters folded in as numbers."""
    m = plant.equations
    rate = ca.cse(ca.substitute(m.derivative, m.p, ca.DM(plant.p)))
    f = ca.Function("f", [m.x, m.u], [ca.densify(rate)])
    binary = {
        ca.OP_ADD: "{0} + {1}", ca.OP_SUB: "{0} - {1}", ca.OP_MUL: "{0} * {1}", ca.OP_DIV: "{0} / {1}",
        ca.OP_POW: "{0} ** {1}", ca.OP_CONSTPOW: "{0} ** {1}", ca.OP_FMIN: "({0} if {0} < {1} else {1})",
        ca.OP_FMAX: "({0} if {0} > {1} else {1})", ca.OP_LT: "{0} < {1}", ca.OP_LE: "{0} <= {1}",
        ca.OP_EQ: "{0} == {1}", ca.OP_NE: "{0} != {1}", ca.OP_AND: "({0} and {1})", ca.OP_OR: "({0} or {1})",
        ca.OP_IF_ELSE_ZERO: "({1} if {0} else 0.0)",
    }  # fmt: skip
    unary = {
        ca.OP_NEG: "-{0}", ca.OP_EXP: "exp({0})", ca.OP_LOG: "log({0})", ca.OP_SQRT: "sqrt({0})", ca.OP_SQ: "{0} * {0}",
        ca.OP_TWICE: "{0} + {0}", ca.OP_INV: "1.0 / {0}", ca.OP_SIN: "sin({0})", ca.OP_COS: "cos({0})",
        ca.OP_TANH: "tanh({0})", ca.OP_FABS: "fabs({0})", ca.OP_NOT: "not {0}", ca.OP_ASSIGN: "{0}",
    }  # fmt: skip
    lines = ["def f(x, u):", f"    r = [0.0] * {len(plant.state_names)}"]
    for k in range(f.n_instructions()):
        op, i, o = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if op == ca.OP_OUTPUT:
            lines.append(f"    r[{o[1]}] = v{i[0]}")
            continue
        if op == ca.OP_INPUT:
            text = f"{'xu'[i[0]]}[{i[1]}]"
        elif op == ca.OP_CONST:
            text = repr(float(f.instruction_constant(k)))
        else:
            form = binary.get(op) or unary[op]
            text = form.format(*(f"v{j}" for j in i))
        lines.append(f"    v{o[0]} = {text}")
    lines.append("    return r")
    names: dict[str, Any] = {name: getattr(math, name) for name in ("exp", "log", "sqrt", "sin", "cos", "tanh", "fabs")}
    exec("\n".join(lines), names)
    function: Callable[[list[float], list[float]], list[float]] = names["f"]
    return function


def _pointer(array: Array) -> Any:
    return array.ctypes.data_as(_DOUBLE)
