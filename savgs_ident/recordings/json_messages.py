"""JSON messages of one topic as numbers. A block is parsed by one call, which is what makes it fast."""

import json
from collections.abc import Iterator, Sequence
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.binding import SignalCandidate
from savgs_ident.recordings.layout import find_unit
from savgs_ident.recordings.mcap_records import DecodeError, MessageBlock

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
        messages = self._parse([block.payload(index) for index in range(block.log.size)])
        table = _flat_table(messages, keys)
        if table is None:
            return {key: _column(messages, tuple(key.split(".")), key) for key in keys}, _stamps(messages)
        return dict(zip(keys, table.T, strict=True)), _stamps(messages)

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


def _stamps(messages: list[dict[str, Any]]) -> NDArray[np.int64] | None:
    """Header stamps [ns] if every message has one in one of the usual places."""
    for *place, sec, nanosec in _STAMPS:
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
