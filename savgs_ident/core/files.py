"""Files: each written whole or not at all, as bytes, JSON or a table; and records read strictly.

:func:`write_bytes` writes a temporary file beside the target and then renames it, so that an interrupted command or
a full disk leaves finished files only; :func:`write_json` and :func:`write_table` make its bytes of a result.
:func:`record_of` reads a dataclass back from the JSON object that ``dataclasses.asdict`` made of it, checked against
the annotations of the dataclass.

>>> from savgs_ident.core.errors import DataWarning
>>> record_of(DataWarning, {"code": "clipped", "what": "is clipped", "time": 1}).time
1
>>> record_of(DataWarning, {"code": "clipped", "what": 3})
Traceback (most recent call last):
ValueError: what is a whole number, not a text
"""

import csv
import io
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from fnmatch import fnmatchcase
from glob import escape
from math import isfinite
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from savgs_ident.core.errors import DataWarning, InputError

_LEAST_FREE_SPACE = 32 * 2**20
"""Free space that a temporary folder must have [byte]."""
_PART = ".part"


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file atomically: whole or not at all. Raises :class:`InputError` if it cannot be written."""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=_PART)
    except OSError as error:
        raise cannot_write(path, error) from error
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        part.chmod(0o644)
        part.replace(path)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        part.unlink(missing_ok=True)
    return path


def is_begun(name: str, of: Iterable[str]) -> bool:
    """Whether ``name`` is the temporary file of an interrupted :func:`write_bytes` of one of the names ``of``."""
    return any(fnmatchcase(name, f".{escape(each)}.????????{_PART}") for each in of)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A temporary folder with free space, for libraries that write to files only and do not survive a full disk.

    HDF5 ends the process where the disk fills. Raises :class:`InputError` if there is no free space.
    """
    with tempfile.TemporaryDirectory(prefix="savgs-ident-") as name:
        if shutil.disk_usage(name).free < _LEAST_FREE_SPACE:
            raise InputError(
                "the disk is full",
                source=tempfile.gettempdir(),
                remedy="make room there, or name another folder in TMPDIR",
            )
        yield Path(name)


def spelled_out(text: object) -> str:
    r"""``text`` as UTF-8 can encode it; an undecodable byte of a file name becomes ``\udcff`` or the like."""
    return str(text).encode("utf-8", "backslashreplace").decode()


def cannot_write(path: Path, error: OSError) -> InputError:
    """The error for a file or folder that cannot be written."""
    return InputError(
        f"cannot be written: {error.strerror or error}",
        source=path,
        remedy="choose a writable folder with space left: --out DIR",
    )


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
    return _record(hint, found, where) if is_dataclass(hint) else _scalar(hint, found, where)


def _one_of(hints: tuple[Any, ...], found: object, where: str) -> Any:
    """The value of an optional field: null, or a value of its type."""
    if found is None and NoneType in hints:
        return None
    (hint,) = (each for each in hints if each is not NoneType)
    return _value(hint, found, where)


def _scalar(hint: type, found: object, where: str) -> object:
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
    # A whole number stays one, so that a record that is written again is identical.
    return found


def _of_type(found: object, kind: type, where: str, expected: str) -> Any:
    if not isinstance(found, kind):
        raise _wrong(found, where, expected)
    return found


def _wrong(found: object, where: str, expected: str) -> ValueError:
    # Long lists, deep ones and numbers of thousands of digits are not shown.
    shown = {list: "a list", dict: "a table", int: "a whole number"}.get(type(found), f"{found!r:.60}")
    return ValueError(f"{where or 'the record'} is {shown}, not {expected}")


Json = dict[str, object] | list[object] | str | int | float | bool | None
"""What a JSON file can say."""


def prepare_folder(folder: Path) -> Path:
    """Make ``folder`` if need be and try to write there, so that a long run does not end in a refusal.

    Raises :class:`InputError` where it is not a folder or cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise cannot_write(folder, error) from error


def to_json(record: object) -> str:
    """``record`` as indented JSON; numpy becomes plain, a number that is not finite becomes null."""
    return json.dumps(_plain(record), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def json_bytes(record: object) -> bytes:
    """:func:`to_json` of a record as UTF-8; a byte of a file name that is no text is spelled out as JSON does."""
    return to_json(record).encode("utf-8", "backslashreplace")


def write_json(path: Path, record: object) -> Path:
    """Write :func:`json_bytes` of a record."""
    return write_bytes(path, json_bytes(record))


def write_table(path: Path, columns: Mapping[str, Sequence[object]]) -> Path:
    """Write columns, headed by their names with units, as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return write_bytes(path, text.getvalue().encode())


def warning_record(warning: DataWarning) -> dict[str, object]:
    """A warning as JSON has it."""
    return {
        "code": warning.code,
        "message": str(warning),
        "test": warning.test or None,
        "channel": warning.channel or None,
        "time_s": warning.time,
        "remedy": warning.remedy or None,
    }


def _plain(value: object) -> Json:
    if hasattr(value, "tolist"):  # Arrays and scalars of numpy, without loading it.
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    if value is None or isinstance(value, str | int | float | bool):
        return value
    raise TypeError(f"{type(value).__name__} has no place in JSON")
