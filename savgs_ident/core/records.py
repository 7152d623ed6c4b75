"""Records back from JSON: what was written by ``dataclasses.asdict``, checked against the record's own annotations.

>>> from savgs_ident.core.errors import DataWarning
>>> record_of(DataWarning, {"code": "clipped", "what": "is clipped", "time": 1}).time
1
>>> record_of(DataWarning, {"code": "clipped", "what": 3})
Traceback (most recent call last):
ValueError: what is a whole number, not a text
"""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from math import isfinite
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

Record = TypeVar("Record")


def record_of(kind: type[Record], found: object) -> Record:
    """A record of this ``kind`` from a JSON object; a list becomes a tuple where the record has one.

    Raises ``ValueError`` for a field that is missing, not known, or not of its type; numbers must be finite.
    """
    record: Record = _record(kind, found, "")
    return record


def _record(kind: Any, found: object, where: str) -> Any:
    table = _of_type(found, Mapping, where, "a table")
    prefix = f"{where}." if where else ""
    hints, known = get_type_hints(kind), {each.name: each for each in fields(kind)}
    for name in table:
        if name not in known:
            raise ValueError(f"{prefix}{name!r:.40} is not known")
    for name, each in known.items():
        if name not in table and each.default is MISSING and each.default_factory is MISSING:
            raise ValueError(f"{prefix}{name} is missing")
    return kind(**{name: _value(hints[name], each, f"{prefix}{name}") for name, each in table.items()})


def _value(hint: Any, found: object, where: str) -> Any:
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _one_of(inner, found, where)
    if origin is Literal:
        if not isinstance(found, str) or found not in inner:
            raise _wrong(found, where, "one of: " + ", ".join(inner))
        return found
    if origin is tuple or origin is Sequence:
        entries = _of_type(found, list, where, "a list")
        return tuple(_value(inner[0], each, f"{where}[{place}]") for place, each in enumerate(entries))
    if origin in (dict, Mapping):
        entries = _of_type(found, Mapping, where, "a table")
        return {name: _value(inner[1], each, f"{where}.{name:.40}") for name, each in entries.items()}
    return _record(hint, found, where) if is_dataclass(hint) else _plain(hint, found, where)


def _one_of(hints: tuple[Any, ...], found: object, where: str) -> Any:
    """What may be missing is null, or else what it is."""
    if found is None and NoneType in hints:
        return None
    (hint,) = (each for each in hints if each is not NoneType)
    return _value(hint, found, where)


def _plain(hint: type, found: object, where: str) -> object:
    if hint is float:
        return _number(found, where)
    if hint is int and isinstance(found, bool):
        raise _wrong(found, where, "a whole number")
    return _of_type(found, hint, where, {bool: "true or false", int: "a whole number", str: "a text"}[hint])


def _number(found: object, where: str) -> float:
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise _wrong(found, where, "a number")
    try:
        finite = isfinite(found)
    except OverflowError:
        finite = False
    if not finite:
        raise _wrong(found, where, "a finite number")
    # A whole number stays one, so that a record that is written again is the same to the letter.
    return found


def _of_type(found: object, kind: type, where: str, expected: str) -> Any:
    if not isinstance(found, kind):
        raise _wrong(found, where, expected)
    return found


def _wrong(found: object, where: str, expected: str) -> ValueError:
    # Long lists need not be shown, deep ones cannot, nor numbers of thousands of digits.
    shown = {list: "a list", dict: "a table", int: "a whole number"}.get(type(found), f"{found!r:.60}")
    return ValueError(f"{where or 'the record'} is {shown}, not {expected}")
