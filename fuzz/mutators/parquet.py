"""Damage of a Parquet file that leaves it one: its columns of other kinds, lengths, names and values."""

from io import BytesIO

import pyarrow as pa
import pyarrow.parquet as pq
from numpy.random import Generator

_ODD = (
    pa.scalar("words"),
    pa.scalar(float("nan")),
    pa.scalar(float("inf")),
    pa.scalar(None, pa.float64()),
    pa.scalar(2**62),
    pa.scalar([1.0, 2.0]),
    pa.scalar(b"\x00\xff"),
    pa.scalar(10**15, pa.timestamp("us")),
)


def damage_parquet(content: bytes, random: Generator) -> bytes:
    """The table with one of its columns changed, renamed, left out or there twice, or without rows."""
    table = pq.read_table(BytesIO(content))
    names = list(table.column_names)
    place = int(random.integers(len(names)))
    match int(random.integers(5)):
        case 0:
            value = _ODD[int(random.integers(len(_ODD)))]
            table = table.set_column(
                place, names[place], pa.array([value.as_py()] * table.num_rows, value.type)
            )
        case 1:
            other = names[int(random.integers(len(names)))]
            table = table.rename_columns([other if k == place else name for k, name in enumerate(names)])
        case 2:
            table = table.remove_column(place)
        case 3:
            table = table.append_column(names[place], table.column(place))
        case _:
            table = table.slice(0, int(random.integers(3)))
    stream = BytesIO()
    pq.write_table(table, stream)
    return stream.getvalue()
