"""The body of a CSV file as growing float columns; a bad cell or row is named by its line.

pandas parses the numbers (it is fast and rounds correctly); how many cells a row has is counted here,
because pandas fills a short row with missing values and says nothing.
"""

import re
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.csv_header import CsvHead

if TYPE_CHECKING:
    import pandas as pd

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
        """The whole column (rows,) in the unit of its header; it is handed over, not kept."""
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
