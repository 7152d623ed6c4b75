"""Writing JSON that people can read too: a table in lines, a list of plain values in one.

    >>> print(json_text({"names": ["a", "b"], "matrix": [[1.0, 0.5], [0.5, 1.0]]}), end="")
    {
      "names": ["a", "b"],
      "matrix": [
        [1.0, 0.5],
        [0.5, 1.0]
      ]
    }

Numbers keep all their digits.
"""

import json
from collections.abc import Mapping
from math import isfinite
from pathlib import Path

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import write_bytes

Plain = dict[str, object] | list[object] | str | int | float | bool | None
"""What JSON can say, numbers in any unit."""


def as_plain(value: object, where: str) -> Plain:
    """``value`` in the types of JSON: arrays and tuples as lists.

    Raises :class:`InputError` that names the place for what JSON cannot say: a date, a number that is not finite.
    """
    if hasattr(value, "tolist"):  # Arrays and scalars of numpy.
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(name): as_plain(entry, f"{where}.{name}") for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [as_plain(entry, f"{where}[{index}]") for index, entry in enumerate(value)]
    if value is None or isinstance(value, str | bool | int) or (isinstance(value, float) and isfinite(value)):
        return value
    raise InputError(
        f"{where} is {value!r}, which JSON cannot say", remedy="write it as a text or as a finite number"
    )


def json_text(record: object) -> str:
    """A record of plain values as JSON text that ends with a line break."""
    return _lines(record, "") + "\n"


def write_json_text(path: Path, record: object) -> Path:
    """Write :func:`json_text`, whole or not at all; raises :class:`InputError` if that cannot be."""
    # A half of a surrogate pair has no UTF-8; JSON knows it escaped.
    return write_bytes(path, json_text(record).encode("utf-8", "backslashreplace"))


def _lines(value: object, indent: str) -> str:
    deeper = f"{indent}  "
    if isinstance(value, dict) and value:
        rows = [f"{deeper}{_word(str(name))}: {_lines(entry, deeper)}" for name, entry in value.items()]
        return "{\n" + ",\n".join(rows) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(entry, dict | list) for entry in value):
        return "[\n" + ",\n".join(f"{deeper}{_lines(entry, deeper)}" for entry in value) + f"\n{indent}]"
    return _word(value)


def _word(value: object) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)
