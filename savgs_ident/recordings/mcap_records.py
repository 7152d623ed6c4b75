"""The container of an MCAP file (specification: mcap.dev/spec), read front to back without its index, and JSON in it.

Everything that a message needs stands before it, so neither index nor summary is used: files without them, and
files that end too early, are read the same way. Chunks are decompressed one at a time, and never to more bytes
than they declare. A :class:`Segment` holds the records of a chunk; :func:`message_block` addresses the messages
of one topic in it, and :func:`gather` reads the same field of all of them at once.

Messages in JSON are decoded in :mod:`savgs_ident.recordings.mcap_json`, those of ROS 2 in
:mod:`savgs_ident.recordings.cdr`.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Schema
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError, SavgsIdentError
from savgs_ident.recordings.channels import Progress

MAGIC = b"\x89MCAP0\r\n"
LARGEST_CHUNK = 1 << 27
"""Bytes that one chunk may expand to. Writers use about 1 MiB: more is a mistake or an attack."""
_HEAD = struct.Struct("<BQ")
_RECORD = struct.Struct("<BQH")
_CHUNK = struct.Struct("<QQQII")
_LOG_TIME_AT = 15
_MESSAGE_FIELDS = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log", "<i8"),
        ("publish", "<i8"),
    ]
)
_LOG_TIME = struct.Struct("<Q")
_MESSAGE_HEAD = 22
"""Bytes of a message record's content before its payload: channel, sequence, log and publish time."""
_LOOSE_BLOCK = 1 << 20
_BROKEN = (McapError, struct.error, UnicodeDecodeError, RuntimeError, EOFError, zstandard.ZstdError)


@dataclass(frozen=True)
class Segment:
    """Decompressed records back to back: new schemas and channels, and where each channel's messages are.

    ``messages[channel id]`` holds the offsets of the message records in ``data``.
    """

    data: bytes
    schemas: tuple[Schema, ...]
    channels: tuple[McapChannel, ...]
    messages: dict[int, list[int]]


class McapRecords:
    """Iterate to get :class:`Segment` after segment; ``warnings`` grows as damage is found."""

    def __init__(self, path: Path, progress: Progress) -> None:
        self.path = path
        self.progress = progress
        self.warnings: list[DataWarning] = []
        self._ends_early = False
        self._first_log = 0
        self._last_log = 0

    def __iter__(self) -> Iterator[Segment]:
        size = self.path.stat().st_size
        with self.path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise InputError(
                    "is not an MCAP file (its first bytes are others)",
                    source=self.path,
                    remedy="give an MCAP or CSV file",
                )
            for data in self._payloads(stream, size):
                yield self._segment_of(data)
        if self._ends_early:
            self.warnings.append(self._truncated())

    def _payloads(self, stream: BinaryIO, size: int) -> Iterator[bytes]:
        """Decompressed chunks, and the records outside chunks in blocks."""
        loose = bytearray()
        while True:
            head = stream.read(_HEAD.size)
            if len(head) < _HEAD.size:
                self._ends_early = True
                break
            opcode, length = _HEAD.unpack(head)
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                break
            if length > size - stream.tell():
                self._ends_early = True
                break
            if opcode == Opcode.CHUNK:
                if loose:
                    yield bytes(loose)
                    loose.clear()
                yield self._unpack_chunk(stream.read(length))
                self.progress(stream.tell() / size)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                loose += head
                loose += stream.read(length)
                if len(loose) > _LOOSE_BLOCK:
                    yield bytes(loose)
                    loose.clear()
                    self.progress(stream.tell() / size)
            else:
                stream.seek(length, 1)
        yield bytes(loose)
        self.progress(1.0)

    def _truncated(self) -> DataWarning:
        return DataWarning(
            "truncated_file",
            "the file ends too early, the whole chunks and messages before that are used",
            source=str(self.path),
            time=(self._last_log - self._first_log) * 1e-9,
            remedy="copy the file again, or run `mcap recover`",
        )

    def _unpack_chunk(self, body: bytes) -> bytes:
        """The records of a chunk, or nothing with a warning where the chunk is damaged."""
        try:
            start, end, declared, crc, name_length = _CHUNK.unpack_from(body)
            at = _CHUNK.size + name_length
            compression = body[_CHUNK.size : at].decode()
            (stored,) = struct.unpack_from("<Q", body, at)
            packed = body[at + 8 : at + 8 + stored]
            self._check_size(declared, start)
            data = self._decompress(packed, compression, declared)
        except _BROKEN as error:
            self._damaged(str(error) or type(error).__name__)
            return b""
        if len(data) != declared:
            self._damaged(f"{len(data)} bytes instead of {declared}, from {start} to {end} ns")
        elif crc and zlib.crc32(data) != crc:
            self._damaged(f"checksum wrong, from {start} to {end} ns")
        else:
            return data
        return b""

    def _check_size(self, declared: int, start: int) -> None:
        if declared > LARGEST_CHUNK:
            raise InputError(
                f"the chunk from {start} ns declares {declared} bytes, more than {LARGEST_CHUNK}",
                source=self.path,
                remedy="rewrite the file with chunks of a few MiB: `mcap compress`",
            )

    def _decompress(self, packed: bytes, compression: str, declared: int) -> bytes:
        """At most ``declared`` + 1 bytes, whatever size the stream itself declares."""
        if compression == "":
            return packed
        if compression == "zstd":
            with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(packed) as reader:
                return reader.read(declared + 1)
        if compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=declared + 1))
        raise InputError(
            f"a chunk is compressed with '{compression}', which is not known",
            source=self.path,
            remedy="rewrite the file with zstd, lz4 or none: `mcap compress`",
        )

    def _damaged(self, reason: str) -> None:
        self.warnings.append(
            DataWarning(
                "damaged_chunk",
                f"a chunk is damaged and left out ({reason})",
                source=str(self.path),
                remedy="copy the file again, or run `mcap recover`",
            )
        )

    def _segment_of(self, data: bytes) -> Segment:
        schemas: list[Schema] = []
        channels: list[McapChannel] = []
        messages: dict[int, list[int]] = {}
        position, size = 0, len(data)
        unpack, smallest, message = _RECORD.unpack_from, _RECORD.size, int(Opcode.MESSAGE)
        while position + smallest <= size:
            opcode, length, channel_id = unpack(data, position)
            end = position + 9 + length
            # There is no opcode 0: these are zeros, and millions of them in a chunk of little else.
            if end > size or not opcode:
                break
            if opcode == message:
                if length < _MESSAGE_HEAD:
                    break
                try:
                    messages[channel_id].append(position)
                except KeyError:
                    messages[channel_id] = [position]
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._definition(opcode, data[position + 9 : end], schemas, channels)
            position = end
        if position != size:
            self._damaged("its records do not fill it")
        if messages:
            self._note_times(data, messages)
        return Segment(data, tuple(schemas), tuple(channels), messages)

    def _note_times(self, data: bytes, messages: dict[int, list[int]]) -> None:
        first, last = min(at[0] for at in messages.values()), max(at[-1] for at in messages.values())
        (self._last_log,) = _LOG_TIME.unpack_from(data, last + _LOG_TIME_AT)
        if not self._first_log:
            (self._first_log,) = _LOG_TIME.unpack_from(data, first + _LOG_TIME_AT)

    def _definition(
        self, opcode: int, body: bytes, schemas: list[Schema], channels: list[McapChannel]
    ) -> None:
        try:
            if opcode == Opcode.SCHEMA:
                schemas.append(Schema.read(ReadDataStream(BytesIO(body))))
            else:
                channels.append(McapChannel.read(ReadDataStream(BytesIO(body))))
        except _BROKEN as error:
            raise InputError(
                f"a schema or channel record is damaged ({str(error) or type(error).__name__})",
                source=self.path,
                remedy="copy the file again, or run `mcap recover`",
            ) from error


class DecodeError(SavgsIdentError):
    """A message that cannot be decoded: the reason and its index in the block; the reader adds topic and time."""

    def __init__(self, why: str, index: int = 0) -> None:
        super().__init__(why)
        self.index = index


@dataclass(frozen=True)
class MessageBlock:
    """``data`` holds the message records; payload i is ``data[starts[i]:stops[i]]``; times [ns], (n,)."""

    data: bytes
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]
    log: NDArray[np.int64]
    publish: NDArray[np.int64]

    def payload(self, index: int) -> bytes:
        """The bytes of one message."""
        return self.data[self.starts[index] : self.stops[index]]


def gather(data: bytes, positions: NDArray[np.int64], code: str) -> NDArray[Any]:
    """The numbers of type ``code`` that begin at ``positions``, aligned or not, shape (n,)."""
    kind = np.dtype(code)
    raw = np.frombuffer(data, dtype=np.uint8)
    picked: NDArray[Any] = raw[positions[:, None] + np.arange(kind.itemsize)]
    return picked.view(kind).ravel()


def message_block(data: bytes, records: NDArray[np.int64]) -> MessageBlock:
    """The messages whose records begin at ``records`` (n,) in ``data``."""
    heads = np.frombuffer(data, dtype=np.uint8)[records[:, None] + np.arange(_HEAD.size + _MESSAGE_HEAD)]
    fields = heads.view(_MESSAGE_FIELDS)[:, 0]
    starts = records + _HEAD.size + _MESSAGE_HEAD
    stops = starts + fields["length"].astype(np.int64) - _MESSAGE_HEAD
    return MessageBlock(data, starts, stops, fields["log"].copy(), fields["publish"].copy())
