"""Write an hour of road in the formats that test labs have: eight channels at 1 kHz, as a data logger does.

MCAP has a module of its own, :mod:`benchmarks.write_long_mcap`.

    python -m benchmarks.write_long_recordings mdf4 FOLDER --minutes 60

Six are those of the rig, two are others that a reader passes over: a temperature and a voltage. What matters here is
how fast and in how much memory they are read.
"""

import argparse
import sqlite3
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from benchmarks.write_long_mcap import UNITS

RATE_HZ = 1000.0

_UNITS = {**UNITS, "oil_temperature": "degC", "supply_voltage": "V"}
_SIZES = {"road_height": 0.01, "sprung_accel": 1.0, "susp_deflection": 0.008, "link_velocity": 0.01}
_NAME = "road_class_c"

Signals = Mapping[str, NDArray[np.float64]]


def signals(minutes: float) -> Signals:
    """The time [s] and the eight channels [unit of each], (n,) each."""
    time = np.arange(round(60.0 * minutes * RATE_HZ)) / RATE_HZ
    random = np.random.default_rng(1)
    found = {"time": time}
    for name in _UNITS:
        size = _SIZES.get(name, 0.1)
        waves = sum(np.sin(2.0 * np.pi * f * time + 6.0 * random.random()) for f in (0.7, 1.3, 2.9, 7.1))
        found[name] = size * (waves + 0.01 * random.standard_normal(time.size))
    return found


def _columns(found: Signals) -> Iterator[tuple[str, NDArray[np.float64]]]:
    yield "time [s]", found["time"]
    yield from ((f"{name} [{unit}]", found[name]) for name, unit in _UNITS.items())


def _csv(folder: Path, found: Signals) -> Path:
    import pyarrow as pa
    import pyarrow.csv as pc

    path = folder / f"{_NAME}.csv"
    pc.write_csv(pa.table({name: np.round(values, 6) for name, values in _columns(found)}), path)
    return path


def _csv_gz(folder: Path, found: Signals) -> Path:
    import gzip
    import shutil

    plain = _csv(folder, found)
    path = folder / f"{_NAME}.csv.gz"
    with plain.open("rb") as read, gzip.open(path, "wb", compresslevel=1) as written:
        shutil.copyfileobj(read, written)
    plain.unlink()
    return path


def _parquet(folder: Path, found: Signals) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / f"{_NAME}.parquet"
    pq.write_table(pa.table(dict(_columns(found))), path)
    return path


def _mdf4(folder: Path, found: Signals) -> Path:
    from asammdf import MDF, Signal

    path = folder / f"{_NAME}.mf4"
    with MDF() as file:
        file.append(
            [Signal(found[name], found["time"], unit=unit, name=name) for name, unit in _UNITS.items()]
        )
        file.save(path)
    return path


def _tdms(folder: Path, found: Signals) -> Path:
    from nptdms import ChannelObject, TdmsWriter

    path = folder / f"{_NAME}.tdms"
    clock = {"wf_increment": 1.0 / RATE_HZ, "wf_start_offset": 0.0}
    channels = [
        ChannelObject("run", name, found[name], {"unit_string": unit, **clock})
        for name, unit in _UNITS.items()
    ]
    with TdmsWriter(path) as writer:
        writer.write_segment(channels)
    return path


def _units_of_matlab(folder: Path) -> None:
    lines = (
        f'[channels.{name}]\ncolumn = "{name}"\nunit = "{unit}"\n' for name, unit in list(_UNITS.items())[:6]
    )
    (folder / "channels.toml").write_text("".join(lines))


def _mat5(folder: Path, found: Signals) -> Path:
    from scipy.io import savemat

    path = folder / f"{_NAME}.mat"
    savemat(path, {name: values[:, None] for name, values in found.items()})
    _units_of_matlab(folder)
    return path


def _mat73(folder: Path, found: Signals) -> Path:
    import h5py

    path = folder / f"{_NAME}.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in found.items():
            file[name] = values[None]
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116))
    _units_of_matlab(folder)
    return path


def _rosbag(folder: Path, found: Signals) -> Path:
    """One topic for each channel, of std_msgs/Float64."""
    path, began = folder / f"{_NAME}.db3", 1_763_715_600_000_000_000
    pack = struct.Struct("<4sd").pack
    with sqlite3.connect(path) as bag:
        bag.execute(
            "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
        )
        bag.execute(
            "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
        )
        stamps = (began + np.rint(1e9 * found["time"]).astype(np.int64)).tolist()
        for number, name in enumerate(_UNITS, 1):
            bag.execute(
                "INSERT INTO topics VALUES (?, ?, 'std_msgs/msg/Float64', 'cdr')", (number, f"/{name}")
            )
            bag.executemany(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                (
                    (number, stamp, pack(b"\x00\x01\x00\x00", value))
                    for stamp, value in zip(stamps, found[name].tolist(), strict=True)
                ),
            )
    return path


WRITERS: Mapping[str, Callable[[Path, Signals], Path]] = MappingProxyType(
    {
        "csv": _csv,
        "csv_gz": _csv_gz,
        "parquet": _parquet,
        "mdf4": _mdf4,
        "tdms": _tdms,
        "mat5": _mat5,
        "mat73": _mat73,
        "rosbag": _rosbag,
    }
)
"""What writes a recording into a folder and gives its path, by the name of the format."""


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="write a long recording")
    parser.add_argument("format", choices=WRITERS)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--minutes", type=float, default=60.0)
    options = parser.parse_args()
    print(WRITERS[options.format](options.folder, signals(options.minutes)))


if __name__ == "__main__":
    main()
