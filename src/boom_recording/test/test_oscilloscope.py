"""Oscilloscope bags: what is written is read, blocks join to stretches, what is wrong is told in one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boom_recording.bag_writer import BagWriter
from boom_recording.errors import RecordingError
from boom_recording.oscilloscope import OscilloscopeTrace, Stretch, load_traces, write_trace
from boom_recording.recording import Configuration
from boom_recording.writing import from_columns, write

PERIOD = 0.16e-3


def trace(count: int = 20_000, valve: str = "extend") -> OscilloscopeTrace:
    k = np.arange(count, dtype=float)
    columns = (24.0 * (k % 63 < 20), 0.4 + 0.1 * np.sin(k / 500), 1e6 + 10.0 * k)
    single = [column.astype(np.float32).astype(float) for column in columns]
    return OscilloscopeTrace("made", Path("made"), valve, PERIOD, (Stretch(0.0, *single),))


def test_a_trace_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_trace(tmp_path / "one", trace())
    (found,) = load_traces(tmp_path / "one")
    assert (found.name, found.valve, found.period, found.lost) == ("one", "extend", PERIOD, 0)
    assert found.duration == pytest.approx(19_999 * PERIOD)
    for name in ("voltage", "current", "pressure"):
        assert np.array_equal(getattr(found.stretches[0], name), getattr(trace().stretches[0], name))


def test_a_missing_block_cuts_the_trace_and_is_counted(tmp_path: Path) -> None:
    whole = trace().stretches[0]
    second = Stretch(12_500 * PERIOD, *(getattr(whole, n)[12_500:] for n in ("voltage", "current", "pressure")))
    first = Stretch(0.0, *(getattr(whole, n)[:6_250] for n in ("voltage", "current", "pressure")))
    write_trace(tmp_path / "gap", replace(trace(), stretches=(first, second)))
    (found,) = load_traces(tmp_path / "gap")
    assert [len(s.current) for s in found.stretches] == [6_250, 7_500]
    assert found.stretches[1].start == pytest.approx(2.0)
    assert found.lost == 6_250


def test_samples_that_are_no_numbers_cut_it_too(tmp_path: Path) -> None:
    made = trace()
    made.stretches[0].pressure[100:150] = np.nan
    write_trace(tmp_path / "nan", made)
    (found,) = load_traces(tmp_path / "nan")
    assert [len(s.current) for s in found.stretches] == [100, 19_850]
    assert found.lost == 50


def test_two_valves_in_a_bag_are_two_traces(tmp_path: Path) -> None:
    write_trace(tmp_path / "a", trace(valve="retract"))
    assert [t.valve for t in load_traces(tmp_path / "a")] == ["retract"]


def test_a_recording_of_the_machine_holds_none(tmp_path: Path) -> None:
    time = np.arange(50) * 0.01
    write(tmp_path / "crane", from_columns("crane", time, {"angle": time, "rate": time}, Configuration("m", 0, 0, 0)))
    assert load_traces(tmp_path / "crane") == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"valve": "left"}, "names the valve 'left'"),
        ({"period": -1.0}, "sample period"),
    ],
)
def test_blocks_that_make_no_sense_are_refused_in_one_line(
    change: dict[str, object], message: str, tmp_path: Path
) -> None:
    if "period" in change:
        made = replace(trace(100), stretches=(replace(trace(100).stretches[0], start=0.0),))
        write_trace(tmp_path / "bad", made, block=1e9)
        _rewrite_period(tmp_path / "bad", tmp_path / "worse")
        with pytest.raises(RecordingError, match=message):
            load_traces(tmp_path / "worse")
        return
    write_trace(tmp_path / "bad", replace(trace(100), **change))  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match=message) as caught:
        load_traces(tmp_path / "bad")
    assert "\n" not in str(caught.value)


def test_overlapping_blocks_are_two_recordings_in_one(tmp_path: Path) -> None:
    made = trace(1_000).stretches[0]
    write_trace(tmp_path / "twice", replace(trace(), stretches=(made, replace(made, start=0.05))))
    with pytest.raises(RecordingError, match="overlap at"):
        load_traces(tmp_path / "twice")


def _rewrite_period(source: Path, target: Path) -> None:
    """The same block with a sample period of zero."""
    from boom_recording import definitions
    from boom_recording.channels import OSCILLOSCOPE
    from boom_recording.mcap_file import McapFile
    from boom_recording.oscilloscope import TYPE

    store = definitions.typestore()
    (file,) = source.glob("*.mcap")
    (batch,) = McapFile(file.read_bytes()).batches()
    first = int(batch.offset[0])
    message = store.deserialize_cdr(batch.data[first : first + int(batch.size[0])].tobytes(), TYPE)
    message.sample_period = 0.0
    text, type_hash = definitions.definition(TYPE)
    with BagWriter(target) as bag:
        number = bag.add_topic(OSCILLOSCOPE, TYPE, text, type_hash)
        bag.write(number, bytes(store.serialize_cdr(message, TYPE)), 1, 1)
