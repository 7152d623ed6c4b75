"""A CSV file as float columns in bounded memory: text blocks, then the body below the head.

:class:`TextBlocks` reads a text file, plain or gzipped, in UTF-8, UTF-16 or Latin-1, as blocks of whole lines. gzip
is decompressed with ``zlib`` itself, because Python's ``gzip`` discards the last part of a file that ends too early,
and that part is good data. :class:`CsvTable` parses what is below the head (:mod:`savgs_ident.recordings.csv_head`)
with pandas (fast, correctly rounded); the cells of a row are counted here, because pandas fills a short row with
missing values silently. Errors name the line of a bad cell or row.
"""

import codecs
import re
import zlib
from collections.abc import Generator, Iterable, Iterator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.channels import Progress
from savgs_ident.recordings.csv_head import SPACE, CsvHead

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

    def __iter__(self) -> Generator[bytes, None, None]:
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


_SPACES = re.compile(rb"[ \t]+")
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
        if self._head.delimiter == SPACE:
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
        return "\t" if self._head.delimiter == SPACE else self._head.delimiter

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
