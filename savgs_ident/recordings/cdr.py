"""ROS 2 CDR messages of one topic as numbers: any message type, many messages at a time.

The schema of a topic is a message definition (``ros2msg``), parsed into a tree of fields; constants, default
values and comments do not change the bytes and are skipped::

    std_msgs/Header header
    float64[] position
    ====================
    MSG: std_msgs/Header
    builtin_interfaces/Time stamp
    string frame_id

CDR has no tags: the offset of a number depends only on the lengths of the strings and sequences before it. So one
message is parsed in Python and its offsets are kept as a :class:`MessageLayout`; every other message with the same
lengths (in practice all of a topic) is read by numpy at those offsets, thousands at a time.
"""

import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.channels import SignalCandidate
from savgs_ident.recordings.mcap_records import DecodeError, MessageBlock, gather
from savgs_ident.recordings.recording import RecordingLayout

PRIMITIVES: Mapping[str, str] = MappingProxyType(
    {
        "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
        "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
    }
)  # fmt: skip
"""Primitive types and their numpy codes, without byte order."""

SINGLE, SEQUENCE = -1, -2
_BUILTIN = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
}
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?P<bound><=)?(?P<count>\d*)\])?\s+(?P<name>[A-Za-z]\w*)"
    r"(?P<constant>\s*=)?"
)
_DEEPEST = 16


class SchemaError(ValueError):
    """A message definition that cannot be understood; the text is the reason."""


@dataclass(frozen=True)
class Field:
    """``count`` is the length of a fixed array, ``SINGLE`` or ``SEQUENCE``; ``members`` of a nested type."""

    name: str
    type: str
    count: int
    members: tuple["Field", ...] = ()


def parse_definition(name: str, text: str) -> tuple[Field, ...]:
    """The fields of the message type ``name``, nested types resolved.

    Raises :class:`SchemaError` for a line or type that is not understood.
    """
    first, *others = re.split(r"^=+\s*$", text, flags=re.MULTILINE)
    bodies = dict(_BUILTIN)
    for part in others:
        head, _, body = part.strip().partition("\n")
        bodies[_short(head.removeprefix("MSG:").strip())] = body
    return _fields(first, _short(name).rpartition("/")[0], bodies, 0)


def _short(name: str) -> str:
    return name.replace("/msg/", "/")


def _fields(body: str, package: str, bodies: dict[str, str], depth: int) -> tuple[Field, ...]:
    if depth > _DEEPEST:
        raise SchemaError(f"types are nested deeper than {_DEEPEST}")
    fields = []
    for line in body.splitlines():
        text = line.split("#")[0].strip()
        if not text:
            continue
        match = _FIELD.match(text)
        if match is None:
            raise SchemaError(f"the line '{text}' is not understood")
        if match["constant"]:
            continue
        members = _members(match["type"], package, bodies, depth)
        fields.append(Field(match["name"], match["type"], _count(match), members))
    return tuple(fields)


def _count(match: re.Match[str]) -> int:
    if match["array"] is None:
        return SINGLE
    return SEQUENCE if match["bound"] or not match["count"] else int(match["count"])


def _members(kind: str, package: str, bodies: dict[str, str], depth: int) -> tuple[Field, ...]:
    if kind in PRIMITIVES or kind in ("string", "wstring"):
        return ()
    short = _short(kind)
    for full in (short, f"{package}/{short}", f"std_msgs/{short}"):
        if full in bodies:
            members = _fields(bodies[full], full.rpartition("/")[0], bodies, depth + 1)
            return members or (Field("structure_needs_at_least_one_member", "uint8", SINGLE),)
    raise SchemaError(f"type '{kind}' is not defined")


_MOST_ELEMENTS = 64
"""Elements of an array that are offered by index; longer arrays are images and clouds, not sensors."""
_ENCAPSULATION = 4
_ALIGNMENTS = {0: 8, 1: 8, 6: 4, 7: 4}
"""Largest alignment by encapsulation kind: CDR big/little endian, XCDR2 the same (OMG DDS-XTypes)."""


class NumberAt(NamedTuple):
    """Where a number stands: offset from the start of the message, numpy code with byte order."""

    offset: int
    code: str


@dataclass(frozen=True)
class MessageLayout:
    """Where the numbers stand (``numbers``, by dotted path), for messages whose ``guards`` are the same.

    ``guards`` are the offsets and values of the lengths that shift what follows (and the encapsulation),
    ``size`` how many bytes the message must have, ``texts`` the strings in it.
    """

    numbers: dict[str, NumberAt]
    guards: tuple[tuple[NumberAt, int], ...]
    texts: dict[str, str]
    size: int


def find_layout(message: bytes, fields: tuple[Field, ...]) -> MessageLayout:
    """Parse one message; raises :class:`SchemaError` where the bytes do not fit the definition."""
    if len(message) < _ENCAPSULATION or message[1] not in _ALIGNMENTS:
        raise SchemaError("the message does not begin as CDR does")
    reader = _LayoutReader(message, "<" if message[1] & 1 else ">", _ALIGNMENTS[message[1]])
    reader.guards.append((NumberAt(1, "u1"), message[1]))
    reader.struct(fields, "")
    return MessageLayout(reader.numbers, tuple(reader.guards), reader.texts, reader.at)


class _LayoutReader:
    """Parses one message field by field and records the offsets of its numbers."""

    def __init__(self, message: bytes, order: str, alignment: int) -> None:
        self.message = message
        self.order = order
        self.alignment = alignment
        self.at = _ENCAPSULATION
        self.numbers: dict[str, NumberAt] = {}
        self.guards: list[tuple[NumberAt, int]] = []
        self.texts: dict[str, str] = {}

    def struct(self, fields: tuple[Field, ...], path: str) -> None:
        for field in fields:
            name = f"{path}.{field.name}" if path else field.name
            if field.count == SINGLE:
                self._element(field, name, record=True)
                continue
            count = self._length() if field.count == SEQUENCE else field.count
            self._array(field, name, count)

    def _array(self, field: Field, name: str, count: int) -> None:
        kept = min(count, _MOST_ELEMENTS)
        for index in range(kept):
            self._element(field, f"{name}[{index}]", record=True)
        if field.type in PRIMITIVES:
            self._advance((count - kept) * int(PRIMITIVES[field.type][1]))
            return
        for _ in range(count - kept):
            self._element(field, name, record=False)

    def _element(self, field: Field, name: str, record: bool) -> None:
        if field.type in PRIMITIVES:
            code = PRIMITIVES[field.type]
            offset = self._take(int(code[1]))
            if record:
                self.numbers[name] = NumberAt(offset, self.order + code)
        elif field.type == "string":
            length = self._length()
            text = self.message[self.at : self.at + length].rstrip(b"\x00")
            self._advance(length)
            if record:
                self.texts[name] = text.decode("utf-8", errors="replace")
        elif field.type == "wstring":
            raise SchemaError(f"'{name}' is a wstring, which is not read")
        else:
            self.struct(field.members, name)

    def _length(self) -> int:
        offset = self._take(4)
        (value,) = struct.unpack_from(self.order + "I", self.message, offset)
        self.guards.append((NumberAt(offset, self.order + "u4"), int(value)))
        return int(value)

    def _take(self, width: int) -> int:
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


_KEPT_LAYOUTS = 8
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_OTHER_MEANING = ("sensor_msgs/", "geometry_msgs/", "nav_msgs/", "diagnostic_msgs/", "rcl_interfaces/")
"""Standard packages whose field names mean other things (the ``current`` of a battery, say)."""
_INDEXED = re.compile(r"^(?P<array>.+)\[(?P<index>[^\]]+)\]$")


class CdrDecoder:
    """Decoder of one topic. ROS numbers are SI by convention (REP 103), so no unit is needed."""

    def __init__(self, topic: str, type_name: str, definition: str, layout: RecordingLayout) -> None:
        self.topic = topic
        self.type_name = type_name.replace("/msg/", "/")
        self.notes: tuple[DataWarning, ...] = ()
        try:
            self._fields: tuple[Field, ...] = parse_definition(type_name, definition)
        except SchemaError as error:
            raise DecodeError(f"its schema is not understood: {error}") from error
        self._layouts: list[MessageLayout] = []
        self._channels = layout

    def candidates(self, first: bytes) -> tuple[SignalCandidate, ...]:
        """The numbers in the first message as signals; usual message types are recognised."""
        layout = self._layout(first)
        other_meaning = self.type_name.startswith(_OTHER_MEANING)
        names = {path: "" if other_meaning else self._field_name(path) for path in layout.numbers}
        if self.type_name == "sensor_msgs/Imu":
            names["linear_acceleration.z"] = "accel_z"
        elif self.type_name == "sensor_msgs/JointState":
            names |= self._joint(layout)
        units = {path: self._unit(name) for path, name in names.items()}
        return tuple(
            SignalCandidate(path, name, units[path], f"{self.topic} {path}") for path, name in names.items()
        )

    def find(self, field: str, first: bytes) -> str | None:
        """The path that the map's ``field`` means (``position[joint name]`` included), or None."""
        layout = self._layout(first)
        if field in layout.numbers:
            return field
        match = _INDEXED.match(field)
        if match is None:
            return None
        for path, text in layout.texts.items():
            if text == match["index"] and path.startswith("name["):
                found = f"{match['array']}[{path[5:-1]}]"
                return found if found in layout.numbers else None
        return None

    def decode(
        self, block: MessageBlock, keys: Sequence[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64] | None]:
        """The numbers at ``keys``, each of shape (n,), and the header stamps [ns] if there is a header."""
        values = {key: np.full(block.log.size, np.nan) for key in keys}
        stamps = np.zeros(block.log.size, dtype=np.int64)
        has_stamp = False
        left = np.arange(block.log.size)
        while left.size:
            layout = self._layout(block.payload(int(left[0])), int(left[0]))
            same = self._fits(layout, block, left)
            here = left[same]
            starts = block.starts[here]
            for key in keys:
                if key in layout.numbers:
                    offset, code = layout.numbers[key]
                    values[key][here] = gather(block.data, starts + offset, code)
            if all(path in layout.numbers for path in _STAMP):
                sec, nanosec = (
                    gather(block.data, starts + layout.numbers[path].offset, layout.numbers[path].code)
                    for path in _STAMP
                )
                stamps[here] = sec.astype(np.int64) * 1_000_000_000 + nanosec.astype(np.int64)
                has_stamp = True
            left = left[~same]
        return values, stamps if has_stamp else None

    def _layout(self, message: bytes, index: int = 0) -> MessageLayout:
        for layout in self._layouts:
            if len(message) >= layout.size and all(
                np.frombuffer(message, spot.code, 1, spot.offset)[0] == value for spot, value in layout.guards
            ):
                return layout
        try:
            layout = find_layout(message, self._fields)
        except SchemaError as error:
            raise DecodeError(str(error), index) from error
        self._layouts = [layout, *self._layouts[: _KEPT_LAYOUTS - 1]]
        return layout

    def _fits(self, layout: MessageLayout, block: MessageBlock, left: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Which messages have this layout; guards are compared only inside messages that are long enough."""
        fits = block.stops[left] - block.starts[left] >= layout.size
        for spot, value in layout.guards:
            where = np.flatnonzero(fits)
            fits[where] = gather(block.data, block.starts[left[where]] + spot.offset, spot.code) == value
        return fits

    def _joint(self, layout: MessageLayout) -> dict[str, str]:
        """The joint that is meant: the only one, or the only one with the word of the layout in its name."""
        joint = self._channels.joint
        if joint is None:
            return {}
        joints = {path[5:-1]: text for path, text in layout.texts.items() if path.startswith("name[")}
        meant = [index for index, text in joints.items() if joint.word in text.lower()]
        if len(meant) != 1 and len(joints) > 1:
            self.notes = (
                DataWarning(
                    "ambiguous_joint",
                    f"which joint is the {joint.word} is not clear: " + ", ".join(joints.values()),
                    channel=self.topic,
                    remedy='name it in channels.toml: field = "position[joint name]"',
                ),
            )
            return {}
        index = meant[0] if meant else next(iter(joints), "0")
        if f"effort[{index}]" in layout.numbers:
            self.notes = (
                DataWarning(
                    "effort_ignored",
                    "effort of a joint is a torque [N m], and is not used",
                    channel=self.topic,
                    remedy="log a motor's current as its own topic",
                ),
            )
        wanted = {f"position[{index}]": joint.position, f"velocity[{index}]": joint.velocity}
        return {path: name for path, name in wanted.items() if path in layout.numbers}

    def _unit(self, name: str) -> str | None:
        channel = self._channels.canonical_name(name)
        return None if channel is None else self._channels.si_unit(channel)

    def _field_name(self, path: str) -> str:
        """The name by which a field is recognised: its own, or for ``data`` that of its topic."""
        if path != "data":
            return path
        parts = [part for part in self.topic.split("/") if part]
        joined = "_".join(parts)
        return joined if self._channels.canonical_name(joined) else (parts[-1] if parts else self.topic)
