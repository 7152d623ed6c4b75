"""ROS 2 message definitions (``ros2msg`` schemas in MCAP) as trees of fields.

    std_msgs/Header header
    float64[] position
    ====================
    MSG: std_msgs/Header
    builtin_interfaces/Time stamp
    string frame_id

Constants, default values and comments do not change the bytes and are skipped.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

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
    """A message definition that cannot be understood; the text says why."""


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
