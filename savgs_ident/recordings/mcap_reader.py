"""MCAP campaigns: JSON or ROS 2 CDR topics, each with its own clock, cut into tests by their events.

Chunked or not, compressed with zstd, lz4 or not at all, with index and summary or without. A topic is used if
the channel map names it, or if it is a usual one: a field or Float64 topic with a usual name, the vertical
axis of ``sensor_msgs/Imu``, the single link in ``sensor_msgs/JointState``.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.records import Channel as McapChannel
from mcap.records import Schema
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.binding import Binding, ambiguous
from savgs_ident.recordings.channel_map import ChannelMap
from savgs_ident.recordings.clock import choose_clock
from savgs_ident.recordings.epoch import unix_time
from savgs_ident.recordings.events import Event, Span, looks_like_events, parse_event, spans_of
from savgs_ident.recordings.kinds import kind_of
from savgs_ident.recordings.mcap_records import MAGIC, McapRecords, Segment
from savgs_ident.recordings.mcap_topic import TopicColumns, TopicData, decoder_for
from savgs_ident.recordings.message_block import DecodeError, message_block
from savgs_ident.recordings.reading import Progress, Reader, Reading
from savgs_ident.recordings.recording import CANONICAL_UNITS, Channel, Recording


def read_mcap(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one MCAP file; raises :class:`InputError` where nothing in it can be used."""
    gathering = _Gathering(channel_map, str(path))
    records = McapRecords(path, progress)
    for segment in records:
        gathering.append(segment)
    warnings = [*records.warnings, *gathering.warnings()]
    topics = gathering.topics(warnings)
    spans, notes = spans_of(gathering.events, str(path))
    recordings, told = _cut_into_tests(topics, spans, channel_map, path)
    return Reading(recordings, (*warnings, *notes, *told))


MCAP = Reader(name="MCAP", suffixes=(".mcap",), magic=(MAGIC,), plain_text=False, read=read_mcap)


class _Gathering:
    """Takes segments, sends the messages to the columns of their topic or to the events."""

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
                decoder = decoder_for(channel, self._schemas.get(channel.schema_id))
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
        """What binding the topics, and refusing some, had to say."""
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
                rival = best.get(binding.channel)
                if rival is not None and rival.exact == binding.exact:
                    raise ambiguous(binding.channel, rival.label, binding.label, self._source)
                if rival is None or binding.exact:
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
                raise InputError(
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
        told = f" ({cut[0]})" if cut else f" ({reasons})" if reasons else ""
        return InputError(
            f"no topic carries a known channel{told}; topics: {self._listed()}",
            source=self._source,
            remedy="copy the file again"
            if cut
            else "map topics to " + ", ".join(CANONICAL_UNITS) + " in channels.toml",
        )


def _cut_into_tests(
    topics: tuple[TopicData, ...], spans: tuple[Span, ...], channel_map: ChannelMap, path: Path
) -> tuple[tuple[Recording, ...], tuple[DataWarning, ...]]:
    """The channels of every test, with time from its start [s]; samples outside every test are dropped."""
    source = str(path)
    times: list[NDArray[np.int64]] = []
    warnings: list[DataWarning] = []
    for data in topics:
        choice = choose_clock(
            data.log, data.publish, data.header, topic=data.topic, source=source, forced=channel_map.clock
        )
        times.append(choice.time)
        warnings.extend(choice.warnings)
    if not spans:
        start = min(int(time.min()) for time in times)
        spans = (Span(path.stem, start, None, None),)
    recordings = []
    for span in spans:
        channels: dict[str, Channel] = {}
        for data, time in zip(topics, times, strict=True):
            channels |= _channels_within(span, data, time)
        kind, named = kind_of(span.name)
        frequency = span.frequency_hz if span.frequency_hz is not None else named
        kind = "dwell" if kind == "other" and frequency is not None else kind
        frequency = frequency if kind == "dwell" else None
        recordings.append(Recording(span.name, kind, frequency, channels, unix_time(1e-9 * span.start)))
    return tuple(recordings), tuple(warnings)


def _channels_within(span: Span, data: TopicData, time: NDArray[np.int64]) -> dict[str, Channel]:
    inside = time >= span.start
    if span.stop is not None:
        inside &= time <= span.stop
    picked = np.flatnonzero(inside)
    if picked.size == 0:
        return {}
    whole = slice(int(picked[0]), int(picked[-1]) + 1)
    contiguous = whole.stop - whole.start == picked.size
    clock = 1e-9 * (time[whole if contiguous else picked] - span.start).astype(np.float64)
    return {
        binding.channel: Channel(
            binding.channel,
            CANONICAL_UNITS[binding.channel],
            clock,
            data.values[binding.channel][whole if contiguous else picked],
            binding.label,
        )
        for binding in data.bindings
    }
