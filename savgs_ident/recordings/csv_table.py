"""A CSV file as float columns in bounded memory: text blocks, the head, the body.

:class:`TextBlocks` reads a text file, plain or gzipped, in UTF-8, UTF-16 or Latin-1, as blocks of whole lines. gzip
is decompressed with ``zlib`` itself, because Python's ``gzip`` discards the last part of a file that ends too early,
and that part is good data. :func:`read_head` finds delimiter, decimal mark, encoding, column names and a row of units
if there is one, below whatever title lines stand above them. :class:`CsvTable` parses the body with pandas (fast,
correctly rounded); the cells of a row are counted here, because pandas fills a short row with missing values
silently. Errors name the line of a bad cell or row.
"""

import codecs
import csv
import re
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from itertools import islice
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
            parts = _as_utf_8(self._inflated(stream) if zipped else self._raw(stream))
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


_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


def _as_utf_8(parts: Iterable[bytes]) -> Iterator[bytes]:
    """The parts of a text, in UTF-8 where they begin as UTF-16 does."""
    decoder: codecs.IncrementalDecoder | None = None
    for number, part in enumerate(parts):
        if number == 0 and part.startswith(_UTF_16):
            decoder = codecs.getincrementaldecoder("utf-16")(errors="replace")
        yield part if decoder is None else decoder.decode(part).encode()


_SPACE = " "
"""Stands for any white space between cells; such cells are read as if tabs were between them."""
_DELIMITERS = (",", ";", "\t", "|")
_SPACES = re.compile(rb"[ \t]+")
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
    _, end, count = lines[last if data < len(lines) else place]
    first = _cells(texts[data], delimiter) if data < len(lines) else ()
    decimal = "," if any(_WITH_COMMA.fullmatch(cell) for cell in first) else "."
    return CsvHead(delimiter, decimal, encoding, columns, units, block[end:], count, place, first)


_MOST_LINES = 400
"""Lines among which the names of the columns are looked for."""
_WITH_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
_FEW_WORDS = 4
"""Lines of words that may stand between the names of the columns and the data."""


def _header_line(texts: list[str], layout: RecordingLayout) -> tuple[int, str]:
    """Where the names of the columns stand, and what delimits them: above data of as many cells.

    Of several such lines the one with most names that are known. The first line where there is no data below any.
    """
    best, known = (0, max(_DELIMITERS, key=texts[0].count)), -1
    for place, text in enumerate(texts):
        if known >= 0 and place > best[0] + _FEW_WORDS:
            break
        for delimiter in _possible_delimiters(text):
            cells = _cells(text, delimiter)
            below = texts[place + 1 : place + 2 + _FEW_WORDS]
            if len(cells) < 2 or all(_is_number(cell) for cell in cells if cell):
                continue
            if not any(_is_data(_cells(each, delimiter), len(cells)) for each in below):
                continue
            names = sum(layout.canonical_name(layout.split_header(each).label) is not None for each in cells)
            if names > known:
                best, known = (place, delimiter), names
    return best


def _possible_delimiters(text: str) -> list[str]:
    """What may stand between the cells of a line: what is there most often; white space where nothing else is."""
    found = sorted((each for each in _DELIMITERS if each in text), key=text.count, reverse=True)
    return found[:1] or [_SPACE]


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
    if delimiter == _SPACE:
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


_COMMA_SECONDS = r",(?=\d+$)"
"""The decimal comma of seconds."""


def _since_1970(cells: "pd.Series[str]") -> "pd.Series[float]":
    """Dates as seconds since 1970, hours without a date as seconds of that day; NaN for what is neither.

    With dots between its parts a date begins with the day, as it does where people write it so.
    """
    import pandas as pd

    first = str(cells.iloc[0]) if len(cells) else ""
    if "-" not in first and "/" not in first and "." not in first.partition(":")[0]:
        return pd.to_timedelta(cells, errors="coerce").dt.total_seconds()
    day_first = "." in first.partition(":")[0]
    dates = pd.to_datetime(cells, utc=True, errors="coerce", format="mixed", dayfirst=day_first)
    return (dates - pd.Timestamp(0, tz="UTC")).dt.total_seconds()


_QUOTED = re.compile(rb'"[^"\n]*"')


class CsvTable:
    """Columns ``wanted`` (positions) as float64 and the column ``test`` as runs of equal names.

    Of columns of ``dates`` the numbers are seconds since 1970, as if clocks without a zone showed UTC.
    """

    def __init__(
        self, head: CsvHead, wanted: tuple[int, ...], test: int | None, source: str, dates: frozenset[int]
    ) -> None:
        self._head = head
        self._dates = dates
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
        if self._head.delimiter == _SPACE:
            block = b"".join(_SPACES.sub(b"\t", line.strip()) + b"\n" for line in block.splitlines())
        self._check_ragged(block)
        if block.strip():
            frame = self._parse(block)
            for position in self._wanted:
                self._blocks[position].append(self._numbers(frame, position))
            self._append_runs(frame)
            self.rows += len(frame)
        self._line += block.count(b"\n")

    @property
    def _delimiter(self) -> str:
        return "\t" if self._head.delimiter == _SPACE else self._head.delimiter

    def take(self, position: int) -> NDArray[np.float64]:
        """The whole column (rows,) in the unit of its header; it is removed from the table."""
        blocks = self._blocks.pop(position)
        return np.concatenate(blocks) if blocks else np.empty(0)

    def _check_ragged(self, block: bytes) -> None:
        text = _QUOTED.sub(b"", block) if b'"' in block else block
        raw = np.frombuffer(text, dtype=np.uint8)
        ends = np.flatnonzero(raw == ord("\n"))
        marks = np.flatnonzero(raw == ord(self._delimiter))
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

        numbers: dict[int, type | str] = {
            position: str if position in self._dates or self._quoted else np.float64
            for position in self._wanted
        }
        types = numbers if self._test is None else {**numbers, self._test: "category"}
        options = {
            "sep": self._delimiter,
            "decimal": "." if self._quoted else self._head.decimal,
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

    @property
    def _quoted(self) -> bool:
        """Whether numbers with a decimal comma stand in quotes, for commas are between the cells, too."""
        return self._head.decimal == self._delimiter

    def _numbers(self, frame: "pd.DataFrame", position: int) -> NDArray[np.float64]:
        import pandas as pd

        column = frame[position]
        if position in self._dates:
            found = _since_1970(column.str.replace(_COMMA_SECONDS, ".", regex=True))
            if (found.isna() & column.notna()).any():
                raise self._bad_cell(frame, ValueError("no date"))
            return np.asarray(found, dtype=np.float64)
        if self._quoted:
            numbers = pd.to_numeric(column.str.replace(",", ".", regex=False), errors="coerce")
            if (numbers.isna() & column.notna()).any():
                raise self._bad_cell(frame, ValueError("no number"))
            return np.asarray(numbers, dtype=np.float64)
        return np.asarray(column.to_numpy(dtype=np.float64))

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
