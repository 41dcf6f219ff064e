"""CasADi expressions -> C for the integrator: one prepared part per run, one part per step, and a sparse elimination.

Expressions of the parameters alone are computed once per run (``model_prepare``), which CasADi's own generator does not do; the
rest is straight-line code, in which what is needed under a condition of the parameters stands in a branch that all points of a
run take or none. The linear systems of the Rosenbrock method, (I / (gamma h) - J) k = b, are factorised by straight-line code
for the sparsity of J, pivots on the diagonal in minimum-degree order (the shift makes them safe for small h; a step with a bad
pivot is rejected by its error).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
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


_LOGICAL = frozenset((ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT))
_DEAR = {
    **dict.fromkeys((ca.OP_DIV, ca.OP_INV, ca.OP_SQRT), 5),
    **dict.fromkeys((ca.OP_POW, ca.OP_CONSTPOW, ca.OP_EXP, ca.OP_LOG, ca.OP_SIN, ca.OP_COS, ca.OP_TANH), 25),
    **dict.fromkeys((ca.OP_TAN, ca.OP_ASIN, ca.OP_ACOS, ca.OP_ATAN, ca.OP_ATAN2), 100),
}
_WORTHWHILE, _MOST_GUARDS = 10, 62
"""Cost, of an addition one, from which on a condition is worth asking; conditions that the bits of a number hold."""
_UNGUARDED = frozenset[str]()


@dataclass
class _Instruction:
    """One number of a function: ``text`` of ``needs``, each under a condition (the name of a prepared number) or always ("")."""

    name: str
    text: str
    needs: dict[str, str]
    cost: int
    guard: frozenset[str] | None = None

    @property
    def own(self) -> frozenset[str]:
        """Conditions of its ``needs``: where one does not hold it is zero."""
        return frozenset(condition for condition in self.needs.values() if condition)

    @property
    def runs(self) -> frozenset[str]:
        """Conditions under which it is computed."""
        return (self.guard or _UNGUARDED) | self.own


class _Emitter:
    """Walks CasADi functions and collects instructions; shares the prepared part between functions."""

    def __init__(self) -> None:
        self.prepared: dict[str, str] = {}
        self.logical: set[str] = set()
        self.asked: list[str] = []

    def function(self, name: str, inputs: Sequence[Any], outputs: Sequence[Any], targets: Sequence[str]) -> str:
        """C code of a static function (x, u, c, outputs...) whose inputs are x, u and the prepared constants c.

        What is needed under a condition of the parameters only, is computed where that holds for one of the lanes.
        """
        f = ca.Function(name, list(inputs), ca.cse([ca.densify(o) if o.is_dense() else o for o in outputs]))
        variable: dict[int, str] = {}
        constant: dict[int, bool] = {}
        instructions: list[_Instruction] = []
        results: list[tuple[str, str]] = []
        arrays = ("x", "u", "p")
        for k in range(f.n_instructions()):
            op, i, o = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
            if op == ca.OP_OUTPUT:
                results.append((f"{targets[o[0]]}[{o[1]}]", variable[i[0]]))
                continue
            if op == ca.OP_CONST:
                variable[o[0]], constant[o[0]] = f"R({float(f.instruction_constant(k))!r})", True
                continue
            needs: dict[str, str] = {}
            if op == ca.OP_INPUT:
                text, fixed = f"{arrays[i[0]]}[{i[1]}]", i[0] == 2
            elif op in _BINARY or op in _UNARY:
                given = i[:2] if op in _BINARY else i[:1]
                fixed = all(constant[slot] for slot in given)
                text = (_BINARY if op in _BINARY else _UNARY)[op].format(*(variable[slot] for slot in given))
                needs = {variable[slot]: "" for slot in given if not constant[slot]}
                if op in (ca.OP_IF_ELSE_ZERO, ca.OP_MUL) and len(needs) == 1:
                    needs = dict.fromkeys(needs, next((variable[s] for s in given if variable[s] in self.logical), ""))
            else:
                raise BuildError(f"an equation uses CasADi's operation {op}, of which there is no C form here")
            constant[o[0]] = fixed
            if fixed:
                # prepared values are shared: the same text is the same number, whichever function asks for it
                variable[o[0]] = self.prepared.setdefault(text, f"c{len(self.prepared)}")
                if op in _LOGICAL:
                    self.logical.add(variable[o[0]])
            else:
                variable[o[0]] = f"v{k}"
                instructions.append(_Instruction(f"v{k}", text, needs, _DEAR.get(op, 1)))
        self._guard(instructions, [value for _, value in results])
        lines = _in_blocks(instructions, self.asked, {value for _, value in results})
        return "\n".join([*lines, *(f"  {target} = {value};" for target, value in results)])

    def _guard(self, instructions: Sequence[_Instruction], results: Iterable[str]) -> None:
        """Sets under which conditions each is needed; conditions that save little are given up."""
        by_name = {instruction.name: instruction for instruction in instructions}
        for name in results:
            if name in by_name:
                by_name[name].guard = _UNGUARDED
        for instruction in reversed(instructions):
            if instruction.guard is None:
                continue
            for name, condition in instruction.needs.items():
                beneath, other = instruction.guard | ({condition} if condition else _UNGUARDED), by_name[name]
                other.guard = beneath if other.guard is None else other.guard & beneath
        saved: dict[str, int] = {}
        for instruction in instructions:
            for condition in instruction.guard or ():
                saved[condition] = saved.get(condition, 0) + instruction.cost
        kept = {
            c
            for c, cost in saved.items()
            if cost >= _WORTHWHILE and (c in self.asked or len(self.asked) < _MOST_GUARDS)
        }
        self.asked += [c for c in sorted(kept) if c not in self.asked][: _MOST_GUARDS - len(self.asked)]
        for instruction in instructions:
            instruction.guard = (instruction.guard or _UNGUARDED) & frozenset(self.asked)
            instruction.needs = {n: c if c in self.asked else "" for n, c in instruction.needs.items()}


def _in_blocks(instructions: Sequence[_Instruction], asked: Sequence[str], results: Collection[str]) -> list[str]:
    """C of instructions, those with one guard together as far as what they need allows; ``results`` are read behind them."""
    users: dict[str, list[_Instruction]] = {instruction.name: [] for instruction in instructions}
    for instruction in instructions:
        for name in instruction.needs:
            users[name].append(instruction)
    blocks = _ordered(instructions, users)
    place = {instruction.name: k for k, (_, block) in enumerate(blocks) for instruction in block}
    declared, lines = list[str](), list[str]()
    for k, (guard, block) in enumerate(blocks):
        bits = sum(1 << asked.index(condition) for condition in guard)
        lines += [f"  if ((on & {bits}LL) == {bits}LL) {{"] if guard else []
        for instruction in block:
            name, seen = instruction.name, [place[user.name] for user in users[instruction.name]]
            local = not guard or (seen and name not in results and all(other == k for other in seen))
            declared += [] if local else [f"  real {name} = R(0.0);"]
            lines.append(f"  {'const real ' if local else ''}{name} = {instruction.text};")
        lines += ["  }"] if guard else []
    return [*declared, *lines]


def _ordered(
    instructions: Sequence[_Instruction], users: Mapping[str, Sequence[_Instruction]]
) -> list[tuple[frozenset[str], list[_Instruction]]]:
    """Blocks of one guard each, in an order in which each instruction stands behind what it needs."""
    left = {instruction.name: len(instruction.needs) for instruction in instructions}
    ready: dict[frozenset[str], list[_Instruction]] = {}
    for instruction in instructions:
        if not instruction.needs:
            ready.setdefault(instruction.runs, []).append(instruction)
    blocks = []
    while ready:
        guard = _UNGUARDED if _UNGUARDED in ready else max(ready, key=lambda g: (len(ready[g]), sorted(g)))
        block: list[_Instruction] = []
        while todo := ready.pop(guard, []):
            block += todo
            for user in (user for instruction in todo for user in users[instruction.name]):
                left[user.name] -= 1
                if not left[user.name]:
                    ready.setdefault(user.runs, []).append(user)
        blocks.append((guard, block))
    return blocks


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

    asked = "".join(f" | (long long)boom_any({name}) << {k}" for k, name in enumerate(emitter.asked))
    prepare += f"\n  const long long on = 0LL{asked};\n  memcpy(&c[{len(emitter.prepared)}], &on, sizeof on);"

    def body(text: str) -> str:
        names = set(_tokens(text))
        needed = [line for line in used.splitlines() if line.split()[2] in names]
        if "on" in names:
            needed += ["  long long on;", f"  memcpy(&on, &c[{len(emitter.prepared)}], sizeof on);"]
        return "\n".join([*needed, text])

    added = "".join(
        f"static void model_{o.name}(const real *x, const real *u, const real *c, real *value) {{\n{body(text)}\n}}\n"
        for o, text in zip(further, others, strict=True)
    )
    return f"""
#define NX {n}
#define NU {m.u.numel()}
#define NP {m.p.numel()}
#define NY {m.outputs.numel()}
#define NC {len(emitter.prepared) + 1}
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
