"""The joints that the laws take as locked, and what is said when they are not where the configuration says."""

from __future__ import annotations

from math import nan

from boom_controller.loop.other_joints import OtherJoints
from boom_model.machine_file import load_machine

NAMES = ("slewing_joint", "inner_boom_joint", "outer_boom_joint", "telescope_joint")
TZ17 = load_machine("tz17")
SET = TZ17, TZ17.pose(0.28, 2.2)


def test_an_outer_boom_that_left_its_configured_angle_is_said_once_and_again_after_it_was_back() -> None:
    said: list[str] = []
    joints = OtherJoints(said.append)
    assert joints.moved(SET) == ""  # nobody told
    for outer, telescope, moved in ((0.28, 2.2, False), (0.285, 2.2, False), (0.6, 2.2, True), (0.6, 2.2, True),
                                    (0.28, 2.2, False), (0.28, 3.0, True)):  # fmt: skip
        joints.take(NAMES, (0.0, 0.3, outer, telescope))
        assert bool(joints.moved(SET)) is moved
    assert len(said) == 2
    assert "0.60 rad" in said[0]
    assert "takes them as locked" in said[0]


def test_joints_that_nobody_measures_count_as_locked() -> None:
    joints = OtherJoints(lambda text: None)
    joints.take(("inner_boom_joint",), (0.3,))
    assert joints.moved(SET) == ""
    joints.take(NAMES, (0.0, 0.3, nan, 2.2))
    assert joints.moved(SET) == ""
    assert joints.moved(None) == ""
