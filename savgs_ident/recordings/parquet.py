"""Parquet campaigns: a table with a ``test`` column, or one test a file, as CSV has them.

The unit of a column stands in its name (``angle [deg]``) or in the metadata ``unit`` of its field. Columns that are
not numbers are left out; a column of times becomes seconds since 1970.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.channels import ChannelMap, Progress, Reader, Reading
from savgs_ident.recordings.csv import TEST_COLUMNS
from savgs_ident.recordings.recording import normalise
from savgs_ident.recordings.signals import Signal, reading_of, test_of

MOST_NUMBERS = 2**28
"""Most numbers that are unpacked: two gigabytes."""


def read_parquet(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one Parquet file; raises :class:`InputError` where it is no table of measurements."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    source = str(path)
    try:
        about = pq.read_metadata(path)
        if about.num_rows * about.num_columns > MOST_NUMBERS:
            raise InputError(
                f"holds {about.num_rows} rows of {about.num_columns} columns",
                source=source,
                remedy="give one test a file, and only the columns that are needed",
            )
        # What is in the columns is looked at here only.
        return _reading(pq.read_table(path), path, channel_map, progress)
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"cannot be read as Parquet: {str(error).splitlines()[0]}",
            source=source,
            remedy="copy the file again",
        ) from error


def _reading(table: Any, path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """The recordings of a table; raises what pyarrow does where its columns are damaged."""
    import pyarrow as pa

    source = str(path)
    if table.num_rows == 0:
        raise InputError(
            "has columns but no data", source=source, remedy="record again, or give another file"
        )
    names = table.column_names
    tests = channel_map.test_column or next((each for each in names if normalise(each) in TEST_COLUMNS), None)
    signals = [
        Signal(field.name, _unit(field), None, values)
        for field in table.schema
        if field.name != tests and (values := _numbers(table.column(field.name))) is not None
    ]
    progress(1.0)
    if tests is None:
        return reading_of([(test_of(path), signals)], channel_map, source)
    if tests not in names:
        raise InputError(
            f"channels.toml names column '{tests}', the file does not have it",
            source=source,
            channel="test",
            remedy="the columns are " + ", ".join(names[:20]),
        )
    runs = np.asarray(table.column(tests).cast(pa.string()).to_pylist(), dtype=object)
    starts = np.flatnonzero(np.append(True, runs[1:] != runs[:-1]))
    named = zip(starts, [*starts[1:], runs.size], strict=True)
    parts = [
        (str(runs[a]), [Signal(each.name, each.unit, None, each.values[a:b]) for each in signals])
        for a, b in named
        if runs[a]
    ]
    return reading_of(parts, channel_map, source)


def _unit(field: Any) -> str | None:
    unit = (field.metadata or {}).get(b"unit")
    return None if unit is None else unit.decode("utf-8", "replace")


def _numbers(column: Any) -> NDArray[np.float64] | None:
    """A column as numbers, what is missing as NaN; None where it holds something else."""
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        ticks = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        column = pc.multiply(column.cast(pa.int64()).cast(pa.float64()), ticks)
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
        return None
    return np.asarray(pc.fill_null(column.cast(pa.float64(), safe=False), float("nan")), dtype=np.float64)


PARQUET = Reader(
    name="Parquet", suffixes=(".parquet", ".pq"), magic=(b"PAR1",), plain_text=False, read=read_parquet
)
