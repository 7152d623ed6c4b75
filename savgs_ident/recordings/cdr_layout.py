"""Where in the bytes of a CDR message each number stands.

CDR has no tags: a number's offset depends only on the lengths of the strings and sequences before it. So one
message is walked in Python, its offsets are kept as a :class:`Layout`, and every other message with the same
lengths (in practice all of a topic) is read by numpy at those offsets, thousands at a time.
"""

import struct
from dataclasses import dataclass
from typing import NamedTuple

from savgs_ident.recordings.cdr_schema import PRIMITIVES, SEQUENCE, SINGLE, Field, SchemaError

_MOST_ELEMENTS = 64
"""Elements of an array that are offered by index; longer arrays are images and clouds, not sensors."""
_ENCAPSULATION = 4
_ALIGNMENTS = {0: 8, 1: 8, 6: 4, 7: 4}
"""Largest alignment by encapsulation kind: CDR big/little endian, XCDR2 the same (OMG DDS-XTypes)."""


class Spot(NamedTuple):
    """Offset from the start of the message, numpy code with byte order."""

    offset: int
    code: str


@dataclass(frozen=True)
class Layout:
    """Where the numbers stand (``spots``, by dotted path), for messages whose ``guards`` are the same.

    ``guards`` are the offsets and values of the lengths that shift what follows (and the encapsulation),
    ``size`` how many bytes the message must have, ``texts`` the strings that were met.
    """

    spots: dict[str, Spot]
    guards: tuple[tuple[Spot, int], ...]
    texts: dict[str, str]
    size: int


def layout_of(message: bytes, fields: tuple[Field, ...]) -> Layout:
    """Walk one message; raises :class:`SchemaError` where the bytes do not fit the definition."""
    if len(message) < _ENCAPSULATION or message[1] not in _ALIGNMENTS:
        raise SchemaError("the message does not begin as CDR does")
    walk = _Walk(message, "<" if message[1] & 1 else ">", _ALIGNMENTS[message[1]])
    walk.guards.append((Spot(1, "u1"), message[1]))
    walk.struct(fields, "")
    return Layout(walk.spots, tuple(walk.guards), walk.texts, walk.at)


class _Walk:
    def __init__(self, message: bytes, order: str, alignment: int) -> None:
        self.message = message
        self.order = order
        self.alignment = alignment
        self.at = _ENCAPSULATION
        self.spots: dict[str, Spot] = {}
        self.guards: list[tuple[Spot, int]] = []
        self.texts: dict[str, str] = {}

    def struct(self, fields: tuple[Field, ...], path: str) -> None:
        for field in fields:
            name = f"{path}.{field.name}" if path else field.name
            if field.count == SINGLE:
                self._element(field, name, keep=True)
                continue
            count = self._length() if field.count == SEQUENCE else field.count
            self._array(field, name, count)

    def _array(self, field: Field, name: str, count: int) -> None:
        kept = min(count, _MOST_ELEMENTS)
        for index in range(kept):
            self._element(field, f"{name}[{index}]", keep=True)
        if field.type in PRIMITIVES:
            self._advance((count - kept) * int(PRIMITIVES[field.type][1]))
            return
        for _ in range(count - kept):
            self._element(field, name, keep=False)

    def _element(self, field: Field, name: str, keep: bool) -> None:
        if field.type in PRIMITIVES:
            code = PRIMITIVES[field.type]
            offset = self._place(int(code[1]))
            if keep:
                self.spots[name] = Spot(offset, self.order + code)
        elif field.type == "string":
            length = self._length()
            text = self.message[self.at : self.at + length].rstrip(b"\x00")
            self._advance(length)
            if keep:
                self.texts[name] = text.decode("utf-8", errors="replace")
        elif field.type == "wstring":
            raise SchemaError(f"'{name}' is a wstring, which is not read")
        else:
            self.struct(field.members, name)

    def _length(self) -> int:
        offset = self._place(4)
        (value,) = struct.unpack_from(self.order + "I", self.message, offset)
        self.guards.append((Spot(offset, self.order + "u4"), int(value)))
        return int(value)

    def _place(self, width: int) -> int:
        """Align to ``width``, take that many bytes, return where they begin."""
        align = min(width, self.alignment)
        self._advance(-(self.at - _ENCAPSULATION) % align)
        offset = self.at
        self._advance(width)
        return offset

    def _advance(self, count: int) -> None:
        self.at += count
        if self.at > len(self.message):
            raise SchemaError(f"the message ends after {len(self.message)} bytes, its definition wants more")
