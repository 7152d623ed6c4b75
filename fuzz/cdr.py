"""A ROS 2 accelerometer's messages, and tests announced in text, as a laboratory records them."""

import struct

IMU = (
    b"std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    b"geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    b"geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    b"===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    b"===\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    b"===\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
)
"""Definition of sensor_msgs/msg/Imu."""

JOINTS = (
    b"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    b"===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
)
"""Definition of sensor_msgs/msg/JointState."""

_BEGIN = b"\x00\x01\x00\x00"


def imu_message(time: int, acceleration: float) -> bytes:
    """An Imu message with a vertical acceleration [m/s^2]."""
    body = _header(time) + bytes(-len(_header(time)) % 8)
    numbers = [0.0] * (4 + 9 + 3 + 9 + 2) + [acceleration] + [0.0] * 9
    return _BEGIN + body + struct.pack(f"<{len(numbers)}d", *numbers)


def joint_message(time: int, angle: float) -> bytes:
    """A JointState message of the single link [rad]."""
    body = _header(time)
    body += bytes(-len(body) % 4) + struct.pack("<I", 1) + _text("single_link")
    body += bytes(-len(body) % 4) + struct.pack("<I", 1)
    body += bytes(-len(body) % 8) + struct.pack("<d", angle)
    return _BEGIN + body + struct.pack("<II", 0, 0)


def number_message(value: float) -> bytes:
    """A std_msgs/Float64 message."""
    return _BEGIN + struct.pack("<d", value)


def text_message(text: str) -> bytes:
    """A std_msgs/String message."""
    return _BEGIN + _text(text)


def _header(time: int) -> bytes:
    return struct.pack("<iI", time // 10**9, time % 10**9) + _text("body")


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text) + 1) + text.encode() + b"\x00"
