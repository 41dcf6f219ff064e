"""Injected faults, on times and frames of our own."""

from __future__ import annotations

import pytest

from boom_node.parameters import ParameterSpec
from boom_sim.ecu_faults import PARAMETERS, FaultSettings, FaultyLine, Frame, from_values

FRAMES = [Frame(0x100 + k % 5, False, bytes([k % 256, k // 256, 3, 4, 5, 6, 7, 8])) for k in range(5000)]


def passed(settings: FaultSettings, seed: int = 1, frames: list[Frame] = FRAMES) -> list[Frame]:
    """What leaves when a frame enters every 2 ms and leaves are looked for every millisecond."""
    line = FaultyLine(seed, settings)
    result = []
    for k, frame in enumerate(frames):
        line.put(frame, 0.002 * k)
        result += line.due(0.002 * k) + line.due(0.002 * k + 0.001)
    return result + line.due(1e9)


def test_neutral_line_changes_nothing() -> None:
    assert passed(FaultSettings()) == FRAMES


def test_losses_have_the_asked_probability_and_are_the_seeds() -> None:
    settings = FaultSettings(loss=0.1)
    first = passed(settings)
    assert len(FRAMES) - len(first) == pytest.approx(500, abs=80)
    assert first == passed(settings)
    assert first != passed(settings, seed=2)


def test_burst_loses_all_frames_of_its_duration() -> None:
    left = passed(FaultSettings(burst=0.002, burst_duration=0.05))
    there = {frame.data[0] + 256 * frame.data[1] for frame in left}
    gaps, run = [], 0
    for k in range(len(FRAMES)):
        if k in there:
            if run:
                gaps.append(run)
            run = 0
        else:
            run += 1
    assert len(gaps) > 3
    assert min(gaps) >= 25


def test_flip_inverts_one_bit_and_no_more() -> None:
    left = passed(FaultSettings(bit_flip=1.0))
    assert len(left) == len(FRAMES)
    for before, after in zip(FRAMES, left, strict=True):
        changed = int.from_bytes(before.data) ^ int.from_bytes(after.data)
        assert changed.bit_count() == 1
        assert after.arbitration_id == before.arbitration_id


def test_delayed_frames_keep_their_order_and_come_when_told() -> None:
    line = FaultyLine(3, FaultSettings(delay=0.03, jitter=0.05))
    left: list[tuple[float, Frame]] = []
    for k, frame in enumerate(FRAMES[:500]):
        line.put(frame, 0.002 * k)
        left += [(0.002 * k, frame) for frame in line.due(0.002 * k)]
    assert [frame for _, frame in left] == FRAMES[: len(left)]
    waits = [time - 0.002 * k for k, (time, _) in enumerate(left)]
    assert min(waits) >= 0.03
    assert max(waits) <= 0.03 + 0.05 + 0.002 + 1e-9


def test_reordered_frames_swap_with_the_next_and_none_is_lost() -> None:
    left = passed(FaultSettings(reorder=0.2), frames=FRAMES[:1000] + [FRAMES[1000]] * 2)
    assert left != FRAMES[: len(left)]
    assert {frame.data for frame in left} >= {frame.data for frame in FRAMES[:1000]}
    numbers = [frame.data[0] + 256 * frame.data[1] for frame in left[:1000]]
    assert max(abs(place - number) for place, number in enumerate(numbers)) <= 1


def test_a_fault_that_is_switched_on_leaves_the_others_as_they_were() -> None:
    lost = {f.data for f in FRAMES} - {f.data for f in passed(FaultSettings(loss=0.05))}
    left = passed(FaultSettings(loss=0.05, delay=0.01))
    assert lost == {f.data for f in FRAMES} - {f.data for f in left}


def test_what_is_under_way_is_lost_when_the_line_is_cleared() -> None:
    line = FaultyLine(0, FaultSettings(delay=1.0))
    line.put(FRAMES[0], 0.0)
    line.clear()
    assert line.due(10.0) == []
    assert line.counts.lost == 1


def test_every_setting_is_a_parameter_with_the_same_default() -> None:
    defaults: dict[str, object] = {spec.name: spec.default for spec in PARAMETERS}
    assert from_values(defaults) == FaultSettings()
    assert {f"fault_{name}" for name in FaultSettings.__dataclass_fields__} <= set(defaults)
    assert all(isinstance(spec, ParameterSpec) and spec.description for spec in PARAMETERS)
