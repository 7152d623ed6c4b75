"""MCAP files from topics and messages, in every dress."""

from collections.abc import Iterable, Mapping
from io import BytesIO

from mcap.writer import CompressionType, Writer

Topic = tuple[str, str, str, bytes]
"""Message encoding, and name, encoding and text of the schema; a schema without encoding is left out."""

Message = tuple[str, int, bytes]
"""Topic, time [ns], content."""


def mcap_bytes(
    topics: Mapping[str, Topic],
    messages: Iterable[Message],
    compression: CompressionType = CompressionType.ZSTD,
    chunked: bool = True,
) -> bytes:
    """A whole file with its index."""
    stream = BytesIO()
    writer = Writer(stream, chunk_size=4000, compression=compression, use_chunking=chunked)
    writer.start()
    channels = {}
    for topic, (encoding, name, form, text) in topics.items():
        schema = writer.register_schema(name, form, text) if form else 0
        channels[topic] = writer.register_channel(topic, encoding, schema)
    for topic, time, data in messages:
        if topic in channels:
            writer.add_message(channels[topic], time, data, time)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()
