"""MCAP files: messages, schemas and clocks that are not what they were, and records that do not fit together."""

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO

import lz4.frame
import zstandard
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType
from numpy.random import Generator

from fuzz.mcap_files import Message, Topic, mcap_bytes
from fuzz.mutators import raw, tokens
from fuzz.mutators.tree import damage_json

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
_CHUNK_OPCODE = 6
_SIZES = (0, 1, 1 << 10, 1 << 20, (1 << 30) + 1, 1 << 32, 1 << 63, (1 << 64) - 1)
_TIMES = (0, 1, (1 << 63) - 1, 1 << 63, (1 << 64) - 1, 1_763_715_600_000_000_000)
_NAMES = (
    "",
    "lz4",
    "zstd",
    "brotli",
    "cdr",
    "json",
    "ros2msg",
    "jsonschema",
    "\x1b[31m",
    "x" * 3000,
    "/test",
    "a\nb",
)


@dataclass(frozen=True)
class Parts:
    """What a file is made from."""

    topics: tuple[tuple[str, Topic], ...]
    messages: tuple[Message, ...]


def damage_mcap(content: bytes, random: Generator) -> bytes:
    """A file written anew from parts that are damaged, or one whose records are."""
    match int(random.integers(20)):
        case 0:
            return _bomb(random)
        case 1 | 2 | 3:
            return _damaged_records(content, random)
        case 4 | 5:
            return _damaged_chunk_head(content, random)
    parts = parts_of(content)
    for _ in range(int(random.choice([1, 1, 2, 4]))):
        parts = _WAYS[int(random.integers(len(_WAYS)))](parts, random)
    compressions = list(CompressionType)
    compression = compressions[int(random.integers(len(compressions)))]
    return mcap_bytes(dict(parts.topics), parts.messages, compression, chunked=random.random() < 0.7)


@lru_cache(maxsize=16)
def parts_of(content: bytes) -> Parts:
    """The topics and messages of a good file."""
    topics: dict[str, Topic] = {}
    messages = []
    for schema, channel, message in NonSeekingReader(BytesIO(content)).iter_messages():
        described = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
        topics[channel.topic] = (channel.message_encoding, *described)
        messages.append((channel.topic, message.log_time, message.data))
    return Parts(tuple(topics.items()), tuple(messages))


def _payload(parts: Parts, random: Generator) -> Parts:
    """One message, or every message from one on, with another content."""
    messages = list(parts.messages)
    at = int(random.integers(len(messages)))
    last = at + 1 if random.random() < 0.7 else len(messages)
    spoil = _spoiler(random)
    for place in range(at, last):
        topic, time, data = messages[place]
        messages[place] = (topic, time, spoil(data))
    return replace(parts, messages=tuple(messages))


def _spoiler(random: Generator) -> Callable[[bytes], bytes]:
    match int(random.integers(4)):
        case 0:
            token = tokens.JSON[int(random.integers(len(tokens.JSON)))].encode()
            return lambda data: token
        case 1:
            way = raw.RAW[int(random.integers(len(raw.RAW)))]
            return lambda data: way(data, random)
        case 2:
            return lambda data: data + data
    return lambda data: damage_json(data, random) if data.startswith(b"{") else raw.set_bytes(data, random)


def _schema(parts: Parts, random: Generator) -> Parts:
    at = int(random.integers(len(parts.topics)))
    topic, (encoding, name, form, text) = parts.topics[at]
    match int(random.integers(7)):
        case 0:
            text = raw.RAW[int(random.integers(len(raw.RAW)))](text, random)
        case 1:
            text = tokens.JSON[int(random.integers(len(tokens.JSON)))].encode()
        case 2:
            text = damage_json(text, random) if text.startswith(b"{") else text.replace(b"float64", b"uint8")
        case 3:
            encoding = _NAMES[int(random.integers(len(_NAMES)))]
        case 4:
            form = _NAMES[int(random.integers(len(_NAMES)))]
        case 5:
            text = text.replace(b"[]", b"[4294967295]").replace(b"string", b"float64[1000000000]")
        case _:
            name = _NAMES[int(random.integers(len(_NAMES)))]
    topics = (*parts.topics[:at], (topic, (encoding, name, form, text)), *parts.topics[at + 1 :])
    return replace(parts, topics=topics)


def _topic(parts: Parts, random: Generator) -> Parts:
    """A topic of another name; it may be that of another one."""
    at = int(random.integers(len(parts.topics)))
    old, described = parts.topics[at]
    names = (*_NAMES, *(name for name, _ in parts.topics), "/road_height", "/events")
    new = names[int(random.integers(len(names)))]
    topics = (*parts.topics[:at], (new, described), *parts.topics[at + 1 :])
    return Parts(
        topics, tuple((new if topic == old else topic, time, data) for topic, time, data in parts.messages)
    )


def _times(parts: Parts, random: Generator) -> Parts:
    messages = list(parts.messages)
    at = int(random.integers(len(messages)))
    last = at + 1 if random.random() < 0.6 else len(messages)
    time = _TIMES[int(random.integers(len(_TIMES)))]
    for place in range(at, last):
        topic, _, data = messages[place]
        messages[place] = (topic, time, data)
    return replace(parts, messages=tuple(messages))


def _lost(parts: Parts, random: Generator) -> Parts:
    begin = int(random.integers(len(parts.messages)))
    end = begin + int(random.integers(1, 100))
    return replace(parts, messages=(*parts.messages[:begin], *parts.messages[end:]) or parts.messages)


def _doubled(parts: Parts, random: Generator) -> Parts:
    begin = int(random.integers(len(parts.messages)))
    end = begin + int(random.integers(1, 100))
    return replace(parts, messages=(*parts.messages[:end], *parts.messages[begin:]))


def _turned(parts: Parts, random: Generator) -> Parts:
    return replace(parts, messages=parts.messages[::-1])


_WAYS: tuple[Callable[[Parts, Generator], Parts], ...] = (
    _payload, _payload, _payload, _schema, _schema, _topic, _times, _lost, _doubled, _turned,
)  # fmt: skip


def records_of(content: bytes) -> list[tuple[int, bytes]]:
    """The outermost records of a good file."""
    found, at = [], len(_MAGIC)
    while at + _HEAD.size <= len(content) - len(_MAGIC):
        opcode, length = _HEAD.unpack_from(content, at)
        found.append((opcode, content[at + _HEAD.size : at + _HEAD.size + length]))
        at += _HEAD.size + length
    return found


def _damaged_records(content: bytes, random: Generator) -> bytes:
    """A record lost, doubled, of another kind, of another length, or elsewhere."""
    records = records_of(content)
    at = int(random.integers(len(records)))
    opcode, body = records[at]
    length = len(body)
    match int(random.integers(6)):
        case 0:
            del records[at]
        case 1:
            records.insert(int(random.integers(len(records))), records[at])
        case 2:
            records[at] = (int(random.integers(256)), body)
        case 3:
            records[at] = (opcode, raw.RAW[int(random.integers(len(raw.RAW)))](body, random))
        case 4:
            records.insert(at, records.pop(int(random.integers(len(records)))))
        case _:
            length = _SIZES[int(random.integers(len(_SIZES)))]
    packed = [_HEAD.pack(kind, len(each)) + each for kind, each in records]
    if length != len(body):
        packed[at] = _HEAD.pack(opcode, length) + body
    return _MAGIC + b"".join(packed) + _MAGIC


def _damaged_chunk_head(content: bytes, random: Generator) -> bytes:
    """A chunk that says something else of itself: its size, its compression, no checksum."""
    records = records_of(content)
    chunks = [place for place, (opcode, _) in enumerate(records) if opcode == _CHUNK_OPCODE]
    if not chunks:
        return _damaged_records(content, random)
    at = chunks[int(random.integers(len(chunks)))]
    body = bytearray(records[at][1])
    match int(random.integers(4)):
        case 0:
            struct.pack_into("<Q", body, 16, _SIZES[int(random.integers(len(_SIZES)))])
        case 1:
            struct.pack_into("<I", body, 28, int(random.choice([1, 3, 5, 1 << 31])))
        case 2:
            body[32:36] = [b"zstd", b"lz4\x00", b"none"][int(random.integers(3))]
        case _:
            struct.pack_into("<I", body, 24, 0)
            body[60:] = raw.flip_bits(bytes(body[60:]), random)
    records[at] = (_CHUNK_OPCODE, bytes(body))
    return _MAGIC + b"".join(_HEAD.pack(kind, len(each)) + each for kind, each in records) + _MAGIC


def _bomb(random: Generator) -> bytes:
    """A few kilobytes that unfold to very much more than a file of measurements would."""
    size = 1 << int(random.choice([20, 24, 28, 30]))
    compression = ("zstd", "lz4")[int(random.integers(2))]
    declared = (size, 1000, 1 << 63, size - 1)[int(random.integers(4))]
    body = (
        struct.pack("<QQQI", 0, 0, declared, 0) + struct.pack("<I", len(compression)) + compression.encode()
    )
    packed = packed_zeros(compression, size)
    body += struct.pack("<Q", len(packed)) + packed
    return _MAGIC + _HEAD.pack(1, 8) + bytes(8) + _HEAD.pack(_CHUNK_OPCODE, len(body)) + body


@lru_cache(maxsize=8)
def packed_zeros(compression: str, size: int) -> bytes:
    """So many zeros, packed piece by piece."""
    piece = bytes(1 << 20)
    if compression == "zstd":
        packer = zstandard.ZstdCompressor(level=1).compressobj()
        return b"".join(packer.compress(piece) for _ in range(size >> 20)) + packer.flush()
    lz = lz4.frame.LZ4FrameCompressor()
    return (
        bytes(lz.begin()) + b"".join(bytes(lz.compress(piece)) for _ in range(size >> 20)) + bytes(lz.flush())
    )
