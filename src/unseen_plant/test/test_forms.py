"""Every form of an effect changes what physics says that it must, in the right direction; and none is without an effect."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from unseen_plant.families import FAMILIES, Site, gather
from unseen_plant.layout import STEP
from unseen_plant.machine import LockedPose, Owner, crane
from unseen_plant.sensing import Fitting
from unseen_plant.visibility import Work

MACHINE = Path(__file__).parents[3] / "src" / "boom_model" / "boom_model" / "machines" / "tz17.yaml"
DURATION = 9.0
LIFTING, LOWERING, END = slice(400, 700), slice(1000, 1300), slice(1700, 1800)
"""Steps in which the boom lifts, lowers, and rests at last."""

gather()


@cache
def at_work(top=0.48):
    """A healthy crane that lifts for 2.5 s, rests, lowers for 2.5 s and rests."""
    owner, pose = Owner.read(MACHINE), LockedPose(0.28, 2.2)
    time = np.arange(round(DURATION / STEP)) * STEP
    currents = np.zeros((len(time), 2))
    currents[(time >= 1.0) & (time < 3.5), 1] = top
    currents[(time >= 4.5) & (time < 7.0), 0] = top
    work = Work(owner, pose, (0.4, 1.0e6), currents, Fitting())
    base = work.shown()
    low, high = base[:, 0].min(), base[:, 0].max()
    pressure = tuple(np.quantile(base[:, 2], (0.1, 0.5, 0.9)))
    site = Site(crane(owner, pose), DURATION, low, high, pressure, 4.5e4, 1.6e-3, np.full(4, 0.3), 5)
    return work, base, site


def shown(name, form, size, draw, draws=0.4):
    """What the crane shows with the effect, and without; ``draw``: the first one, which tells the sign."""
    work, base, site = at_work()
    r = np.full(8, draws)
    r[0] = draw
    return work.shown([FAMILIES[name].lay(size, form, r, site)]), base


def mean(part, column):
    return lambda y: float(np.mean(y[part, column]))


# effect, forms, size, first draw, what is looked at, the sign of its change
RULES = [
    ("payload", (1, 2, 4), 300.0, 0.4, mean(END, 2), 1),
    ("stribeck_friction", (1, 2, 3, 4), 3.0, 0.9, mean(LIFTING, 2), 1),
    ("friction_drift", (1, 2, 3, 5), 2.0, 0.1, mean(LIFTING, 2), 1),
    ("friction_drift", (1, 2, 3, 5), 2.0, 0.9, mean(LIFTING, 2), -1),
    ("position_dependent_friction", (1, 2, 3, 5), 4.0, 0.5, mean(LIFTING, 2), 1),
    ("piston_leakage", (1, 2, 3, 4), 2.0e-5, 0.4, mean(END, 0), -1),
    ("hose_burst_valve_setting", (1, 2, 4), 0.5, 0.1, mean(LOWERING, 3), 1),
    ("hose_burst_valve_setting", (1, 2, 4), 0.5, 0.9, mean(LOWERING, 3), -1),
    ("load_holding_valve", (1, 2, 3, 4), 0.9, 0.4, mean(LOWERING, 2), -1),
    ("sticking_poppet", (1, 2, 3, 4), 0.9, 0.4, mean(slice(905, 960), 3), 1),
    ("valve_dead_zone", (1, 2), 0.05, 0.1, mean(LIFTING, 0), -1),
    ("valve_dead_zone", (1, 3), 0.05, 0.1, mean(LOWERING, 1), 1),
    ("valve_dead_zone", (4,), 0.05, 0.1, mean(LIFTING, 0), 1),
    ("edge_overlap", (1,), 0.05, 0.1, mean(LIFTING, 0), -1),
    ("edge_overlap", (4,), 0.05, 0.1, mean(LOWERING, 3), 1),
    ("neutral_offset", (1,), 0.03, 0.1, mean(LIFTING, 0), -1),
    ("flow_force", (1, 2, 3, 4, 5), 0.2, 0.4, mean(LOWERING, 1), 1),
    ("spring_rate", (1, 2), 0.2, 0.1, mean(LIFTING, 0), -1),
    ("spring_rate", (1, 2), 0.2, 0.9, mean(LIFTING, 0), 1),
    ("compensator_droop", (1, 2, 3, 4), 0.4, 0.4, mean(LIFTING, 0), -1),
    ("pump_flow_limit", (1, 2, 3, 4), 0.5, 0.4, mean(LIFTING, 0), -1),
    ("supply_variation", (4,), 0.3, 0.4, mean(LIFTING, 0), -1),
    ("pilot_lag", (1, 2, 3, 4, 5), 3.0, 0.4, mean(slice(300, 400), 0), -1),
    ("command_delay", (1, 2, 3, 4), 0.1, 0.4, mean(slice(300, 400), 0), -1),
    ("return_line_pressure", (1, 2, 3, 4), 20e5, 0.4, mean(LIFTING, 3), 1),
    ("kinked_hose", (1, 2, 3, 4), 8.0, 0.4, mean(LOWERING, 3), 1),
    ("seeping_valve", (1, 2, 3), 2.0e-5, 0.4, mean(END, 0), -1),
    ("seeping_valve", (4,), 2.0e-5, 0.4, mean(END, 0), 1),
    ("sticking_spool", (1, 2, 4), 0.1, 0.4, mean(LIFTING, 0), -1),
    ("ground_contact", (1, 2, 3, 4, 5), 2.0e5, 0.1, mean(END, 2), -1),
    ("mechanical_stop", (1, 2, 3, 4, 5), 1.0e6, 0.1, mean(slice(750, 880), 2), 1),
    ("hunting_relief_valve", (1, 2, 3, 4), 5.0e-4, 0.1, mean(LIFTING, 0), -1),
    ("angle_offset", (1, 2, 4), 0.03, 0.1, mean(END, 0), 1),
    ("rate_scale", (1, 2, 4, 5), 0.3, 0.1, mean(LOWERING, 1), -1),
    ("pressure_bias", (1, 2, 3, 4), 3.0e5, 0.1, mean(END, 2), 1),
    ("pressure_delay", (1, 2, 3, 4, 5), 0.05, 0.4, mean(slice(215, 240), 2), -1),
    ("thinning_oil", (1, 2, 3), 2.0, 0.4, mean(LOWERING, 3), -1),
]  # fmt: skip


@pytest.mark.parametrize(("name", "form", "size", "draw", "look", "sign"), [
    pytest.param(name, form, size, draw, look, sign, id=f"{name}-{form}-{'+' if sign > 0 else '-'}{k}")
    for k, (name, forms, size, draw, look, sign) in enumerate(RULES) for form in forms
])  # fmt: skip
def test_it_changes_what_it_must_in_the_right_direction(name, form, size, draw, look, sign):
    with_it, without = shown(name, form, size, draw)
    assert len(with_it) == len(without)
    assert sign * (look(with_it) - look(without)) > 1e-6 * abs(look(without))


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_every_family_has_four_forms_and_none_is_the_same_as_another(name):
    family = FAMILIES[name]
    assert len(family.forms) >= 4
    size = (family.low * family.high) ** 0.5
    _, base, site = at_work()
    seen = set()
    for form in range(1, len(family.forms) + 1):
        laid = family.lay(size, form, np.linspace(0.2, 0.8, 8), site)
        shape = (
            tuple(laid.crane.items()), tuple(laid.rows.items()),
            tuple((column, course.tobytes()) for column, course in laid.courses.items()),
            tuple(change(base[:, :2]).tobytes() for change in laid.currents),
            tuple(change(base).tobytes() for change in laid.senses),
        )  # fmt: skip
        assert any(shape), f"form {form} changes nothing"
        assert shape not in seen, f"form {form} is another one"
        seen.add(shape)


def test_the_later_draws_of_another_recording_move_what_happens_at_some_time_and_nothing_else():
    _, _, site = at_work()
    other = replace(site, late=np.full(4, 0.8), noise=6)
    lay, draws = FAMILIES["payload_change"].lay, np.full(8, 0.3)
    first, second = lay(200.0, 1, draws, site), lay(200.0, 1, draws, other)
    assert first.onset == pytest.approx(0.365 * DURATION) and second.onset == pytest.approx(0.64 * DURATION)
    tight = FAMILIES["position_dependent_friction"].lay
    assert tight(1.0, 1, draws, site).rows == tight(1.0, 1, draws, other).rows
