"""The parts of boom_node that need no process."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import JointState

from boom_node import stamps
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.errors import StartError
from boom_node.joint_state import angle_and_rate
from boom_node.parameters import ParameterSpec, check_files, nearest


class Stamp:
    sec = 0
    nanosec = 0


@given(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
def test_a_stamp_keeps_every_nanosecond(nanoseconds: int) -> None:
    stamp = stamps.set_ns(Stamp(), nanoseconds)
    assert 0 <= stamp.nanosec < 10**9
    assert stamps.to_ns(stamp) == nanoseconds


def test_a_time_that_does_not_fit_a_stamp_is_refused() -> None:
    with pytest.raises(ValueError, match="int32"):
        stamps.set_ns(Stamp(), 2**31 * 10**9)


def test_seconds_become_whole_nanoseconds() -> None:
    assert stamps.seconds_to_ns(0.1 + 0.2) == 300_000_000
    assert stamps.ns_to_seconds(1_500_000_000) == 1.5


@pytest.mark.parametrize(
    ("spec", "good", "bad", "reason"),
    [
        (ParameterSpec("x", 1.0, "x", "m", 0.0, 2.0), 2, 2.1, "0 to 2 m"),
        (ParameterSpec("x", 1.0, "x", "m", minimum=0.0), 5.0, -0.1, "at least 0 m"),
        (ParameterSpec("x", 1.0, "x"), 0.5, float("nan"), "finite"),
        (ParameterSpec("n", 3, "n", maximum=4), 4, 5, "at most 4"),
        (ParameterSpec("n", 3, "n"), 4, 4.5, "whole number"),
        (ParameterSpec("n", 3, "n"), 4, True, "whole number"),
        (ParameterSpec("s", "a", "s", choices=("a", "b")), "b", "c", "one of a, b"),
        (ParameterSpec("b", False, "b"), True, 1, "truth value"),
        (ParameterSpec("l", ["a"], "l"), [], [1.0], "list of texts"),
    ],
)
def test_a_value_is_refused_with_what_is_allowed(spec: ParameterSpec, good: object, bad: object, reason: str) -> None:
    assert spec.problem(good) is None
    assert reason in str(spec.problem(bad))


def test_the_label_of_a_parameter_tells_unit_and_range() -> None:
    assert ParameterSpec("x", 1.0, "length", "m", 0.0, 2.0).label() == "length [m], 0 to 2 m"


def test_the_nearest_name_is_proposed_and_all_are_listed_where_none_is_near() -> None:
    assert nearest("sead", ["seed", "rate"]) == ": did you mean 'seed'?"
    assert nearest("zzz", ["seed", "rate"]) == "; it has: rate, seed"


@pytest.mark.parametrize(
    ("section", "accepted"),
    [
        ("/**", True), ("/*", True), ("/boom/controller", False), ("controller", True), ("/controller", True),
        ("other", False),
        ("/boom/**", False), ("/**/controller", True),
    ],
)  # fmt: skip
def test_a_section_of_a_parameter_file_has_to_match_the_node(tmp_path, section: str, accepted: bool) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(f"{section}:\n  ros__parameters:\n    a: 1\n")
    if accepted:
        check_files(["--params-file", str(file)], "/controller")
    else:
        with pytest.raises(StartError, match="has nothing for /controller"):
            check_files(["--params-file", str(file)], "/controller")


def test_a_parameter_file_that_is_none_is_refused(tmp_path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("a: [1\n")
    with pytest.raises(StartError, match=r"p\.yaml, line 2: not readable as YAML"):
        check_files(["--params-file", str(file)], "/controller")
    file.write_text("a: 1\n")
    with pytest.raises(StartError, match="ros__parameters"):
        check_files(["--params-file", str(file)], "/controller")


@pytest.mark.parametrize(
    ("position", "velocity", "expected"),
    [([0.3, 0.5], [0.0, 0.1], (0.5, 0.1)), ([0.3, 0.5], [], None), ([], [], None)],
)
def test_a_joint_state_without_a_gyros_rate_is_refused_by_what_is_missing(position, velocity, expected):
    said = []
    guard = SimpleNamespace(refuse=lambda topic, reason, detail="": said.append(reason))
    message = JointState(name=["other", "boom"], position=position, velocity=velocity)
    assert angle_and_rate(guard, "/joint_states", message, "boom") == expected
    assert angle_and_rate(guard, "/joint_states", message, "third") is None
    missing = "velocity, a gyro's rate," if position else "position"
    assert said == ([] if expected else [f"the joint's {missing} is missing"])


def test_health_is_told_at_once_where_its_words_change_and_not_for_every_number() -> None:
    node, told = MagicMock(), ["waiting", "the angle is 60.1 ms old", "the angle is 7 ms old", "the rate is 7 ms old"]
    node.guard.internal, node.guard.values.return_value = "", {}
    node.get_name.return_value = "tiny"
    node.get_clock().now().to_msg.return_value = Time()
    health = iter(told)
    publisher = DiagnosticsPublisher(node, lambda: Health(Level.OK, next(health)))
    for _ in told:
        publisher.update()
    sent = [call.args[0].status[0].message for call in node.create_publisher().publish.call_args_list]
    assert sent == [told[0], told[1], told[3]]
