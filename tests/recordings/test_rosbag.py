"""Bags of ROS 2 in SQLite give the numbers of the same messages in MCAP."""

import sqlite3
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from fuzz import recordings
from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.cdr import parse_definition
from savgs_ident.recordings.recording import Campaign
from savgs_ident.recordings.rosbag import DEFINITIONS

from .test_mcap_reader import IMU, JOINT

TOPICS = {"/road_height": "std_msgs/msg/Float64", "/susp_deflection": "std_msgs/msg/Float32"}
COUNT, RATE = 2000, 200.0
START_NS = 1_763_715_600_000_000_000


def _bag(
    path: Path, topics: dict[str, str], messages: Sequence[tuple[str, int, bytes]], form: str = "cdr"
) -> Path:
    bag = sqlite3.connect(path)
    bag.execute(
        "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
    )
    bag.execute(
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    )
    numbers = {topic: number for number, topic in enumerate(topics, 1)}
    bag.executemany(
        "INSERT INTO topics VALUES (?, ?, ?, ?)",
        [(numbers[name], name, kind, form) for name, kind in topics.items()],
    )
    rows = [(numbers[topic], time, data) for topic, time, data in messages]
    bag.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    bag.commit()
    bag.close()
    return path


def _number(value: float, code: str) -> bytes:
    return b"\x00\x01\x00\x00" + np.array(value, code).tobytes()


def _messages(count: int = COUNT) -> list[tuple[str, int, bytes]]:
    found = []
    for place in range(count):
        time = place / RATE
        wave = float(np.sin(2.0 * np.pi * 2.0 * time))
        at = START_NS + round(1e9 * time)
        found.append(("/road_height", at, _number(0.01 * wave, "<f8")))
        found.append(("/susp_deflection", at, _number(0.004 * wave, "<f4")))
    return found


def _same(one: Campaign, other: Campaign) -> None:
    assert [each.name for each in one.recordings] == [each.name for each in other.recordings]
    for mine, yours in zip(one.recordings, other.recordings, strict=True):
        assert set(mine.channels) == set(yours.channels)
        for name, channel in mine.channels.items():
            np.testing.assert_array_equal(channel.time, yours.channels[name].time)
            np.testing.assert_array_equal(channel.values, yours.channels[name].values)


def test_a_bag_with_its_definitions_or_without_is_the_same_campaign_as_in_mcap(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(recordings.cdr_mcap().contents[0])
    expected = load_campaign(tmp_path / "a.mcap")
    assert {"road_height", "sprung_accel"} <= set(expected.recordings[0].channels)
    for content in recordings.rosbag().contents:
        (tmp_path / "bag_0.db3").write_bytes(content)
        _same(load_campaign(tmp_path / "bag_0.db3"), expected)


def test_a_folder_as_rosbag2_writes_it_is_a_test_named_after_the_file(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    _bag(tmp_path / "dwell_2Hz.db3", TOPICS, _messages())
    campaign = load_campaign(tmp_path)
    (test,) = campaign.recordings
    assert (test.name, test.kind, test.frequency_hz) == ("dwell_2Hz", "dwell", 2.0)
    time = np.arange(COUNT) / RATE
    road, deflection = test.channels["road_height"], test.channels["susp_deflection"]
    np.testing.assert_allclose(road.time, time, atol=1e-9)
    np.testing.assert_allclose(road.values, 0.01 * np.sin(4.0 * np.pi * time), atol=1e-12)
    np.testing.assert_allclose(deflection.values, 0.004 * np.sin(4.0 * np.pi * time), atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "definition"), [("sensor_msgs/msg/Imu", IMU), ("sensor_msgs/msg/JointState", JOINT)]
)
def test_known_definitions_have_the_fields_of_those_that_bags_hold(kind: str, definition: bytes) -> None:
    assert parse_definition(kind, DEFINITIONS[kind]) == parse_definition(kind, definition.decode())


def test_every_known_definition_is_understood() -> None:
    for kind, definition in DEFINITIONS.items():
        assert parse_definition(kind, definition), kind


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        ("DROP TABLE messages", "cannot be read as a bag of ROS 2: no such table: messages"),
        ("DROP TABLE topics", "cannot be read as a bag of ROS 2: no such table: topics"),
        ("UPDATE topics SET type = 'rig_msgs/msg/Rig'", "its schema is missing from the file"),
        ("UPDATE topics SET serialization_format = 'protobuf'", "encoding 'protobuf' is not read"),
        ("DELETE FROM messages", "no topic carries a known channel"),
    ],
)
def test_what_cannot_be_used_is_refused(spoil: str, says: str, tmp_path: Path) -> None:
    path = _bag(tmp_path / "dwell_2Hz.db3", TOPICS, _messages()[:200])
    bag = sqlite3.connect(path)
    bag.execute(spoil)
    bag.commit()
    bag.close()
    with pytest.raises(InputError, match=says):
        load_campaign(path)


def test_a_bag_that_was_cut_is_refused(tmp_path: Path) -> None:
    path = _bag(tmp_path / "dwell_2Hz.db3", TOPICS, _messages())
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(
        InputError, match="cannot be read as a bag of ROS 2: database disk image is malformed"
    ):
        load_campaign(path)


def test_of_a_damaged_bag_the_messages_before_that_are_used(tmp_path: Path) -> None:
    path = _bag(tmp_path / "dwell_2Hz.db3", TOPICS, _messages(3 * COUNT))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + bytes(len(whole) - len(whole) // 2))
    campaign = load_campaign(path)
    assert "truncated_file" in {each.code for each in campaign.warnings}
    (test,) = campaign.recordings
    time = test.channels["road_height"].time
    assert COUNT / RATE < time[-1] < 2.5 * COUNT / RATE
    np.testing.assert_allclose(
        test.channels["road_height"].values, 0.01 * np.sin(4.0 * np.pi * time), atol=1e-9
    )


def test_cells_of_another_kind_are_no_messages(tmp_path: Path) -> None:
    path = _bag(tmp_path / "dwell_2Hz.db3", TOPICS, _messages())
    expected = load_campaign(path)
    bag = sqlite3.connect(path)
    for time, data in ((None, b"x"), (1, "text"), (-5, b"x"), (2**62, None)):
        bag.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)", (time, data))
    bag.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (77, 1, x'00')")
    bag.commit()
    bag.close()
    _same(load_campaign(path), expected)
