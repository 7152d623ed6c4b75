"""MCAP in every dress gives the same numbers; clocks and joints are chosen rightly; other people's files."""

import itertools
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.cdr import find_layout, parse_definition
from savgs_ident.recordings.mcap_timing import choose_clock, irregularity

from ..in_one_test import over

START = 1_763_715_600_000_000_000
IMU = (
    b"std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    b"geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    b"geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    b"===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    b"===\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    b"===\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
)
JOINT = (
    b"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    b"===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
)


class _Cdr:
    """Writes little-endian CDR, to be independent of the reader."""

    def __init__(self) -> None:
        self.body = b""

    def put(self, code: str, value: float) -> "_Cdr":
        self.body += bytes(-len(self.body) % struct.calcsize(code)) + struct.pack("<" + code, value)
        return self

    def text(self, value: str) -> "_Cdr":
        self.put("I", len(value) + 1)
        self.body += value.encode() + b"\x00"
        return self

    def many(self, values: list[float]) -> "_Cdr":
        self.put("I", len(values))
        for value in values:
            self.put("d", value)
        return self

    def done(self) -> bytes:
        return b"\x00\x01\x00\x00" + self.body


def _stamped(stamp: int, frame: str) -> _Cdr:
    return _Cdr().put("i", stamp // 10**9).put("I", stamp % 10**9).text(frame)


def _imu(stamp: int, z: float, frame: str = "body") -> bytes:
    message = _stamped(stamp, frame)
    for _ in range(4 + 9 + 3 + 9 + 2):
        message.put("d", -1.0)
    message.put("d", z)
    for _ in range(9):
        message.put("d", 0.0)
    return message.done()


def _joints(stamp: int, names: list[str], position: list[float]) -> bytes:
    message = _stamped(stamp, "").put("I", len(names))
    for name in names:
        message.text(name)
    return message.many(position).many([2 * x for x in position]).many([]).done()


DRESSES = list(
    itertools.product(
        [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD], [True, False], [True, False]
    )
)


@pytest.mark.parametrize(("compression", "chunked", "index"), DRESSES)
def test_every_dress_of_a_file_gives_the_same_numbers(
    compression: CompressionType,
    chunked: bool,
    index: bool,
    tmp_path: Path,
    signals: Callable[..., Any],
    json_messages: Callable[..., Any],
    json_topics: Any,
    write_mcap: Callable[..., Path],
) -> None:
    dwell = signals(2.0)
    messages = json_messages(dwell, "any name", 2.0)
    path = write_mcap(
        tmp_path / "a.mcap", json_topics, messages, compression=compression, chunked=chunked, index=index
    )
    campaign = load_campaign(path)
    assert campaign.warnings == ()
    (recording,) = campaign.recordings
    assert (recording.name, recording.kind, recording.frequency_hz) == ("any name", "dwell", 2.0)
    for name in ("road_height", "sprung_accel", "susp_deflection", "link_angle"):
        np.testing.assert_array_equal(recording.channels[name].values, dwell[name])
        np.testing.assert_allclose(recording.channels[name].time, dwell["time"], rtol=0, atol=1e-9)


def test_samples_outside_every_test_are_dropped(
    tmp_path: Path,
    signals: Callable[..., Any],
    json_messages: Callable[..., Any],
    json_topics: Any,
    write_mcap: Callable[..., Path],
) -> None:
    first, second = json_messages(signals(1.0), "a", 1.0), json_messages(signals(2.0), "b", 2.0, 60.0)
    stray = ("/rig/daq", START + 30 * 10**9, json.dumps({"road_height": 99.0}).encode())
    path = write_mcap(tmp_path / "a.mcap", json_topics, [*first, stray, *second])
    campaign = load_campaign(path)
    assert [r.name for r in campaign.recordings] == ["a", "b"]
    assert all(r.channels["road_height"].time[0] == 0.0 for r in campaign.recordings)
    assert max(np.abs(r.channels["road_height"].values).max() for r in campaign.recordings) < 0.02


def test_tests_without_their_events_are_reported(
    tmp_path: Path,
    signals: Callable[..., Any],
    json_messages: Callable[..., Any],
    json_topics: Any,
    write_mcap: Callable[..., Path],
) -> None:
    first, second = json_messages(signals(1.0), "a", 1.0), json_messages(signals(1.0), "b", 1.0, 10.5)
    path = write_mcap(tmp_path / "a.mcap", json_topics, [*first[:-1], *second[1:]])
    campaign = load_campaign(path)
    reported = [(w.code, w.test) for w in campaign.warnings]
    assert reported == [("unpaired_event", "b"), ("unpaired_event", "a"), ("time_jump", "a")]
    assert campaign.recordings[0].duration_s == pytest.approx(20.49)


def test_header_clock_is_taken_where_messages_come_in_bursts(
    tmp_path: Path, write_mcap: Callable[..., Path]
) -> None:
    sampled = START + np.arange(400) * 5_000_000
    logged = START + 40_000_000 * (1 + (sampled - START) // 40_000_000) + (np.arange(400) % 8) * 1000
    messages = [
        ("/imu", int(log), _imu(int(at), 9.81 + 0.01 * i, "x" * (i % 5)))
        for i, (at, log) in enumerate(zip(sampled, logged, strict=True))
    ]
    topic = ("cdr", "sensor_msgs/msg/Imu", "ros2msg", IMU)
    campaign = load_campaign(write_mcap(tmp_path / "idle.mcap", {"/imu": topic}, messages))
    assert [w.code for w in campaign.warnings] == ["clock_choice", "gravity_removed"]
    assert "the header clock" in campaign.warnings[0].what
    channel = campaign.recordings[0].channels["sprung_accel"]
    np.testing.assert_allclose(np.diff(channel.time), 0.005, atol=1e-9)
    np.testing.assert_allclose(np.diff(channel.values), 0.01, atol=1e-9)


def test_the_map_can_force_a_clock(tmp_path: Path, write_mcap: Callable[..., Path]) -> None:
    messages = [("/imu", START + i * 10_000_000, _imu(START + i * 5_000_000, 9.8)) for i in range(100)]
    topic = ("cdr", "sensor_msgs/msg/Imu", "ros2msg", IMU)
    path = write_mcap(tmp_path / "idle.mcap", {"/imu": topic}, messages)
    assert load_campaign(path).recordings[0].channels["sprung_accel"].rate_hz == pytest.approx(200.0)
    (tmp_path / "channels.toml").write_text('[time]\nclock = "log"\n')
    assert load_campaign(path).recordings[0].channels["sprung_accel"].rate_hz == pytest.approx(100.0)


def test_clock_of_another_epoch_is_moved_onto_the_log_time() -> None:
    log = START + np.arange(100) * 10_000_000
    choice = choose_clock(log, log, log - START + 77, topic="/imu", source="a")
    assert choice.name == "header"
    assert [w.code for w in choice.warnings] == ["clock_offset"]
    np.testing.assert_array_equal(choice.time, log)


def test_a_header_that_is_never_set_is_not_trusted() -> None:
    log = START + np.arange(100) * 10_000_000
    choice = choose_clock(log, log, np.zeros(100, dtype=np.int64), topic="/imu", source="a")
    assert (choice.name, [w.code for w in choice.warnings]) == ("log", ["clock_choice"])
    assert irregularity(log) == 0.0


def test_the_joint_that_is_the_link(tmp_path: Path, write_mcap: Callable[..., Path]) -> None:
    topic = ("cdr", "sensor_msgs/msg/JointState", "ros2msg", JOINT)
    messages = [
        (
            "/joint_states",
            START + i * 10_000_000,
            _joints(START + i * 10_000_000, ["arm", "knee"], [1.0, 0.1 * i]),
        )
        for i in range(50)
    ]
    path = write_mcap(tmp_path / "idle.mcap", {"/joint_states": topic}, messages)
    with pytest.raises(InputError, match="no topic carries a known channel"):
        load_campaign(path)
    (tmp_path / "channels.toml").write_text(
        '[channels.link_angle]\ntopic = "/joint_states"\n'
        'field = "position[knee]"\nunit = "deg"\noffset = 90\n'
    )
    angle = load_campaign(path).recordings[0].channels["link_angle"]
    np.testing.assert_allclose(angle.values, np.deg2rad(90 + 0.1 * np.arange(50)))


def test_json_and_table_campaigns_are_the_same_recording(shared_rig: Path) -> None:
    table = load_campaign(shared_rig / "nominal" / "campaign.csv.gz")
    stream = load_campaign(shared_rig / "nominal" / "campaign_json.mcap")
    assert table.warnings == stream.warnings == ()
    assert len(table.recordings) == len(stream.recordings) == 30
    for one, other in zip(table.recordings, stream.recordings, strict=True):
        assert (one.name, one.kind, one.frequency_hz) == (other.name, other.kind, other.frequency_hz)
        assert one.channels.keys() == other.channels.keys()
        for name, channel in one.channels.items():
            np.testing.assert_array_equal(channel.values, other.channels[name].values)
            np.testing.assert_allclose(channel.time, other.channels[name].time, rtol=0, atol=1e-6)


def test_ros2_campaign_has_its_own_clocks(shared_rig: Path) -> None:
    campaign = load_campaign(shared_rig / "nominal" / "campaign_ros2.mcap")
    assert [w.code for w in campaign.warnings] == ["effort_ignored", "gravity_removed"]
    rates = {
        "sprung_accel": 200, "susp_deflection": 100, "road_height": 50, "link_angle": 50, "link_velocity": 50,
        "motor_current": 40,
    }  # fmt: skip
    assert len(campaign.recordings) == 30
    assert len(campaign.of_kind("dwell")) == 28
    for recording in campaign.recordings:
        assert recording.channels.keys() == rates.keys()
        for name, rate in rates.items():
            assert recording.channels[name].rate_hz == pytest.approx(rate, rel=2e-3)
    still = campaign.of_kind("standstill")[0].channels["sprung_accel"].values
    assert abs(still.mean()) < 1e-9
    dwells = [recording.channels["sprung_accel"].values.mean() for recording in campaign.of_kind("dwell")]
    assert np.abs(dwells).max() < 0.05


@over(
    "name",
    ["none", "zstd", "imu_lz4_chunks32k", "imu_unchunked", "imu_noindex_nosummary", "imu_lz4_truncated60pct"],
)
def test_real_imu_in_every_dress(name: str, shared_mcap: Path) -> None:
    campaign = load_campaign(shared_mcap / f"tilt_{name}.mcap")
    codes = [w.code for w in campaign.warnings]
    truncated = "truncated" in name
    expected = ["clock_choice", "test_kind_unknown", "gravity_removed"]
    assert codes == ["truncated_file"] * truncated + expected
    channel = campaign.recordings[0].channels["sprung_accel"]
    assert channel.values.size == (183 if truncated else 356)
    assert channel.rate_hz == pytest.approx(20.0, rel=1e-3)
    assert np.diff(channel.time).min() > 0.039
    assert abs(channel.values.mean()) < 0.02


@pytest.mark.parametrize("name", ["rosbag2_talker", "lichtblick_example"])
def test_files_without_a_known_channel_are_refused(name: str, shared_mcap: Path) -> None:
    with pytest.raises(InputError, match="no topic carries a known channel; topics: "):
        load_campaign(shared_mcap / f"{name}.mcap")


def test_a_bag_of_every_message_type_is_read(shared_mcap: Path) -> None:
    campaign = load_campaign(shared_mcap / "rosbags-rs_test_bag.mcap")
    assert (
        campaign.recordings[0].channels["sprung_accel"].source
        == "/test/sensor_msgs/imu linear_acceleration.z"
    )


def _lookup(message: Any, path: str) -> float:
    for part in path.replace("[", ".[").split("."):
        message = message[int(part[1:-1])] if part.startswith("[") else getattr(message, part)
    return float(message)


def test_layouts_agree_with_the_ros2_decoder_on_every_type(shared_mcap: Path) -> None:
    types = set()
    with (shared_mcap / "rosbags-rs_test_bag.mcap").open("rb") as stream:
        reader = NonSeekingReader(stream, decoder_factories=[DecoderFactory()])
        for schema, _, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            layout = find_layout(message.data, parse_definition(schema.name, schema.data.decode()))
            for path, (offset, code) in layout.numbers.items():
                if path.endswith("structure_needs_at_least_one_member"):
                    continue
                value = float(np.frombuffer(message.data, code, 1, offset)[0])
                expected = _lookup(decoded, path)
                assert value == expected or (np.isnan(value) and np.isnan(expected)), (schema.name, path)
            types.add(schema.name)
    assert len(types) > 80
