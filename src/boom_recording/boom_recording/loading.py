"""Loads a bag: files -> messages -> named signals with units, masked where they are wrong, with a list of what is."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from boom_input.channels import CHANNELS, ESSENTIAL_TOPICS, JOINT_NAMES, MEASURED_TOPICS, PREDICTED, SENSOR_TOPICS
from boom_input.shown import quoted
from boom_recording import bag_folder, defects, defects_stamps, defects_stuck
from boom_recording.bag_reader import BagReader
from boom_recording.channels import DEFAULT_JOINT, MACHINE_CONFIGURATION
from boom_recording.defects import StampedEvent, TopicSamples
from boom_recording.errors import RecordingError
from boom_recording.mcap_records import Damage
from boom_recording.recording import GivenConfiguration, Recording, Signal

REQUIRED = (*ESSENTIAL_TOPICS, MACHINE_CONFIGURATION)
_MANY_DAMAGES = 8
_UNRELATED_NS = 3600 * 10**9


def load(
    path: str | Path, *, require: Iterable[str] = REQUIRED, joint: str = DEFAULT_JOINT, check: bool = True,
    given: GivenConfiguration | None = None, joints: Mapping[str, str] = JOINT_NAMES,
) -> Recording:  # fmt: skip
    """Load the bag at `path`: a rosbag2 directory or a bare .mcap file.

    require   topics that must be there; the rest is optional. Default: angle, currents and configuration. Where the configuration
              is asked for, a sensor that was not recorded is a signal without valid samples, and a note
    joint     name of the boom's joint in /joint_states
    joints    names there of the other joints, by the keys of `boom_input.channels.JOINT_NAMES`
    given     pose and load that replace the recorded ones; a bag without a configuration then needs none
    check     False: values and stamps are taken as they are (only the order of stamps is held)

    Raises RecordingError, one line that begins with the path, where a required topic is missing or of another type,
    where two machines are in one bag, or where there is no bag. What can still be read of a damaged file is read;
    `Recording.warnings` says what is lost.
    """
    path = Path(path)
    bag = bag_folder.find(path)
    try:
        reader = BagReader(joint, {**JOINT_NAMES, **joints})
        return _load(path, bag, tuple(require), reader, check, given or GivenConfiguration())
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None


def _load(
    path: Path, bag: bag_folder.BagFiles, require: tuple[str, ...], reader: BagReader, check: bool,
    given: GivenConfiguration,
) -> Recording:  # fmt: skip
    damages: list[Damage] = []
    for file in bag.files:
        try:
            damages += reader.read(file)
        except RecordingError as error:
            raise RecordingError(f"{file.name}: {error}" if len(bag.files) > 1 else str(error)) from None
    whole = MACHINE_CONFIGURATION in require
    if given.complete():
        require = tuple(topic for topic in require if topic != MACHINE_CONFIGURATION)
    reader.demand(require, damages, bag_folder.import_line(path))
    topics = reader.samples()
    sensors = [samples for samples in topics.values() if samples.topic in SENSOR_TOPICS] or list(topics.values())
    if not sensors:
        raise RecordingError("none of the topics that are asked for holds a sample: record again, or give another bag")
    raw = _check_stamps(topics, sensors) if check else _put_in_order(topics)
    for samples in topics.values():
        for valid in samples.valid.values():
            valid &= samples.timed
    start_ns, end_ns = _span(sensors)
    if check:
        _check_values(topics, raw, start_ns, end_ns)
    events = [event for topic, found in raw.items() for event in defects.in_seconds(topic, found, start_ns)]
    signals = _signals(topics, start_ns)
    absent = _absent(signals) if whole else {}
    signals |= absent
    recording = Recording(
        name=bag.name,
        path=path,
        start_ns=start_ns,
        duration=(end_ns - start_ns) / 1e9,
        signals=signals,
        events=sorted(events, key=lambda event: (event.start_s, event.topic, event.kind)),
        notes=sorted({*reader.notes, *(f"{name} was not recorded" for name in absent)}),
        stored_configuration=given.over(reader.configuration()),
    )
    recording.warnings = bag.warnings + _losses(damages, reader, bag, recording) + reader.unstamped
    return recording


def _check_stamps(topics: dict[str, TopicSamples], sensors: list[TopicSamples]) -> dict[str, list[StampedEvent]]:
    bounds = defects_stamps.together(np.concatenate([samples.stamps_ns for samples in sensors]))
    return {
        samples.topic: [*defects_stamps.check_far(samples, *bounds), *defects_stamps.check_stamps(samples)]
        for samples in topics.values()
    }


def _put_in_order(topics: dict[str, TopicSamples]) -> dict[str, list[StampedEvent]]:
    """What is done unchecked: stamps that repeat or go back are masked, and not told."""
    for samples in topics.values():
        defects_stamps.unordered(samples)
    return {}


def _check_values(
    topics: dict[str, TopicSamples], raw: dict[str, list[StampedEvent]], start_ns: int, end_ns: int
) -> None:
    """Add to `raw` what is missing, impossible or stuck."""
    for samples in topics.values():
        if samples.topic in MEASURED_TOPICS:
            raw[samples.topic] += defects.check_missing(samples, start_ns, end_ns, raw[samples.topic])
        raw[samples.topic] += defects.check_values(samples)
    for topic, found in defects_stuck.check_stuck(topics).items():
        raw[topic] += found


def _signals(topics: dict[str, TopicSamples], start_ns: int) -> dict[str, Signal]:
    result: dict[str, Signal] = {}
    for channel in CHANNELS:
        samples = topics.get(channel.topic)
        if samples is None or channel.name not in samples.values:
            continue
        time = (samples.stamps_ns - start_ns) / 1e9
        values, valid = samples.values[channel.name], samples.valid[channel.name]
        result[channel.name] = Signal(channel.name, channel.unit, channel.topic, samples.stamps_ns, time, values, valid)
    return result


def _absent(signals: dict[str, Signal]) -> dict[str, Signal]:
    """Signals of the sensors that were not recorded: NaN, never valid, at the stamps of their topic if it was recorded."""
    result = {}
    for sensor in (sensor for sensor in PREDICTED if sensor.name not in signals):
        beside = next((s.stamps_ns for s in signals.values() if s.topic == sensor.topic), np.zeros(0, np.int64))
        time = next((s.time for s in signals.values() if s.topic == sensor.topic), np.zeros(0))
        nothing = np.full(len(beside), np.nan)
        never = np.zeros(len(beside), bool)
        result[sensor.name] = Signal(sensor.name, sensor.unit, sensor.topic, beside, time, nothing, never)
    return result


def _span(sensors: list[TopicSamples]) -> tuple[int, int]:
    """First and last stamp [ns] over the sensor topics. Raises RecordingError where their clocks are unrelated."""
    firsts, lasts = [], []
    for samples in sensors:
        stamps = samples.stamps_ns[samples.timed]
        firsts.append(int(stamps[0]))
        lasts.append(int(stamps[-1]))
    for samples, first, last in zip(sensors, firsts, lasts, strict=True):
        if first - min(lasts) > _UNRELATED_NS or max(firsts) - last > _UNRELATED_NS:
            other = next(s.topic for s in sensors if s is not samples)
            raise RecordingError(
                f"the stamps of {samples.topic} lie more than an hour from those of {other}: "
                "synchronise the clocks of the senders and record again"
            )
    return min(firsts), max(lasts)


def _losses(damages: list[Damage], reader: BagReader, bag: bag_folder.BagFiles, recording: Recording) -> list[str]:
    """Sentences on what of the files was not read, with times since the start of the recording."""
    sentences = [_damage(damage, recording.start_ns) for damage in damages[:_MANY_DAMAGES]]
    if len(damages) > _MANY_DAMAGES:
        sentences.append(f"{len(damages) - _MANY_DAMAGES} more parts of the file are damaged")
    missing = 0 if bag.promised_messages is None else bag.promised_messages - reader.messages
    if reader.missing > 0 or (missing > 0 and not reader.cut):
        who = "the file's index" if reader.missing >= missing else "metadata.yaml"
        promised = max(missing, reader.missing) + reader.messages
        sentences.append(f"{max(missing, reader.missing)} of the {promised} messages that {who} counts are lost")
    if reader.cut:
        sentences.append(_cut(bag, missing, recording.duration))
    for topic, column in reader.columns.items():
        if column.unreadable:
            sentences.append(
                f"{column.unreadable} messages of {topic} cannot be read ({quoted(column.reason)}) and are left out"
            )
    if reader.unknown:
        sentences.append(f"{reader.unknown} messages belong to no topic that the file declares and are left out")
    return sentences


def _damage(damage: Damage, start_ns: int) -> str:
    def at(nanoseconds: int | None) -> str:
        return "an unknown time" if nanoseconds is None else f"{max(0.0, (nanoseconds - start_ns) / 1e9):.1f} s"

    if not damage.loss:
        return damage.what
    if damage.end_ns is None:
        return f"{damage.what}: what follows {at(damage.start_ns)} is lost"
    return f"{damage.what}: {damage.loss} from {at(damage.start_ns)} to {at(damage.end_ns)} are lost"


def _cut(bag: bag_folder.BagFiles, missing: int, duration: float) -> str:
    text = (
        f"cut at {duration:.1f} s: the file was not closed (recorder killed or still running, or copied only in part)"
    )
    if bag.promised_duration_s is None or bag.promised_messages is None:
        return text + "; what followed is lost"
    promise = f"; metadata.yaml promises {bag.promised_duration_s:.1f} s, "
    return text + promise + f"{max(missing, 0)} of {bag.promised_messages} messages are lost"
