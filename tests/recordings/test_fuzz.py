"""Whatever bytes come in, a reader answers with a campaign or an InputError, never with another exception."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.recordings.cdr import SchemaError, find_layout, parse_definition
from savgs_ident.recordings.mcap_records import MAGIC
from savgs_ident.recordings.recording import Campaign

SHARED_FOLDER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
START = 1_763_715_600_000_000_000
FLIPS = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=6)


def _survives(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    try:
        campaign = load_campaign(path)
    except InputError as error:
        refusal = str(error)
    else:
        refusal = ""
        _check_sound(campaign)
    assert not refusal or str(path.parent) in refusal


def _check_sound(campaign: Campaign) -> None:
    assert campaign.recordings
    for recording in campaign.recordings:
        for name, channel in recording.channels.items():
            assert channel.unit == RIG_LAYOUT.si_unit(name)
            assert np.isfinite(channel.values).all()
            assert (np.diff(channel.time) > 0).all()


def _flipped(content: bytes, flips: list[tuple[float, int]]) -> bytes:
    changed = bytearray(content)
    for where, mask in flips:
        changed[int(where * len(changed))] ^= mask
    return bytes(changed)


@SHARED_FOLDER
@given(
    content=st.binary(max_size=300), name=st.sampled_from(["a.csv", "a.csv.gz", "a.mcap", "dwell_1Hz.txt"])
)
def test_random_bytes(content: bytes, name: str, tmp_path: Path) -> None:
    _survives(tmp_path / name, content)


@SHARED_FOLDER
@given(tail=st.binary(max_size=300))
def test_random_bytes_behind_the_magic(tail: bytes, tmp_path: Path) -> None:
    _survives(tmp_path / "a.mcap", MAGIC + tail)
    _survives(tmp_path / "a.csv.gz", b"\x1f\x8b\x08" + tail)


CELL = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True).map(str),
    st.floats(-1, 1).map(str),
    st.integers(-(10**30), 10**30).map(str),
    st.text(max_size=6),
    st.sampled_from(["", "nan", "inf", '"', '""', ",", "1,5", "0x1F", "1e999", "\x00", "#"]),
)
HEADER = st.one_of(
    st.sampled_from(
        ["time [s]", "time", "road [mm]", "sprung_accel [g]", "deflection_mm", "test", "road [", "[m]"]
    ),
    st.text(max_size=8),
)


@SHARED_FOLDER
@given(
    header=st.lists(HEADER, min_size=1, max_size=5),
    rows=st.lists(st.lists(CELL, min_size=1, max_size=5), max_size=8),
    separator=st.sampled_from([",", ";", "\t"]),
    encoding=st.sampled_from(["utf-8", "latin-1", "utf-16"]),
)
def test_random_tables(
    header: list[str], rows: list[list[str]], separator: str, encoding: str, tmp_path: Path
) -> None:
    text = "\n".join(separator.join(row) for row in [header, *rows]) + "\n"
    _survives(tmp_path / "dwell_1Hz.csv", text.encode(encoding, errors="replace"))


@SHARED_FOLDER
@given(
    rows=st.lists(st.lists(CELL, min_size=3, max_size=3), min_size=1, max_size=8),
    kind=st.sampled_from(["dwell_1Hz", "sweep", "standstill", "x"]),
)
def test_random_cells_under_a_good_header(rows: list[list[str]], kind: str, tmp_path: Path) -> None:
    text = "time [s],road_height [m],sprung_accel [g]\n" + "".join(",".join(row) + "\n" for row in rows)
    _survives(tmp_path / f"{kind}.csv", text.encode(errors="replace"))


@SHARED_FOLDER
@given(flips=FLIPS, packed=st.booleans())
def test_flipped_bits_in_a_table(
    flips: list[tuple[float, int]],
    packed: bool,
    tmp_path: Path,
    signals: Callable[..., Any],
    csv_bytes: Callable[..., bytes],
) -> None:
    text = csv_bytes(signals(2.0, 4.0, 50.0), test="dwell_2Hz")
    _survives(tmp_path / "a.csv", _flipped(gzip.compress(text) if packed else text, flips))


@pytest.fixture(scope="module")
def whole_files(
    tmp_path_factory: pytest.TempPathFactory,
    signals: Callable[..., Any],
    json_messages: Callable[..., Any],
    json_topics: Any,
    write_mcap: Callable[..., Path],
) -> list[bytes]:
    folder = tmp_path_factory.mktemp("whole")
    messages = json_messages(signals(2.0, 4.0, 50.0), "dwell_2Hz", 2.0)
    files = [
        write_mcap(folder / f"{chunked}{compression.name}", json_topics, messages, compression=compression,
                   chunked=chunked, chunk_size=2000)
        for compression in (CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD)
        for chunked in (True, False)
    ]  # fmt: skip
    return [file.read_bytes() for file in files]


@SHARED_FOLDER
@given(flips=FLIPS, which=st.integers(0, 5), share=st.floats(0.3, 1.0))
def test_flipped_bits_in_an_mcap(
    flips: list[tuple[float, int]], which: int, share: float, tmp_path: Path, whole_files: list[bytes]
) -> None:
    content = whole_files[which]
    _survives(tmp_path / "a.mcap", _flipped(content[: int(share * len(content))], flips))


@SHARED_FOLDER
@given(
    flips=FLIPS, name=st.sampled_from(["tilt_imu_unchunked", "tilt_none", "rosbags-rs_test_bag", "tilt_zstd"])
)
def test_flipped_bits_in_files_of_others(
    flips: list[tuple[float, int]], name: str, tmp_path: Path, shared_mcap: Path
) -> None:
    _survives(tmp_path / "a.mcap", _flipped((shared_mcap / f"{name}.mcap").read_bytes(), flips))


@SHARED_FOLDER
@given(payloads=st.lists(st.binary(max_size=80), min_size=1, max_size=5), schema=st.text(max_size=60))
def test_random_cdr_messages(
    payloads: list[bytes], schema: str, tmp_path: Path, write_mcap: Callable[..., Path]
) -> None:
    topics = {
        "/road_height": ("cdr", "std_msgs/msg/Float64", "ros2msg", b"float64 data"),
        "/imu": ("cdr", "a/Imu", "ros2msg", schema.encode(errors="replace")),
        "/deflection": ("json", "a", "jsonschema", schema.encode(errors="replace")),
        "/test": ("cdr", "std_msgs/msg/String", "ros2msg", b"string data"),
    }
    messages = [(topic, START + i, data) for topic in topics for i, data in enumerate(payloads)]
    path = write_mcap(tmp_path / "a.mcap", topics, messages)
    _survives(path, path.read_bytes())


@given(
    text=st.lists(
        st.sampled_from(
            [
                "float64[] a",
                "string[3] b",
                "a/B[2] c",
                "uint8 d",
                "wstring e",
                "===",
                "MSG: a/B",
                "int8[<=4] f",
            ]
        ),
        max_size=8,
    ).map("\n".join),
    message=st.binary(max_size=120),
)
def test_random_definitions(text: str, message: bytes) -> None:
    try:
        layout = find_layout(b"\x00\x01\x00\x00" + message, parse_definition("a/A", text))
    except SchemaError:
        return
    assert all(spot.offset + int(spot.code[2]) <= len(message) + 4 for spot in layout.numbers.values())
