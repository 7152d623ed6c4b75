"""JSON messages of one topic as numbers, a block at a time.

Messages that are like the first one of their block are decoded by columns, by Arrow; what it does not take is parsed
by one call of the standard library, which also finds what is wrong.
"""

import json
from collections.abc import Iterator, Sequence
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.json as pa_json
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.channels import SignalCandidate
from savgs_ident.recordings.mcap_records import DecodeError, MessageBlock
from savgs_ident.recordings.units import find_unit

_DEEPEST = 4

_STAMPS = (
    ("header", "stamp", "sec", "nanosec"),
    ("header", "stamp", "sec", "nsec"),
    ("timestamp", "sec", "nsec"),
)

_JSON_ERRORS = (ValueError, RecursionError)


class JsonDecoder:
    """Decoder of one topic. The description of a property in the schema is its unit where it is one."""

    def __init__(self, topic: str, schema: bytes) -> None:
        self.topic = topic
        self.notes: tuple[DataWarning, ...] = ()
        self._units = _schema_units(schema)

    def candidates(self, first: bytes) -> tuple[SignalCandidate, ...]:
        """The numbers in the first message as signals, nested ones by their dotted path."""
        message = self._parse([first])[0]
        return tuple(
            SignalCandidate(path, path, self._units.get(path), f"{self.topic} {path}")
            for path, _ in _numbers(message, "", 0)
        )

    def find(self, field: str, first: bytes) -> str | None:
        """The path that the map's ``field`` means, or None."""
        return field if field in {path for path, _ in _numbers(self._parse([first])[0], "", 0)} else None

    def decode(
        self, block: MessageBlock, keys: Sequence[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64] | None]:
        """The numbers at ``keys``, each (n,), NaN where a message lacks one, and stamps [ns] if any."""
        found = self._by_columns(block, keys)
        if found is not None:
            return found
        messages = self._parse([block.payload(index) for index in range(block.log.size)])
        table = _flat_table(messages, keys)
        if table is None:
            return {key: _column(messages, _path(key, messages[0]), key) for key in keys}, _stamps(messages)
        return dict(zip(keys, table.T, strict=True)), _stamps(messages)

    def _by_columns(
        self, block: MessageBlock, keys: Sequence[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64] | None] | None:
        """The same in a third of the time; None where a message is not like the first one, which then says why."""
        first = self._parse([block.payload(0)])[0]
        numbers = [_path(key, first) for key in keys]
        clock = next(
            (each for each in _STAMPS if each[0] in first and _stamps([first], (each,)) is not None), None
        )
        stamps = [(*clock[:-2], part) for part in clock[-2:]] if clock else []
        try:
            columns = _columns(block, numbers, stamps)
        except pa.ArrowException:
            return None
        if columns is None:
            return None
        values = dict(zip(keys, columns[: len(keys)], strict=True))
        if not stamps:
            return values, None
        sec, nanosec = columns[len(keys) :]
        if max(np.abs(sec).max(), np.abs(nanosec).max() // 1_000_000_000) > _LAST_SECOND:
            return None
        return values, sec * 1_000_000_000 + nanosec

    def _parse(self, texts: list[bytes]) -> list[dict[str, Any]]:
        try:
            messages: list[dict[str, Any]] = json.loads(b"[" + b",".join(texts) + b"]")
        except _JSON_ERRORS:
            messages = []
        if len(messages) == len(texts) and all(type(message) is dict for message in messages):
            return messages
        for index, text in enumerate(texts):
            try:
                good = type(json.loads(text)) is dict
            except _JSON_ERRORS:
                good = False
            if not good:
                shown = text[:60].decode("utf-8", errors="replace")
                raise DecodeError(f"a message is not a JSON object: {shown!r}", index)
        return [json.loads(text) for text in texts]


_LAST_SECOND = 2**32
"""Seconds since 1970 that are no time of a recording any more: an integer might not hold their nanoseconds."""


def _path(key: str, message: dict[str, Any]) -> tuple[str, ...]:
    """The names that lead to a key: one, where a message has a field of that name, or those between its dots."""
    return (key,) if key in message else tuple(key.split("."))


_OBJECT, _LINE_END = ord("{"), ord("\n")
_TEXT_AT_ONCE = 1 << 16
"""Bytes of text that a core turns into numbers at a time; messages that are longer are not cut."""


def _columns(
    block: MessageBlock, numbers: Sequence[tuple[str, ...]], stamps: Sequence[tuple[str, ...]]
) -> list[NDArray[Any]] | None:
    """Numbers, NaN where there is none, and integers at paths in all messages, (n,) each.

    None where messages are no objects, each on a line, or lack one of the integers, and where a path goes on from the
    end of another. Raises :class:`ArrowException` where something else stands at a path.
    """
    paths = [*numbers, *stamps]
    if any(one != other and one == other[: len(one)] for one in paths for other in paths):
        return None
    raw = np.frombuffer(block.data, dtype=np.uint8)
    if (block.stops == block.starts).any() or (raw[block.starts] != _OBJECT).any():
        return None
    lines = _as_lines(block, raw)
    if np.count_nonzero(lines == _LINE_END) != block.log.size:
        return None
    shape: dict[str, Any] = {}
    for path, kind in [*((each, pa.float64()) for each in numbers), *((each, pa.int64()) for each in stamps)]:
        part = shape
        for name in path[:-1]:
            part = part.setdefault(name, {})
        part[path[-1]] = kind
    table = pa_json.read_json(
        pa.py_buffer(lines),
        pa_json.ReadOptions(block_size=max(_TEXT_AT_ONCE, 2 * int((block.stops - block.starts).max()))),
        pa_json.ParseOptions(explicit_schema=pa.schema(_fields(shape)), unexpected_field_behavior="ignore"),
        memory_pool=pa.system_memory_pool(),
    )
    if table.num_rows != block.log.size:
        return None
    found = [_at(table, path) for path in (*numbers, *stamps)]
    if any(each.null_count for each in found[len(numbers) :]):
        return None
    return [each.to_numpy(zero_copy_only=False) for each in found]


def _as_lines(block: MessageBlock, raw: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Messages as text, each on a line of its own, which begins with its end."""
    begin = int(block.starts[0]) - 1
    text = raw[begin : int(block.stops[-1])].copy()
    # Of a message and what stands before the next one, as two texts, every other one is taken: that moves memory.
    edges = np.stack([block.starts - 1, block.stops], axis=1).ravel() - begin
    text[edges[::2]] = _LINE_END
    texts = pa.LargeBinaryArray.from_buffers(
        pa.large_binary(), edges.size - 1, [None, pa.py_buffer(edges), pa.py_buffer(text)]
    )
    taken = pc.take(texts, pa.array(np.arange(0, edges.size - 1, 2)), memory_pool=pa.system_memory_pool())
    return np.frombuffer(taken.buffers()[2], dtype=np.uint8)[: int((block.stops - block.starts + 1).sum())]


def _fields(shape: dict[str, Any]) -> list[pa.Field]:
    """Fields of types by name; what is a dictionary is a struct of further ones."""
    return [
        pa.field(name, pa.struct(_fields(kind)) if isinstance(kind, dict) else kind)
        for name, kind in shape.items()
    ]


def _at(table: pa.Table, path: Sequence[str]) -> pa.Array:
    """The column at a path of names."""
    column = table.column(path[0]).combine_chunks()
    for name in path[1:]:
        column = pc.struct_field(column, name)
    return column


def _flat_table(messages: list[dict[str, Any]], keys: Sequence[str]) -> NDArray[np.float64] | None:
    """The fields of all messages at once, (n, keys); None unless each is a plain number at top level."""
    try:
        # One key more than needed: with a single key itemgetter would not give a tuple.
        rows = list(map(itemgetter(*keys, keys[0]), messages))
    except KeyError:
        return None
    if not set(map(type, chain.from_iterable(rows))) <= {float, int}:
        return None
    try:
        return np.array(rows, dtype=np.float64)[:, : len(keys)]
    except OverflowError:
        return None


def _column(messages: list[dict[str, Any]], path: tuple[str, ...], key: str) -> NDArray[np.float64]:
    """One field of every message; bool and text are not numbers, null and absence are missing samples."""
    found = [message.get(path[0]) for message in messages]
    for name in path[1:]:
        found = [part.get(name) if type(part) is dict else None for part in found]
    kinds = set(map(type, found)) - {float, int, type(None)}
    if kinds:
        index = next(i for i, value in enumerate(found) if type(value) in kinds)
        raise DecodeError(f"'{key}' is {found[index]!r:.60}, not a number", index)
    try:
        return np.array(found, dtype=np.float64)
    except OverflowError as error:
        raise DecodeError(f"'{key}' has a number too large to hold") from error


def _stamps(
    messages: list[dict[str, Any]], places: Sequence[tuple[str, ...]] = _STAMPS
) -> NDArray[np.int64] | None:
    """Header stamps [ns] if every message has one in one of the usual ``places``."""
    for *place, sec, nanosec in places:
        if place[0] not in messages[0]:
            continue
        parts: list[Any] = messages
        for name in place:
            parts = [part.get(name) if type(part) is dict else None for part in parts]
        if not all(
            type(part) is dict and type(part.get(sec)) is int and type(part.get(nanosec)) is int
            for part in parts
        ):
            continue
        try:
            return np.array([part[sec] * 1_000_000_000 + part[nanosec] for part in parts], dtype=np.int64)
        except OverflowError:
            return None
    return None


def _numbers(value: object, path: str, depth: int) -> Iterator[tuple[str, float]]:
    if depth > _DEEPEST:
        return
    if isinstance(value, dict):
        for name, part in value.items():
            yield from _numbers(part, f"{path}.{name}" if path else name, depth + 1)
    elif path and (value is None or (isinstance(value, int | float) and not isinstance(value, bool))):
        yield path, float("nan") if value is None else 0.0


def _schema_units(schema: bytes) -> dict[str, str]:
    """Unit of each top-level property, from ``unit`` or from a description that is nothing but a unit."""
    try:
        properties = json.loads(schema)["properties"]
        pairs = [(name, entry.get("unit") or entry.get("description")) for name, entry in properties.items()]
    except (*_JSON_ERRORS, KeyError, TypeError, AttributeError):
        return {}
    return {name: text for name, text in pairs if isinstance(text, str) and find_unit(text)}
