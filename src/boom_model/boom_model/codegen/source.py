"""CasADi expressions -> C for the integrator: one prepared part per run, one part per step, and a sparse elimination.

Expressions of the parameters alone are computed once per run (``model_prepare``), which CasADi's own generator does not do;
the rest is straight-line code without branches on pointers. The linear systems of the Rosenbrock method,
(I / (gamma h) - J) k = b, are factorised by straight-line code for the sparsity of J, pivots on the diagonal in
minimum-degree order (the shift makes them safe for small h; a step with a bad pivot is rejected by its error).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from boom_model.equations import Equations
from boom_model.errors import BuildError

_BINARY = {
    ca.OP_ADD: "({0} + {1})", ca.OP_SUB: "({0} - {1})", ca.OP_MUL: "({0} * {1})", ca.OP_DIV: "({0} / {1})",
    ca.OP_POW: "boom_pow({0}, {1})", ca.OP_CONSTPOW: "boom_pow({0}, {1})", ca.OP_FMIN: "boom_min({0}, {1})",
    ca.OP_FMAX: "boom_max({0}, {1})", ca.OP_LT: "boom_if({0} < {1})", ca.OP_LE: "boom_if({0} <= {1})",
    ca.OP_EQ: "boom_if({0} == {1})", ca.OP_NE: "boom_if({0} != {1})", ca.OP_AND: "boom_and({0}, {1})",
    ca.OP_OR: "boom_or({0}, {1})", ca.OP_IF_ELSE_ZERO: "boom_choose({0} != R(0.0), {1}, R(0.0))",
    ca.OP_ATAN2: "boom_atan2({0}, {1})", ca.OP_COPYSIGN: "boom_copysign({0}, {1})",
}  # fmt: skip
_UNARY = {
    ca.OP_NEG: "(-{0})", ca.OP_EXP: "boom_exp({0})", ca.OP_LOG: "boom_log({0})", ca.OP_SQRT: "boom_sqrt({0})",
    ca.OP_SQ: "({0} * {0})", ca.OP_TWICE: "({0} + {0})", ca.OP_INV: "(R(1.0) / {0})", ca.OP_SIN: "boom_sin({0})",
    ca.OP_COS: "boom_cos({0})", ca.OP_TAN: "boom_tan({0})", ca.OP_TANH: "boom_tanh({0})", ca.OP_FABS: "boom_fabs({0})",
    ca.OP_NOT: "boom_if({0} == R(0.0))", ca.OP_SIGN: "boom_sign({0})", ca.OP_ASIN: "boom_asin({0})",
    ca.OP_ACOS: "boom_acos({0})", ca.OP_ATAN: "boom_atan({0})", ca.OP_ASSIGN: "{0}",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Further:
    """A further function of a model: C ``model_NAME(argument, u, c, value)`` of ``value`` (argument, u, p), both symbolic."""

    name: str
    argument: Any
    value: Any


def derivatives(m: Equations) -> tuple[str, tuple[Further, ...]]:
    """What sensitivity.c needs of a model: C of where df/dp, df/du, dy/dx, dy/dp are not zero, and functions that give them."""
    places, functions = ["#define SENSITIVE"], []
    for name, jacobian in (
        ("fp", ca.jacobian(m.derivative, m.p)), ("fu", ca.jacobian(m.derivative, m.u)),
        ("yx", ca.jacobian(m.outputs, m.x)), ("yp", ca.jacobian(m.outputs, m.p)),
    ):  # fmt: skip
        rows, columns = jacobian.sparsity().get_triplet()
        places.append(f"#define N{name.upper()} {len(rows)}")
        for what, numbers in (("ROW", rows), ("COLUMN", columns)):
            listed = ", ".join(map(str, numbers)) or "0"
            places.append(f"static const int {name.upper()}_{what}[] = {{{listed}}};")
        functions.append(Further(name, m.x, ca.vertcat(*jacobian.nonzeros()) if rows else ca.SX(0.0)))
    return "\n".join(places) + "\n", tuple(functions)


class _Emitter:
    """Walks CasADi functions and collects instructions; shares the prepared part between functions."""

    def __init__(self) -> None:
        self.prepared: dict[str, str] = {}

    def function(self, name: str, inputs: Sequence[Any], outputs: Sequence[Any], targets: Sequence[str]) -> str:
        """C code of a static function (x, u, c, outputs...) whose inputs are x, u and the prepared constants c."""
        f = ca.Function(name, list(inputs), ca.cse([ca.densify(o) if o.is_dense() else o for o in outputs]))
        pre: dict[int, str] = {}
        variable: dict[int, str] = {}
        lines: list[str] = []
        constant: dict[int, bool] = {}
        arrays = ("x", "u", "p")
        for k in range(f.n_instructions()):
            op, i, o = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
            if op == ca.OP_OUTPUT:
                lines.append(f"  {targets[o[0]]}[{o[1]}] = {variable[i[0]]};")
                continue
            if op == ca.OP_INPUT:
                text, fixed = f"{arrays[i[0]]}[{i[1]}]", i[0] == 2
            elif op == ca.OP_CONST:
                variable[o[0]], constant[o[0]] = f"R({float(f.instruction_constant(k))!r})", True
                pre[o[0]] = variable[o[0]]
                continue
            elif op in _BINARY:
                fixed = constant[i[0]] and constant[i[1]]
                names = pre if fixed else variable
                text = _BINARY[op].format(names[i[0]], names[i[1]])
            elif op in _UNARY:
                fixed = constant[i[0]]
                text = _UNARY[op].format((pre if fixed else variable)[i[0]])
            else:
                raise BuildError(f"an equation uses CasADi's operation {op}, of which there is no C form here")
            constant[o[0]] = fixed
            if fixed:
                # prepared values are shared: the same text is the same number, whichever function asks for it
                index = self.prepared.setdefault(text, f"c{len(self.prepared)}")
                pre[o[0]], variable[o[0]] = index, index
            else:
                name_ = f"v{k}"
                lines.append(f"  const real {name_} = {text};")
                variable[o[0]] = name_
        return "\n".join(lines)


def _elimination(pattern: np.ndarray) -> tuple[str, str, int]:
    """C of the factorisation and of the solution, number of stored factors.

    ``pattern``: (n, n) bool, where the matrix may be non-zero (the diagonal always is).
    """
    order, filled = _minimum_degree(pattern)
    slot = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(*np.nonzero(filled), strict=True))}
    return _factorisation(order, slot), _solution(order, slot), len(slot)


def _minimum_degree(pattern: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Order of the pivots with few new non-zeros, and the resulting pattern."""
    filled = pattern | np.eye(len(pattern), dtype=bool)
    order: list[int] = []
    left = set(range(len(pattern)))

    def cost(k: int) -> tuple[int, int]:
        others = sorted(left)
        return (int(filled[others, k].sum()) - 1) * (int(filled[k, others].sum()) - 1), k

    while left:
        k = min(left, key=cost)
        left.remove(k)
        order.append(k)
        rows = [i for i in left if filled[i, k]]
        columns = [j for j in left if filled[k, j]]
        filled[np.ix_(rows, columns)] = True
    return order, filled


def _factorisation(order: list[int], slot: dict[tuple[int, int], int]) -> str:
    n = len(order)
    lines = [f"  real w{slot[i, j]} = -J[{i * n + j}];" for (i, j) in slot if i != j]
    lines += [f"  real w{slot[i, i]} = R(shift) - J[{i * n + i}];" for i in range(n)]
    for m, k in enumerate(order):
        lines.append(f"  const real r{k} = R(1.0) / w{slot[k, k]}; w{slot[k, k]} = r{k};")
        columns = [j for j in order[m + 1 :] if (k, j) in slot]
        for i in (i for i in order[m + 1 :] if (i, k) in slot):
            lines.append(f"  w{slot[i, k]} *= r{k};")
            lines += [f"  w{slot[i, j]} -= w{slot[i, k]} * w{slot[k, j]};" for j in columns]
    return "\n".join([*lines, *(f"  W[{s}] = w{s};" for s in slot.values())])


def _solution(order: list[int], slot: dict[tuple[int, int], int]) -> str:
    lines: list[str] = []
    for m, k in enumerate(order):
        lines += [f"  b[{i}] -= W[{slot[i, k]}] * b[{k}];" for i in order[m + 1 :] if (i, k) in slot]
    for m, k in reversed(list(enumerate(order))):
        terms = "".join(f" - W[{slot[k, j]}] * b[{j}]" for j in sorted(order[m + 1 :]) if (k, j) in slot)
        lines.append(f"  b[{k}] = (b[{k}]{terms}) * W[{slot[k, k]}];")
    return "\n".join(lines)


@lru_cache(maxsize=16)
def generate(m: Equations, further: tuple[Further, ...] = ()) -> str:
    """C of model_prepare, model_f, model_fj, model_y, model_factor, model_solve and ``further`` functions.

    To stand between lanes.c and integrator.c.
    """
    emitter = _Emitter()
    n = len(m.states)
    jacobian = ca.jacobian(m.derivative, m.x)
    arguments = (m.x, m.u, m.p)
    f = emitter.function("f", arguments, [m.derivative], ["f"])
    entries = jacobian.sparsity().get_triplet()
    nonzeros = ca.vertcat(*[jacobian[i, j] for i, j in zip(*entries, strict=True)])
    fj = emitter.function("fj", arguments, [m.derivative, nonzeros], ["f", "nz"])
    y = emitter.function("y", arguments, [m.outputs], ["y"])
    others = [emitter.function(o.name, (o.argument, m.u, m.p), [ca.densify(o.value)], ["value"]) for o in further]
    pattern = np.zeros((n, n), dtype=bool)
    pattern[entries[0], entries[1]] = True
    factor, solve, slots = _elimination(pattern)
    scatter = "\n".join(f"  J[{i * n + j}] = nz[{k}];" for k, (i, j) in enumerate(zip(*entries, strict=True)))
    used = "\n".join(f"  const real {name} = c[{k}];" for k, name in enumerate(emitter.prepared.values()))
    prepare = "\n".join(
        f"  const real {name} = {text}; c[{k}] = {name};" for k, (text, name) in enumerate(emitter.prepared.items())
    )

    def body(text: str) -> str:
        names = set(_tokens(text))
        needed = "\n".join(line for line in used.splitlines() if line.split()[2] in names)
        return needed + "\n" + text

    added = "".join(
        f"static void model_{o.name}(const real *x, const real *u, const real *c, real *value) {{\n{body(text)}\n}}\n"
        for o, text in zip(further, others, strict=True)
    )
    return f"""
#define NX {n}
#define NU {m.u.numel()}
#define NP {m.p.numel()}
#define NY {m.outputs.numel()}
#define NC {len(emitter.prepared)}
#define NW {slots}
static void model_prepare(const real *p, real *c) {{
{prepare}
}}
static void model_f(const real *x, const real *u, const real *c, real *f) {{
{body(f)}
}}
static void model_fj(const real *x, const real *u, const real *c, real *f, real *J) {{
  real nz[{len(entries[0])}];
{body(fj)}
{scatter}
}}
static void model_y(const real *x, const real *u, const real *c, real *y) {{
{body(y)}
}}
static void model_factor(const real *J, double shift, real *W) {{
{factor}
}}
static void model_solve(const real *W, real *b) {{
{solve}
}}
{added}"""


def _tokens(text: str) -> list[str]:
    return text.replace("(", " ").replace(")", " ").replace(",", " ").replace(";", " ").split()
