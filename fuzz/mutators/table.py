"""Tables of measurements: cells, columns, rows, units and separators that are not what they were."""

import gzip
import zlib
from collections.abc import Callable
from functools import lru_cache

from numpy.random import Generator

from fuzz.mutators import tokens

Rows = list[list[str]]


def damage_table(content: bytes, random: Generator) -> bytes:
    """A CSV table with one to three such faults."""
    rows = [line.split(",") for line in content.decode("utf-8").splitlines()]
    for _ in range(int(random.integers(1, 4))):
        if rows and rows[0]:
            _WAYS[int(random.integers(len(_WAYS)))](rows, random)
    text = "\n".join(",".join(row) for row in rows) + "\n"
    return _dressed(text, random)


def damage_packed(content: bytes, random: Generator) -> bytes:
    """The same within a gzip file, or several such files one behind the other, or a table that never ends."""
    text = gzip.decompress(content)
    match int(random.integers(12)):
        case 0:
            return content + content
        case 1:
            return content + random.bytes(20)
        case 2:
            return content + _packed(b"0" * (1 << 20), 16)
        case 3:
            last = text.splitlines(keepends=True)[-1]
            return content + _packed(last * (1 << 10), 16)
        case 4:
            return content + _packed(b"\n" * (1 << 20), 8)
        case 5:
            # Nothing for long behind the header.
            return (
                gzip.compress(text[: text.index(b"\n") + 1], mtime=0)
                + _packed(b"\n" * (1 << 20), 8)
                + content
            )
    return gzip.compress(damage_table(text, random), 1, mtime=0)


@lru_cache(maxsize=8)
def _packed(piece: bytes, count: int) -> bytes:
    """A piece so many times, gzipped."""
    packer = zlib.compressobj(6, wbits=31)
    return b"".join(packer.compress(piece) for _ in range(count)) + packer.flush()


def _dressed(text: str, random: Generator) -> bytes:
    match int(random.integers(14)):
        case 0:
            return text.replace(",", ";").encode()
        case 1:
            return text.replace("\n", "\r\n").encode()
        case 2:
            return text.replace("\n", "\r").encode()
        case 3:
            return text.encode("utf-16")
        case 4:
            return text.encode("utf-8-sig")
        case 5:
            return text.replace(".", ",").encode()
        case 6:
            return text.rstrip("\n").encode()
    return text.encode()


def _cell(rows: Rows, random: Generator) -> None:
    for _ in range(int(random.choice([1, 1, 5]))):
        row = rows[int(random.integers(len(rows)))]
        if row:
            row[int(random.integers(len(row)))] = _one(tokens.CELLS, random)


def _column(rows: Rows, random: Generator) -> None:
    """The same in a whole column, below the header."""
    at, cell = int(random.integers(len(rows[0]))), _one(tokens.CELLS, random)
    for row in rows[1:]:
        if at < len(row):
            row[at] = cell


def _drop_column(rows: Rows, random: Generator) -> None:
    at = int(random.integers(len(rows[0])))
    for row in rows[int(random.integers(2)) :]:
        del row[at : at + 1]


def _double_column(rows: Rows, random: Generator) -> None:
    at = int(random.integers(len(rows[0])))
    for row in rows:
        row.extend(row[at : at + 1])


def _header(rows: Rows, random: Generator) -> None:
    rows[0][int(random.integers(len(rows[0])))] = _one(tokens.HEADERS, random)


def _unit_row(rows: Rows, random: Generator) -> None:
    rows.insert(1, [_one(("s", "mm", "g", "", "m", "furlong", "[ms]"), random) for _ in rows[0]])


def _disorder(rows: Rows, random: Generator) -> None:
    body = rows[1:]
    order = random.permutation(len(body)) if random.random() < 0.5 else range(len(body) - 1, -1, -1)
    rows[1:] = [body[int(place)] for place in order]


def _double_rows(rows: Rows, random: Generator) -> None:
    begin = int(random.integers(len(rows)))
    rows[begin:begin] = [list(row) for row in rows[begin : begin + int(random.integers(1, 20))]]


def _drop_rows(rows: Rows, random: Generator) -> None:
    begin = int(random.integers(1, max(len(rows), 2)))
    del rows[begin : begin + int(random.integers(1, len(rows) + 1))]


def _comment(rows: Rows, random: Generator) -> None:
    rows.insert(int(random.integers(len(rows) + 1)), [_one(("# a note", "", "   ", "sep=;"), random)])


def _one(values: tuple[str, ...], random: Generator) -> str:
    return values[int(random.integers(len(values)))]


_WAYS: tuple[Callable[[Rows, Generator], None], ...] = (
    _cell, _cell, _column, _drop_column, _double_column, _header, _header, _unit_row, _disorder, _double_rows,
    _drop_rows, _comment,
)  # fmt: skip
