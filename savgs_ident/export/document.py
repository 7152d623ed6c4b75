"""JSON documents: readable writing and strict reading, of parameters, too.

What is written is made to be read: a table stands over several lines, a list of plain values on one, and numbers keep
all their digits.

    >>> print(json_text({"names": ["a", "b"], "matrix": [[1.0, 0.5], [0.5, 1.0]]}), end="")
    {
      "names": ["a", "b"],
      "matrix": [
        [1.0, 0.5],
        [0.5, 1.0]
      ]
    }

What is read is checked: a :class:`JsonValue` knows its place in the document, so that every error names that place.

    >>> document = JsonValue({"k_t": {"value": 275000.0, "unit": "N/m"}})
    >>> k_t = document.table(("k_t",))["k_t"].table(("value", "unit"))
    >>> k_t["value"].number()
    275000.0
    >>> k_t["unit"].number()
    Traceback (most recent call last):
    savgs_ident.core.errors.InputError: k_t.unit is 'N/m', not a finite number.
"""

import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass
from math import inf, isfinite
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import write_bytes
from savgs_ident.core.parameter import Parameter

Plain = dict[str, object] | list[object] | str | int | float | bool | None
"""The values of JSON, numbers in any unit."""


def as_plain(value: object, where: str) -> Plain:
    """``value`` in the types of JSON: arrays and tuples as lists.

    Raises :class:`InputError` that names the place for what JSON cannot represent: a date, a number that is not
    finite.
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
    """Write :func:`json_text` atomically; raises :class:`InputError` if it cannot be written."""
    # Half a surrogate pair has no UTF-8; JSON has an escape for it.
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


Result = TypeVar("Result")
_SHOWN = 60
"""Characters of a wrong value that a message shows."""


@dataclass(frozen=True)
class JsonValue:
    """A value of a JSON document and its place; all methods raise :class:`InputError` naming the place."""

    value: object
    where: str = ""

    def wrong(self, expected: str) -> InputError:
        """The error for a value other than ``expected``."""
        shown = repr(self.value)
        shown = shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}..."
        return InputError(f"{self.where or 'the document'} is {shown}, not {expected}")

    def entries(self) -> dict[str, "JsonValue"]:
        """The entries of a table with any names."""
        if not isinstance(self.value, dict):
            raise self.wrong("a table")
        prefix = f"{self.where}." if self.where else ""
        return {str(name): JsonValue(entry, f"{prefix}{name}") for name, entry in self.value.items()}

    def table(self, required: Collection[str], free: bool = False) -> dict[str, "JsonValue"]:
        """The entries of a table that has the ``required`` names, and others only if ``free``."""
        found = self.entries()
        prefix = f"{self.where}." if self.where else ""
        for name in required:
            if name not in found:
                raise InputError(f"{prefix}{name} is missing")
        unknown = [name for name in found if name not in required]
        if unknown and not free:
            raise InputError(f"{prefix}{unknown[0]} is not known")
        return found

    def items(self) -> list["JsonValue"]:
        """The entries of a list."""
        if not isinstance(self.value, list):
            raise self.wrong("a list")
        return [JsonValue(entry, f"{self.where}[{index}]") for index, entry in enumerate(self.value)]

    def text(self, among: Collection[str] = ()) -> str:
        """A text, one ``among`` those given if any are."""
        if not isinstance(self.value, str):
            raise self.wrong("a text")
        if among and self.value not in among:
            raise self.wrong("one of: " + ", ".join(among))
        return self.value

    def names(self, among: Collection[str] = ()) -> tuple[str, ...]:
        """A list of texts, none of them twice."""
        found = tuple(entry.text(among) for entry in self.items())
        if len(set(found)) < len(found):
            raise self.wrong("a list of different names")
        return found

    def number(self) -> float:
        """A finite number, of any unit."""
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            raise self.wrong("a finite number")
        try:
            number = float(self.value)
        except OverflowError:
            raise self.wrong("a finite number") from None
        if not isfinite(number):
            raise self.wrong("a finite number")
        return number

    def vector(self) -> NDArray[np.float64]:
        """A list of finite numbers of any unit, (n,)."""
        return np.array([entry.number() for entry in self.items()], dtype=np.float64)

    def matrix(self, rows: int, columns: int) -> NDArray[np.float64]:
        """A list of rows of finite numbers of any unit, (rows, columns)."""
        found = [entry.vector() for entry in self.items()]
        if len(found) != rows or any(row.size != columns for row in found):
            raise self.wrong(f"a matrix of {rows} rows and {columns} columns")
        return np.reshape(np.array(found, dtype=np.float64), (rows, columns))


def read_document(path: Path, remedy: str, parse: Callable[[JsonValue], Result]) -> Result:
    """Read a JSON document from a file and apply ``parse``.

    Raises :class:`InputError` with the file, the place and the ``remedy`` for a file that cannot be read, is no JSON,
    names an entry twice, holds a number that is not finite, or is refused by ``parse``.
    """
    try:
        document = json.loads(
            path.read_bytes().decode("utf-8"),
            object_pairs_hook=_each_once,
            parse_float=_finite,
            parse_constant=_finite,
        )
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", source=path, remedy=remedy) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not such JSON: {error}", source=path, remedy=remedy) from error
    try:
        return parse(JsonValue(document))
    except InputError as error:
        raise InputError(error.what, source=path, remedy=error.remedy or remedy) from None
    except RecursionError as error:
        raise InputError("is nested too deeply", source=path, remedy=remedy) from error


def _each_once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{twice!r} is given twice")
    return found


def _finite(text: str) -> float:
    number = float(text)
    if not isfinite(number):
        raise ValueError(f"{text} is no finite number")
    return number


NUMBERS = ("value", "tolerance", "lower", "upper")
"""The entries of a parameter that are numbers."""
TEXTS = ("unit", "about", "source")
"""Those that are texts."""
BOUNDS = ("lower", "upper")
"""Those that may be null."""


def parameter_record(entry: Parameter) -> dict[str, object]:
    """What is known of a parameter, but for its name; an absent bound is null.

    >>> found = parameter_record(Parameter("k", 6e4, "N/m", lower=0.0))
    >>> found["lower"], found["upper"]
    (0.0, None)
    """
    bounds = {name: value if isfinite(value := getattr(entry, name)) else None for name in BOUNDS}
    return {name: value for name, value in asdict(entry).items() if name != "name"} | bounds


def parse_parameter(place: JsonValue, known: Parameter) -> Parameter:
    """The parameter at a place, by name and unit the ``known`` one; raises :class:`InputError` for an invalid one."""
    fields = place.table((*NUMBERS, *TEXTS))
    lower, upper = (
        without if fields[name].value is None else fields[name].number()
        for name, without in zip(BOUNDS, (-inf, inf), strict=True)
    )
    return Parameter(
        known.name,
        fields["value"].number(),
        fields["unit"].text((known.unit,)),
        fields["tolerance"].number(),
        lower,
        upper,
        fields["about"].text(),
        fields["source"].text(),
    )
