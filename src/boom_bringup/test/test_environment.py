import socket

import pytest

from boom_bringup import environment


def test_a_sourced_ros_is_dropped_and_named():
    user = {
        "AMENT_PREFIX_PATH": "/home/user/ws/install/a:/opt/ros/jazzy",
        "ROS_DISTRO": "jazzy",
        "PYTHONPATH": "/x",
        "A": "1",
    }

    ours = environment.for_processes(user)

    assert environment.sourced_ros(user) == "jazzy (/opt/ros/jazzy)"
    assert not {"AMENT_PREFIX_PATH", "ROS_DISTRO", "PYTHONPATH"} & set(ours)
    assert ours["A"] == "1"
    assert environment.sourced_ros({}) == ""


@pytest.mark.parametrize("domain", ["999", "abc", "-1", "1.5"])
def test_a_domain_that_cannot_be_is_told(domain):
    with pytest.raises(environment.EnvironmentSettingError, match=r"set it to 0 \.\. 232"):
        environment.for_processes({"ROS_DOMAIN_ID": domain})


def test_the_default_is_the_loopback_profile_whatever_range_the_user_has_set():
    for user in ({}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}):
        ours = environment.for_processes(user | {"ROS_STATIC_PEERS": "10.0.0.1", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"})

        assert ours["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(environment.LOOPBACK_PROFILE)
        assert ours["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
        assert not {"ROS_STATIC_PEERS", "FASTDDS_BUILTIN_TRANSPORTS"} & set(ours)
    assert environment.for_processes({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"})["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "OFF"


def test_an_ignored_wish_for_the_subnet_is_told():
    assert "BOOM_NETWORK=lan" in environment.ignored_range({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"})
    assert environment.ignored_range({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "BOOM_NETWORK": "lan"}) == ""
    assert environment.ignored_range({}) == ""


def test_lan_opens_up_and_drops_the_profile():
    once = environment.for_processes({})
    ours = environment.for_processes(once | {"BOOM_NETWORK": "lan"})

    assert "FASTRTPS_DEFAULT_PROFILES_FILE" not in ours
    assert ours["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"


def test_a_profile_of_the_user_decides():
    ours = environment.for_processes({"FASTRTPS_DEFAULT_PROFILES_FILE": "/etc/mine.xml"})

    assert ours["FASTRTPS_DEFAULT_PROFILES_FILE"] == "/etc/mine.xml"
    assert ours["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert environment.network_mode(ours) == "custom"


def test_an_unknown_network_is_an_error_that_names_the_known_ones():
    with pytest.raises(
        environment.EnvironmentSettingError, match="BOOM_NETWORK=wan is unknown: set it to loopback or lan"
    ):
        environment.for_processes({"BOOM_NETWORK": "wan"})


def test_applying_twice_changes_nothing_and_keeps_the_loader_path():
    target = {
        "LD_LIBRARY_PATH": "/venv/lib",
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        "AMENT_PREFIX_PATH": "/opt/ros/jazzy",
    }
    environment.apply(target)
    once = dict(target)
    environment.apply(target)

    assert target == once
    assert target["LD_LIBRARY_PATH"] == "/venv/lib"
    assert "AMENT_PREFIX_PATH" not in target


def test_messages_are_checked_before_they_are_sent():
    assert environment.for_processes({})["ROS_PYTHON_CHECK_FIELDS"] == "1"


def test_linear_algebra_stays_in_one_thread_unless_the_user_says_otherwise():
    assert environment.for_processes({})["OPENBLAS_NUM_THREADS"] == "1"
    assert environment.for_processes({"OPENBLAS_NUM_THREADS": "4"})["OPENBLAS_NUM_THREADS"] == "4"


def test_a_private_domain_is_given_to_one_only_and_free_again_afterwards():
    with environment.private_domain() as first, environment.private_domain() as second:
        assert first != second
        assert {int(first), int(second)} <= set(environment.PRIVATE_DOMAINS)
    with environment.private_domain() as third:
        assert third == first


def test_a_domain_on_which_somebody_is_heard_is_left_alone():
    with environment.private_domain() as free:
        pass
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("127.0.0.1", 7410 + 250 * int(free)))
        with environment.private_domain() as other:
            assert other != free


def test_no_domain_left_is_an_error_that_says_what_to_do(monkeypatch):
    with environment.private_domain() as held:
        monkeypatch.setattr(environment, "PRIVATE_DOMAINS", [int(held)])
        with pytest.raises(environment.EnvironmentSettingError, match="wait until"), environment.private_domain():
            pass
