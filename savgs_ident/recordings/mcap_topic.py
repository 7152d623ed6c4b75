"""One topic of an MCAP file while it is being read: its decoder, its bindings, its growing columns."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace
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

    def candidates(self, first: bytes) -> tuple[Candidate, ...]:
        """The fields of a first message that hold numbers."""

    def find(self, field: str, first: bytes) -> str | None:
        """The key of a field as the user wrote it; None if the first message has none."""

    def decode(
        self, block: MessageBlock, keys: Sequence[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64] | None]:
        """Values (n,) by key [unit of the field], and the stamps of the headers [ns], (n,), if there are any."""


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

    def in_order(self, order: NDArray[np.intp]) -> "TopicData":
        """The same samples in another ``order``, (n,)."""
        log = self.log[order]
        return replace(
            self,
            log=log,
            publish=log if self.publish is self.log else self.publish[order],
            header=None if self.header is None else self.header[order],
            values={name: column[order] for name, column in self.values.items()},
        )


class TopicColumns:
    """Grows block by block; ``finish`` hands everything over."""

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
        bindings, notes = bind(candidates, rules, mapped_channels(self._map), self._source)
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
    # What overflows becomes infinite, and the checks say so.
    with np.errstate(over="ignore", invalid="ignore"):
        return raw * binding.gain + binding.bias
