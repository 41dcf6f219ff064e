"""The rigid body in any pose: agrees with the tabulated poses and with mechanics by hand, refuses what cannot be."""

from __future__ import annotations

import copy
import math
from importlib import resources
from typing import Any

import numpy as np
import pytest
import yaml

from boom_model.errors import MachineError
from boom_model.rigid_body import PoseError, locked_inertia, place_bodies, tip_position


@pytest.fixture(scope="module")
def crane() -> dict[str, Any]:
    text = (resources.files("boom_model") / "machines" / "tz17.yaml").read_text(encoding="utf-8")
    section: dict[str, Any] = yaml.safe_load(text)["rigid_body"]
    return section


def two_bodies(**changes: Any) -> dict[str, Any]:
    """A boom of 100 kg and an arm of 10 kg; every number can be done in the head."""
    body: dict[str, Any] = {
        "links": {
            "boom": {"m": 100.0, "com": [1.0, 0.0, 0.0], "I": [1.0, 2.0, 30.0]},
            "arm": {"m": 10.0, "com": [0.0, 0.0, 1.0], "I": [1.0, 5.0, 2.0]},
            "grapple": {"m": 1.0, "com": [0.0, 0.0, 0.0], "I": [1.0, 1.0, 1.0]},
        },
        "planar": {
            "elbow": {"value": [2.0, 0.0], "unit": "m"},
            "arm_origin": [0.0, 0.0],
            "bodies": {
                "boom": {"carrier": "boom", "origin": [0.0, 0.0], "axes": ["x", "y"], "q4_share": 0.0},
                "arm": {"carrier": "arm", "origin": [0.0, 0.0], "axes": ["x", "z"], "q4_share": 0.5},
            },
            "tip": {"carrier": "arm", "origin": [0.0, 2.0], "q4_share": 1.0, "hangs": ["grapple"]},
            "arm_cylinder": {
                "foot": [0.5, 0.0],
                "eye": [0.0, 0.0],
                "barrels": {"m": 0.0, "com": 0.4, "I": 0.0},
                "rods": {"m": 0.0, "com": 0.4, "I": 0.0},
            },
        },
    }
    body.update(changes)
    return body


@pytest.mark.parametrize("name", ["T1_T2_folded", "T3_extended", "T4_log"])
def test_agrees_with_the_tabulated_pose(crane: dict[str, Any], name: str) -> None:
    pose = crane["configs"][name]
    body = locked_inertia(crane, pose["q3"], pose["q4"], pose["m_L"])
    assert pytest.approx(pose["D0"], rel=2e-4) == body.D0
    assert body.Sx == pytest.approx(pose["Sx"], rel=2e-4)
    assert body.Sy == pytest.approx(pose["Sy"], rel=2e-4)
    assert body.tip == pytest.approx(pose["tip"], abs=1e-4)
    assert body.load_mass == pose["m_L"]


def test_moving_mass_is_that_of_the_machine_file(crane: dict[str, Any]) -> None:
    total = sum(body.mass for body in place_bodies(crane, 1.0, 1.0))
    assert total == pytest.approx(crane["m_total_moving"]["value"], abs=1.0)


def test_two_bodies_by_hand() -> None:
    # Arm at q3 = pi/2: in line. Its centre is at 2 + 1 + q4/2, the tip at 2 + 2 + q4, everything on the boom's axis.
    body = locked_inertia(two_bodies(), math.pi / 2, 1.0)
    assert body.tip == pytest.approx((5.0, 0.0), abs=1e-12)
    assert body.Sx == pytest.approx(100 * 1 + 10 * 3.5 + 1 * 5)
    assert body.Sy == pytest.approx(0.0, abs=1e-9)
    assert pytest.approx(100 * 1 + 30 + 10 * 3.5**2 + 5 + 1 * 25) == body.D0


def test_a_crane_whose_arm_cylinder_nobody_knows_is_one_without_its_mass() -> None:
    known, unknown = two_bodies(), two_bodies()
    del unknown["planar"]["arm_cylinder"]
    assert locked_inertia(unknown, 0.7, 0.5) == locked_inertia(known, 0.7, 0.5)


def test_arm_hangs_straight_down_at_zero() -> None:
    body = locked_inertia(two_bodies(), 0.0, 0.0)
    assert body.tip == pytest.approx((2.0, -2.0))
    assert body.Sy == pytest.approx(-10 * 1 - 1 * 2)


def test_sums_over_the_placed_bodies_are_what_pinocchio_says(crane: dict[str, Any]) -> None:
    for q3, q4 in [(-0.9, 0.0), (0.7, 4.4), (2.5, 1.3), (4.6, 0.2)]:
        body = locked_inertia(crane, q3, q4)
        placed = place_bodies(crane, q3, q4)
        first_moment = sum((b.mass * b.center for b in placed), np.zeros(2))
        second_moment = sum(b.mass * float(b.center @ b.center) + b.inertia for b in placed)
        assert (body.Sx, body.Sy) == pytest.approx(tuple(first_moment), rel=1e-12)
        assert pytest.approx(second_moment, rel=1e-12) == body.D0


def test_load_is_not_in_the_sums(crane: dict[str, Any]) -> None:
    without, with_load = locked_inertia(crane, 0.28, 2.8), locked_inertia(crane, 0.28, 2.8, 300.0)
    assert (without.D0, without.Sx, without.Sy, without.tip) == (
        with_load.D0,
        with_load.Sx,
        with_load.Sy,
        with_load.tip,
    )


def test_telescope_moves_the_tip_by_its_whole_extension(crane: dict[str, Any]) -> None:
    moved = tip_position(crane, 1.1, 3.0) - tip_position(crane, 1.1, 1.0)
    assert np.hypot(*moved) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("q3", "q4", "load", "named"),
    [
        (5.0, 0.0, 0.0, "outer boom angle"),
        (-1.0, 0.0, 0.0, "outer boom angle"),
        (1.0, -0.1, 0.0, "telescope length"),
        (1.0, 4.6, 0.0, "telescope length"),
        (math.nan, 0.0, 0.0, "not a pair of numbers"),
        (1.0, 0.0, -1.0, "load"),
        (1.0, 0.0, math.nan, "load"),
    ],
)
def test_impossible_pose_is_refused(crane: dict[str, Any], q3: float, q4: float, load: float, named: str) -> None:
    with pytest.raises(PoseError, match=named):
        locked_inertia(crane, q3, q4, load)


@pytest.mark.parametrize(
    "path", [("links",), ("planar",), ("planar", "tip"), ("links", "inner_boom", "m"), ("planar", "elbow")]
)
def test_missing_key_is_named(crane: dict[str, Any], path: tuple[str, ...]) -> None:
    broken = copy.deepcopy(crane)
    inner = broken
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    with pytest.raises(MachineError, match=r"\.".join(("rigid_body", *path)) + ": missing"):
        locked_inertia(broken, 1.0, 0.0)


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (("links", "inner_boom", "m"), -1.0, "rigid_body.links.inner_boom.m"),
        (("links", "inner_boom", "m"), "heavy", "rigid_body.links.inner_boom.m"),
        (("links", "inner_boom", "com"), [0.0, 1.0], "rigid_body.links.inner_boom.com"),
        (("links", "inner_boom", "I"), [0.0, 1.0, 1.0], "rigid_body.links.inner_boom.I"),
        (("planar", "bodies", "inner_boom", "axes"), ["x", "w"], "axes"),
        (("planar", "bodies", "inner_boom", "axes"), ["x", "-x"], "axes"),
        (("planar", "bodies", "inner_boom", "carrier"), "column", "carrier"),
    ],
)
def test_impossible_value_is_named(crane: dict[str, Any], path: tuple[str, ...], value: Any, named: str) -> None:
    broken = copy.deepcopy(crane)
    inner = broken
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(MachineError, match=named):
        locked_inertia(broken, 1.0, 0.0)
