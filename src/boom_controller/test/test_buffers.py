"""Functions on buffers: through C and without a compiler the same numbers."""

from __future__ import annotations

from array import array

import casadi as ca
import pytest

from boom_controller.blocks import buffers
from boom_controller.blocks.buffers import compiled_on_buffers, on_buffers
from boom_model.errors import BuildError


def function() -> ca.Function:
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    return ca.Function(
        "made_for_a_test", [x, y], [ca.vertcat(ca.tanh(x[0]) * y, ca.if_else(x[1] > 0, y, -y)), x[0] / 3]
    )


def refuse(_source: str, _optimised: str) -> None:
    raise BuildError("no C compiler found")


@pytest.mark.parametrize("way", ["virtual machine", "C", "no compiler"])
def test_every_call_reads_and_writes_the_buffers(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if way == "no compiler":
        monkeypatch.setattr(buffers, "load_c", refuse)
    x, y, a, b = array("d", [0.7, -1.0]), array("d", [2.0]), array("d", [0.0, 0.0]), array("d", [0.0])
    evaluate = (on_buffers if way == "virtual machine" else compiled_on_buffers)(function(), (x, y), (a, b))
    for first, second in ((0.7, -1.0), (-0.2, 4.0)):
        x[0], x[1] = first, second
        evaluate()
        expected = function()([first, second], 2.0)
        assert list(a) == pytest.approx([float(v) for v in ca.vertsplit(expected[0])], rel=1e-15)
        assert b[0] == pytest.approx(first / 3, rel=1e-15)
