"""Every kind of broken MCAP file gives an error that says what and where, or a warning and what is whole."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard
from mcap.writer import CompressionType

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.mcap_records import LARGEST_CHUNK, MAGIC

from ..in_one_test import over
from .refusal import check_refusal

START = 1_763_715_600_000_000_000
FLOAT64 = b"float64 data"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _chunk(compression: str, data: bytes, declared: int, crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", START, START, declared, crc) + _text(compression)
    return _record(0x06, head + struct.pack("<Q", len(data)) + data)


def _file(*records: bytes) -> bytes:
    return MAGIC + _record(0x01, _text("") + _text("test")) + b"".join(records)


BOMB = zstandard.ZstdCompressor().compress(bytes(1 << 24))
LOST_MESSAGE = _record(0x05, struct.pack("<HIQQ", 9, 0, START, START) + b"{}")
BYTES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty"),
    "other magic": (b"MCAP but not really", "is not an MCAP file: its first bytes are b'MCAP but'"),
    "nothing after the magic": (MAGIC, "ends too early.*Remedy: copy the file again"),
    "cut in the first chunk": (_file(_chunk("zstd", BOMB, 1 << 24)[:60]), "ends too early"),
    "absurd record length": (MAGIC + struct.pack("<BQ", 5, 1 << 62), "ends too early"),
    "absurd chunk": (
        _file(_chunk("zstd", BOMB, LARGEST_CHUNK + 1)),
        f"declares {LARGEST_CHUNK + 1} bytes, more than {LARGEST_CHUNK}",
    ),
    "chunk that holds more than it says": (_file(_chunk("zstd", BOMB, 100)), "101 bytes instead of 100"),
    "chunk that holds less": (_file(_chunk("", b"abc", 100)), "3 bytes instead of 100"),
    "chunk with a wrong checksum": (_file(_chunk("", LOST_MESSAGE, 33, crc=1)), "checksum wrong"),
    "chunk of rubbish": (_file(_chunk("zstd", b"rubbish", 100)), "a chunk is damaged"),
    "unknown compression": (_file(_chunk("brotli", b"x", 1)), "compressed with 'brotli'.*zstd, lz4 or none"),
    "message of no channel": (_file(LOST_MESSAGE), "messages of channel 9, which it does not describe"),
    "channel record cut": (_file(_record(0x04, b"\x01\x00")), "schema or channel record is damaged"),
}


@over("case", BYTES)
def test_broken_container_is_refused(case: str, tmp_path: Path) -> None:
    content, message = BYTES[case]
    path = tmp_path / "broken.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_campaign(path)
    assert str(path) in str(caught.value)
    assert "Remedy: " in str(caught.value)
    check_refusal(path, caught.value)


def test_the_checksum_that_is_tested_can_be_right(tmp_path: Path) -> None:
    path = tmp_path / "whole.mcap"
    path.write_bytes(_file(_chunk("", LOST_MESSAGE, 33, crc=zlib.crc32(LOST_MESSAGE))))
    with pytest.raises(InputError, match="messages of channel 9"):
        load_campaign(path)


CDR = b"\x00\x01\x00\x00"
TOPICS: dict[str, tuple[tuple[str, str, str, bytes], bytes, str]] = {
    "unknown message encoding": (
        ("protobuf", "Road", "protobuf", b""),
        b"\x01",
        "/road_height: its message encoding 'protobuf' is not read",
    ),
    "schema missing": (("cdr", "", "", b""), CDR + bytes(8), "/road_height: its schema is missing"),
    "schema in IDL": (
        ("cdr", "Road", "ros2idl", b""),
        CDR + bytes(8),
        "schema encoding 'ros2idl' is not read",
    ),
    "schema of rubbish": (("cdr", "a/Road", "ros2msg", b"!?"), CDR, "its schema is not understood"),
    "schema without its type": (
        ("cdr", "a/Road", "ros2msg", b"b/Cam cam"),
        CDR,
        "type 'b/Cam' is not defined",
    ),
    "schema in a circle": (
        ("cdr", "a/Road", "ros2msg", b"a/Cam cam\n===\nMSG: a/Cam\na/Cam cam"),
        CDR,
        "nested deeper",
    ),
    "message cut": (
        ("cdr", "std_msgs/msg/Float64", "ros2msg", FLOAT64),
        CDR + b"\x00",
        "channel '/road_height', at 1763715600.000 s: the message ends after 5 bytes",
    ),
    "message of another format": (
        ("cdr", "std_msgs/msg/Float64", "ros2msg", FLOAT64),
        b"\x00\x77\x00\x00" + bytes(8),
        "does not begin as CDR",
    ),
    "not JSON": (("json", "Road", "jsonschema", b"{}"), b"{road", "is not a JSON object: '{road'"),
    "JSON list": (("json", "Road", "jsonschema", b"{}"), b"[1]", "is not a JSON object"),
    "JSON joined": (("json", "Road", "jsonschema", b"{}"), b"{},{}", "is not a JSON object"),
    "unknown topic only": (
        ("json", "Road", "jsonschema", b"{}"),
        b'{"x": 1}',
        "topics: /road_height.*channels.toml",
    ),
}


@over("case", TOPICS)
def test_unreadable_topic_is_refused_with_its_reason(
    case: str, tmp_path: Path, write_mcap: Callable[..., Path]
) -> None:
    topic, payload, message = TOPICS[case]
    path = write_mcap(tmp_path / "a.mcap", {"/road_height": topic}, [("/road_height", START, payload)])
    with pytest.raises(InputError, match=message) as caught:
        load_campaign(path)
    check_refusal(path, caught.value)


def test_a_text_where_a_number_belongs_is_named_with_its_time(
    tmp_path: Path, write_mcap: Callable[..., Path]
) -> None:
    messages = [
        ("/road", START + i * 10_000_000, b'{"road_height": "high"}' if i == 3 else b'{"road_height": 0.1}')
        for i in range(9)
    ]
    path = write_mcap(tmp_path / "a.mcap", {"/road": ("json", "R", "jsonschema", b"{}")}, messages)
    with pytest.raises(
        InputError, match=r"'/road', at 1763715600\.030 s: 'road_height' is 'high', not a number"
    ):
        load_campaign(path)


def test_the_same_channel_on_two_topics(tmp_path: Path, write_mcap: Callable[..., Path]) -> None:
    kind = ("cdr", "std_msgs/msg/Float64", "ros2msg", FLOAT64)
    payload = CDR + struct.pack("<d", 0.01)
    path = write_mcap(
        tmp_path / "a.mcap",
        {"/front/road_height": kind, "/rear/road_height": kind},
        [("/front/road_height", START, payload), ("/rear/road_height", START, payload)],
    )
    with pytest.raises(InputError, match="'/front/road_height data' and '/rear/road_height data' could both"):
        load_campaign(path)


MAPS = {
    "absent topic": ('[channels.road_height]\ntopic = "/cam"', "names topic '/cam'.*the topics are /rig/daq"),
    "absent field": (
        '[channels.road_height]\ntopic = "/rig/daq"\nfield = "z"',
        "names field 'z'.*road_height",
    ),
}


@pytest.mark.parametrize("case", MAPS)
def test_channel_map_that_does_not_fit(
    case: str,
    tmp_path: Path,
    signals: Callable[..., object],
    json_messages: Callable[..., object],
    json_topics: object,
    write_mcap: Callable[..., Path],
) -> None:
    text, message = MAPS[case]
    write_mcap(tmp_path / "a.mcap", json_topics, json_messages(signals(), "dwell_1Hz", 1.0))
    (tmp_path / "channels.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        load_campaign(tmp_path / "a.mcap")


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE])
def test_a_cut_file_gives_its_whole_chunks(
    compression: CompressionType,
    tmp_path: Path,
    signals: Callable[..., object],
    json_messages: Callable[..., list[object]],
    json_topics: object,
    write_mcap: Callable[..., Path],
) -> None:
    messages = json_messages(signals(seconds=20.0), "dwell_1Hz", 1.0)
    path = write_mcap(tmp_path / "a.mcap", json_topics, messages, compression=compression, chunk_size=8192)
    whole = load_campaign(path)
    path.write_bytes(path.read_bytes()[: int(0.6 * path.stat().st_size)])
    cut = load_campaign(path)
    codes = [warning.code for warning in cut.warnings]
    assert codes == ["truncated_file", "unpaired_event"]
    stops = cut.recordings[0].channels["sprung_accel"].time[-1]
    assert cut.warnings[0].time == pytest.approx(stops, abs=1e-6)
    assert 5.0 < stops < 19.0
    count = cut.recordings[0].channels["sprung_accel"].values.size
    original = whole.recordings[0].channels["sprung_accel"].values
    assert (cut.recordings[0].channels["sprung_accel"].values == original[:count]).all()


def test_a_damaged_chunk_costs_its_samples_only(
    tmp_path: Path,
    signals: Callable[..., object],
    json_messages: Callable[..., list[object]],
    json_topics: object,
    write_mcap: Callable[..., Path],
) -> None:
    messages = json_messages(signals(seconds=30.0), "dwell_1Hz", 1.0)
    path = write_mcap(tmp_path / "a.mcap", json_topics, messages, chunk_size=8192)
    content = bytearray(path.read_bytes())
    inside = content.index(ZSTD_MAGIC, len(content) // 3) + 200
    content[inside] ^= 0x10
    path.write_bytes(bytes(content))
    campaign = load_campaign(path)
    assert [warning.code for warning in campaign.warnings] == ["damaged_chunk", "time_jump"]
    assert 2000 < campaign.recordings[0].channels["sprung_accel"].values.size < 3000
