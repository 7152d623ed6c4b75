"""Reading JSON strictly: a value that knows where it stands, so that every fault is named by its place.

>>> document = Place({"k_t": {"value": 275000.0, "unit": "N/m"}})
>>> k_t = document.table(("k_t",))["k_t"].table(("value", "unit"))
>>> k_t["value"].number()
275000.0
>>> k_t["unit"].number()
Traceback (most recent call last):
savgs_ident.core.errors.InputError: k_t.unit is 'N/m', not a finite number.
"""

import json
from collections.abc import Callable, Collection
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError

Result = TypeVar("Result")

_SHOWN = 60
"""Characters of a wrong value that a message shows."""


@dataclass(frozen=True)
class Place:
    """A value of a JSON document and ``where`` it stands; all methods raise :class:`InputError` naming that."""

    value: object
    where: str = ""

    def wrong(self, expected: str) -> InputError:
        """The error for a value that is not what was ``expected``."""
        shown = repr(self.value)
        shown = shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}..."
        return InputError(f"{self.where or 'the document'} is {shown}, not {expected}")

    def entries(self) -> dict[str, "Place"]:
        """The entries of a table with any names."""
        if not isinstance(self.value, dict):
            raise self.wrong("a table")
        prefix = f"{self.where}." if self.where else ""
        return {str(name): Place(entry, f"{prefix}{name}") for name, entry in self.value.items()}

    def table(self, required: Collection[str], free: bool = False) -> dict[str, "Place"]:
        """The entries of a table that has the ``required`` names, and others only if that is ``free``."""
        found = self.entries()
        prefix = f"{self.where}." if self.where else ""
        for name in required:
            if name not in found:
                raise InputError(f"{prefix}{name} is missing")
        unknown = [name for name in found if name not in required]
        if unknown and not free:
            raise InputError(f"{prefix}{unknown[0]} is not known")
        return found

    def items(self) -> list["Place"]:
        """The entries of a list."""
        if not isinstance(self.value, list):
            raise self.wrong("a list")
        return [Place(entry, f"{self.where}[{index}]") for index, entry in enumerate(self.value)]

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


def read_document(path: Path, remedy: str, parse: Callable[[Place], Result]) -> Result:
    """What ``parse`` makes of the JSON document in a file.

    Raises :class:`InputError` with the file, the place and the ``remedy`` for a file that cannot be read, is no JSON,
    names an entry twice, holds a number that is not finite, or what ``parse`` refuses.
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
        return parse(Place(document))
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
