"""What is replayed and when, without ROS."""

import threading
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording_samples import recording

from boom_recording import replay
from boom_recording.errors import RecordingError
from boom_recording.pacing import ReplayPacer, StoodStillError
from boom_recording.replay import ReplayLockstep, ReplaySample

MS = 1_000_000


def test_commands_are_the_recorded_currents_at_their_stamps() -> None:
    made = recording()
    chosen = replay.samples(made, "commands")
    current = made.signals["extend_current"]
    assert [s.stamp_ns for s in chosen] == (current.stamps_ns - made.start_ns).tolist()
    assert [s.values[1] for s in chosen] == current.values.tolist()


def test_masked_samples_are_left_out_and_in_a_gap_zero_is_commanded() -> None:
    made = recording()
    made.signals["extend_current"].valid[300:400] = False
    made.signals["retract_current"].valid[450] = False
    chosen = replay.samples(made, "commands")
    assert len(chosen) == 600 - 101 + 1
    (zero,) = [s for s in chosen if s.gap]
    assert zero.values == (0.0, 0.0)
    assert zero.stamp_ns == chosen[299].stamp_ns + 50 * MS


def test_a_reference_is_held_over_a_gap() -> None:
    made = recording()
    made.signals["angle"].valid[300:400] = False
    chosen = replay.samples(made, "reference")
    assert len(chosen) == 500 and not any(s.gap for s in chosen)


def test_a_recording_without_valid_currents_is_refused() -> None:
    made = recording()
    made.signals["extend_current"].valid[:] = False
    with pytest.raises(RecordingError, match="nothing valid to replay"):
        replay.samples(made, "commands")


def test_samples_are_as_far_apart_as_most_of_them() -> None:
    everything = replay.samples(recording(), "commands")
    assert replay.apart([*everything[:300], *everything[400:]]) == pytest.approx(0.01)
    assert replay.apart(everything[:1]) == 0.0


def test_a_part_begins_with_what_acted_then() -> None:
    everything = replay.samples(recording(), "commands")
    chosen = replay.part(everything, 1.0, 0.5)
    assert chosen[0] == ReplaySample(0, everything[99].values)
    assert chosen[1].stamp_ns == everything[100].stamp_ns - 1000 * MS
    assert chosen[-1].stamp_ns < 500 * MS
    with pytest.raises(RecordingError, match="the recording ends at"):
        replay.part(everything, 100.0, 0.0)


def test_a_loop_goes_on_with_increasing_stamps() -> None:
    chosen = [ReplaySample(0, (1.0, 0.0)), ReplaySample(10 * MS, (2.0, 0.0))]
    stream = replay.endless(chosen, loop=True)
    assert [next(stream).stamp_ns // MS for _ in range(6)] == [0, 10, 20, 30, 40, 50]


# ---- lockstep ----


def test_each_tick_is_answered_with_the_current_of_its_period_at_its_own_stamp() -> None:
    step = ReplayLockstep(
        [ReplaySample(3 * MS, (0.1, 0.0)), ReplaySample(13 * MS, (0.2, 0.0)), ReplaySample(23 * MS, (0.3, 0.0))]
    )
    assert step.first() == ReplaySample(3 * MS, (0.1, 0.0))
    assert step.answer(10 * MS) == ReplaySample(13 * MS, (0.2, 0.0))
    assert not step.finished
    assert step.answer(20 * MS) == ReplaySample(23 * MS, (0.3, 0.0))
    assert step.finished


def test_of_several_currents_in_a_period_the_last_counts_and_without_one_the_value_before_stays() -> None:
    step = ReplayLockstep([ReplaySample(t * MS, (t / 10, 0.0)) for t in (2, 4, 33)])
    assert step.first() == ReplaySample(4 * MS, (0.4, 0.0))
    assert step.answer(10 * MS) == ReplaySample(10 * MS, (0.4, 0.0))
    assert step.answer(20 * MS) == ReplaySample(20 * MS, (0.4, 0.0))
    assert step.answer(30 * MS) == ReplaySample(33 * MS, (3.3, 0.0))


def test_jitter_about_a_tick_loses_no_current() -> None:
    """Stamps a little before and after t_n: each tick gets its own current, an early one acts from t_n on."""
    jitter = (0, 100, -50, 20, -90, 60)
    chosen = [ReplaySample(max(0, k * 10 * MS + 1000 * j), (float(k), 0.0)) for k, j in enumerate(jitter)]
    step = ReplayLockstep(chosen)
    answers = [step.first(), *(step.answer(10 * MS * k) for k in range(1, len(chosen)))]
    assert [a.values[0] for a in answers if a] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert [a.stamp_ns for a in answers if a] == [max(s.stamp_ns, 10 * MS * k) for k, s in enumerate(chosen)]


def test_before_the_first_current_zero_is_commanded() -> None:
    assert ReplayLockstep([ReplaySample(25 * MS, (0.1, 0.0))]).first() == ReplaySample(0, (0.0, 0.0))


def test_a_reference_in_lockstep_begins_with_its_first_angle_and_is_stamped_with_its_tick_or_later() -> None:
    chosen = [ReplaySample(25 * MS, (0.3,)), ReplaySample(35 * MS, (0.4,))]
    step = ReplayLockstep(chosen, what=replay.REFERENCE)
    assert step.first() == ReplaySample(0, (0.3,))
    assert step.answer(10 * MS) == ReplaySample(10 * MS, (0.3,))
    assert step.answer(20 * MS) == ReplaySample(25 * MS, (0.3,))
    assert step.answer(30 * MS) == ReplaySample(35 * MS, (0.4,))


def test_a_tick_is_answered_once() -> None:
    step = ReplayLockstep([ReplaySample(0, (0.1, 0.0)), ReplaySample(10 * MS, (0.2, 0.0))])
    step.first()
    assert step.answer(0) is None
    assert step.answer(10 * MS) is not None
    assert step.answer(10 * MS) is None


def test_a_start_time_shifts_stamps_and_ticks() -> None:
    step = ReplayLockstep([ReplaySample(3 * MS, (0.1, 0.0)), ReplaySample(13 * MS, (0.2, 0.0))], start_ns=5_000 * MS)
    assert step.first().stamp_ns == 5_003 * MS
    assert step.next_tick_ns == 5_010 * MS
    answer = step.answer(5_010 * MS)
    assert answer is not None and answer.stamp_ns == 5_013 * MS


@given(st.lists(st.integers(0, 300), min_size=1, max_size=60), st.integers(0, 1000))
def test_the_answers_follow_the_recording_whatever_its_stamps(stamps_ms: list[int], start_ms: int) -> None:
    chosen = [ReplaySample(t * MS, (float(k + 1), 0.0)) for k, t in enumerate(sorted(set(stamps_ms)))]
    step = ReplayLockstep(chosen, start_ns=start_ms * MS)
    for tick in range(31):
        answer = step.first() if tick == 0 else step.answer((start_ms + 10 * tick) * MS)
        assert answer is not None
        stamp = answer.stamp_ns - start_ms * MS
        acting = [s for s in chosen if s.stamp_ns <= stamp]
        due = [
            s for s in chosen if s.stamp_ns < tick * 10 * MS - 5 * MS
        ]  # half a period is the most that one comes late
        assert answer.values[0] == (acting[-1].values[0] if acting else 0.0)
        assert not due or answer.values[0] >= due[-1].values[0]
        assert 10 * tick * MS <= stamp < (10 * tick + 15) * MS
    assert step.finished


# ---- pacing ----


def test_the_pacer_sends_everything_in_order_with_the_clock_before_it() -> None:
    log: list[tuple[str, int]] = []
    chosen = [ReplaySample(k * 7 * MS, (float(k), 0.0)) for k in range(20)]
    pacer = ReplayPacer(
        1000.0, lambda s, clock: log.append(("send", clock)), lambda clock: log.append(("clock", clock)), start_ns=100
    )
    assert pacer.run(chosen)
    assert [t for what, t in log if what == "send"] == [s.stamp_ns + 100 for s in chosen]
    clocks = [t for what, t in log if what == "clock"]
    assert clocks == sorted(set(clocks))
    assert set(range(100, 133 * MS, 10 * MS)) <= set(clocks)
    times = [t for _, t in log]
    assert times == sorted(times)


def test_a_paused_pacer_sends_nothing_until_it_goes_on_and_stops_when_told() -> None:
    sent: list[ReplaySample] = []
    first = threading.Event()

    def send(sample: ReplaySample, _: int) -> None:
        sent.append(sample)
        first.set()

    pacer = ReplayPacer(1.0, send)
    pacer.pause()
    ended: list[bool] = []
    thread = threading.Thread(
        target=lambda: ended.append(pacer.run([ReplaySample(0, (0.0, 0.0)), ReplaySample(10**15, (0.0, 0.0))]))
    )
    thread.start()
    assert pacer.paused and not sent
    pacer.resume()
    assert first.wait(10)
    pacer.stop()
    thread.join(10)
    assert ended == [False] and len(sent) == 1


def test_a_pacer_that_is_slow_goes_on_and_one_that_stood_still_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """What counts is the silence that a valve hears; samples that are late all along are none."""
    now = [0.0]
    monkeypatch.setattr("boom_recording.pacing.time.monotonic", lambda: now[0])
    chosen = [ReplaySample(k * 10 * MS, (0.0, 0.0)) for k in range(100)]

    def took(seconds: Callable[[int], float]) -> list[int]:
        sent: list[int] = []

        def send(sample: ReplaySample, _: int) -> None:
            sent.append(sample.stamp_ns)
            now[0] += seconds(len(sent))

        ReplayPacer(1000.0, send, silence=0.1).run(chosen)
        return sent

    assert len(took(lambda _: 0.05)) == 100  # seconds behind in the end
    with pytest.raises(StoodStillError, match="stood still for 150 ms"):
        took(lambda k: 0.15 if k == 40 else 0.001)


def test_a_pacer_suspended_between_its_wait_and_its_send_does_not_send(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process is suspended between any two lines: here where the clock of the sample goes out."""
    now = [0.0]
    monkeypatch.setattr("boom_recording.pacing.time.monotonic", lambda: now[0])
    sent: list[int] = []

    def send(sample: ReplaySample, _: int) -> None:
        sent.append(sample.stamp_ns)
        now[0] += 0.001

    def tick(_: int) -> None:
        now[0] += 0.15 if len(sent) == 40 else 0.0

    chosen = [ReplaySample(k * 10 * MS, (0.0, 0.0)) for k in range(100)]
    with pytest.raises(StoodStillError, match="stood still for 151 ms"):
        ReplayPacer(1000.0, send, tick, silence=0.1).run(chosen)
    assert len(sent) == 40


def test_the_stamps_of_a_replay_are_whole_nanoseconds_of_the_recording() -> None:
    made = recording()
    chosen = replay.samples(made, "reference")
    assert np.array_equal([s.stamp_ns for s in chosen], made.signals["angle"].stamps_ns - made.start_ns)


def test_over_can_each_tick_gets_the_current_nearest_to_it() -> None:
    stamps = [k * 10 * MS - MS // 500 for k in range(1, 5)]  # just before the ticks, as a sender in step with them does
    step = ReplayLockstep([ReplaySample(t, (k + 1.0, 0.0)) for k, t in enumerate(stamps)], on_ticks=True)
    values = [step.first().values[0]]
    while not step.finished:
        answer = step.answer(step.next_tick_ns)
        assert answer is not None
        values.append(answer.values[0])
    assert values == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_reference_that_is_looped_comes_back_to_its_beginning_slowly() -> None:
    """The boom had rushed there at each repetition, as fast as the valve lets it."""
    chosen = [ReplaySample(10 * MS * k, (0.6 - 0.0003 * k,)) for k in range(1000)]
    looped = replay.with_way_back(chosen)
    assert looped[: len(chosen)] == chosen and abs(chosen[0].values[0] - chosen[-1].values[0]) > 0.2
    angles = np.array([sample.values[0] for sample in (*looped, looped[0])])
    times = np.array([sample.stamp_ns for sample in looped] + [looped[-1].stamp_ns + replay.PERIOD_NS])
    rates = np.diff(angles) / np.diff(times) * 1e9
    assert np.abs(rates[len(chosen) - 1 :]).max() <= replay.RETURN + 1e-6
    assert replay.with_way_back(chosen[:1]) == chosen[:1]
