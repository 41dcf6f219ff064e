"""Parameters of the simulation that cannot be used: one line each, which names the parameter or key."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from boom_model.errors import ModelError
from boom_sim import settings


def values(**changed: object) -> SimpleNamespace:
    return SimpleNamespace(**{spec.name: spec.default for spec in settings.PARAMETERS} | changed)


def test_defaults_make_a_crane_at_rest() -> None:
    crane = settings.make_crane(values())
    assert crane.sample.angle == pytest.approx(0.3, abs=4e-4)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"machine": "nowhere.yaml"}, r"nowhere.yaml: cannot be read"),
        ({"effects": "{piston_leak: {c: 1}}"}, r"effects.piston_leak: no such effect; did you mean piston_leakage"),
        ({"effects": "{piston_leakage: {c: 1.0e3}}"}, r"effects.piston_leakage.c: 1000 .* is outside"),
        ({"effects": "{piston_leakage: {d: 1}}"}, r"effects.piston_leakage.d: no such parameter"),
        ({"effects": "[1, 2]"}, r"is not of the form"),
        ({"effects": "{a: [}"}, r"not readable as YAML"),
        ({"initial_angle": 1.9}, r"initial angle of 1.9 rad is outside the stroke"),
        ({"outer_boom_angle": 6.0}, r"outer boom angle .* 6 rad"),
    ],
)
def test_a_setting_that_cannot_be_used_is_one_plain_line(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        settings.make_crane(values(**changed))
    assert "\n" not in str(caught.value)


def test_effects_are_added_to_those_of_the_machine_file() -> None:
    machine = settings.make_crane(values(effects="{piston_leakage: {c: 1.0e-12}}")).machine
    again = settings.with_effects(machine, "{entrained_air: {a: 0.01}}")
    assert set(again.effects) == {"piston_leakage", "entrained_air"}
