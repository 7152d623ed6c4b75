"""Files of measurements: campaigns in each format, their channel map, a road, an axis' motion."""

import gzip
import json
import sqlite3
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from mcap.writer import CompressionType
from numpy.typing import NDArray

from fuzz.cdr import IMU, JOINTS, imu_message, joint_message, number_message, text_message
from fuzz.loader import Original
from fuzz.mcap_files import Message, Topic, mcap_bytes
from fuzz.mutators.matlab import written
from savgs_ident.plants.quarter_car.inputs import read_road
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.recordings.axis_recording import read_axis
from savgs_ident.recordings.channels import read_channel_map

START_NS = 1_763_715_600_000_000_000
RATE_HZ, SAMPLES, FREQUENCY_HZ = 50.0, 120, 2.0

_UNITS = {"road_height": "m", "sprung_accel": "m/s^2", "susp_deflection": "m", "link_angle": "rad"}
_COLUMNS = "time [s],road_height [m],sprung_accel [m/s^2],susp_deflection [m],link_angle [rad]"
_MAP = """\
[channels.sprung_accel]
column = "ACC_3"
unit = "g"
sign = -1

[channels.susp_deflection]
column = "pot"
unit = "mm"
scale = 1.02
offset = -12.5

[free.oil_temperature]
column = "oil"
unit = "degC"

[time]
column = "clock"
unit = "ms"

[tests]
column = "condition"
"""


def _signals() -> NDArray[np.float64]:
    """Time and the four channels of a dwell, (n, 5)."""
    time = np.arange(SAMPLES) / RATE_HZ
    turn = np.exp(2j * np.pi * FREQUENCY_HZ * time)
    noise = np.random.default_rng(7).standard_normal((SAMPLES, 2))
    return np.column_stack(
        [
            time,
            np.round((0.01375 * turn).real, 6),
            np.round(((2.0 - 0.5j) * turn).real + 0.05 * noise[:, 0], 4),
            np.round((0.01 * turn).real + 1e-4 * noise[:, 1], 6),
            np.full(SAMPLES, 1.570796),
        ]
    )


def _rows(test: str) -> str:
    return "".join(f"{test},{','.join(repr(float(cell)) for cell in row)}\n" for row in _signals())


def table() -> Original:
    """Two tests in a table."""
    text = f"test,{_COLUMNS}\n" + _rows("dwell_2.00Hz") + _rows("standstill")
    one = f"{_COLUMNS}\n" + _rows("x").replace("x,", "")
    return Original((text.encode(), one.encode()))


def packed_table() -> Original:
    """The same, gzipped."""
    return Original(tuple(gzip.compress(each, mtime=0) for each in table().contents))


def json_mcap() -> Original:
    """A test logged as JSON, in every dress."""
    topics: dict[str, Topic] = {
        "/rig/test": ("json", "rig.TestEvent", "jsonschema", b"{}"),
        "/rig/daq": ("json", "rig.Daq", "jsonschema", _schema()),
    }
    names = list(_UNITS)
    messages: list[Message] = []
    for time, *values in _signals().tolist():
        record = json.dumps(dict(zip(names, values, strict=True)))
        messages.append(("/rig/daq", START_NS + round(1e9 * time), record.encode()))
    return _in_every_container(topics, _between_events(messages, "/rig/test"))


def cdr_mcap() -> Original:
    """A test logged by ROS 2: accelerometer, joints, single numbers, and events in words."""
    return _in_every_container(*_of_ros())


def rosbag() -> Original:
    """The same in a bag in SQLite, with the definitions of its types and without."""
    topics, messages = _of_ros()
    contents = []
    for defined in (True, False):
        bag = sqlite3.connect(":memory:")
        bag.execute(
            "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
        )
        bag.execute(
            "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
        )
        numbers = {topic: number for number, topic in enumerate(topics, 1)}
        for topic, (_, kind, _, _) in topics.items():
            bag.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr')", (numbers[topic], topic, kind))
        rows = [(numbers[topic], time, data) for topic, time, data in messages]
        bag.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        if defined:
            bag.execute("CREATE TABLE message_definitions (topic_type, encoding, encoded_message_definition)")
            held = [(kind, "ros2msg", text.decode()) for _, kind, _, text in topics.values()]
            bag.executemany("INSERT INTO message_definitions VALUES (?, ?, ?)", held)
        bag.commit()
        contents.append(bag.serialize())
        bag.close()
    return Original(tuple(contents))


def _of_ros() -> tuple[dict[str, Topic], list[Message]]:
    topics: dict[str, Topic] = {
        "/test": ("cdr", "std_msgs/msg/String", "ros2msg", b"string data"),
        "/imu": ("cdr", "sensor_msgs/msg/Imu", "ros2msg", IMU),
        "/joint_states": ("cdr", "sensor_msgs/msg/JointState", "ros2msg", JOINTS),
        "/road_height": ("cdr", "std_msgs/msg/Float64", "ros2msg", b"float64 data"),
    }
    messages: list[Message] = []
    for time, road, accel, _, angle in _signals().tolist():
        at = START_NS + round(1e9 * time)
        messages.append(("/imu", at, imu_message(at, accel)))
        messages.append(("/joint_states", at, joint_message(at, angle)))
        messages.append(("/road_height", at, number_message(road)))
    first, last = messages[0][1], messages[-1][1]
    begin, end = (
        ("/test", at, text_message(f"{word} dwell_2.00Hz"))
        for word, at in (("start", first), ("end", last + 1))
    )
    return topics, [begin, *messages, end]


def channel_map() -> Original:
    """A map that names every channel, beside a campaign that needs it."""
    header = "condition,clock,road_height [m],ACC_3,pot,link_angle [rad],oil\n"
    body = "".join(
        f"dwell_2.00Hz,{1000.0 * time},{road},{-accel / 9.80665},{1000.0 * deflection},{angle},{40.0 + time}\n"
        for time, road, accel, deflection, angle in _signals().tolist()
    )
    return Original((_MAP.encode(),), {"campaign.csv": (header + body).encode()})


def road() -> Original:
    """A road as a table of time and height."""
    rows = "".join(f"{time},{height}\n" for time, height in _signals()[:, :2].tolist())
    return Original((f"time [s],height [m]\n{rows}".encode(),))


def axis() -> Original:
    """A recording of a servo axis, packed and not."""
    t = 1e-3 * np.arange(60)[:, None]
    arrays = {"t": t, "qm": 0.1 * np.sin(t), "qg": 0.1 * np.sin(t) + 1e-5, "vir": np.cos(t), "gtau": 35.0}
    return Original(tuple(written(arrays, packed) for packed in (True, False)))


def parquet() -> Original:
    """Two tests in a table with a column of their names."""
    signals = np.tile(_signals(), (2, 1))
    names = ["test", *_COLUMNS.split(",")]
    tests = ["dwell_2.00Hz"] * SAMPLES + ["standstill"] * SAMPLES
    stream = BytesIO()
    pq.write_table(pa.table(dict(zip(names, [tests, *signals.T], strict=True))), stream)
    return Original((stream.getvalue(),))


def matlab_7_3() -> Original:
    """A test as MATLAB writes it today: HDF5, vectors as columns, units in the map beside it."""
    stream = BytesIO()
    with h5py.File(stream, "w") as file:
        for name, signal in zip(("time", *_UNITS), _signals().T, strict=True):
            file[name] = signal[None, :]
    maps = "".join(
        f'[channels.{name}]\ncolumn = "{name}"\nunit = "{unit}"\n' for name, unit in _UNITS.items()
    )
    return Original((stream.getvalue(),), {"channels.toml": f'{maps}[time]\nunit = "s"\n'.encode()})


def read_table(path: Path) -> object:
    """The campaign in a file."""
    return load_campaign(path)


def read_map(path: Path) -> object:
    """The map, and the campaign beside it as it says."""
    found = read_channel_map(path, RIG_LAYOUT)
    return found.rules, load_campaign(path.parent / "campaign.csv", found)


def read_road_file(path: Path) -> object:
    """The road's height where it begins and between its knots."""
    found = read_road(path)
    return found.profile


def read_axis_file(path: Path) -> object:
    """The positioner's recording."""
    return read_axis(path)


def _schema() -> bytes:
    return json.dumps({"properties": {name: {"description": unit} for name, unit in _UNITS.items()}}).encode()


def _between_events(messages: list[Message], topic: str) -> list[Message]:
    event = {"test": "dwell_2.00Hz", "frequency_hz": FREQUENCY_HZ}
    begin = json.dumps(event | {"event": "start"}).encode()
    end = json.dumps(event | {"event": "end"}).encode()
    return [(topic, messages[0][1], begin), *messages, (topic, messages[-1][1] + 1, end)]


def _in_every_container(topics: dict[str, Topic], messages: list[Message]) -> Original:
    return Original(
        tuple(
            mcap_bytes(topics, messages, compression, chunked)
            for compression in CompressionType
            for chunked in (True, False)
        )
    )
