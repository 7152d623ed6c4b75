"""A few kilobytes that unfold to gigabytes are refused or read in little memory and time."""

import gzip
import struct
import time
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import lz4.frame
import pytest
import zstandard

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.recordings.channels import read_channel_map
from savgs_ident.recordings.mcap_records import LARGEST_CHUNK, MAGIC

GIGABYTE = 1 << 30
MEGABYTE = bytes(1 << 20)
HEADER = b"time [s],road_height [m],sprung_accel [m/s^2]\n"


@contextmanager
def _bounded(memory: int, seconds: float = 10.0) -> Iterator[None]:
    """At most so much memory of Python and NumPy [bytes], and time of the processor [s]."""
    tracemalloc.start()
    began = time.process_time()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < memory
        assert time.process_time() - began < seconds
    finally:
        tracemalloc.stop()


@cache
def _zstd(size: int) -> bytes:
    packer = zstandard.ZstdCompressor(level=1).compressobj()
    return b"".join(packer.compress(MEGABYTE) for _ in range(size >> 20)) + packer.flush()


@cache
def _lz4(size: int) -> bytes:
    packer = lz4.frame.LZ4FrameCompressor()
    pieces = [bytes(packer.begin()), *(bytes(packer.compress(MEGABYTE)) for _ in range(size >> 20))]
    return b"".join(pieces) + bytes(packer.flush())


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def _chunk(compression: str, packed: bytes, declared: int) -> bytes:
    head = (
        struct.pack("<QQQI", 0, 0, declared, 0) + struct.pack("<I", len(compression)) + compression.encode()
    )
    return MAGIC + _record(1, bytes(8)) + _record(6, head + struct.pack("<Q", len(packed)) + packed)


@pytest.mark.parametrize("declared", [1000, LARGEST_CHUNK + 1, GIGABYTE, 1 << 63, (1 << 64) - 1])
@pytest.mark.parametrize(("compression", "pack"), [("zstd", _zstd), ("lz4", _lz4)])
def test_a_chunk_that_unfolds_to_a_gigabyte(
    compression: str, pack: Callable[[int], bytes], declared: int, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    # lz4 packs 255 to one at best: a quarter of it has a megabyte.
    path.write_bytes(
        _chunk(compression, pack(GIGABYTE if compression == "zstd" else GIGABYTE >> 2), declared)
    )
    assert path.stat().st_size < 2 << 20
    with _bounded(8 << 20), pytest.raises(InputError, match=r"declares .* bytes|a chunk is damaged"):
        load_campaign(path)


@pytest.mark.parametrize(("compression", "pack"), [("zstd", _zstd), ("lz4", _lz4)])
def test_a_chunk_of_zeros_that_is_as_large_as_it_says(
    compression: str, pack: Callable[[int], bytes], tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(_chunk(compression, pack(LARGEST_CHUNK), LARGEST_CHUNK))
    with _bounded(3 * LARGEST_CHUNK), pytest.raises(InputError, match="its records do not fill it"):
        load_campaign(path)


def _gzipped(*pieces: tuple[bytes, int]) -> bytes:
    packer = zlib.compressobj(9, wbits=31)
    return b"".join(packer.compress(piece) for piece, count in pieces for _ in range(count)) + packer.flush()


def test_a_line_of_a_gigabyte(tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(_gzipped((HEADER, 1), (b"1" * len(MEGABYTE), 1 << 8)) * 4)
    assert path.stat().st_size < 2 << 20
    with _bounded(64 << 20), pytest.raises(InputError, match="has a line longer than"):
        load_campaign(path)


def test_millions_of_empty_lines(tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(_gzipped((HEADER, 1), (b"\n" * len(MEGABYTE), 1 << 3)))
    with _bounded(256 << 20), pytest.raises(InputError, match="has a header but no data"):
        load_campaign(path)


def test_millions_of_rows_in_some_kilobytes(tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(HEADER + b"0,0,0\n" * (1 << 22), 9))
    assert path.stat().st_size < 100_000
    with _bounded(GIGABYTE, 20.0), pytest.raises(InputError, match=r"a\.csv\.gz"):
        load_campaign(path)


@pytest.mark.parametrize("nested", ["[" * 2000 + "]" * 2000, "{a=" * 2000 + "1" + "}" * 2000, "9" * 5000])
def test_a_map_without_end(nested: str, tmp_path: Path) -> None:
    path = tmp_path / "channels.toml"
    path.write_text(f"channels = {nested}\n")
    with pytest.raises(InputError, match="is not TOML") as caught:
        read_channel_map(path, RIG_LAYOUT)
    assert caught.value.source == str(path)
