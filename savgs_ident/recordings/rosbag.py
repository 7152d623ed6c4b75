"""ROS 2 bags in SQLite (``.db3``), the usual storage of rosbag2 before MCAP: the same messages, read the same way.

A bag has a table of topics and one of messages, in order of their time of recording. The definitions of the types
are in it since ROS 2 Iron; in older bags the usual types of sensors are known (:data:`DEFINITIONS`). Messages are put
in records as MCAP has them, so that all that is said of topics, clocks and events in
:mod:`savgs_ident.recordings.mcap` holds for bags.
"""

import sqlite3
import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from urllib.parse import quote

from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Schema

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.channels import ChannelMap, Progress, Reader, Reading
from savgs_ident.recordings.mcap import reading_of_segments
from savgs_ident.recordings.mcap_records import LARGEST_CHUNK, Segment

_HEADER = "builtin_interfaces/Time stamp\nstring frame_id"
_VECTOR = "float64 x\nfloat64 y\nfloat64 z"
_STAMPED = f"===\nMSG: std_msgs/Header\n{_HEADER}\n===\nMSG: geometry_msgs/Vector3\n{_VECTOR}\n"
_NUMBERS = (
    "Bool",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Float32",
    "Float64",
)

DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        **{f"std_msgs/msg/{name}": f"{name.lower()} data\n" for name in _NUMBERS},
        "std_msgs/msg/String": "string data\n",
        "sensor_msgs/msg/Imu": (
            "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
            "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
            "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
            f"{_STAMPED}===\nMSG: geometry_msgs/Quaternion\n{_VECTOR}\nfloat64 w\n"
        ),
        "sensor_msgs/msg/JointState": (
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
            f"{_STAMPED}"
        ),
        "sensor_msgs/msg/Range": (
            "std_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\n"
            f"float32 max_range\nfloat32 range\n{_STAMPED}"
        ),
        "geometry_msgs/msg/Vector3Stamped": f"std_msgs/Header header\ngeometry_msgs/Vector3 vector\n{_STAMPED}",
        "geometry_msgs/msg/AccelStamped": (
            "std_msgs/Header header\ngeometry_msgs/Accel accel\n===\nMSG: geometry_msgs/Accel\n"
            f"geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n{_STAMPED}"
        ),
        "geometry_msgs/msg/WrenchStamped": (
            "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n===\nMSG: geometry_msgs/Wrench\n"
            f"geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n{_STAMPED}"
        ),
    }
)
"""Definitions of common types, which bags before ROS 2 Iron do not hold. Source: common_interfaces, version 2."""

_AT_ONCE = 4096
_MESSAGE = struct.Struct("<BQHIQQ")
_AFTER_LENGTH = _MESSAGE.size - 9
_MOST_TOPICS = 1 << 16


def read_rosbag(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one SQLite file of a bag; raises :class:`InputError` where nothing in it can be used."""
    # Nothing is locked, and no journal is looked for beside a bag that was copied.
    try:
        bag = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1", uri=True)
    except sqlite3.Error as error:
        raise _damaged(path, error) from error
    warnings: list[DataWarning] = []
    try:
        return reading_of_segments(path, _segments(bag, path, progress, warnings), warnings, channel_map)
    finally:
        bag.close()


ROSBAG = Reader(
    name="rosbag2", suffixes=(".db3",), magic=(b"SQLite format 3\x00",), plain_text=False, read=read_rosbag
)


def _segments(
    bag: sqlite3.Connection, path: Path, progress: Progress, warnings: list[DataWarning]
) -> Iterator[Segment]:
    """The topics, then the messages, some thousand at a time; of a damaged bag what comes before the damage."""
    try:
        topics = _topics(bag)
    except (sqlite3.Error, TypeError, ValueError) as error:
        raise _damaged(path, error) from error
    yield Segment(b"", *topics, {})
    known, done, count = {each.id for each in topics[1]}, 0, None
    # The last row of a bag that was cut is not there; then nothing is known of the progress.
    with suppress(sqlite3.Error):
        (count,) = bag.execute("SELECT max(rowid) FROM messages").fetchone()
    try:
        rows = bag.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY rowid")
        while some := rows.fetchmany(_AT_ONCE):
            done += len(some)
            yield _segment([row for row in some if _is_message(row, known)])
            progress(min(done / count, 1.0) if isinstance(count, int) and count > 0 else 1.0)
    except sqlite3.Error as error:
        if not done:
            raise _damaged(path, error) from error
        what = "the bag is damaged, the messages before that are used"
        remedy = "copy the bag again, or run `ros2 bag reindex`"
        warnings.append(DataWarning("truncated_file", what, str(path), remedy=remedy))
    progress(1.0)


def _topics(bag: sqlite3.Connection) -> tuple[tuple[Schema, ...], tuple[McapChannel, ...]]:
    definitions = dict(DEFINITIONS)
    tables = {name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if "message_definitions" in tables:
        held = bag.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        definitions |= {
            str(kind): str(text) for kind, encoding, text in held if encoding == "ros2msg" and text
        }
    schemas, channels = [], []
    listed = bag.execute("SELECT id, name, type, serialization_format FROM topics")
    for place, (number, topic, kind, form) in enumerate(listed.fetchmany(_MOST_TOPICS), 1):
        definition = definitions.get(str(kind))
        if definition is not None:
            schemas.append(Schema(data=definition.encode(), encoding="ros2msg", name=str(kind), id=place))
        channels.append(
            McapChannel(
                id=int(number),
                topic=str(topic),
                message_encoding=str(form),
                metadata={},
                schema_id=place if definition is not None else 0,
            )
        )
    return tuple(schemas), tuple(channels)


def _is_message(row: tuple[object, object, object], known: set[int]) -> bool:
    number, time, data = row
    return (
        isinstance(number, int)
        and 0 <= number < 1 << 16
        and number in known
        and isinstance(time, int)
        and 0 <= time < 1 << 63
        and isinstance(data, bytes)
        and len(data) <= LARGEST_CHUNK
    )


def _segment(rows: list[tuple[int, int, bytes]]) -> Segment:
    """Messages as records of MCAP, back to back."""
    data, messages = bytearray(), dict[int, list[int]]()
    for number, time, payload in rows:
        messages.setdefault(number, []).append(len(data))
        data += _MESSAGE.pack(Opcode.MESSAGE, _AFTER_LENGTH + len(payload), number, 0, time, time)
        data += payload
    return Segment(bytes(data), (), (), messages)


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(
        f"cannot be read as a bag of ROS 2: {str(error) or type(error).__name__}",
        source=path,
        remedy="copy the bag again, or convert it: `ros2 bag convert`",
    )
