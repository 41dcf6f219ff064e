"""Bags again with other chunks, packing and checksums, for the benchmarks that need one of each kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.writer import Writer


def rewrite(file: Path, **options: Any) -> None:
    """Write the messages of an MCAP file into it again, with these options of `mcap.writer.Writer`."""
    with file.open("rb") as stream:
        messages = list(make_reader(stream).iter_messages())
    with file.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start("ros2")
        channels: dict[int, int] = {}
        for schema, channel, message in messages:
            if channel.id not in channels:
                assert schema is not None
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
