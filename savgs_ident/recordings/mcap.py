"""MCAP campaigns: JSON or ROS 2 CDR topics, each with its own clock, cut into tests by their events.

A file may be chunked or not, compressed with zstd, lz4 or not at all, with index and summary or without. A topic is
used if the channel map names it, or if it is a usual one: a field or Float64 topic with a usual name, the vertical
axis of ``sensor_msgs/Imu``, the single link in ``sensor_msgs/JointState``.

Segments of the container go to ``_TopicCollector``, which keeps a :class:`TopicColumns` for each topic: its
decoder, its bindings, its growing columns. At the end each topic gets its clock and is cut into tests.
"""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from mcap.records import Channel as McapChannel
from mcap.records import Schema
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.threads import one_ahead
from savgs_ident.recordings.cdr import CdrDecoder
from savgs_ident.recordings.channels import (
    AbsentSignalError,
    Binding,
    ChannelMap,
    Progress,
    Reader,
    Reading,
    SignalCandidate,
    ambiguous,
    bind,
)
from savgs_ident.recordings.mcap_json import JsonDecoder
from savgs_ident.recordings.mcap_records import (
    MAGIC,
    DecodeError,
    McapRecords,
    MessageBlock,
    Segment,
    message_block,
)
from savgs_ident.recordings.mcap_timing import (
    Event,
    looks_like_events,
    pair_events,
    parse_event,
)
from savgs_ident.recordings.mcap_topics import TopicData, split_tests
from savgs_ident.recordings.recording import (
    RecordingLayout,
)


def read_mcap(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one MCAP file; raises :class:`InputError` where nothing in it can be used."""
    records = McapRecords(path, progress)
    with closing(one_ahead(records)) as segments:
        return reading_of_segments(path, segments, records.warnings, channel_map)


def reading_of_segments(
    path: Path, segments: Iterable[Segment], damage: Sequence[DataWarning], channel_map: ChannelMap
) -> Reading:
    """The reading of the messages in ``segments``; ``damage`` has the warnings that came up while they were read."""
    collector = _TopicCollector(channel_map, str(path))
    for segment in segments:
        collector.append(segment)
    warnings = [*damage, *collector.warnings()]
    topics = collector.topics(warnings)
    spans, notes = pair_events(collector.events, str(path))
    recordings, clock_notes = split_tests(topics, spans, channel_map, path)
    return Reading(recordings, (*warnings, *notes, *clock_notes))


MCAP = Reader(name="MCAP", suffixes=(".mcap",), magic=(MAGIC,), plain_text=False, read=read_mcap)
_AT_ONCE = 16384


class Decoder(Protocol):
    """Turns the messages of one topic into numbers."""

    notes: tuple[DataWarning, ...]

    def candidates(self, first: bytes) -> tuple[SignalCandidate, ...]:
        """The fields of a first message that hold numbers."""

    def find(self, field: str, first: bytes) -> str | None:
        """The key of a field as the user wrote it; None if the first message has none."""

    def decode(
        self, block: MessageBlock, keys: Sequence[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64] | None]:
        """Values (n,) by key [unit of the field], and the stamps of the headers [ns], (n,), if there are any."""


def choose_decoder(channel: McapChannel, schema: Schema | None, layout: RecordingLayout) -> Decoder:
    """The decoder of a topic; raises :class:`DecodeError` with the reason where there is none."""
    if channel.message_encoding == "json":
        return JsonDecoder(channel.topic, schema.data if schema else b"{}")
    if channel.message_encoding != "cdr":
        raise DecodeError(f"its message encoding '{channel.message_encoding}' is not read (json and cdr are)")
    if schema is None:
        raise DecodeError("its schema is missing from the file")
    if schema.encoding != "ros2msg":
        raise DecodeError(f"its schema encoding '{schema.encoding}' is not read (ros2msg is)")
    definition = schema.data.decode("utf-8", errors="replace")
    return CdrDecoder(channel.topic, schema.name, definition, layout)


class TopicColumns:
    """The columns of a topic while it is read; they grow block by block until ``finish``."""

    def __init__(self, topic: str, decoder: Decoder, channel_map: ChannelMap, source: str) -> None:
        self.topic = topic
        self.bindings: tuple[Binding, ...] | None = None
        self.warnings: tuple[DataWarning, ...] = ()
        self._decoder = decoder
        self._map = channel_map
        self._source = source
        # array.array grows in place: it needs the memory once, where lists of blocks would need it twice.
        self._log = array("q")
        self._publish: array[int] | None = None
        self._header: array[int] | None = array("q")
        self._values: dict[str, array[float]] = {}

    def append(self, data: bytes, records: list[int]) -> None:
        """Decode the messages at ``records``; raises :class:`InputError` at the first bad one."""
        if self.bindings is not None and not self.bindings:
            return
        for at in range(0, len(records), _AT_ONCE):
            block = message_block(data, np.array(records[at : at + _AT_ONCE], dtype=np.int64))
            try:
                self._append(block)
            except DecodeError as error:
                raise InputError(
                    str(error),
                    source=self._source,
                    channel=self.topic,
                    time=float(block.log[error.index]) * 1e-9,
                    remedy="record again, or leave this topic out of the file: `mcap filter`",
                ) from error

    def _append(self, block: MessageBlock) -> None:
        if self.bindings is None:
            self.bindings = self._bind(block.payload(0))
            self._values = {binding.channel: array("d") for binding in self.bindings}
        if not self.bindings:
            return
        values, stamps = self._decoder.decode(block, [binding.key for binding in self.bindings])
        for binding in self.bindings:
            self._values[binding.channel].frombytes(_converted(values[binding.key], binding).tobytes())
        if self._publish is None and not np.array_equal(block.log, block.publish):
            self._publish = array("q", self._log)
        if self._publish is not None:
            self._publish.frombytes(block.publish.tobytes())
        self._log.frombytes(block.log.tobytes())
        if stamps is None:
            self._header = None
        elif self._header is not None:
            self._header.frombytes(stamps.tobytes())

    def _bind(self, first: bytes) -> tuple[Binding, ...]:
        candidates = self._decoder.candidates(first)
        rules = []
        for rule in self._map.rules:
            if rule.topic != self.topic:
                continue
            wanted = rule.field or "data"
            key = self._decoder.find(wanted, first)
            if key is None:
                raise InputError(
                    f"channels.toml names field '{wanted}', the messages do not have it",
                    source=self._source,
                    channel=rule.channel,
                    remedy="the fields are " + ", ".join(c.key for c in candidates[:20]),
                )
            rules.append((rule, key))
        bindings, notes = bind(candidates, rules, self._map, self._source)
        self.warnings = notes + self._decoder.notes
        return bindings

    def finish(self) -> TopicData:
        """The whole columns, in order of log time (the order of the file where that is the same)."""
        log = np.frombuffer(self._log, dtype=np.int64)
        publish = log if self._publish is None else np.frombuffer(self._publish, dtype=np.int64)
        header = None if self._header is None else np.frombuffer(self._header, dtype=np.int64)
        values = {name: np.frombuffer(column, dtype=np.float64) for name, column in self._values.items()}
        data = TopicData(self.topic, self.bindings or (), log, publish, header, values)
        return data if np.all(log[1:] >= log[:-1]) else data.in_order(np.argsort(log, kind="stable"))


def _converted(raw: NDArray[np.float64], binding: Binding) -> NDArray[np.float64]:
    # An overflow becomes infinite, which the checks report.
    with np.errstate(over="ignore", invalid="ignore"):
        return raw * binding.gain + binding.bias


class _TopicCollector:
    """Distributes the messages of the segments to the columns of their topic, or to the events."""

    def __init__(self, channel_map: ChannelMap, source: str) -> None:
        self.events: list[Event] = []
        self._map = channel_map
        self._source = source
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, McapChannel] = {}
        self._columns: dict[str, TopicColumns] = {}
        self._refused: dict[str, str] = {}

    def append(self, segment: Segment) -> None:
        """Decode one segment."""
        self._schemas |= {schema.id: schema for schema in segment.schemas}
        self._channels |= {channel.id: channel for channel in segment.channels}
        for channel_id, records in segment.messages.items():
            channel = self._channels.get(channel_id)
            if channel is None:
                raise InputError(
                    f"has messages of channel {channel_id}, which it does not describe",
                    source=self._source,
                    remedy="copy the file again, or run `mcap recover`",
                )
            if self._is_events(channel):
                self._append_events(channel, segment.data, records)
            elif channel.topic not in self._refused:
                self._append_samples(channel, segment.data, records)

    def _is_events(self, channel: McapChannel) -> bool:
        if self._map.test_topic is not None:
            return channel.topic == self._map.test_topic
        return looks_like_events(channel.topic) and channel.message_encoding in ("json", "cdr")

    def _append_events(self, channel: McapChannel, data: bytes, records: list[int]) -> None:
        block = message_block(data, np.array(records, dtype=np.int64))
        for index in range(block.log.size):
            event = parse_event(block.payload(index), channel.message_encoding, int(block.log[index]))
            if event is not None:
                self.events.append(event)

    def _append_samples(self, channel: McapChannel, data: bytes, records: list[int]) -> None:
        columns = self._columns.get(channel.topic)
        if columns is None:
            try:
                decoder = choose_decoder(channel, self._schemas.get(channel.schema_id), self._map.layout)
            except DecodeError as error:
                self._refuse(channel.topic, str(error))
                return
            columns = TopicColumns(channel.topic, decoder, self._map, self._source)
            self._columns[channel.topic] = columns
        columns.append(data, records)

    def _refuse(self, topic: str, why: str) -> None:
        self._refused[topic] = why
        for rule in self._map.rules:
            if rule.topic == topic:
                raise InputError(
                    f"topic '{topic}' cannot be read: {why}",
                    source=self._source,
                    channel=rule.channel,
                    remedy="record it as JSON or ROS 2 CDR with its schema",
                )

    def warnings(self) -> Iterator[DataWarning]:
        """The warnings of binding the topics, and of the topics left out."""
        for columns in self._columns.values():
            for warning in columns.warnings:
                yield replace(warning, source=self._source)
        for topic, why in self._refused.items():
            yield DataWarning(
                "unread_topic",
                f"the topic is left out: {why}",
                source=self._source,
                channel=topic,
                remedy="record it as JSON or ROS 2 CDR with its schema, if it is needed",
            )

    def topics(self, warnings: list[DataWarning]) -> tuple[TopicData, ...]:
        """The topics that carry channels, each channel once."""
        self._check_rules()
        used = [columns for columns in self._columns.values() if columns.bindings]
        if not used:
            raise self._no_channel(warnings)
        best: dict[str, Binding] = {}
        for columns in used:
            for binding in columns.bindings or ():
                earlier = best.get(binding.channel)
                if earlier is not None and earlier.exact == binding.exact:
                    raise ambiguous(binding.channel, earlier.label, binding.label, self._source)
                if earlier is None or binding.exact:
                    best[binding.channel] = binding
        kept = []
        for columns in used:
            data = columns.finish()
            bindings = tuple(b for b in data.bindings if best[b.channel] is b)
            if bindings:
                values = {b.channel: data.values[b.channel] for b in bindings}
                kept.append(replace(data, bindings=bindings, values=values))
        return tuple(kept)

    def _check_rules(self) -> None:
        for rule in self._map.rules:
            if rule.topic is not None and rule.topic not in self._columns:
                raise AbsentSignalError(
                    f"channels.toml names topic '{rule.topic}', the file has no message on it",
                    source=self._source,
                    channel=rule.channel,
                    remedy="the topics are " + self._listed(),
                )

    def _listed(self) -> str:
        return ", ".join(sorted({channel.topic for channel in self._channels.values()})[:20]) or "none"

    def _no_channel(self, warnings: list[DataWarning]) -> InputError:
        cut = [warning.what for warning in warnings if warning.code in ("truncated_file", "damaged_chunk")]
        reasons = "; ".join(f"{topic}: {why}" for topic, why in list(self._refused.items())[:5])
        reason = f" ({cut[0]})" if cut else f" ({reasons})" if reasons else ""
        return InputError(
            f"no topic carries a known channel{reason}; topics: {self._listed()}",
            source=self._source,
            remedy="copy the file again"
            if cut
            else "map topics to " + ", ".join(self._map.layout.names) + " in channels.toml",
        )
