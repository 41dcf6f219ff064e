"""An input that falls silent is warned of, once in a while."""

from __future__ import annotations

from boom_node.input_watch import InputWatch


def test_warning_comes_after_the_timeout_and_is_repeated_seldom() -> None:
    watch = InputWatch("nothing for {age} s", started=100.0, timeout=2.0, repeat=10.0)
    assert watch.warning(101.9) is None
    assert watch.warning(102.5) == "nothing for 2.5 s"
    assert watch.warning(112.0) is None
    assert watch.warning(112.5) == "nothing for 12.5 s"
    watch.seen(113.0)
    assert not watch.missing(114.0)
    assert watch.warning(115.5) == "nothing for 2.5 s", "after input came again the next silence is told at once"


def test_latched_input_never_goes_missing_again() -> None:
    watch = InputWatch("nothing", started=0.0, once=True)
    assert watch.missing(5.0)
    watch.seen(5.0)
    assert watch.warning(500.0) is None
