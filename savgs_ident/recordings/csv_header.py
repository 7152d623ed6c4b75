"""The head of a CSV file: delimiter, decimal mark, encoding, column names, and a row of units if any."""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.binding import Candidate
from savgs_ident.recordings.names import canonical_name, split_header
from savgs_ident.recordings.units import find_unit

_DELIMITERS = (",", ";", "\t")
_CONTENT = re.compile(rb"^[ \t\r\v\f]*[^\s#][^\n]*", re.MULTILINE)
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class CsvHead:
    """How the table is written; ``body``: what of the first block follows the head, ``lines``: its length."""

    delimiter: str
    decimal: str
    encoding: str
    columns: tuple[str, ...]
    units: tuple[str | None, ...]
    body: bytes
    lines: int

    def candidates(self) -> tuple[Candidate, ...]:
        """The columns as signals; the key is the position."""
        return tuple(
            Candidate(str(position), text, self.units[position], text)
            for position, text in enumerate(self.columns)
        )


def read_head(block: bytes, source: str) -> CsvHead:
    """Read the head from the first block of whole lines.

    Raises :class:`InputError` where there is no header, a column is named twice, or the file is not text.
    """
    if b"\x00" in block[:4096]:
        raise InputError("is not a text file", source=source, remedy="give a CSV or MCAP file")
    encoding = _encoding(block)
    lines = _content_lines(block.removeprefix(_BYTE_ORDER_MARK))
    head, rest, count = next(lines, (b"", b"", 0))
    if not head:
        raise InputError("is empty", source=source, remedy="record again, or give another file")
    text = head.decode(encoding)
    delimiter = max(_DELIMITERS, key=text.count)
    columns = _cells(text, delimiter)
    _check_columns(columns, source)
    units: tuple[str | None, ...] = (None,) * len(columns)
    second, rest_after, count_after = next(lines, (b"", b"", count))
    row = _cells(second.decode(encoding), delimiter)
    if _is_unit_row(row, columns):
        units, rest, count = tuple(cell.strip("[]() ") or None for cell in row), rest_after, count_after
        row = _cells(next(lines, (b"", b"", count))[0].decode(encoding), delimiter)
    decimal = "," if delimiter != "," and any("," in cell for cell in row) else "."
    return CsvHead(delimiter, decimal, encoding, columns, units, rest, count)


def _encoding(block: bytes) -> str:
    try:
        block.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _content_lines(block: bytes) -> Iterator[tuple[bytes, bytes, int]]:
    """Lines that are neither blank nor comments: the line, what follows it, and its number from 1."""
    for found in _CONTENT.finditer(block):
        yield found[0].strip(), block[found.end() + 1 :], block.count(b"\n", 0, found.start()) + 1


def _cells(line: str, delimiter: str) -> tuple[str, ...]:
    try:
        row = next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        row = line.split(delimiter)
    return tuple(cell.strip() for cell in row)


def _check_columns(columns: tuple[str, ...], source: str) -> None:
    twice = sorted({name for name in columns if name and columns.count(name) > 1})
    if twice:
        raise InputError(
            f"column '{twice[0]}' is there twice", source=source, remedy="rename or delete one of the two"
        )
    if all(_is_number(name) for name in columns):
        raise InputError(
            "has no header line",
            source=source,
            remedy="write one such as 'time [s],road_height [m],sprung_accel [m/s^2]'",
        )


def _is_unit_row(row: tuple[str, ...], columns: tuple[str, ...]) -> bool:
    """A second line such as ``s;mm;g``: what stands below a known column is a unit or empty."""
    if len(row) != len(columns) or any(_is_number(cell) for cell in row):
        return False
    known = [
        cell.strip("[]() ")
        for cell, name in zip(row, columns, strict=True)
        if canonical_name(split_header(name).label)
    ]
    return bool(known) and all(not cell or find_unit(cell) for cell in known) and any(known)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
