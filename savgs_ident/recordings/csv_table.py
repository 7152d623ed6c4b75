"""A CSV file as float columns in bounded memory: text blocks, the head, the body.

:class:`TextBlocks` reads a text file, plain or gzipped, as blocks of whole lines. gzip is decompressed with
``zlib`` itself, because Python's ``gzip`` discards the last part of a file that ends too early, and that part is
good data. :func:`read_head` finds delimiter, decimal mark, encoding, column names and a row of units if there is
one. :class:`CsvTable` parses the body with pandas (fast, correctly rounded); the cells of a row are counted here,
because pandas fills a short row with missing values silently. Errors name the line of a bad cell or row.
"""

import csv
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.channels import Progress, SignalCandidate
from savgs_ident.recordings.recording import RecordingLayout, find_unit

if TYPE_CHECKING:
    import pandas as pd


GZIP_MAGIC = b"\x1f\x8b"
_RAW_BLOCK = 1 << 18
_TEXT_BLOCK = 1 << 22
_LONGEST_LINE = 1 << 20


class TextBlocks:
    """Iterate to get blocks of whole lines (bytes, each block ends with a newline).

    After the last block, ``cut`` says why the file ended early (empty if it did not) and ``tail`` is the
    line without a newline that was left over.
    """

    def __init__(self, path: Path, progress: Progress) -> None:
        self.path = path
        self.progress = progress
        self.cut = ""
        self.tail = b""

    def __iter__(self) -> Iterator[bytes]:
        with self.path.open("rb") as stream:
            zipped = stream.read(2) == GZIP_MAGIC
            stream.seek(0)
            parts = self._inflated(stream) if zipped else self._raw(stream)
            waiting, size = [], 0
            for part in parts:
                waiting.append(part)
                size += len(part)
                if size >= _TEXT_BLOCK:
                    block, rest = self._split(b"".join(waiting))
                    waiting, size = [rest], len(rest)
                    if block:
                        yield block
            block, self.tail = self._split(b"".join(waiting))
            if block:
                yield block

    def _split(self, text: bytes) -> tuple[bytes, bytes]:
        end = text.rfind(b"\n") + 1
        if len(text) - end > _LONGEST_LINE:
            raise InputError(
                f"has a line longer than {_LONGEST_LINE} bytes",
                source=self.path,
                remedy="this is not a table of measurements: give a CSV or MCAP file",
            )
        return text[:end], text[end:]

    def _raw(self, stream: BinaryIO) -> Iterator[bytes]:
        total = max(self.path.stat().st_size, 1)
        read = 0
        while part := stream.read(_RAW_BLOCK):
            read += len(part)
            self.progress(min(read / total, 1.0))
            yield part

    def _inflated(self, stream: BinaryIO) -> Iterator[bytes]:
        inflater = zlib.decompressobj(wbits=31)
        try:
            for raw in self._raw(stream):
                pending = raw
                while pending:
                    if inflater.eof:
                        if not pending.startswith(GZIP_MAGIC):
                            return
                        inflater = zlib.decompressobj(wbits=31)
                    text = inflater.decompress(pending, _TEXT_BLOCK)
                    pending = inflater.unused_data if inflater.eof else inflater.unconsumed_tail
                    if text:
                        yield text
        except zlib.error as error:
            self.cut = f"its compressed data is damaged ({error})"
        else:
            if not inflater.eof:
                self.cut = "its compressed data ends too early"


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
    lines = _content_lines(block.removeprefix(_BYTE_ORDER_MARK))
    head, rest, count = next(lines, (b"", b"", 0))
    if not head:
        raise InputError("is empty", source=source, remedy="record again, or give another file")
    text = head.decode(encoding)
    delimiter = max(_DELIMITERS, key=text.count)
    columns = _cells(text, delimiter)
    _check_columns(columns, layout, source)
    units: tuple[str | None, ...] = (None,) * len(columns)
    second, rest_after, count_after = next(lines, (b"", b"", count))
    row = _cells(second.decode(encoding), delimiter)
    if _is_unit_row(row, columns, layout):
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
    """A second line such as ``s;mm;g``: what stands below a known column is a unit or empty."""
    if len(row) != len(columns) or any(_is_number(cell) for cell in row):
        return False
    known = [
        cell.strip("[]() ")
        for cell, name in zip(row, columns, strict=True)
        if layout.canonical_name(layout.split_header(name).label)
    ]
    return bool(known) and all(not cell or find_unit(cell) for cell in known) and any(known)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


_QUOTED = re.compile(rb'"[^"\n]*"')


class CsvTable:
    """Columns ``wanted`` (positions) as float64 and the column ``test`` as runs of equal names."""

    def __init__(self, head: CsvHead, wanted: tuple[int, ...], test: int | None, source: str) -> None:
        self._head = head
        self._wanted = wanted
        self._test = test
        self._source = source
        self._line = head.lines
        self._blocks: dict[int, list[NDArray[np.float64]]] = {position: [] for position in wanted}
        self.rows = 0
        self.runs: list[tuple[str, int]] = []

    def append(self, block: bytes) -> None:
        """Parse a block of whole lines; raises :class:`InputError` at the first bad line."""
        if b"\x00" in block:
            raise InputError("is not a text file", source=self._source, remedy="give a CSV or MCAP file")
        self._check_ragged(block)
        if block.strip():
            frame = self._parse(block)
            for position in self._wanted:
                self._blocks[position].append(frame[position].to_numpy(dtype=np.float64))
            self._append_runs(frame)
            self.rows += len(frame)
        self._line += block.count(b"\n")

    def take(self, position: int) -> NDArray[np.float64]:
        """The whole column (rows,) in the unit of its header; it is removed from the table."""
        blocks = self._blocks.pop(position)
        return np.concatenate(blocks) if blocks else np.empty(0)

    def _check_ragged(self, block: bytes) -> None:
        text = _QUOTED.sub(b"", block) if b'"' in block else block
        raw = np.frombuffer(text, dtype=np.uint8)
        ends = np.flatnonzero(raw == ord("\n"))
        marks = np.flatnonzero(raw == ord(self._head.delimiter))
        cells = np.diff(np.searchsorted(marks, ends), prepend=0) + 1
        lengths = np.diff(ends, prepend=-1)
        bad = np.flatnonzero((cells != len(self._head.columns)) & (lengths > 2))
        for index in bad:
            start = int(ends[index - 1]) + 1 if index else 0
            if text[start : int(ends[index])].strip():
                raise InputError(
                    f"line {self._line + int(index) + 1} has {cells[index]} cells,"
                    f" the header has {len(self._head.columns)}",
                    source=self._source,
                    remedy="mend that line, or export again (a decimal comma needs ';' between cells)",
                )

    def _parse(self, block: bytes) -> "pd.DataFrame":
        import pandas as pd

        numbers: dict[int, type | str] = dict.fromkeys(self._wanted, np.float64)
        types = numbers if self._test is None else {**numbers, self._test: "category"}
        options = {
            "sep": self._head.delimiter,
            "decimal": self._head.decimal,
            "encoding": self._head.encoding,
            "encoding_errors": "replace",
            "header": None,
            "index_col": False,
            "names": list(range(len(self._head.columns))),
            "usecols": sorted(types),
            "skipinitialspace": True,
        }
        try:
            return pd.read_csv(BytesIO(block), dtype=types, **options)
        except pd.errors.ParserError as error:
            raise InputError(
                f"cannot be parsed after line {self._line}: {error}",
                source=self._source,
                remedy="look for an unpaired quotation mark, or export the file again",
            ) from error
        except (ValueError, OverflowError) as error:
            raise self._bad_cell(pd.read_csv(BytesIO(block), dtype=str, **options), error) from error

    def _bad_cell(self, frame: "pd.DataFrame", error: Exception) -> InputError:
        import pandas as pd

        for position in self._wanted:
            cells = frame[position].str.replace(self._head.decimal, ".", regex=False)
            bad = np.flatnonzero(pd.to_numeric(cells, errors="coerce").isna() & cells.notna())
            if bad.size:
                row = int(bad[0])
                return InputError(
                    f"'{frame[position].iloc[row]}' in data row {self.rows + row + 1} is not a number",
                    source=self._source,
                    channel=self._head.columns[position],
                    remedy="mend the cell, or leave it empty if the sample is missing",
                )
        return InputError(f"cannot be parsed: {error}", source=self._source, remedy="export the file again")

    def _append_runs(self, frame: "pd.DataFrame") -> None:
        if self._test is None:
            return
        column = frame[self._test].cat
        codes = column.codes.to_numpy()
        starts = np.flatnonzero(np.diff(codes, prepend=codes[0] - 1))
        for start in starts:
            code = int(codes[start])
            name = str(column.categories[code]).strip() if code >= 0 else ""
            if not self.runs or self.runs[-1][0] != name:
                self.runs.append((name, self.rows + int(start)))
