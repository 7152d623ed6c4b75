"""One topic of an MCAP file while it is being read: its decoder, its bindings, its growing columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from mcap.records import Channel as McapChannel
from mcap.records import Schema
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.binding import Binding, Candidate, bind, mapped_channels
from savgs_ident.recordings.cdr_decoder import CdrDecoder
from savgs_ident.recordings.channel_map import ChannelMap
from savgs_ident.recordings.json_decoder import JsonDecoder
from savgs_ident.recordings.message_block import DecodeError, MessageBlock, message_block

_AT_ONCE = 16384


class Decoder(Protocol):
    """Turns the messages of one topic into numbers."""

    notes: tuple[DataWarning, ...]

    def candidates(self, first: bytes) -> tuple[Candidate, ...]: ...

    def find(self, field: str, first: bytes) -> str | None: ...

    def decode(
        self, block: MessageBlock, keys: Sequence[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64] | None]: ...


def decoder_for(channel: McapChannel, schema: Schema | None) -> Decoder:
    """The decoder of a topic; raises :class:`DecodeError` saying why there is none."""
    if channel.message_encoding == "json":
        return JsonDecoder(channel.topic, schema.data if schema else b"{}")
    if channel.message_encoding != "cdr":
        raise DecodeError(f"its message encoding '{channel.message_encoding}' is not read (json and cdr are)")
    if schema is None:
        raise DecodeError("its schema is missing from the file")
    if schema.encoding != "ros2msg":
        raise DecodeError(f"its schema encoding '{schema.encoding}' is not read (ros2msg is)")
    return CdrDecoder(channel.topic, schema.name, schema.data.decode("utf-8", errors="replace"))


@dataclass(frozen=True)
class TopicData:
    """Everything read from a topic: clocks [ns] and channels (SI), all (n,), in order of log time."""

    topic: str
    bindings: tuple[Binding, ...]
    log: NDArray[np.int64]
    publish: NDArray[np.int64]
    header: NDArray[np.int64] | None
    values: dict[str, NDArray[np.float64]]


class TopicColumns:
    """Grows block by block; ``finish`` hands everything over."""

    def __init__(self, topic: str, decoder: Decoder, channel_map: ChannelMap, source: str) -> None:
        self.topic = topic
        self.bindings: tuple[Binding, ...] | None = None
        self.warnings: tuple[DataWarning, ...] = ()
        self._decoder = decoder
        self._map = channel_map
        self._source = source
        self._log: list[NDArray[np.int64]] = []
        self._publish: list[NDArray[np.int64]] = []
        self._header: list[NDArray[np.int64]] | None = []
        self._values: dict[str, list[NDArray[np.float64]]] = {}

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
            self._values = {binding.channel: [] for binding in self.bindings}
        if not self.bindings:
            return
        values, stamps = self._decoder.decode(block, [binding.key for binding in self.bindings])
        for binding in self.bindings:
            self._values[binding.channel].append(values[binding.key] * binding.gain + binding.bias)
        self._log.append(block.log)
        self._publish.append(block.log if np.array_equal(block.log, block.publish) else block.publish)
        if stamps is None:
            self._header = None
        elif self._header is not None:
            self._header.append(stamps)

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
        bindings, notes = bind(candidates, rules, mapped_channels(self._map), self._source)
        self.warnings = notes + self._decoder.notes
        return bindings

    def finish(self) -> TopicData:
        """The whole columns, in order of log time (the order of the file where that is the same)."""
        log = np.concatenate(self._log)
        same = all(one is other for one, other in zip(self._log, self._publish, strict=True))
        publish = log if same else np.concatenate(self._publish)
        header = None if self._header is None else np.concatenate(self._header)
        self._log, self._publish, self._header = [], [], None
        order = None if np.all(np.diff(log) >= 0) else np.argsort(log, kind="stable")
        values = {}
        for channel in tuple(self._values):
            column = np.concatenate(self._values.pop(channel))
            values[channel] = column if order is None else column[order]
        if order is not None:
            publish = publish[order] if publish is not log else log[order]
            header = None if header is None else header[order]
            log = publish if same else log[order]
        return TopicData(self.topic, self.bindings or (), log, publish, header, values)
