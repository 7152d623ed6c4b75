"""How a CSV file is written: delimiter, decimal mark, encoding, names of the columns and a row of units.

The names stand above the first rows of numbers, below whatever title lines there are; :func:`read_head` finds them in
the first block of a file (:mod:`savgs_ident.recordings.csv_table` reads the rest).
"""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.channels import SignalCandidate
from savgs_ident.recordings.recording import RecordingLayout
from savgs_ident.recordings.units import find_unit

SPACE = " "
"""Stands for any white space between cells; such cells are read as if tabs were between them."""
_DELIMITERS = (",", ";", "\t", "|")
_CONTENT = re.compile(rb"^[ \t\r\v\f]*[^\s#][^\n]*", re.MULTILINE)
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class CsvHead:
    """How the table is written.

    Attributes:
        delimiter: between cells.
        decimal: mark of a number.
        encoding: of the text.
        columns: names, with units as they are written there.
        units: those of a row of units.
        body: what of the first block follows the head.
        lines: its length.
        skipped: lines of words above the names.
        first: cells of the first row of data; empty where there is none.
    """

    delimiter: str
    decimal: str
    encoding: str
    columns: tuple[str, ...]
    units: tuple[str | None, ...]
    body: bytes
    lines: int
    skipped: int
    first: tuple[str, ...]

    def candidates(self) -> tuple[SignalCandidate, ...]:
        """The columns as signals; the key is the position."""
        return tuple(
            SignalCandidate(str(position), text, self.units[position], text)
            for position, text in enumerate(self.columns)
        )


def read_head(block: bytes, layout: RecordingLayout, source: str) -> CsvHead:
    """Read the head from the first block of whole lines.

    Raises :class:`InputError` where there is no header, a column is named twice, or the file is not text.
    """
    if b"\x00" in block[:4096]:
        raise InputError("is not a text file", source=source, remedy="give a CSV or MCAP file")
    encoding = _encoding(block)
    block = block.removeprefix(_BYTE_ORDER_MARK)
    lines = list(islice(_content_lines(block), _MOST_LINES))
    if not lines:
        raise InputError("is empty", source=source, remedy="record again, or give another file")
    texts = [line.decode(encoding) for line, _, _ in lines]
    place, delimiter = _header_line(texts, layout)
    columns = _cells(texts[place], delimiter)
    _check_columns(columns, layout, source)
    units: tuple[str | None, ...] = (None,) * len(columns)
    last, data = place, place + 1
    while data < len(lines) and not _is_data(_cells(texts[data], delimiter), len(columns)):
        row = _cells(texts[data], delimiter)
        if _is_unit_row(row, columns, layout):
            units = tuple(cell.strip("[]() ") or None for cell in row)
        elif place == 0 and data == 1:
            # What may be a broken row of data is for the table to judge.
            break
        last, data = data, data + 1
    columns = tuple(
        "time" if not name and unit in _TIMES else name for name, unit in zip(columns, units, strict=True)
    )
    _, end, count = lines[last if data < len(lines) else place]
    first = _cells(texts[data], delimiter) if data < len(lines) else ()
    decimal = "," if any(_WITH_COMMA.fullmatch(cell) for cell in first) else "."
    return CsvHead(delimiter, decimal, encoding, columns, units, block[end:], count, place, first)


_MOST_LINES = 400
"""Lines among which the names of the columns are looked for."""
_WITH_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
_FEW_WORDS = 4
"""Lines of words that may stand between the names of the columns and the data."""
_ROWS, _MOST_OF_THEM = 8, 0.7
"""Rows below the names that are looked at, and the least share of them with numbers: a preamble has some, too."""
_TIMES = ("s", "ms", "us", "µs", "min")
"""Units by which a column without a name is known to be the time."""


def _header_line(texts: list[str], layout: RecordingLayout) -> tuple[int, str]:
    """Where the names of the columns stand, and what delimits them: above data of as many cells.

    Of several such lines the one with most names that are known. The first line where there is no data below any.
    """
    best, known = (0, max(_DELIMITERS, key=texts[0].count)), (False, -1)
    for place, text in enumerate(texts):
        if known[0] and place > best[0] + _FEW_WORDS:
            break
        for delimiter in _possible_delimiters(text):
            cells = _cells(text, delimiter)
            below = texts[place + 1 : place + 2 + _FEW_WORDS]
            if len(cells) < 2 or all(_is_number(cell) for cell in cells if cell):
                continue
            if not any(_is_data(_cells(each, delimiter), len(cells)) for each in below):
                continue
            names = sum(layout.canonical_name(layout.split_header(each).label) is not None for each in cells)
            found = _goes_on(texts[place + 1 :], delimiter, len(cells)), names
            if found > known:
                best, known = (place, delimiter), found
    return best


def _goes_on(below: list[str], delimiter: str, count: int) -> bool:
    """Whether the lines below the names of so many columns are a table, once there are numbers in one."""
    rows = [_is_data(_cells(each, delimiter), count) for each in below[: _FEW_WORDS + _ROWS]]
    table = rows[rows.index(True) :][:_ROWS]
    return sum(table) >= _MOST_OF_THEM * len(table)


def _possible_delimiters(text: str) -> list[str]:
    """What may stand between the cells of a line: what is there most often; white space where nothing else is."""
    found = sorted((each for each in _DELIMITERS if each in text), key=text.count, reverse=True)
    return found[:1] or [SPACE]


def _is_data(cells: tuple[str, ...], count: int) -> bool:
    """Whether a row of so many cells holds numbers, in half of the cells that are not empty at least."""
    filled = [cell for cell in cells if cell]
    return len(cells) == count and 0 < len(filled) <= 2 * sum(_is_number(cell) for cell in filled)


def _encoding(block: bytes) -> str:
    try:
        block.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _content_lines(block: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Lines that are neither blank nor comments: the line, where the next one begins, and its number from 1."""
    for found in _CONTENT.finditer(block):
        yield found[0].strip(), found.end() + 1, block.count(b"\n", 0, found.start()) + 1


def _cells(line: str, delimiter: str) -> tuple[str, ...]:
    if delimiter == SPACE:
        return tuple(line.split())
    try:
        row = next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        row = line.split(delimiter)
    return tuple(cell.strip() for cell in row)


def _check_columns(columns: tuple[str, ...], layout: RecordingLayout, source: str) -> None:
    twice = sorted({name for name in columns if name and columns.count(name) > 1})
    if twice:
        raise InputError(
            f"column '{twice[0]}' is there twice", source=source, remedy="rename or delete one of the two"
        )
    if all(_is_number(name) for name in columns):
        example = ",".join(["time [s]", *(f"{each.name} [{each.unit}]" for each in layout.channels[:2])])
        raise InputError(
            "has no header line",
            source=source,
            remedy=f"write one such as '{example}'",
        )


def _is_unit_row(row: tuple[str, ...], columns: tuple[str, ...], layout: RecordingLayout) -> bool:
    """A second line such as ``s;mm;g``: what stands below a known column is a unit or empty.

    So is one with a time below a column without a name; and where no column is known, one of nothing but units.
    """
    if len(row) != len(columns) or any(_is_number(cell) for cell in row):
        return False
    if any(not name and cell.strip("[]() ") in _TIMES for cell, name in zip(row, columns, strict=True)):
        return True
    known = [
        cell.strip("[]() ")
        for cell, name in zip(row, columns, strict=True)
        if layout.canonical_name(layout.split_header(name).label)
    ]
    if not known:
        known = [cell.strip("[]() ") for cell in row]
    return all(not cell or find_unit(cell) for cell in known) and any(known)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
