"""What the recorder decides, without ROS."""

from boom_recording import recorder
from boom_recording.bag_writer import OfferedQos
from boom_recording.recorder import Publisher, Readiness, Traffic


def publisher(reliable: bool, latched: bool) -> Publisher:
    return Publisher("std_msgs/msg/Bool", "", OfferedQos(reliable=reliable, latched=latched))


def test_the_subscription_asks_for_what_all_publishers_offer() -> None:
    both = recorder.request([publisher(True, True), publisher(True, True)])
    assert both.reliable and both.latched
    mixed = recorder.request([publisher(True, True), publisher(False, False)])
    assert not mixed.reliable and not mixed.latched


def test_a_weaker_publisher_makes_the_subscription_be_renewed_and_a_stronger_one_does_not() -> None:
    strong, weak = publisher(True, True), publisher(False, False)
    assert recorder.must_renew(recorder.request([strong]), [strong, weak])
    assert not recorder.must_renew(recorder.request([weak]), [strong, weak])


def test_a_star_stands_for_all_topics_but_the_housekeeping() -> None:
    seen = ["/b", "/rosout", "/parameter_events", "/a", "/x/_hidden"]
    assert recorder.wanted_topics(["*"], seen) == ["/a", "/b"]
    assert recorder.wanted_topics(["/b", "*"], seen) == ["/b", "/a"]
    assert recorder.wanted_topics(["/c"], seen) == ["/c"]


def test_it_is_ready_once_all_required_topics_have_been_matched_for_a_while() -> None:
    ready = Readiness(("/a", "/b"))
    assert not ready.update(["/a"], 0.0)
    assert not ready.update(["/a", "/b"], 1.0)
    assert ready.missing(1.0) == ["/b"]
    assert ready.update(["/a", "/b"], 1.5)
    assert not ready.update(["/b"], 2.0)
    assert ready.missing(2.0) == ["/a"]


def test_rates_count_since_the_last_report() -> None:
    traffic = Traffic()
    assert traffic.rate(0.0) == 0.0
    for _ in range(50):
        traffic.add(10)
    assert traffic.rate(0.5) == 100.0
    assert traffic.rate(1.0) == 0.0


def test_the_summary_names_topics_that_stayed_silent() -> None:
    traffic = {"/a": Traffic(messages=3, lost=1)}
    assert recorder.summary("bag", traffic, ["/a", "/b"]) == [
        "bag: 3 messages", "  /a: 3 messages, 1 lost in transit", "  /b: no message was received",
    ]  # fmt: skip


def test_a_topic_is_recorded_with_its_type_only_and_what_is_no_type_is_told() -> None:
    def publisher(kind: str) -> recorder.Publisher:
        return recorder.Publisher(kind, "", OfferedQos())

    right, wrong = publisher("sensor_msgs/msg/JointState"), publisher("std_msgs/msg/String")
    assert recorder.offered("/joint_states", [wrong, right]) == (
        [right],
        "/joint_states is offered as std_msgs/msg/String, which is not recorded: it has to be sensor_msgs/msg/JointState",
    )
    assert recorder.offered("/other", [wrong, right]) == ([wrong], recorder.offered("/other", [wrong, right])[1])
    assert recorder.offered("/other", [wrong, right], current=right.type)[0] == [right]
    for odd in (
        "",
        "String",
        "a/b/c/d",
        "std_msgs/String",
        "../msg/X",
        ".os/msg/X",
        "os/path/join",
        "std_msgs/msg/S\x1b[2J",
    ):
        publishers, told = recorder.offered("/other", [publisher(odd)])
        assert publishers == [] and "not recorded" in told and told.isprintable()
