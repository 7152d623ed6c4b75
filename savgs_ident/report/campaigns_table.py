"""The table of many campaigns on disk: as CSV for everybody, as Parquet with types and times for programs."""

import io
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from savgs_ident.report.files import write_bytes, write_table

_TIMES = "start [UTC]"
_TEXTS = ("name", "source", "status", "reason")


def write_campaigns(folder: Path, columns: Mapping[str, Sequence[object]]) -> tuple[Path, Path]:
    """Write ``campaigns.csv`` and ``campaigns.parquet``, where None is an empty cell.

    Raises :class:`InputError` if they cannot be written.
    """
    return (
        write_table(folder / "campaigns.csv", columns),
        write_bytes(folder / "campaigns.parquet", _parquet(columns)),
    )


def _parquet(columns: Mapping[str, Sequence[object]]) -> bytes:
    content = io.BytesIO()
    pq.write_table(pa.table({name: _array(name, cells) for name, cells in columns.items()}), content)
    return content.getvalue()


def _array(name: str, cells: Sequence[object]) -> pa.Array:
    if name == _TIMES:
        times = [
            None if each is None else datetime.fromisoformat(str(each)).astimezone(UTC) for each in cells
        ]
        return pa.array(times, pa.timestamp("ms", tz="UTC"))
    return pa.array(cells, pa.string() if name in _TEXTS else pa.float64())
